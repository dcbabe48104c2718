"""What lines and the unseen road let a driver do."""

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


def test_who_heeds_lines_starts_no_pass_where_a_solid_line_is_announced():
    begins, announced = 1500.0, float(constant("model.oncoming.line_lookahead"))
    course = RoadCourse(
        centre_line_spans=(CentreLineSpan(start=begins, stop=6000.0, mark=RoadMark.SOLID),)
    )
    on = dataclasses.replace(road(), course=course)
    heeds = np.array([True, False])
    scenes = [pair(patience=1e6, gap_demand_factor=0.3, heeds_solid_lines=one) for one in heeds]
    for shift in (begins - announced - 1000.0 + 30.0, -200.0):
        placed = [[dataclasses.replace(one, s=one.s + shift) for one in scene] for scene in scenes]
        run = engine.simulate(scenario(*placed, road=on, horizon=15.0))
        goes = (run.stage == Stage.PULL_OUT).any(axis=1)
        assert goes[~heeds].all()
        assert goes[heeds].any() == (shift == -200.0)


def with_ego(given: StepParameters, **changed: float) -> StepParameters:
    """Other parameters of the ego."""
    vehicle = given.vehicle_table.copy()
    for name, value in changed.items():
        vehicle[VEHICLE_FIELDS.index(name), EGO_SLOT] = value
    return dataclasses.replace(given, vehicle_table=vehicle)


def test_who_heeds_lines_hurries_to_be_back_before_one_and_takes_no_small_gap():
    course = RoadCourse(
        centre_line_spans=(CentreLineSpan(start=1200.0, stop=8000.0, mark=RoadMark.SOLID),)
    )
    on = dataclasses.replace(road(), course=course)
    scenes = [pair(gap_demand_factor=0.3, heeds_solid_lines=one) for one in (True, False)]
    runs = [engine.simulate(scenario(scene, road=on, horizon=25.0)) for scene in scenes]
    out = [in_the_other_lane(run, 0) for run in runs]
    assert out[0][0] == out[1][0]
    assert out[0][-1] < out[1][-1] - 10
    s, body = runs[0].states.s[0, :2, out[0][-1]], runs[0].scenario.vehicles.length[0, :2].mean()
    assert 1e-3 * (s[0] - s[1]) - body > 2.0 * float(constant("model.oncoming.min_return_gap"))


def test_who_is_content_with_small_gaps_trusts_the_unseen_road_farther():
    scenes = [pair(gap_demand_factor=asked) for asked in (0.4, 0.9, 1.6)]
    world = scenario(*scenes, road=road())
    trust = step_parameters(world).vehicle_table[
        VEHICLE_FIELDS.index("assumed_sight_factor"), EGO_SLOT
    ]
    expected = float(constant("model.oncoming.assumed_sight_factor")) / np.sqrt([0.4, 0.9, 1.6])
    np.testing.assert_allclose(trust, expected, rtol=1e-6)


def test_trust_decides_where_the_road_is_not_seen_and_nowhere_else():
    course = RoadCourse(sight=((0.0, 400.0),))
    for on, limited in ((dataclasses.replace(road(), course=course), True), (road(), False)):
        world = scenario(pair(600.0, gap_demand_factor=0.4), road=on, horizon=3.0)
        given = step_parameters(world)
        goes = [
            (
                engine.run(world, with_ego(given, assumed_sight_factor=trust)).stage
                == Stage.PULL_OUT
            ).any()
            for trust in (1.0, 4.0)
        ]
        assert goes == ([False, True] if limited else [False, False])
