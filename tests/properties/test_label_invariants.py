"""Labels do not depend on where, when or in which order a recording was made."""

from __future__ import annotations

import dataclasses
import itertools
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.transformations import (
    begin_earlier,
    mirror_recording,
    new_slots,
    reorder_recording,
)

from overtaking.labels.labelling import LabelledTrajectories, label
from overtaking.labels.snapshots import at_frame
from overtaking.model.overtake_events import NEVER
from overtaking.model.verdicts import Verdict
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine

if TYPE_CHECKING:
    from overtaking.model.trajectories import Trajectories

NUM_SIMULATIONS = 400
EVENTS_AFTER_BEGIN = (
    *("attempt", "line_crossed", "overlap_begin", "overlap_end", "return_begin", "return_end"),
    *("abort", "abort_end"),
)
"""Events that cannot move to the first frame when the recording begins earlier."""


@cache
def simulated(interval_ms: int = 50, num_simulations: int = NUM_SIMULATIONS) -> Trajectories:
    specification = load_specification(
        "pinto2023-physical", {"profile.frame_interval_ms": interval_ms}
    )
    source = ScenarioSource(specification, load_road(specification.road), 11)
    return engine.simulate(source.sample(np.arange(num_simulations, dtype=np.uint64)))


@cache
def labelled(interval_ms: int = 50, num_simulations: int = NUM_SIMULATIONS) -> LabelledTrajectories:
    return label(simulated(interval_ms, num_simulations))


def assert_same_labels(
    actual: LabelledTrajectories, expected: LabelledTrajectories, ignored: tuple[str, ...] = ()
) -> None:
    """Events, findings, labels and features are the same in every value."""
    for part in ("events", "findings", "labels", "paper_features", "matched_features"):
        actual_part, expected_part = getattr(actual, part), getattr(expected, part)
        for field in dataclasses.fields(actual_part):
            values = getattr(actual_part, field.name)
            if isinstance(values, np.ndarray) and field.name not in ignored:
                differs = values != getattr(expected_part, field.name)
                simulations = np.flatnonzero(differs.reshape(len(differs), -1).any(axis=1))
                assert not len(simulations), (part, field.name, simulations[:5])


def test_the_origin_of_the_road_is_irrelevant():
    trajectories = simulated()
    states = trajectories.states
    moved = trajectories.replace(states=states.replace(s=states.s + np.int32(123_457)))
    assert_same_labels(label(moved), labelled())


def test_mirrored_left_hand_traffic_has_the_same_labels():
    assert_same_labels(label(mirror_recording(simulated())), labelled())


def test_the_order_of_the_other_vehicles_is_irrelevant():
    num_slots = simulated().scenario.num_slots
    order = np.array([0, *range(num_slots - 1, 0, -1)])  # The ego keeps its slot.
    reordered = label(reorder_recording(simulated(), order))
    expected = labelled()
    slots = new_slots(order)
    assert (reordered.events.target_slot == slots[expected.events.target_slot]).all()
    assert_same_labels(reordered, expected, ignored=("target_slot", "collision_slot"))


def test_an_earlier_begin_of_the_recording_only_moves_the_times():
    shift = 40
    earlier = label(begin_earlier(simulated(), shift))
    events, events_earlier = labelled().events, earlier.events
    # With attempts so late, nothing of the window of the law lies before the recording.
    is_late = events.attempt > 80
    assert is_late.sum() > 30
    for name in EVENTS_AFTER_BEGIN:
        frames = getattr(events, name)[is_late]
        expected = np.where(frames == NEVER, NEVER, frames + shift)
        assert (getattr(events_earlier, name)[is_late] == expected).all(), name
    assert (earlier.labels.classes[is_late] == labelled().labels.classes[is_late]).all()


@pytest.mark.ci
@pytest.mark.parametrize(("interval_ms", "min_share"), [(40, 0.995), (100, 0.98)])
def test_classes_hardly_depend_on_the_frame_rate(interval_ms: int, min_share: float):
    num_simulations = 1200
    reference, resampled = labelled(50, num_simulations), labelled(interval_ms, num_simulations)
    is_same = (reference.labels.classes == resampled.labels.classes).all(axis=1)
    assert is_same.mean() >= min_share
    attempt, attempt_resampled = reference.events.attempt, resampled.events.attempt
    has_attempt = (attempt != NEVER) & (attempt_resampled != NEVER)
    difference_ms = np.abs(attempt * 50 - attempt_resampled * interval_ms)[has_attempt]
    assert np.percentile(difference_ms, 95) <= 2 * max(50, interval_ms)


def test_labels_of_a_part_equal_the_labels_of_the_whole():
    rows = np.array([5, 17, 3, 211])
    assert_same_labels(label(simulated().select(rows)), labelled().select(rows))


def test_breaches_lie_within_the_recording_and_have_negative_margins():
    findings = labelled().findings
    is_broken = findings.verdict == Verdict.ILLEGAL
    last_frame = np.broadcast_to(labelled().events.last[:, None], is_broken.shape)[is_broken]
    assert (findings.margin[is_broken] < 0).all()
    first, last = findings.first_frame[is_broken], findings.last_frame[is_broken]
    assert ((first >= 0) & (first <= last) & (last <= last_frame)).all()
    assert (findings.first_frame[~is_broken] == NEVER).all()


def test_phases_of_completed_overtakes_are_in_order():
    events = labelled().events
    is_completed = events.is_completed
    assert is_completed.sum() > 50
    names = ("attempt", "overlap_begin", "overlap_end", "return_end")
    frames = [getattr(events, name)[is_completed] for name in names]
    assert all((earlier <= later).all() for earlier, later in itertools.pairwise(frames))
    # An ego that cuts in closely begins its return before it has passed completely.
    return_begin = events.return_begin[is_completed]
    assert ((frames[0] < return_begin) & (return_begin <= frames[-1])).all()
    final_lane = at_frame(labelled().signals.lane, events.return_end)[is_completed]
    assert (final_lane == events.original_lane[is_completed]).all()
