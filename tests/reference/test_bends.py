"""Roads with bends and hills: both engines, and motion against closed formulas."""

from __future__ import annotations

import dataclasses
import math
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import brentq
from scipy.special import fresnel
from tests.support.bends import BENDS, HILLS, on
from tests.support.worlds import Vehicle, body_of, scenario

from overtaking import _core
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.labelling import label
from overtaking.model.known_roads import known_road
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource, extend_road
from overtaking.sim import engine, reference

from .situations import difference

if TYPE_CHECKING:
    from overtaking.model.road import Road
    from overtaking.model.trajectories import Trajectories

pytestmark = pytest.mark.ci

LEVELS = [name for name, available in _core.simd_levels() if available]
GRAVITY, AIR_DENSITY, USABLE_POWER = 9.81, 1.2, 0.9


@cache
def wide() -> Road:
    """A straight road of five lanes."""
    return known_road("town06").extend_to(6000.0)


def lone(road: Road, *, seconds: float = 20.0, kind: str = "M", **changes: float) -> Trajectories:
    """A run of one vehicle alone on a road, in the lane next to the reference line."""
    speed = changes.pop("speed", 25.0)
    vehicle = Vehicle(kind=kind, s=10.0, lane=3, speed=speed, driver=changes)
    return engine.simulate(scenario([vehicle], road=road, horizon=seconds))


def recorded(run: Trajectories, name: str) -> np.ndarray:
    """A recorded field of the only vehicle, in SI units."""
    scale = {"heading": 1e-4, "yaw_rate": 1e-4}.get(name, 1e-3)
    return getattr(run.states, name)[0, 0, : run.num_frames[0]] * scale


@pytest.mark.parametrize("profile", ["motorway", "rural"])
def test_both_engines_have_the_same_bits(profile: str):
    # 20 s are some 600 m: through bends of either side, over a rise or a fall.
    specification = load_specification(
        profile, {"time.horizon_s": 20.0, "time.attempt_deadline_s": 20.0}
    )
    straight = extend_road(specification, known_road(specification.road))
    batch = ScenarioSource(specification, on(straight, *BENDS, grade=HILLS), 5).sample(np.arange(4))
    expected = reference.simulate(batch)
    for level in LEVELS:
        assert not difference(expected, engine.simulate(batch, level=level))


def test_a_reference_line_without_bends_drives_like_a_straight_road():
    batch = ScenarioSource(load_specification("motorway"), known_road("motorway"), 5).sample(
        np.arange(16)
    )
    road = batch.road
    at_origin = dataclasses.replace(road, x0=0.0, y0=0.0, heading=0.0)
    straight = engine.simulate(dataclasses.replace(batch, road=at_origin))
    on_reference_line = engine.simulate(
        dataclasses.replace(batch, road=on(road, (road.length, 0.0, 0.0)))
    )
    assert not difference(straight, on_reference_line)


def test_a_mirrored_road_gives_mirrored_trajectories():
    batch = ScenarioSource(load_specification("motorway"), known_road("motorway"), 5).sample(
        np.arange(8)
    )
    batch = batch.replace(road=on(batch.road, *BENDS, grade=HILLS))
    weather = batch.weather.replace(
        wind_direction=-batch.weather.wind_direction, sun_azimuth=-batch.weather.sun_azimuth
    )
    run = engine.simulate(batch)
    mirrored_run = engine.simulate(batch.replace(road=batch.road.mirror(), weather=weather))
    for name in ("s", "x", "speed"):
        np.testing.assert_array_equal(getattr(run.states, name), getattr(mirrored_run.states, name))
    for name in ("d", "y", "yaw_rate", "heading"):
        np.testing.assert_array_equal(
            getattr(run.states, name), -getattr(mirrored_run.states, name)
        )
    assert batch.road.mirror().mirror() == batch.road


@pytest.mark.parametrize("radius", [150.0, 400.0, 1500.0])
def test_steady_cornering_takes_the_acceleration_of_a_circle(radius: float):
    run = lone(on(wide(), (6000.0, 1 / radius, 1 / radius)), desired_speed=17.0, speed=17.0)
    speed, path_radius = recorded(run, "speed")[200:], radius - recorded(run, "d")[200:]
    # In the mean: keeping the lane adds some hundredths of m/s^2 to either side.
    needed = float(np.mean(speed**2 / path_radius))
    assert float(recorded(run, "accel_lat")[200:].mean()) == pytest.approx(
        needed, rel=0.02, abs=0.01
    )
    assert (
        np.abs(recorded(run, "d")[200:] + 1.75).max() < 0.35
    )  # The wander in the lane is 0.3 m at most.


