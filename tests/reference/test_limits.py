"""Limits that change along a road: what drivers do about them, and both engines."""

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


def of(run: Trajectories, name: str, slot: int = 0) -> np.ndarray:
    """A recorded field of a vehicle, in SI units."""
    return getattr(run.states, name)[0, slot, : run.num_frames[0]] * 1e-3


def lone(road: Road, *, kind: str = "M", seconds: float = 70.0, **given: float) -> Trajectories:
    """One vehicle that has a road to itself."""
    return engine.simulate(scenario([one(kind, **given)], road=road, horizon=seconds))


def one(kind: str = "M", s: float = 100.0, speed: float = HIGH, **driver: float) -> Vehicle:
    driver = {"desired_speed": 28.0, "speed_limit_compliance": 1.0} | driver
    return Vehicle(kind=kind, s=s, lane=1, speed=speed, driver=driver)


@pytest.mark.parametrize("kind", ["M", "T", "MC"])
def test_who_obeys_has_slowed_down_where_the_stretch_begins_and_needs_no_more_than_the_bound(kind):
    # A truck keeps its top speed.
    run = lone(village(), kind=kind, speed=24.0 if kind == "T" else HIGH)
    s, speed, accel = of(run, "s"), of(run, "speed"), of(run, "accel_lon")
    inside, before = (s >= TOWN.start) & (s < TOWN.stop), s < TOWN.start
    assert speed[inside].max() <= LOW + 0.002
    assert speed[inside][-1] == pytest.approx(LOW, abs=0.02)
    # The way left is enough for the comfortable braking, at every frame.
    way = TOWN.start - s[before]
    assert (speed[before] ** 2 <= LOW**2 + 2.0 * BRAKING * way + 0.5).all()
    assert accel.min() > -BRAKING - 0.15
    # Nobody dawdles: two seconds more than braking takes, and the full speed behind.
    took = np.count_nonzero(before & (speed < speed[0] - 0.5)) * 0.05
    assert took < (speed[0] - LOW) / BRAKING + 2.0
    assert speed[s < TOWN.stop].min() > LOW - 0.3
    late = s > TOWN.stop + 2.0 * STATION
    assert (accel[late] > 0.0)[: 3 * 20].all()
    assert speed[late][-1] > LOW + 5.0


def test_nobody_is_let_go_before_the_stretch_ends():
    run = lone(village(TOWN, SpeedLimitSpan(start=1200.0, stop=1500.0, speed=20.0)))
    s, speed = of(run, "s"), of(run, "speed")
    assert speed[(s >= TOWN.start) & (s < TOWN.stop)].max() <= LOW + 0.002
    assert speed[(s >= 1200.0) & (s < 1500.0)].max() == pytest.approx(20.0, abs=0.5)
    assert speed.max() == pytest.approx(HIGH, abs=0.05)


@pytest.mark.parametrize("respect", [0.0, 0.3, 1.0])
@pytest.mark.parametrize(
    "sky", [{}, {"rain": 100.0}, {"fog": 85.0, "night": 1.0, "sun_altitude": -0.5}]
)
def test_a_stretch_is_driven_as_a_road_that_has_its_limit(respect: float, sky: dict[str, float]):
    driver = {"speed_limit_compliance": respect, "caution": 0.7}
    there = [one(s=850.0, speed=LOW, **driver)]
    long = village(dataclasses.replace(TOWN, stop=5000.0))
    everywhere = dataclasses.replace(long, speed_limit=LOW, course=None)
    runs = [engine.simulate(scenario(there, road=road, weather=sky)) for road in (long, everywhere)]
    np.testing.assert_array_equal(*(run.states.speed for run in runs))


@pytest.mark.ci
def test_limits_beyond_where_anybody_drives_change_nothing():
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
def test_what_is_allowed_follows_the_formula_within_two_stations(direction, start, stop):
    road = village(SpeedLimitSpan(start=start, stop=stop, speed=LOW))
    s = np.arange(0.0, 3000.0, 0.05)
    own = s if direction > 0 else road.length - s
    given, turned = road_parameters(road), np.bool_(direction < 0)
    allowed = allowed_speed(model_constants(), given, own.astype(np.float32), turned)
    posted = road.speed_limit_at(s, direction)
    assert (allowed <= posted + 1e-5).all()
    begins, ends = (start, stop) if direction > 0 else (stop, start)
    ahead, behind = direction * (begins - s), direction * (s - ends)
    for spare, is_bound in ((0.0, np.less_equal), (2.0 * STATION, np.greater_equal)):
        way = np.maximum(ahead - spare, 0.0)
        wanted = np.minimum(np.sqrt(LOW**2 + 2.0 * BRAKING * way), HIGH)
        assert is_bound(allowed, wanted + (1e-3 if spare == 0.0 else -1e-3))[ahead > 0.0].all()
    # Whoever has left the stretch is let go two stations on, and not before its end.
    assert (allowed[behind > 2.0 * STATION] == HIGH).all()


