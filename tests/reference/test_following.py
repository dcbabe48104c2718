"""Car following against the published formulas, and against properties that they imply."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from tests.support.worlds import Vehicle, scenario, wide_road

from overtaking.sim import engine
from overtaking.sim.reference.car_following import (
    Follower,
    Leader,
    acc_accel,
    cah_accel,
    iidm_accel,
    imposed_accel,
)
from overtaking.world.constants import EnabledEffects, model_constants
from overtaking.world.step_parameters import VehicleParameters, step_parameters

EXPONENT = 4.0

# Perception without delay, error or limits, so that the tests cover only car following.
PERFECT = EnabledEffects(
    gusts=False, wake=False, range=False, delay=False, distance_error=False, looming=False,
    occlusion=False, mobil=False,
)  # fmt: skip

DRIVERS = {
    "time_gap": (0.5, 3.0), "min_gap": (1.0, 4.0), "accel": (0.4, 2.5), "decel": (1.0, 3.5),
}  # fmt: skip


def person(**changes: float) -> dict[str, float]:
    return {"time_gap": 1.2, "min_gap": 2.0, "accel": 1.5, "decel": 2.0} | changes


def as_fields(driver: dict[str, float], shape: tuple[int, ...]) -> VehicleParameters:
    """The parameters of a driver in the form of a model step, constant over an array."""
    a, b = driver["accel"], driver["decel"]
    numbers = driver | {
        "idm_interaction": 0.5 / math.sqrt(a * b),
        "overspeed_exponent": EXPONENT * a / b,
    }
    return VehicleParameters(
        **{
            name: np.full(shape, numbers.get(name, 0.0), np.float32)
            for name in VehicleParameters._fields
        }
    )


def model(
    driver: dict[str, float], speed: object, desired: object, gap: object, closing: object
) -> np.ndarray:
    """The model's acceleration [m/s^2]."""
    arrays = np.broadcast_arrays(
        *(np.asarray(x, np.float32) for x in (speed, desired, gap, closing))
    )
    follower = as_follower(driver, arrays[0], arrays[1])
    leader = Leader(gap=arrays[2], closing_speed=arrays[3])
    return iidm_accel(model_constants(), follower, leader).astype(np.float64)


def as_follower(driver: dict[str, float], speed: object, desired: object) -> Follower:
    """A driver at a speed, which keeps its usual time gap."""
    v, v0 = (np.asarray(x, np.float32) for x in (speed, desired))
    vehicle = as_fields(driver, v.shape)
    return Follower(vehicle=vehicle, speed=v, desired_speed=v0, time_gap=vehicle.time_gap)


def as_leader(gap: float, closing: float, accel: float = 0.0) -> Leader:
    numbers = [np.asarray(x, np.float32) for x in (gap, closing, accel)]
    return Leader(gap=numbers[0], closing_speed=numbers[1], accel=numbers[2])


def textbook(driver: dict[str, float], v: float, v0: float, s: float, dv: float) -> float:
    """Equations 11.15, 11.25 and 11.26 of the book, in float64 [m/s^2]."""
    a, b, s0, t = (driver[name] for name in ("accel", "decel", "min_gap", "time_gap"))
    desired_gap = s0 + max(0.0, v * t + v * dv / (2.0 * math.sqrt(a * b)))
    z = desired_gap / s
    if v <= v0:
        free = a * (1.0 - (v / v0) ** EXPONENT)
        if z >= 1.0:
            return a * (1.0 - z**2)
        return free * (1.0 - z ** (2.0 * a / free)) if free > 0.0 else 0.0
    free = -b * (1.0 - (v0 / v) ** (a * EXPONENT / b))
    return free + a * (1.0 - z**2) if z >= 1.0 else free


drivers = st.fixed_dictionaries(
    {name: st.floats(low, high) for name, (low, high) in DRIVERS.items()}
)