def test_a_full_circle_ends_at_its_start():
    radius = 200.0
    run = lone(
        on(wide(), (6000.0, 1 / radius, 1 / radius)), seconds=90.0, desired_speed=18.0, speed=18.0
    )
    s = recorded(run, "s")
    lap = int(np.argmax(s - s[0] >= 2.0 * math.pi * radius))
    assert lap
    turned_angle = cumulative_trapezoid(recorded(run, "yaw_rate"), dx=0.05)[lap - 1]
    assert turned_angle == pytest.approx(2.0 * math.pi, rel=2e-3)
    x, y = recorded(run, "x"), recorded(run, "y")
    assert math.hypot(x[lap] - x[0], y[lap] - y[0]) < 1.5  # A vehicle drives 0.9 m in a frame.


def test_world_positions_follow_from_recorded_speed_and_yaw_rate():
    """Dead reckoning by speed and yaw rate, in world coordinates, through two bends."""
    run = lone(on(wide(), *BENDS, grade=HILLS), seconds=55.0, desired_speed=25.0)
    speed, rate = recorded(run, "speed"), recorded(run, "yaw_rate")
    x, y, heading = recorded(run, "x"), recorded(run, "y"), np.unwrap(recorded(run, "heading"))
    assert recorded(run, "s")[-1] > 1300.0
    integrated_heading = heading[0] + cumulative_trapezoid(rate, dx=0.05, initial=0.0)
    np.testing.assert_allclose(heading, integrated_heading, atol=0.01)
    distance = np.hypot(np.diff(x), np.diff(y))
    np.testing.assert_allclose(
        distance, 0.05 * 0.5 * (speed[1:] + speed[:-1]), rtol=0.005, atol=0.003
    )
    # The vehicle moves in the direction of its heading, except for the slip angle of its centre.
    course = np.unwrap(np.arctan2(np.diff(y), np.diff(x)))
    np.testing.assert_allclose(course, 0.5 * (heading[1:] + heading[:-1]), atol=0.03)


def test_world_positions_on_a_clothoid_follow_fresnel_integrals():
    length, end = 600.0, 1 / 300
    run = lone(on(wide(), (length, 0.0, end), (3000.0, end, end)), desired_speed=20.0, speed=20.0)
    s, d = recorded(run, "s"), recorded(run, "d")
    inside = s < length
    scale = math.sqrt(math.pi * length / end)
    sine, cosine = fresnel(s / scale)
    angle = 0.5 * end / length * s**2
    x, y = scale * cosine - d * np.sin(angle), scale * sine + d * np.cos(angle)
    np.testing.assert_allclose(recorded(run, "x")[inside], x[inside], atol=2e-3)
    np.testing.assert_allclose(recorded(run, "y")[inside], y[inside], atol=2e-3)


@pytest.mark.parametrize("radius", [100.0, 200.0, 300.0])
def test_drivers_slow_down_before_a_bend_as_on_rural_roads(radius: float):
    """Mean free speeds in bends on level two-lane roads.

    Source:
        Fitzpatrick and others 2000 (FHWA-RD-99-171), table 2: the 85 % quantile is
        104.82 - 3574.51 / R km/h; the mean lies a standard deviation of 8 km/h below, which is
        also how fast the driver wants to go where the road is straight.
    """
    run = lone(
        on(wide(), (500.0, 0.0, 0.0), (60.0, 0.0, 1 / radius), (900.0, 1 / radius, 1 / radius)),
        seconds=60.0, desired_speed=96.8 / 3.6, speed=96.8 / 3.6,
    )  # fmt: skip
    s, speed = recorded(run, "s"), recorded(run, "speed")
    assert speed[s < 250.0].min() > 25.0
    inside = (s > 600.0) & (s < 900.0)
    assert inside.any()
    assert 3.6 * speed[inside].mean() == pytest.approx(104.82 - 3574.51 / radius - 8.0, abs=10.0)
    assert recorded(run, "accel_lon").min() > -3.0


RADIUS, STRAIGHT, ARC = 100.0, 200.0, 150.0


