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
def test_both_engines_record_the_same_bits_of_scenes_written_by_hand(mirrored):
    on_road = road(is_open=False)
    on_road = on_road.mirror() if mirrored else on_road
    world = scenario(*SCENES, road=on_road, horizon=12.0, num_slots=5)
    parameters = step_parameters(world)
    expected = reference.run(world, parameters)
    for level in LEVELS:
        assert not (mismatch := difference(engine.run(world, parameters, level=level), expected)), (
            f"{level}: {mismatch}"
        )


@pytest.mark.ci
def test_oncoming_vehicles_drive_like_vehicles_seen_from_the_other_end():
    storm = {"wind": 60.0, "wind_direction": 1.0}
    far_ego = Vehicle(s=7900.0, speed=20.0, driver={"desired_speed": 20.0})
    along_vehicles = [
        Vehicle(s=s, speed=v, driver=COMES) for s, v in ((300.0, 20.0), (200.0, 25.0))
    ]
    oncoming_vehicles = [
        dataclasses.replace(vehicle, s=8000.0 - vehicle.s, lane=1) for vehicle in along_vehicles
    ]
    turned_ego = dataclasses.replace(far_ego, s=100.0)
    turned_wind = {"wind": 60.0, "wind_direction": 1.0 + float(np.pi)}
    # For the drivers, half a turn of the wind equals half a turn of the road.
    along = run_in([far_ego, *along_vehicles], storm)
    against = run_in([turned_ego, *oncoming_vehicles], turned_wind)
    s, d = (along.states.s[0, 1:3], along.states.d[0, 1:3])
    np.testing.assert_allclose(against.states.s[0, 1:3], 8_000_000 - s, atol=1)
    np.testing.assert_array_equal(against.states.d[0, 1:3], -d)
    for name in ("speed", "accel_lon", "accel_lat", "yaw_rate", "wheel_angle", "lights"):
        np.testing.assert_array_equal(
            getattr(against.states, name)[0, 1:3], getattr(along.states, name)[0, 1:3], err_msg=name
        )
    heading_change = against.states.heading[0, 1:3].astype(int) - along.states.heading[0, 1:3]
    assert (np.abs(np.abs(heading_change) - 31416) <= 1).all()
    assert (against.states.lane[0, 1:3] == 1).all()
    assert (along.states.lane[0, 1:3] == 0).all()


def run_in(scene: list[Vehicle], weather: dict[str, float]) -> Trajectories:
    """A simulation of the scene in a weather without gusts."""
    world = scenario(scene, road=road(), horizon=15.0, weather=weather)
    parameters = step_parameters(world)
    # Gusts have fixed positions on the road, which differ as seen from both ends.
    return reference.run(world, without_gusts(parameters))


def without_gusts(parameters):
    simulation = parameters.simulation_table.copy()
    simulation[SIMULATION_FIELDS.index("gust_gain")] = 0.0
    return dataclasses.replace(parameters, simulation_table=simulation)