@given(
    driver=drivers,
    v=st.floats(0.0, 45.0),
    v0=st.floats(8.0, 45.0),
    s=st.floats(1.0, 400.0),
    dv=st.floats(-15.0, 25.0),
)
def test_the_acceleration_equals_the_formulas_of_the_book(
    driver: dict[str, float], v: float, v0: float, s: float, dv: float
):
    expected = textbook(driver, v, v0, s, dv)
    # Float32 powers: an exponent up to 1000 magnifies the last bit of z into 1e-4 of the result,
    # and the published form jumps where z passes 1 above v0, by as little as z is rounded.
    assert float(model(driver, v, v0, s, dv)) == pytest.approx(expected, rel=2e-3, abs=2e-3)


@pytest.mark.ci
@given(driver=drivers, share=st.floats(0.0, 0.99), v0=st.floats(8.0, 45.0))
def test_below_the_desired_speed_the_equilibrium_gap_is_exactly_s0_plus_v_t(
    driver: dict[str, float], share: float, v0: float
):
    # The equilibrium gap of the IDM is different: s0 + v T over sqrt(1 - (v / v0)^4).
    v = share * v0
    gap = driver["min_gap"] + v * driver["time_gap"]
    steep = 2.0 * driver["accel"] / gap * max(1.0, gap)  # Slope in the gap, for its rounding.
    assert abs(float(model(driver, v, v0, gap, 0.0))) <= 1e-5 * max(1.0, steep * gap)
    assert float(model(driver, v, v0, 0.98 * gap, 0.0)) < 0.0
    assert float(model(driver, v, v0, 1.5 * gap, 0.0)) > 0.0


@given(driver=drivers, v=st.floats(0.0, 40.0), v0=st.floats(8.0, 45.0))
def test_on_a_free_road_the_acceleration_stays_between_a_and_minus_b(
    driver: dict[str, float], v: float, v0: float
):
    value = float(model(driver, v, v0, 1e3 * (v + 1.0), 0.0))
    free = driver["accel"] * (1.0 - (v / v0) ** EXPONENT)
    assert -driver["decel"] <= value <= driver["accel"]
    if v < 0.9 * v0:
        assert value == pytest.approx(free, rel=0.01, abs=1e-3)


@pytest.mark.ci
@given(driver=drivers, v=st.floats(1.0, 40.0), dv=st.floats(-10.0, 20.0))
def test_a_larger_gap_or_a_faster_leader_never_gives_harder_braking(
    driver: dict[str, float], v: float, dv: float
):
    gaps = np.linspace(1.0, 300.0, 600)
    # Rounding of float32 in a value of up to thousands of m/s^2.
    along = model(driver, v, 30.0, gaps, dv)
    assert (np.diff(along) >= -1e-5 * np.abs(along[:-1]) - 1e-4).all()
    closings = np.linspace(20.0, -20.0, 400)
    across = model(driver, v, 30.0, 40.0, closings)
    assert (np.diff(across) >= -1e-5 * np.abs(across[:-1]) - 1e-4).all()


def test_an_overestimated_closing_speed_to_a_standing_vehicle_gives_harder_braking():
    # A driver at 20 m/s perceives a closing speed of 24 m/s: the leader counts as standing.
    expected = -(24.0**2) / (2.0 * 50.0)
    accel = cah_accel(model_constants(), np.float32(20.0), as_leader(50.0, 24.0))
    assert float(accel) == pytest.approx(expected, rel=1e-5)


def needed(v: float, s: float, dv: float, leader: float) -> float:
    """The constant-acceleration heuristic, equation 2.5 of Kesting, Treiber and Helbing (2010)."""
    ahead = v - dv
    if ahead * dv < -2.0 * s * leader:
        return v**2 * leader / (ahead**2 - 2.0 * s * leader)
    return leader - max(dv, 0.0) ** 2 / (2.0 * s)


def cool(driver: dict[str, float], iidm: float, heuristic: float) -> float:
    """The ACC model, equation 2.7 of the same paper, with its coolness of 0.99."""
    coolness, b = 0.99, driver["decel"]
    if iidm >= heuristic:
        return iidm
    # Our addition: the model's alarm is never above gravity, however small the gap.
    limited_iidm = max(iidm, -9.81)
    return (1.0 - coolness) * limited_iidm + coolness * (
        heuristic + b * math.tanh((iidm - heuristic) / b)
    )