@cache
def crooked() -> Road:
    """The rural road, laid out along straights and tight bends to either side in turn."""
    rural = extend_road(load_specification("rural"), known_road("rural"))
    parts: list[tuple[float, float, float]] = []
    for k in range(int(rural.length // (STRAIGHT + ARC)) + 1):
        bend = (-1) ** k / RADIUS
        parts += [(STRAIGHT, 0.0, 0.0), (ARC, bend, bend)]
    return on(dataclasses.replace(rural, course=None), *parts)


def test_start_speeds_respect_the_bends_at_and_ahead_of_the_start():
    batch = ScenarioSource(load_specification("rural"), crooked(), 5).sample(np.arange(48))
    run = engine.simulate(batch)
    is_compared, is_oncoming = batch.vehicles.valid.copy(), batch.start_lane == 1
    # Distances along the road and against it; bends of the length `ARC` alternate with straights.
    s_in_period = batch.start_s % (STRAIGHT + ARC)
    along = np.maximum(STRAIGHT - s_in_period, 0.0)
    against = np.where(s_in_period < STRAIGHT, s_in_period, 0.0)
    distance_to_bend = np.where(is_oncoming, against, along)
    accel, braking = (constant(f"model.steering.bend_{name}") for name in ("accel", "decel"))
    allowed = np.sqrt(accel * RADIUS + 2.0 * braking * distance_to_bend)
    # Curvature is stored at stations 2 m apart, as a mean around each: half of it at a bend end.
    is_at_bend_end = np.where(
        is_oncoming, (s_in_period >= STRAIGHT) & (s_in_period < STRAIGHT + 4.0), s_in_period > 346.0
    )
    is_compared &= ~is_at_bend_end
    assert (batch.start_speed**2 <= allowed**2 + 4.0 * braking + 0.01)[is_compared].all()
    assert (batch.start_speed > allowed - 1.0)[is_compared].mean() > 0.2
    line = 1.75 * np.where(is_oncoming, 1.0, -1.0)[:, :, None]
    lateral_distance = np.abs(1e-3 * run.states.d[:, :, :100] - line).max(axis=2)
    assert lateral_distance[is_compared].max() < 1.2
    assert (run.contacts.partner == NO_VEHICLE).all()


@pytest.mark.parametrize("kind", ["M", "T", "MC"])
@pytest.mark.parametrize("radius", [100.0, -100.0, 300.0])
def test_a_vehicle_that_starts_in_a_bend_keeps_its_lane(kind: str, radius: float):
    speed = math.sqrt(2.0 * abs(radius))
    road = on(wide(), (6000.0, 1 / radius, 1 / radius))
    run = lone(road, kind=kind, seconds=10.0, desired_speed=speed, speed=speed)
    rate = speed / (radius + 1.75)  # In the lane right of the reference line.
    assert recorded(run, "yaw_rate")[0] == pytest.approx(rate, rel=0.01)
    # Drivers wander by 0.3 m. Before, they took a second to turn the wheels: up to 1.6 m.
    assert np.abs(recorded(run, "d") + 1.75).max() < 0.35


def test_a_truck_climbs_at_the_speed_that_its_power_allows():
    body = body_of("T")
    slope = 0.05

    def surplus(speed: float) -> float:
        drag = 0.5 * AIR_DENSITY * body["drag_area"] * speed**2
        weight = body["mass"] * GRAVITY
        resistance = drag + weight * (body["rolling_resistance"] + math.sin(math.atan(slope)))
        return USABLE_POWER * body["power"] - resistance * speed

    climbing_speed = float(np.array(brentq(surplus, 1.0, 40.0)))
    road = on(wide(), (6000.0, 0.0, 0.0), grade=((0.0, slope),))
    run = lone(road, seconds=90.0, kind="T", desired_speed=24.0, speed=24.0)
    assert climbing_speed < 20.0
    assert recorded(run, "speed")[-1] == pytest.approx(climbing_speed, rel=0.02)


def test_height_is_the_integral_of_the_slope():
    road = on(wide(), (6000.0, 0.0, 0.0), grade=HILLS)
    s = np.linspace(0.0, 1500.0, 1501)
    integral = cumulative_trapezoid(road.grade_at(s), s, initial=0.0)
    np.testing.assert_allclose(road.height_at(s), integral, atol=1e-9)


def test_overtakes_in_bends_are_labelled_as_on_straight_roads():
    """The same traffic on a road that bends hardly at all gets the same labels."""
    batch = ScenarioSource(load_specification("motorway"), known_road("motorway"), 5).sample(
        np.arange(64)
    )
    nearly_straight = on(batch.road, (batch.road.length, 1e-9, 1e-9))
    straight, curved = (
        label(engine.simulate(dataclasses.replace(batch, road=road)))
        for road in (batch.road, nearly_straight)
    )
    np.testing.assert_array_equal(straight.labels.outcome, curved.labels.outcome)
