"""Diagrams of overtakes in space and time agree with the recorded states."""

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


def diagram_of(labelled: LabelledTrajectories, simulation: int) -> Diagram:
    only = slice(simulation, simulation + 1)
    return diagram(labelled.trajectories.select(only), labelled.events.select(only))


def first_completed(labelled: LabelledTrajectories) -> int:
    """The first simulation with a completed overtake."""
    return int(np.flatnonzero(labelled.events.is_completed)[0])


def test_each_phase_begins_when_the_previous_one_ends(labelled: LabelledTrajectories):
    for simulation in range(80):
        phases = diagram_of(labelled, simulation).phases
        assert phases[0].begin == 0.0
        for phase, next_phase in itertools.pairwise(phases):
            assert phase.end == next_phase.begin
            assert phase.end > phase.begin


def test_a_completed_overtake_has_all_five_phases_and_marks_at_its_events(
    labelled: LabelledTrajectories,
):
    simulation = first_completed(labelled)
    overtake = diagram_of(labelled, simulation)
    assert tuple(phase.name for phase in overtake.phases) == PHASES
    marks = dict(overtake.marks)
    frame_interval_s = labelled.trajectories.scenario.frame_interval_ms / 1000.0
    assert marks["a"] == pytest.approx(labelled.events.attempt[simulation] * frame_interval_s)
    assert marks["x₂"] == pytest.approx(labelled.events.return_end[simulation] * frame_interval_s)
    assert "collision" not in marks
    assert not overtake.has_contact


def test_the_ego_starts_behind_the_target_and_ends_ahead_of_it(labelled: LabelledTrajectories):
    simulation = first_completed(labelled)
    ego, target, *others = diagram_of(labelled, simulation).tracks
    assert ego.is_ego
    assert target.is_target
    assert target.slot == labelled.events.target_slot[simulation]
    assert not any(track.is_ego or track.is_target for track in others)
    assert ego.ahead[0] < target.ahead[0]
    assert ego.ahead[-1] > target.ahead[-1]


def test_distances_are_relative_to_a_point_that_moves_with_the_target(
    labelled: LabelledTrajectories,
):
    simulation = first_completed(labelled)
    overtake = diagram_of(labelled, simulation)
    target = overtake.tracks[1]
    assert target.ahead[0] == pytest.approx(0.0, abs=1e-9)
    assert target.ahead[-1] == pytest.approx(0.0, abs=1e-9)
    trajectories = labelled.trajectories
    num_frames = int(trajectories.num_frames[simulation])
    speeds = trajectories.states.speed[simulation, target.slot, :num_frames] / 1000.0
    assert overtake.reference_speed == pytest.approx(speeds.mean(), rel=0.02)
    assert mps_from_kmh(30.0) < overtake.reference_speed < mps_from_kmh(130.0)


def test_the_ego_moves_towards_the_faster_lanes(labelled: LabelledTrajectories):
    simulation = first_completed(labelled)
    overtake = diagram_of(labelled, simulation)
    ego = overtake.tracks[0]
    attempt_frame = int(labelled.events.attempt[simulation])
    assert ego.lateral.max() - ego.lateral[attempt_frame] > 1.5
    line_offsets = [offset for offset, _ in overtake.lines]
    assert line_offsets == sorted(line_offsets)
    assert line_offsets[0] == 0.0
    assert [is_solid for _, is_solid in overtake.lines] == [True, False, False, False, False, True]


def test_the_faster_lanes_are_above_in_left_hand_traffic_too():
    road = load_road("town06").mirror()
    run = engine.simulate(
        ScenarioSource(load_specification("pinto2023-physical"), road, 1).sample(
            np.arange(80, dtype=np.uint64)
        )
    )
    mirrored = label(run)
    overtake = diagram_of(mirrored, first_completed(mirrored))
    line_offsets = [offset for offset, _ in overtake.lines]
    assert line_offsets == sorted(line_offsets)
    ego = overtake.tracks[0]
    attempt_frame = int(mirrored.events.attempt[first_completed(mirrored)])
    assert ego.lateral.min() > 0.0
    assert ego.lateral.max() - ego.lateral[attempt_frame] > 1.5


def test_the_diagram_of_a_collision_ends_with_a_contact(labelled: LabelledTrajectories):
    simulation = int(np.flatnonzero(labelled.events.collision != NEVER)[0])
    collision = diagram_of(labelled, simulation)
    assert collision.has_contact
    assert collision.phases[-1].name == "collided"


def test_a_diagram_without_an_attempt_has_only_the_following_phase(labelled: LabelledTrajectories):
    events = labelled.events
    has_ended_early = (events.collision != NEVER) | (events.road_departure != NEVER)
    simulation = int(np.flatnonzero(~events.has_attempt & ~has_ended_early)[0])
    following = diagram_of(labelled, simulation)
    assert [phase.name for phase in following.phases] == ["follows"]
    assert following.marks == ()