@given(
    driver=drivers,
    v=st.floats(0.0, 45.0),
    v0=st.floats(8.0, 45.0),
    s=st.floats(1.0, 400.0),
    ahead=st.floats(0.0, 45.0),
    leader=st.just(0.0) | st.floats(-9.0, -0.1),
)
def test_drivers_follow_the_acc_model_and_heed_stop_lamps(
    driver: dict[str, float], v: float, v0: float, s: float, ahead: float, leader: float
):
    # Leaders that brake with less than 0.1 m/s^2 are left out: behind a standing leader the
    # heuristic divides by 2 s a, for which the model has a lower limit.
    dv = v - ahead
    follower = as_follower(driver, v, v0)
    value = float(acc_accel(model_constants(), follower, as_leader(s, dv, leader)))
    least = needed(v, s, dv, leader)
    expected = cool(driver, textbook(driver, v, v0, s, dv), least)
    if leader < -0.5:  # Our addition: drivers heed stop lamps, fully below 1 s and not beyond 3 s.
        room = (3.0 - s / max(v, 3.0)) / (3.0 - 1.0)
        expected = min(expected, min(max(room, 0.0), 1.0) * least)
    assert value == pytest.approx(expected, rel=2e-3, abs=2e-3)


@given(
    v=st.floats(1.0, 40.0), ahead=st.floats(1.0, 40.0), s=st.floats(2.0, 200.0),
    leader=st.floats(-8.0, -0.5),
)  # fmt: skip
def test_braking_as_hard_as_needed_stops_exactly_at_the_bumper(
    v: float, ahead: float, s: float, leader: float
):
    decel = -float(cah_accel(model_constants(), np.float32(v), as_leader(s, v - ahead, leader)))
    if ahead * (v - ahead) >= -2.0 * s * leader:
        return  # The vehicles would meet while both move, which is another formula.
    # The leader stops after v^2 / (2 b); the follower has that way and the gap.
    assert v**2 / (2.0 * decel) == pytest.approx(s + ahead**2 / (2.0 * -leader), rel=1e-4)


def imposed(driver: dict[str, float], speed: float, gap: float, closing: float) -> float:
    """Acceleration that a leader imposes on a driver [m/s^2]."""
    vehicle, v = as_fields(driver, ()), np.float32(speed)
    leader = as_leader(gap, closing)
    return float(imposed_accel(model_constants(), vehicle, v, vehicle.time_gap, leader))


def test_a_cut_in_by_a_faster_vehicle_causes_no_hard_braking():
    # 5 m behind a vehicle that is 1 m/s faster, the plain model brakes with 50 m/s^2.
    driver = person()
    follower, leader = as_follower(driver, 30.0, 35.0), as_leader(5.0, -1.0)
    assert float(iidm_accel(model_constants(), follower, leader)) < -20.0
    assert float(acc_accel(model_constants(), follower, leader)) > -1.1 * driver["decel"]


@given(driver=drivers, v=st.floats(1.0, 40.0), s=st.floats(2.0, 100.0), ahead=st.floats(0.0, 50.0))
def test_the_imposed_acceleration_at_the_desired_speed_is_never_positive(
    driver: dict[str, float], v: float, s: float, ahead: float
):
    dv = v - ahead
    imposed_value = imposed(driver, v, s, dv)
    root = 2.0 * math.sqrt(driver["accel"] * driver["decel"])
    desired_gap = driver["min_gap"] + max(0.0, v * driver["time_gap"] + v * dv / root)
    expected = driver["accel"] * (1.0 - (desired_gap / s) ** 2)
    assert imposed_value == pytest.approx(min(0.0, expected), rel=1e-3, abs=1e-3)


@given(driver=drivers, v=st.floats(5.0, 40.0), share=st.floats(0.05, 1.0), dv=st.floats(0.0, 20.0))
def test_the_imposed_braking_within_the_comfortable_stopping_distance_is_as_hard_as_needed(
    driver: dict[str, float], v: float, share: float, dv: float
):
    # s* >= v dv / (2 sqrt(a b)), so a (s* / s)^2 >= dv^2 / (2 s) wherever s <= v^2 / (2 b).
    s, closing = share * v**2 / (2.0 * driver["decel"]), min(dv, v)
    imposed_value = imposed(driver, v, s, closing)
    assert imposed_value <= driver["accel"] - closing**2 / (2.0 * max(s, 0.5)) + 1e-3


