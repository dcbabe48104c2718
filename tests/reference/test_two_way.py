"""Two directions on one road: frames, contacts, lanes, and the same bits from both engines."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.two_way import SCENES, pair, road, simulated
from tests.support.worlds import Vehicle, scenario

from overtaking import _core
from overtaking.core.errors import ConfigError
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine, reference
from overtaking.world.sight_distance import sight_at
from overtaking.world.step_parameters import SIMULATION_FIELDS, step_parameters

from .situations import difference

if TYPE_CHECKING:
    from overtaking.model.road import Road
    from overtaking.model.trajectories import Trajectories

LEVELS = [name for name, available in _core.simd_levels() if available]

COMES = {"desired_speed": 25.0}


@pytest.mark.ci
@pytest.mark.parametrize("mirrored", [False, True])
def test_both_engines_record_the_same_bits_by_hand(mirrored):
    on = road(is_open=False)
    on = on.mirror() if mirrored else on
    world = scenario(*SCENES, road=on, horizon=12.0, num_slots=5)
    given = step_parameters(world)
    expected = reference.run(world, given)
    for level in LEVELS:
        assert not (found := difference(engine.run(world, given, level=level), expected)), (
            f"{level}: {found}"
        )


@pytest.mark.ci
def test_who_comes_is_who_goes_seen_from_the_other_end():
    storm = {"wind": 60.0, "wind_direction": 1.0}
    alone = Vehicle(s=7900.0, speed=20.0, driver={"desired_speed": 20.0})
    goes = [Vehicle(s=s, speed=v, driver=COMES) for s, v in ((300.0, 20.0), (200.0, 25.0))]
    comes = [dataclasses.replace(one, s=8000.0 - one.s, lane=1) for one in goes]
    away = dataclasses.replace(alone, s=100.0)
    calm = {"wind": 60.0, "wind_direction": 1.0 + float(np.pi)}
    # Half a turn of the wind is what half a turn of the road is to the drivers.
    there = run_in([alone, *goes], storm)
    back = run_in([away, *comes], calm)
    s, d = (there.states.s[0, 1:3], there.states.d[0, 1:3])
    np.testing.assert_allclose(back.states.s[0, 1:3], 8_000_000 - s, atol=1)
    np.testing.assert_array_equal(back.states.d[0, 1:3], -d)
    for name in ("speed", "accel_lon", "accel_lat", "yaw_rate", "wheel_angle", "lights"):
        np.testing.assert_array_equal(
            getattr(back.states, name)[0, 1:3], getattr(there.states, name)[0, 1:3], err_msg=name
        )
    turned = back.states.heading[0, 1:3].astype(int) - there.states.heading[0, 1:3]
    assert (np.abs(np.abs(turned) - 31416) <= 1).all()
    assert (back.states.lane[0, 1:3] == 1).all()
    assert (there.states.lane[0, 1:3] == 0).all()


def run_in(scene: list[Vehicle], weather: dict[str, float]) -> Trajectories:
    world = scenario(scene, road=road(), horizon=15.0, weather=weather)
    given = step_parameters(world)
    # Gusts stand where they stand on the road, which is not the same from both ends.
    return reference.run(world, without_fields(given))


def without_fields(given):
    simulation = given.simulation_table.copy()
    simulation[SIMULATION_FIELDS.index("gust_gain")] = 0.0
    return dataclasses.replace(given, simulation_table=simulation)


def turned(road: Road) -> Road:
    """A road as seen from its other end, but for its direction."""
    course, length = road.course, road.length
    assert course is not None

    def back(table: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        return tuple((length - s, value) for s, value in reversed(table))

    lines = tuple(
        dataclasses.replace(
            one, start=length - one.stop, stop=length - one.start, mark=one.mark.reverse
        )
        for one in reversed(course.centre_line_spans)
    )
    sight, against = back(course.sight_against), back(course.sight)
    other = dataclasses.replace(
        course, centre_line_spans=lines, zones=(), sight=sight, sight_against=against
    )
    return dataclasses.replace(road, course=other)


def test_who_comes_overtakes_as_who_goes_seen_from_the_other_end():
    """On a road whose sight and line change: what one direction sees is what the other would."""
    there = road(is_open=False)
    keen, van = pair(gap_demand_factor=0.5, lead=15.0)
    starts = np.arange(1000.0, 3000.0, 400.0)
    far = Vehicle(s=7900.0, speed=20.0, driver={"desired_speed": 20.0})
    goes = [
        [far, *(dataclasses.replace(one, s=one.s - 1000.0 + start) for one in (van, keen))]
        for start in starts
    ]
    comes = [
        [
            dataclasses.replace(far, s=100.0),
            *(dataclasses.replace(one, s=8000.0 - one.s, lane=1) for one in scene[1:]),
        ]
        for scene in goes
    ]
    runs = []
    for scenes, on in ((goes, there), (comes, turned(there))):
        world = scenario(*scenes, road=on, horizon=45.0, index=[7] * len(scenes))
        runs.append(engine.run(world, without_fields(step_parameters(world))))
    one, other = (run.states for run in runs)
    away = one.lane[:, 2] == 1
    assert away.any(axis=1).sum() > 1
    np.testing.assert_allclose(other.s[:, 1:3], 8_000_000 - one.s[:, 1:3], atol=3)
    np.testing.assert_allclose(other.d[:, 1:3], -one.d[:, 1:3], atol=3)


def test_a_head_on_collision_keeps_the_momentum_and_is_told_by_both():
    keen = {"lead": 24.0, "desired_speed": 33.0, "gap_demand_factor": 0.0}
    gaps = np.arange(725.0, 775.0, 5.0)
    many = simulated(*(pair(gap, comes=70.0, **keen) for gap in gaps))
    hit = np.flatnonzero(many.contacts.partner[:, 0] == 2)
    assert len(hit)
    hardest = hit[many.contacts.closing_speed[hit, 0].argmax()]
    run = many.select(np.array([hardest]))
    contacts = run.contacts
    assert contacts.partner[0, 2] == 0
    assert contacts.time[0, 0] == contacts.time[0, 2]
    frame = int(contacts.time[0, 0] // 50)
    speed = run.states.speed[0].astype(float)
    met = speed[0, frame] + speed[2, frame]
    assert contacts.closing_speed[0, 0] == pytest.approx(met, rel=0.15)
    mass = run.scenario.vehicles.mass[0, [0, 2]]
    before = mass @ (speed[[0, 2], frame] * (1, -1)) / 1e3
    cosine = np.cos(run.states.heading[0, [0, 2], frame + 1] / 1e4)
    place = run.states.s[0, [0, 2]].astype(float)
    after = mass @ ((place[:, frame + 2] - place[:, frame + 1]) / 50.0)
    assert (np.sign(cosine) == (1, -1)).all()
    assert float(after) == pytest.approx(float(before), abs=0.8 * float(mass.sum()))


@pytest.mark.ci
def test_no_arrival_is_missing_within_sight():
    world = ScenarioSource(load_specification("rural"), load_road("rural"), 5).sample(
        np.arange(300)
    )
    run = engine.run(world, step_parameters(world))
    comes = (world.start_lane == 1) & world.vehicles.valid
    place = np.where(comes[:, :, None], run.states.s, -1)
    last = place.max(axis=1) / 1e3
    ego = run.states.s[:, 0] / 1e3
    # Where not all slots are taken, everybody who could be met before the horizon is there.
    full = comes.sum(axis=1) == world.num_slots - 10
    assert 20 < full.sum() < 300
    sight = np.minimum(sight_at(world.road, ego), 1000.0)
    missing = (last - ego < sight) & run.frame_mask & full[:, None]
    assert not missing.any()


def test_lanes_of_different_widths_are_refused():
    beyond = dataclasses.replace(road().overtaking_side_neighbour, width=3.0)
    narrow = dataclasses.replace(road(), overtaking_side_neighbour=beyond)
    with pytest.raises(ConfigError, match="two equally wide lanes"):
        step_parameters(scenario(pair(500.0), road=narrow))
