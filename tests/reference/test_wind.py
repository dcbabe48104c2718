"""Wind on vehicles: side force against published figures, gusts, the lee of a lorry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.support.bench import bench
from tests.support.single_track import side_wind
from tests.support.worlds import FOUR_WHEELERS, Vehicle, body_of, scenario, wide_road

from overtaking.sim import engine, reference
from overtaking.sim.reference import road_conditions
from overtaking.sim.reference.state import State
from overtaking.world.constants import EnabledEffects
from overtaking.world.step_parameters import step_parameters

ACROSS = math.pi / 2.0
KMH = 1.0 / 3.6


def blown(
    kind: str, *, speed_kmh: float, percent: float, peak: float = 1.0, **body: float
) -> float:
    """Lateral acceleration by a side wind before any tyre answers [m/s^2]."""
    vehicle = Vehicle(kind=kind, speed=speed_kmh * KMH, body=body)
    b = bench(vehicle, sky={"wind": peak * percent, "wind_direction": ACROSS})
    b.decide()
    return float(b.state.friction_and_wind.wind_force[0, 0] * b.vehicles.inverse_mass[0, 0])


# At 30, 60 and 100 % mean wind, then at 1.45 times that; rounded to two digits.
PUBLISHED = [
    ("M", 110.0, {}, (0.41, 0.86, 1.57), (0.60, 1.32, 2.57)),
    ("V", 110.0, {}, (0.58, 1.2, 2.2), (0.86, 1.9, 3.6)),
    ("T", 85.0, {}, (0.23, 0.5, 0.94), (0.34, 0.78, 1.6)),
    ("MC", 110.0, {}, (0.56, 1.2, 2.1), (0.82, 1.8, 3.5)),
]


@pytest.mark.parametrize(("kind", "speed_kmh", "body", "mean", "gust"), PUBLISHED)
def test_the_side_force_equals_the_value_worked_out_by_hand(
    kind: str, speed_kmh: float, body: dict[str, float], mean: tuple[float, ...],
    gust: tuple[float, ...],
):  # fmt: skip
    for peak, figures in ((1.0, mean), (1.45, gust)):
        for percent, expected in zip((30.0, 60.0, 100.0), figures, strict=True):
            value = blown(kind, speed_kmh=speed_kmh, percent=percent, peak=peak, **body)
            assert value == pytest.approx(expected, rel=0.04)


def test_the_side_acceleration_of_a_lorry_is_inverse_to_its_mass():
    loaded = blown("T", speed_kmh=85.0, percent=60.0)
    empty = blown("T", speed_kmh=85.0, percent=60.0, mass=6500.0)
    assert empty / loaded == pytest.approx(12_000.0 / 6_500.0, rel=1e-5)


@pytest.mark.parametrize("kind", FOUR_WHEELERS)
@pytest.mark.parametrize("percent", [10.0, 50.0, 100.0])
def test_force_and_moment_equal_the_equations_in_float64(kind: str, percent: float):
    speed = 28.0
    b = bench(Vehicle(kind=kind, speed=speed), sky={"wind": percent, "wind_direction": ACROSS})
    b.decide()
    force, moment = side_wind(body_of(kind), speed, 0.2 * percent)
    # Float32 and our own arc tangent: a few units in the sixth digit.
    assert float(b.state.friction_and_wind.wind_force[0, 0]) == pytest.approx(force, rel=2e-5)
    assert float(b.state.friction_and_wind.wind_moment[0, 0]) == pytest.approx(moment, rel=5e-5)


@pytest.mark.parametrize("simulator", [engine, reference], ids=["engine", "reference"])
def test_pedals_never_pull_a_rider_back_in_a_head_wind(simulator):
    """A former fault: the load of the rear wheel was negative, and so was the pedal force."""
    rider = Vehicle(kind="B", speed=30.0, driver={"desired_speed": 40.0})
    head_wind = {"wind": 100.0, "wind_direction": math.pi}
    world = scenario([rider], weather=head_wind, horizon=1.0)
    run = simulator.run(world, step_parameters(world, EnabledEffects(gusts=False)))
    body = body_of("B")
    # Newton's second law with the force of the pedals at zero or more.
    # A frame has the acceleration of the step before it, and the speed was highest at its begin.
    air = run.states.speed[0, 0, :-1] / 1000.0 + 20.0
    resistance = 0.5 * 1.2 * body["drag_area"] * air**2 / body["mass"]
    resistance += body["rolling_resistance"] * 9.81
    assert resistance.max() > 4.63  # At which the rear wheel lifts: g * 0.4725 m / 1 m.
    # Recorded to 1 mm/s^2.
    assert (run.states.accel_lon[0, 0, 1:] / 1000.0 >= -resistance - 0.0005).all()


def test_a_head_wind_brakes_and_does_not_push_aside():
    still = bench(Vehicle(speed=30.0)).drive(1.0)
    headwind = bench(Vehicle(speed=30.0), sky={"wind": 100.0, "wind_direction": math.pi})
    run = headwind.drive(1.0)
    assert abs(float(headwind.state.friction_and_wind.wind_force[0, 0])) < 1e-3 * 1400.0
    # No driver reacts here: the pedal holds the air speed, so only the power is a limit.
    body = body_of("M")
    drag = 0.5 * 1.2 * body["drag_area"] * 50.0**2 + body["rolling_resistance"] * 1400.0 * 9.81
    short = drag - 0.9 * body["power"] / 30.0
    assert short < 0.0
    assert run["vx"][-1, 0] == pytest.approx(still["vx"][-1, 0], rel=1e-3)


@pytest.mark.parametrize("direction", [0.0, math.pi])
def test_drag_depends_on_the_speed_through_the_air(direction: float):
    speed, wind = 30.0, 20.0
    b = bench(
        Vehicle(speed=speed, body={"max_speed": 100.0}),
        sky={"wind": 100.0, "wind_direction": direction},
        friction=2.0,
    )
    accel = float(b.drive(0.05, lambda test, _: test.hold(accel=50.0))["accel_lon"][-1, 0])
    body = body_of("M")
    air = speed - wind * math.cos(direction)
    drag = 0.5 * 1.2 * body["drag_area"] * air * abs(air)
    rolling = body["rolling_resistance"] * body["mass"] * 9.81
    expected = (0.9 * body["power"] / speed - drag - rolling) / body["mass"]
    assert accel == pytest.approx(expected, rel=1e-4)


def test_wind_from_either_side_pushes_equally_hard():
    pushed = [
        bench(Vehicle(kind="V", speed=30.0), sky={"wind": 70.0, "wind_direction": side * ACROSS})
        for side in (1.0, -1.0)
    ]
    for b in pushed:
        b.decide()
    left, right = (float(b.state.friction_and_wind.wind_force[0, 0]) for b in pushed)
    assert left > 0.0
    assert left == -right


def gust_along(length_of_road: float = 1200.0) -> tuple[np.ndarray, np.ndarray, float]:
    """The bump of the discrete gusts at every half metre of a road, and its length [m]."""
    places = np.arange(0.0, length_of_road, 0.5)
    world = scenario(
        [Vehicle()], road=wide_road(), weather={"wind": 80.0, "wind_direction": ACROSS}
    )
    parameters = step_parameters(world)
    state = State.at_start(parameters)
    state.motion.s = np.repeat(places.astype(np.float32)[None, :, None], 1, axis=2)[0].T
    q = parameters.simulations
    return (
        places,
        road_conditions.discrete_gust(state, parameters)[0].astype(np.float64),
        float(q.gust_length[0]),
    )


def test_gusts_have_the_shape_of_one_minus_cosine_and_come_every_600_m():
    places, bump, length = gust_along()
    assert 30.0 <= length <= 80.0
    begins = places[np.flatnonzero((bump[1:] > 0.0) & (bump[:-1] == 0.0))]
    assert np.diff(begins) == pytest.approx(600.0, abs=0.6)
    # One whole gust: from its begin on, half of 1 - cos over its length.
    inside = (places > begins[0]) & (places < begins[0] + length + 0.5)
    # The begin is known to half a metre, of 30 to 80, and the slope is at most pi / length.
    first = places[inside] - begins[0]
    shape = 0.5 - 0.5 * np.cos(2.0 * math.pi * np.minimum(first, length) / length)
    np.testing.assert_allclose(bump[inside], shape, atol=0.5 * math.pi / length + 0.01)
    assert bump.max() == pytest.approx(1.0, abs=0.01)
    # Half of the length of each gust, over the spacing, is the mean.
    assert bump.mean() == pytest.approx(0.5 * length / 600.0, rel=0.02)


def test_no_gusts_come_in_a_light_breeze():
    for percent, gusty in ((39.0, False), (41.0, True)):
        world = scenario([Vehicle()], weather={"wind": percent, "wind_direction": ACROSS})
        gain = step_parameters(world).simulations.gust_gain
        assert bool(gain[0] > 0.0) is gusty


def passing_a_lorry(wind_direction: float, offset: float) -> float:
    """Side force on a car `offset` metres ahead of a lorry in the lane to its right [N]."""
    lorry = Vehicle(kind="T", s=100.0, lane=0, speed=25.0)
    car = Vehicle(kind="M", s=100.0 + offset, lane=1, speed=30.0)
    world = scenario(
        [car, lorry], road=wide_road(), weather={"wind": 60.0, "wind_direction": wind_direction}
    )
    parameters = step_parameters(world, EnabledEffects(gusts=False))
    state = State.at_start(parameters)
    road_conditions.update_wind(state, parameters)
    return float(state.friction_and_wind.wind_force[0, 0])


@pytest.mark.ci
def test_beside_a_lorry_the_side_wind_is_weak_and_returns_within_half_its_length():
    # Wind from the right, where the lorry drives.
    free = passing_a_lorry(ACROSS, 60.0)
    beside = passing_a_lorry(ACROSS, 0.0)
    lorry = body_of("T")["length"]
    force = [passing_a_lorry(ACROSS, x) / free for x in np.linspace(0.0, lorry + 0.5, 60)]
    # Three tenths of the cross wind are left; the force follows its angle almost linearly.
    expected, _ = side_wind(body_of("M"), 30.0, 0.3 * 12.0)
    assert beside == pytest.approx(expected, rel=1e-3)
    assert (np.diff(force) >= -1e-6).all()
    assert force[0] == pytest.approx(force[25], rel=1e-5)  # Still alongside.
    assert force[-1] == pytest.approx(1.0, rel=1e-5)
    # The return is smooth: a half of it in the middle of the stretch.
    middle = passing_a_lorry(ACROSS, 0.75 * lorry) / free
    assert middle == pytest.approx(0.5 * (force[0] + 1.0), abs=0.03)


def test_a_lorry_has_no_lee_on_its_windward_side():
    assert passing_a_lorry(-ACROSS, 0.0) == passing_a_lorry(-ACROSS, 60.0)


def test_a_car_that_leaves_the_lee_of_a_lorry_gets_a_sudden_side_force():
    # At 5 m/s faster the lee of half a lorry ends within 0.8 s: the force more than doubles.
    lorry = body_of("T")["length"]
    before, after = (passing_a_lorry(ACROSS, x) for x in (0.5 * lorry, 0.5 * lorry + 0.8 * 5.0))
    assert (after - before) / body_of("M")["mass"] > 0.4