@pytest.mark.parametrize("speed", [8.0, 15.0, 25.0])
@pytest.mark.parametrize("time_gap", [0.8, 1.6])
def test_a_queue_settles_at_the_gap_of_the_formula(speed: float, time_gap: float):
    driver = person(time_gap=time_gap, desired_speed=35.0)
    leader = Vehicle(s=400.0, speed=speed, driver={"desired_speed": speed})
    queue = [Vehicle(s=400.0 - 60.0 * k, speed=speed, driver=driver) for k in range(1, 6)]
    world = scenario([*queue, leader], road=wide_road(lanes=1), horizon=120.0)
    run = engine.run(world, step_parameters(world, PERFECT))
    last = int(run.num_frames[0]) - 1
    s = run.states.s[0, :, last] / 1000.0
    lengths = world.vehicles.length[0]
    gaps = [s[5] - s[0], *(s[k] - s[k + 1] for k in range(4))]
    net_gaps = [gap - 0.5 * (lengths[0] + lengths[5]) for gap in gaps]
    speeds = run.states.speed[0, :6, last] / 1000.0
    # The leader's pedals answer v - v0 softly, so it is 1 mm/s short of its own speed at the end.
    np.testing.assert_allclose(speeds, speed, rtol=2e-3)
    np.testing.assert_allclose(net_gaps, 2.0 + speed * time_gap, rtol=5e-3)


def test_a_driver_alone_accelerates_by_the_free_branch_of_the_model():
    a, v0, start = 0.5, 30.0, 15.0
    alone = Vehicle(speed=start, driver=person(accel=a, desired_speed=v0), body={"power": 2e5})
    world = scenario([alone], road=wide_road(), horizon=60.0)
    run = engine.run(world, step_parameters(world, PERFECT))
    times = np.arange(0, run.num_frames[0], 100) * 0.05
    # The pedal moves at 2.5 m/s^3, which delays everything by half of a / 2.5 s.
    delayed_times = np.maximum(times - 0.5 * a / 2.5, 0.0)
    solution = solve_ivp(
        lambda _, v: a * (1.0 - (v / v0) ** EXPONENT),
        (0.0, 60.0),
        [start],
        t_eval=delayed_times,
        rtol=1e-8,
    )
    speeds = run.states.speed[0, 0, : run.num_frames[0] : 100] / 1000.0
    np.testing.assert_allclose(speeds, solution.y[0], rtol=2e-3)


@st.composite
def queues(draw: st.DrawFn) -> list[Vehicle]:
    """Three vehicles one behind the other, at rest towards each other, and a standing one ahead."""
    speed = draw(st.floats(8.0, 38.0))
    place, vehicles = 0.0, []
    for _ in range(3):
        driver = draw(drivers) | {"desired_speed": draw(st.floats(speed, 45.0))}
        vehicles.append(Vehicle(s=place, speed=speed, driver=driver))
        place -= driver["min_gap"] + speed * driver["time_gap"] + 5.0
    # Room to stop with half of the comfortable deceleration.
    room = speed**2 / min(v.driver["decel"] for v in vehicles) + 60.0
    return [*vehicles, Vehicle(s=room, speed=0.0, driver={"desired_speed": 0.01})]


@given(rows=st.lists(queues(), min_size=8, max_size=8))
@settings(max_examples=8)
def test_a_queue_with_a_safe_start_has_no_contact(rows: list[list[Vehicle]]):
    world = scenario(*rows, road=wide_road(lanes=1), horizon=90.0)
    run = engine.run(world, step_parameters(world, PERFECT))
    assert (run.contacts.partner == 255).all()
    s, lengths = run.states.s[:, :4] / 1000.0, world.vehicles.length[:, :4]
    order = [3, 0, 1, 2]
    for ahead, behind in pairwise(order):
        reach = 0.5 * (lengths[:, ahead] + lengths[:, behind])
        gap = s[:, ahead] - s[:, behind] - reach[:, None]
        assert gap[run.frame_mask].min() > 0.3
    ends = run.states.speed[np.arange(8), :3, run.num_frames[:, None] - 1]
    assert (ends < 500).all()
