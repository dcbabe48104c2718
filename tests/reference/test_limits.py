"""Speed limits that change along a road: drivers obey them, equally on both engines."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.reference.scenes import limited
from tests.support.worlds import Vehicle, scenario, wide_road

from overtaking import _core
from overtaking.core.errors import ConfigError
from overtaking.knowledge.toml_reader import constant
from overtaking.model.driver_interface import MAX_ACTION_PARTS
from overtaking.model.known_roads import known_road
from overtaking.model.road_course import SpeedLimitSpan, ZoneKind
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine, reference
from overtaking.sim.stepping import new_stepper
from overtaking.simulators.carla import traffic
from overtaking.world.constants import model_constants
from overtaking.world.road_parameters import allowed_speed, road_parameters
from overtaking.world.sight_distance import all_zones_for
from overtaking.world.step_parameters import step_parameters

from .situations import difference

if TYPE_CHECKING:
    from overtaking.model.road import Road
    from overtaking.model.scenario import Scenario
    from overtaking.model.trajectories import Trajectories

LEVELS = [name for name, available in _core.simd_levels() if available]
HIGH, LOW = 90.0 / 3.6, 50.0 / 3.6
TOWN = SpeedLimitSpan(start=800.0, stop=1200.0, speed=LOW)
BRAKING = float(constant("model.steering.bend_decel"))
STATION = float(constant("model.steering.station"))


def village(*limits: SpeedLimitSpan) -> Road:
    """A straight road of three lanes through a place with a lower limit."""
    return limited(wide_road(), *(limits or (TOWN,)))


def recorded(run: Trajectories, name: str, slot: int = 0) -> np.ndarray:
    """A recorded field of a vehicle, in SI units."""
    return getattr(run.states, name)[0, slot, : run.num_frames[0]] * 1e-3


def drive_alone(
    road: Road, *, kind: str = "M", seconds: float = 70.0, **driver: float
) -> Trajectories:
    """A run of one vehicle alone on a road."""
    return engine.simulate(scenario([vehicle(kind, **driver)], road=road, horizon=seconds))


def vehicle(kind: str = "M", s: float = 100.0, speed: float = HIGH, **driver: float) -> Vehicle:
    """A vehicle whose driver obeys limits and wants to drive 28 m/s where it may."""
    driver = {"desired_speed": 28.0, "speed_limit_compliance": 1.0} | driver
    return Vehicle(kind=kind, s=s, lane=1, speed=speed, driver=driver)


@pytest.mark.parametrize("kind", ["M", "T", "MC"])
def test_a_driver_that_obeys_limits_brakes_comfortably_to_the_limit_before_the_stretch(kind):
    # A truck keeps its top speed.
    run = drive_alone(village(), kind=kind, speed=24.0 if kind == "T" else HIGH)
    s, speed, accel = recorded(run, "s"), recorded(run, "speed"), recorded(run, "accel_lon")
    is_inside, is_before = (s >= TOWN.start) & (s < TOWN.stop), s < TOWN.start
    assert speed[is_inside].max() <= LOW + 0.002
    assert speed[is_inside][-1] == pytest.approx(LOW, abs=0.02)
    # At every frame the remaining distance is enough for comfortable braking.
    distance_to_town = TOWN.start - s[is_before]
    assert (speed[is_before] ** 2 <= LOW**2 + 2.0 * BRAKING * distance_to_town + 0.5).all()
    assert accel.min() > -BRAKING - 0.15
    # The driver takes at most 2 s more than constant braking, and regains the speed behind.
    braking_time = np.count_nonzero(is_before & (speed < speed[0] - 0.5)) * 0.05
    assert braking_time < (speed[0] - LOW) / BRAKING + 2.0
    assert speed[s < TOWN.stop].min() > LOW - 0.3
    is_behind = s > TOWN.stop + 2.0 * STATION
    assert (accel[is_behind] > 0.0)[: 3 * 20].all()
    assert speed[is_behind][-1] > LOW + 5.0


def test_a_driver_does_not_speed_up_before_the_stretch_ends():
    run = drive_alone(village(TOWN, SpeedLimitSpan(start=1200.0, stop=1500.0, speed=20.0)))
    s, speed = recorded(run, "s"), recorded(run, "speed")
    assert speed[(s >= TOWN.start) & (s < TOWN.stop)].max() <= LOW + 0.002
    assert speed[(s >= 1200.0) & (s < 1500.0)].max() == pytest.approx(20.0, abs=0.5)
    assert speed.max() == pytest.approx(HIGH, abs=0.05)


@pytest.mark.parametrize("compliance", [0.0, 0.3, 1.0])
@pytest.mark.parametrize(
    "weather", [{}, {"rain": 100.0}, {"fog": 85.0, "night": 1.0, "sun_altitude": -0.5}]
)
def test_a_stretch_is_driven_like_a_whole_road_with_its_limit(
    compliance: float, weather: dict[str, float]
):
    driver = {"speed_limit_compliance": compliance, "caution": 0.7}
    scene = [vehicle(s=850.0, speed=LOW, **driver)]
    long_stretch = village(dataclasses.replace(TOWN, stop=5000.0))
    uniform = dataclasses.replace(long_stretch, speed_limit=LOW, course=None)
    runs = [
        engine.simulate(scenario(scene, road=road, weather=weather))
        for road in (long_stretch, uniform)
    ]
    np.testing.assert_array_equal(*(run.states.speed for run in runs))


@pytest.mark.ci
def test_a_limit_far_beyond_all_vehicles_changes_nothing():
    batch = ScenarioSource(load_specification("motorway"), known_road("motorway"), 5).sample(
        np.arange(16)
    )
    far = SpeedLimitSpan(start=batch.road.length - 10.0, stop=batch.road.length, speed=3.0)
    posted = dataclasses.replace(batch.road, course=limited(batch.road, far).course)
    runs = [engine.simulate(batch.replace(road=road)) for road in (batch.road, posted)]
    assert 1e-3 * runs[0].states.s.max() < far.start - 700.0
    assert not difference(*runs)


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize(("start", "stop"), [(800.0, 1200.0), (800.7, 803.1), (801.9, 801.95)])
def test_the_allowed_speed_follows_the_formula_within_two_stations(direction, start, stop):
    road = village(SpeedLimitSpan(start=start, stop=stop, speed=LOW))
    s = np.arange(0.0, 3000.0, 0.05)
    own_s = s if direction > 0 else road.length - s
    parameters, is_oncoming = road_parameters(road), np.bool_(direction < 0)
    allowed = allowed_speed(model_constants(), parameters, own_s.astype(np.float32), is_oncoming)
    posted = road.speed_limit_at(s, direction)
    assert (allowed <= posted + 1e-5).all()
    begins, ends = (start, stop) if direction > 0 else (stop, start)
    distance_ahead, distance_behind = direction * (begins - s), direction * (s - ends)
    for margin, is_bound in ((0.0, np.less_equal), (2.0 * STATION, np.greater_equal)):
        braking_distance = np.maximum(distance_ahead - margin, 0.0)
        formula = np.minimum(np.sqrt(LOW**2 + 2.0 * BRAKING * braking_distance), HIGH)
        assert is_bound(allowed, formula + (1e-3 if margin == 0.0 else -1e-3))[
            distance_ahead > 0.0
        ].all()
    # The full speed is allowed two stations behind the stretch, and not before its end.
    assert (allowed[distance_behind > 2.0 * STATION] == HIGH).all()


@pytest.mark.ci
@pytest.mark.parametrize("profile", ["motorway", "rural"])
def test_both_engines_have_the_same_bits(profile: str):
    batch = on_limits(profile, 4, **{"time.horizon_s": 20.0, "time.attempt_deadline_s": 20.0})
    expected = reference.simulate(batch)
    for level in LEVELS:
        assert not difference(expected, engine.simulate(batch, level=level))


def on_limits(profile: str, count: int, **changes: Any) -> Scenario:
    """Traffic of a profile on its road, with a lower limit on 300 m of each sixteenth of it."""
    specification = load_specification(profile, changes)
    length = (
        ScenarioSource(specification, known_road(specification.road), 5)
        .sample(np.arange(1))
        .road.length
    )
    starts = np.linspace(0.0, length - 300.0, 16)
    road = dataclasses.replace(known_road(specification.road).extend_to(length))
    spans = (
        SpeedLimitSpan(start=float(s), stop=float(s) + 300.0, speed=LOW, direction=0)
        for s in starts
    )
    return ScenarioSource(specification, limited(road, *spans), 5).sample(np.arange(count))


@pytest.mark.ci
def test_a_mirrored_road_gives_mirrored_trajectories():
    batch = on_limits("motorway", 8)
    weather = batch.weather.replace(
        wind_direction=-batch.weather.wind_direction, sun_azimuth=-batch.weather.sun_azimuth
    )
    left = engine.simulate(batch)
    right = engine.simulate(batch.replace(road=batch.road.mirror(), weather=weather))
    np.testing.assert_array_equal(left.states.s, right.states.s)
    np.testing.assert_array_equal(left.states.d, -right.states.d)


def test_each_direction_has_its_own_limits():
    rural = known_road("rural")
    road = limited(rural, dataclasses.replace(TOWN, direction=-1))
    obeys = {"desired_speed": 28.0, "speed_limit_compliance": 1.0}
    pair = [
        Vehicle(s=200.0, speed=HIGH, driver=obeys),
        Vehicle(s=1900.0, lane=1, speed=HIGH, driver=obeys),
    ]
    run = engine.simulate(scenario(pair, road=road, horizon=60.0))
    assert recorded(run, "speed").min() > HIGH - 0.3
    s, speed = recorded(run, "s", 1), recorded(run, "speed", 1)
    inside = (s > TOWN.start) & (s <= TOWN.stop)
    assert inside.sum() > 20 * 25
    assert speed[inside].max() <= LOW + 0.002
    assert speed[s > TOWN.stop + 300.0].min() > HIGH - 0.3


def test_an_ego_pulls_out_only_if_the_limit_allows_a_higher_speed():
    eager = {"min_speed_gain": 3.0, "desired_speed": 28.0}
    slow = Vehicle(s=890.0, lane=1, speed=12.9, driver={"desired_speed": 12.9})
    scene = [vehicle(s=860.0, speed=12.9, **eager), slow]
    in_town, without_town = (
        engine.simulate(scenario(scene, road=road, horizon=20.0))
        for road in (village(), limited(wide_road()))
    )
    assert (in_town.stage[0] == 0).all()
    assert (without_town.stage[0] > 0).any()


@pytest.mark.ci
def test_an_external_driver_observes_the_same_bits_on_both_engines():
    batch = on_limits("rural", 4, **{"time.horizon_s": 6.0, "time.attempt_deadline_s": 6.0})
    parameters = step_parameters(batch)
    observations = []
    for simulator in ("engine", "reference"):
        stepper = new_stepper(parameters, "decision", observes_truth=False, simulator=simulator)
        tables = [stepper.observe_start()[0]]
        tables += [stepper.step(np.zeros((4, MAX_ACTION_PARTS), np.int32), 3)[0] for _ in range(30)]
        observations.append(np.array(tables))
    np.testing.assert_array_equal(*observations)


@pytest.mark.parametrize("profile", ["motorway", "rural"])
def test_start_speeds_respect_the_limits_at_and_ahead_of_the_start(profile: str):
    batch = on_limits(profile, 32)
    is_oncoming = batch.start_lane == batch.road.num_lanes
    compliance, valid = batch.drivers.speed_limit_compliance, batch.vehicles.valid
    desired_speed, start_speed = batch.drivers.desired_speed, batch.start_speed
    for direction_is_oncoming in (False, True):
        own_s = (
            batch.start_s
            if not direction_is_oncoming
            else np.float32(batch.road.length) - batch.start_s
        )
        limit = allowed_speed(
            model_constants(), road_parameters(batch.road), own_s, np.bool_(direction_is_oncoming)
        )
        allowed_start = desired_speed - compliance * np.maximum(desired_speed - limit, 0.0)
        is_compared = valid & (is_oncoming == direction_is_oncoming)
        assert (start_speed <= allowed_start + 1e-3)[is_compared].all()
    posted = np.where(is_oncoming, *(batch.road.speed_limit_at(batch.start_s, k) for k in (-1, 1)))
    assert (valid & (posted == LOW)).mean() > 0.1 * valid.mean()


def test_the_limit_at_a_crest_decides_how_long_it_forbids_passing():
    rural = known_road("rural")
    hill = ((0.0, 0.02), (1400.0, 0.02), (1500.0, -0.02), (5000.0, -0.02))
    course = dataclasses.replace(
        limited(rural, SpeedLimitSpan(start=1000.0, stop=2000.0, speed=LOW)).course,
        grade=hill,
        sight=(),
        sight_against=(),
    )
    crests_with_lower_limit, crests_without = (
        [
            zone.stop - zone.start
            for zone in all_zones_for(
                dataclasses.replace(rural, speed_limit=HIGH, course=road_course), 1
            )
            if zone.kind is ZoneKind.CREST
        ]
        for road_course in (course, dataclasses.replace(course, speed_limit_spans=()))
    )
    assert crests_without
    assert sum(crests_with_lower_limit) < sum(crests_without)


def test_the_traffic_manager_refuses_a_road_with_several_limits():
    with pytest.raises(ConfigError, match="one limit from end to end, got another one from 800 m"):
        traffic.simulate(scenario([vehicle()], road=village()))
