"""Solid lines and unseen road in the decision to pass."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
from tests.support.two_way import in_the_other_lane, pair, road
from tests.support.worlds import scenario

from overtaking.knowledge.toml_reader import constant
from overtaking.model.road_course import CentreLineSpan, RoadCourse, RoadMark
from overtaking.model.trajectories import Stage
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim import engine
from overtaking.world.step_parameters import VEHICLE_FIELDS, step_parameters

if TYPE_CHECKING:
    from overtaking.world.step_parameters import StepParameters


def test_an_ego_that_heeds_solid_lines_starts_no_pass_near_a_solid_line():
    line_start, lookahead = 1500.0, float(constant("model.oncoming.line_lookahead"))
    course = RoadCourse(
        centre_line_spans=(CentreLineSpan(start=line_start, stop=6000.0, mark=RoadMark.SOLID),)
    )
    on_road = dataclasses.replace(road(), course=course)
    heeds = np.array([True, False])
    scenes = [
        pair(patience=1e6, gap_demand_factor=0.3, heeds_solid_lines=is_obeying)
        for is_obeying in heeds
    ]
    for shift in (line_start - lookahead - 1000.0 + 30.0, -200.0):
        placed = [
            [dataclasses.replace(vehicle, s=vehicle.s + shift) for vehicle in scene]
            for scene in scenes
        ]
        run = engine.simulate(scenario(*placed, road=on_road, horizon=15.0))
        has_pulled_out = (run.stage == Stage.PULL_OUT).any(axis=1)
        assert has_pulled_out[~heeds].all()
        assert has_pulled_out[heeds].any() == (shift == -200.0)


def with_ego(parameters: StepParameters, **changed: float) -> StepParameters:
    """The parameters with other values of the ego."""
    vehicle = parameters.vehicle_table.copy()
    for name, value in changed.items():
        vehicle[VEHICLE_FIELDS.index(name), EGO_SLOT] = value
    return dataclasses.replace(parameters, vehicle_table=vehicle)


def test_an_ego_that_heeds_solid_lines_returns_before_the_line_and_not_into_a_small_gap():
    course = RoadCourse(
        centre_line_spans=(CentreLineSpan(start=1200.0, stop=8000.0, mark=RoadMark.SOLID),)
    )
    on_road = dataclasses.replace(road(), course=course)
    scenes = [pair(gap_demand_factor=0.3, heeds_solid_lines=heeds) for heeds in (True, False)]
    runs = [engine.simulate(scenario(scene, road=on_road, horizon=25.0)) for scene in scenes]
    frames_in_other_lane = [in_the_other_lane(run, 0) for run in runs]
    assert frames_in_other_lane[0][0] == frames_in_other_lane[1][0]
    assert frames_in_other_lane[0][-1] < frames_in_other_lane[1][-1] - 10
    s, body = (
        runs[0].states.s[0, :2, frames_in_other_lane[0][-1]],
        runs[0].scenario.vehicles.length[0, :2].mean(),
    )
    assert 1e-3 * (s[0] - s[1]) - body > 2.0 * float(constant("model.oncoming.min_return_gap"))


def test_a_driver_with_a_small_gap_demand_assumes_more_free_road_beyond_sight():
    scenes = [pair(gap_demand_factor=factor) for factor in (0.4, 0.9, 1.6)]
    world = scenario(*scenes, road=road())
    trust = step_parameters(world).vehicle_table[
        VEHICLE_FIELDS.index("assumed_sight_factor"), EGO_SLOT
    ]
    expected = float(constant("model.oncoming.assumed_sight_factor")) / np.sqrt([0.4, 0.9, 1.6])
    np.testing.assert_allclose(trust, expected, rtol=1e-6)


def test_the_assumed_sight_factor_matters_only_beyond_the_sight_distance():
    course = RoadCourse(sight=((0.0, 400.0),))
    for on_road, is_limited in (
        (dataclasses.replace(road(), course=course), True),
        (road(), False),
    ):
        world = scenario(pair(600.0, gap_demand_factor=0.4), road=on_road, horizon=3.0)
        parameters = step_parameters(world)
        has_pulled_out = [
            (
                engine.run(world, with_ego(parameters, assumed_sight_factor=trust)).stage
                == Stage.PULL_OUT
            ).any()
            for trust in (1.0, 4.0)
        ]
        assert has_pulled_out == ([False, True] if is_limited else [False, False])
