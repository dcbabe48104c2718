"""Overtakes in space and time: what the diagrams show is what was recorded."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
import pytest

from overtaking.analysis.stats.diagrams import Diagram, diagram
from overtaking.core.units import mps_from_kmh
from overtaking.labels.labelling import label
from overtaking.model.overtake_events import NEVER
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine

if TYPE_CHECKING:
    from overtaking.labels.labelling import LabelledTrajectories

PHASES = ("follows", "pulls out", "in the other lane", "returns", "done")


@pytest.fixture(scope="module")
def labelled() -> LabelledTrajectories:
    road = load_road("town06")
    return label(
        engine.simulate(
            ScenarioSource(load_specification("pinto2023-physical"), road, 1).sample(
                np.arange(80, dtype=np.uint64)
            )
        )
    )


def of(labelled: LabelledTrajectories, simulation: int) -> Diagram:
    one = slice(simulation, simulation + 1)
    return diagram(labelled.trajectories.select(one), labelled.events.select(one))


def completed(labelled: LabelledTrajectories) -> int:
    return int(np.flatnonzero(labelled.events.is_completed)[0])


def test_phases_follow_each_other_without_gaps(labelled: LabelledTrajectories):
    for simulation in range(80):
        phases = of(labelled, simulation).phases
        assert phases[0].begin == 0.0
        for one, other in itertools.pairwise(phases):
            assert one.end == other.begin
            assert one.end > one.begin


def test_a_completed_overtake_has_all_phases_at_its_events(labelled: LabelledTrajectories):
    simulation = completed(labelled)
    one = of(labelled, simulation)
    assert tuple(phase.name for phase in one.phases) == PHASES
    marks = dict(one.marks)
    step = labelled.trajectories.scenario.frame_interval_ms / 1000.0
    assert marks["a"] == pytest.approx(labelled.events.attempt[simulation] * step)
    assert marks["x₂"] == pytest.approx(labelled.events.return_end[simulation] * step)
    assert "collision" not in marks
    assert not one.has_contact


def test_ego_and_target_come_first_and_swap_places(labelled: LabelledTrajectories):
    simulation = completed(labelled)
    ego, target, *others = of(labelled, simulation).tracks
    assert ego.is_ego
    assert target.is_target
    assert target.slot == labelled.events.target_slot[simulation]
    assert not any(one.is_ego or one.is_target for one in others)
    assert ego.ahead[0] < target.ahead[0]
    assert ego.ahead[-1] > target.ahead[-1]


def test_the_mark_moves_with_the_target(labelled: LabelledTrajectories):
    simulation = completed(labelled)
    one = of(labelled, simulation)
    target = one.tracks[1]
    assert target.ahead[0] == pytest.approx(0.0, abs=1e-9)
    assert target.ahead[-1] == pytest.approx(0.0, abs=1e-9)
    run = labelled.trajectories
    frames = int(run.num_frames[simulation])
    speeds = run.states.speed[simulation, target.slot, :frames] / 1000.0
    assert one.reference_speed == pytest.approx(speeds.mean(), rel=0.02)
    assert mps_from_kmh(30.0) < one.reference_speed < mps_from_kmh(130.0)


def test_the_ego_leaves_its_lane_for_the_fast_side(labelled: LabelledTrajectories):
    simulation = completed(labelled)
    one = of(labelled, simulation)
    ego = one.tracks[0]
    begun = int(labelled.events.attempt[simulation])
    assert ego.lateral.max() - ego.lateral[begun] > 1.5
    places = [place for place, _ in one.lines]
    assert places == sorted(places)
    assert places[0] == 0.0
    assert [solid for _, solid in one.lines] == [True, False, False, False, False, True]


def test_in_left_hand_traffic_the_fast_side_is_up_as_well():
    road = load_road("town06").mirror()
    run = engine.simulate(
        ScenarioSource(load_specification("pinto2023-physical"), road, 1).sample(
            np.arange(80, dtype=np.uint64)
        )
    )
    mirrored = label(run)
    one = of(mirrored, completed(mirrored))
    places = [place for place, _ in one.lines]
    assert places == sorted(places)
    ego = one.tracks[0]
    begun = int(mirrored.events.attempt[completed(mirrored)])
    assert ego.lateral.min() > 0.0
    assert ego.lateral.max() - ego.lateral[begun] > 1.5


def test_a_collision_is_marked(labelled: LabelledTrajectories):
    simulation = int(np.flatnonzero(labelled.events.collision != NEVER)[0])
    one = of(labelled, simulation)
    assert one.has_contact
    assert one.phases[-1].name == "collided"


def test_without_an_attempt_the_ego_follows(labelled: LabelledTrajectories):
    events = labelled.events
    ended = (events.collision != NEVER) | (events.road_departure != NEVER)
    simulation = int(np.flatnonzero(~events.has_attempt & ~ended)[0])
    one = of(labelled, simulation)
    assert [phase.name for phase in one.phases] == ["follows"]
    assert one.marks == ()