@pytest.mark.ci
@pytest.mark.parametrize("profile", ["motorway", "rural"])
def test_both_engines_have_the_same_bits(profile: str):
    batch = on_limits(profile, 4, **{"time.horizon_s": 20.0, "time.attempt_deadline_s": 20.0})
    read = reference.simulate(batch)
    for level in LEVELS:
        assert not difference(read, engine.simulate(batch, level=level))


def on_limits(profile: str, count: int, **changes: Any) -> Scenario:
    """Traffic of a profile on its road, with a lower limit on 300 m of each sixteenth of it."""
    plan = load_specification(profile, changes)
    length = ScenarioSource(plan, known_road(plan.road), 5).sample(np.arange(1)).road.length
    starts = np.linspace(0.0, length - 300.0, 16)
    road = dataclasses.replace(known_road(plan.road).extend_to(length))
    both = (
        SpeedLimitSpan(start=float(s), stop=float(s) + 300.0, speed=LOW, direction=0)
        for s in starts
    )
    return ScenarioSource(plan, limited(road, *both), 5).sample(np.arange(count))


@pytest.mark.ci
def test_left_and_right_are_the_same():
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
    assert of(run, "speed").min() > HIGH - 0.3
    s, speed = of(run, "s", 1), of(run, "speed", 1)
    inside = (s > TOWN.start) & (s <= TOWN.stop)
    assert inside.sum() > 20 * 25
    assert speed[inside].max() <= LOW + 0.002
    assert speed[s > TOWN.stop + 300.0].min() > HIGH - 0.3


def test_who_passes_wants_to_only_where_the_limit_lets_it():
    eager = {"min_speed_gain": 3.0, "desired_speed": 28.0}
    slow = Vehicle(s=890.0, lane=1, speed=12.9, driver={"desired_speed": 12.9})
    pulls = [one(s=860.0, speed=12.9, **eager), slow]
    run, free = (
        engine.simulate(scenario(pulls, road=road, horizon=20.0))
        for road in (village(), limited(wide_road()))
    )
    assert (run.stage[0] == 0).all()
    assert (free.stage[0] > 0).any()


@pytest.mark.ci
def test_another_driver_sees_the_same_bits_on_both_engines():
    batch = on_limits("rural", 4, **{"time.horizon_s": 6.0, "time.attempt_deadline_s": 6.0})
    given = step_parameters(batch)
    told = []
    for simulator in ("engine", "reference"):
        stands = new_stepper(given, "decision", observes_truth=False, simulator=simulator)
        rows = [stands.observe_start()[0]]
        rows += [stands.step(np.zeros((4, MAX_ACTION_PARTS), np.int32), 3)[0] for _ in range(30)]
        told.append(np.array(rows))
    np.testing.assert_array_equal(*told)


@pytest.mark.parametrize("profile", ["motorway", "rural"])
def test_nobody_starts_faster_than_the_limits_at_and_ahead_of_the_start_let_it(profile: str):
    batch = on_limits(profile, 32)
    comes = batch.start_lane == batch.road.num_lanes
    respects, valid = batch.drivers.speed_limit_compliance, batch.vehicles.valid
    free, start = batch.drivers.desired_speed, batch.start_speed
    for turned in (False, True):
        here = batch.start_s if not turned else np.float32(batch.road.length) - batch.start_s
        limit = allowed_speed(
            model_constants(), road_parameters(batch.road), here, np.bool_(turned)
        )
        wanted = free - respects * np.maximum(free - limit, 0.0)
        there = valid & (comes == turned)
        assert (start <= wanted + 1e-3)[there].all()
    posted = np.where(comes, *(batch.road.speed_limit_at(batch.start_s, k) for k in (-1, 1)))
    assert (valid & (posted == LOW)).mean() > 0.1 * valid.mean()


def test_crests_forbid_to_pass_by_the_limit_there():
    rural = known_road("rural")
    hill = ((0.0, 0.02), (1400.0, 0.02), (1500.0, -0.02), (5000.0, -0.02))
    course = dataclasses.replace(
        limited(rural, SpeedLimitSpan(start=1000.0, stop=2000.0, speed=LOW)).course,
        grade=hill,
        sight=(),
        sight_against=(),
    )
    slow, fast = (
        [
            place.stop - place.start
            for place in all_zones_for(dataclasses.replace(rural, speed_limit=HIGH, course=one), 1)
            if place.kind is ZoneKind.CREST
        ]
        for one in (course, dataclasses.replace(course, speed_limit_spans=()))
    )
    assert fast
    assert sum(slow) < sum(fast)


def test_the_traffic_manager_refuses_a_road_with_several_limits():
    with pytest.raises(ConfigError, match="one limit from end to end, got another one from 800 m"):
        traffic.simulate(scenario([one()], road=village()))