def turned_road(road: Road) -> Road:
    """A road with the course of its opposite direction."""
    course, length = road.course, road.length
    assert course is not None

    def back(table: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        return tuple((length - s, value) for s, value in reversed(table))

    lines = tuple(
        dataclasses.replace(
            span, start=length - span.stop, stop=length - span.start, mark=span.mark.reverse
        )
        for span in reversed(course.centre_line_spans)
    )
    sight, against = back(course.sight_against), back(course.sight)
    turned_course = dataclasses.replace(
        course, centre_line_spans=lines, zones=(), sight=sight, sight_against=against
    )
    return dataclasses.replace(road, course=turned_course)


def test_oncoming_vehicles_overtake_like_vehicles_seen_from_the_other_end():
    """On a road with changing sight and line, turned for the second run."""
    on_road = road(is_open=False)
    keen, van = pair(gap_demand_factor=0.5, lead=15.0)
    starts = np.arange(1000.0, 3000.0, 400.0)
    far_ego = Vehicle(s=7900.0, speed=20.0, driver={"desired_speed": 20.0})
    along_scenes = [
        [
            far_ego,
            *(
                dataclasses.replace(vehicle, s=vehicle.s - 1000.0 + start)
                for vehicle in (van, keen)
            ),
        ]
        for start in starts
    ]
    oncoming_scenes = [
        [
            dataclasses.replace(far_ego, s=100.0),
            *(dataclasses.replace(vehicle, s=8000.0 - vehicle.s, lane=1) for vehicle in scene[1:]),
        ]
        for scene in along_scenes
    ]
    runs = []
    for scenes, scene_road in ((along_scenes, on_road), (oncoming_scenes, turned_road(on_road))):
        world = scenario(*scenes, road=scene_road, horizon=45.0, index=[7] * len(scenes))
        runs.append(engine.run(world, without_gusts(step_parameters(world))))
    along, against = (run.states for run in runs)
    is_in_other_lane = along.lane[:, 2] == 1
    assert is_in_other_lane.any(axis=1).sum() > 1
    np.testing.assert_allclose(against.s[:, 1:3], 8_000_000 - along.s[:, 1:3], atol=3)
    np.testing.assert_allclose(against.d[:, 1:3], -along.d[:, 1:3], atol=3)


def test_a_head_on_collision_keeps_the_momentum_and_is_recorded_for_both():
    keen = {"lead": 24.0, "desired_speed": 33.0, "gap_demand_factor": 0.0}
    gaps = np.arange(725.0, 775.0, 5.0)
    batch = simulated(*(pair(gap, comes=70.0, **keen) for gap in gaps))
    hit = np.flatnonzero(batch.contacts.partner[:, 0] == 2)
    assert len(hit)
    hardest = hit[batch.contacts.closing_speed[hit, 0].argmax()]
    run = batch.select(np.array([hardest]))
    contacts = run.contacts
    assert contacts.partner[0, 2] == 0
    assert contacts.time[0, 0] == contacts.time[0, 2]
    frame = int(contacts.time[0, 0] // 50)
    speed = run.states.speed[0].astype(float)
    expected_closing = speed[0, frame] + speed[2, frame]
    assert contacts.closing_speed[0, 0] == pytest.approx(expected_closing, rel=0.15)
    mass = run.scenario.vehicles.mass[0, [0, 2]]
    momentum_before = mass @ (speed[[0, 2], frame] * (1, -1)) / 1e3
    cosine = np.cos(run.states.heading[0, [0, 2], frame + 1] / 1e4)
    position = run.states.s[0, [0, 2]].astype(float)
    momentum_after = mass @ ((position[:, frame + 2] - position[:, frame + 1]) / 50.0)
    assert (np.sign(cosine) == (1, -1)).all()
    assert float(momentum_after) == pytest.approx(
        float(momentum_before), abs=0.8 * float(mass.sum())
    )


@pytest.mark.ci
def test_no_arrival_is_missing_within_sight():
    world = ScenarioSource(load_specification("rural"), load_road("rural"), 5).sample(
        np.arange(300)
    )
    run = engine.run(world, step_parameters(world))
    is_oncoming = (world.start_lane == 1) & world.vehicles.valid
    oncoming_position = np.where(is_oncoming[:, :, None], run.states.s, -1)
    farthest = oncoming_position.max(axis=1) / 1e3
    ego = run.states.s[:, 0] / 1e3
    # Where slots remain free, every vehicle that the ego could meet before the horizon is placed.
    # Only a simulation with all slots taken could miss one.
    is_full = is_oncoming.sum(axis=1) == world.num_slots - 10
    assert 20 < is_full.sum() < 300
    sight = np.minimum(sight_at(world.road, ego), 1000.0)
    missing = (farthest - ego < sight) & run.frame_mask & is_full[:, None]
    assert not missing.any()


def test_lanes_of_different_widths_are_refused():
    beyond = dataclasses.replace(road().overtaking_side_neighbour, width=3.0)
    narrow = dataclasses.replace(road(), overtaking_side_neighbour=beyond)
    with pytest.raises(ConfigError, match="two equally wide lanes"):
        step_parameters(scenario(pair(500.0), road=narrow))
