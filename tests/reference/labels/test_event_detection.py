"""The engine finds the events of the readable definition, number for number."""

from __future__ import annotations

import dataclasses

import pytest
from tests.reference.labels.readable_events import find_events
from tests.reference.labels.readable_recordings import (
    every_recording,
    handwritten_recordings,
    readable_runs,
    sample_case,
)
from tests.reference.labels.readable_signals import SingleRun, signals_of

from overtaking.labels.event_detection import case_from_trajectories
from overtaking.model.overtake_events import NEVER, OvertakeEvents

pytestmark = pytest.mark.ci


def events_of_row(events: OvertakeEvents, row: int) -> dict[str, int]:
    """The events of one simulation by name."""
    names = (field.name for field in dataclasses.fields(events))
    return {name: int(getattr(events, name)[row]) for name in names}


@every_recording
def test_events_of_recordings_equal_the_readable_definition(name):
    events = sample_case(name).events
    for row, (run, signals) in enumerate(readable_runs(name)):
        assert events_of_row(events, row) == find_events(run, signals), row


def test_events_of_handwritten_overtakes_equal_the_readable_definition():
    for trajectories in handwritten_recordings():
        run = SingleRun(trajectories, 0)
        events = case_from_trajectories(trajectories).events
        assert events_of_row(events, 0) == find_events(run, signals_of(run))


def test_the_compared_recordings_contain_every_kind_of_event():
    events = sample_case("pinto2023").events
    for name in (
        "attempt",
        "line_crossed",
        "return_end",
        "abort",
        "abort_end",
        "collision",
        "drift",
    ):
        happens = getattr(events, name) != NEVER
        assert happens.any(), name
        assert not happens.all(), name
    assert events.num_attempts.max() > 1
    assert events.num_passed.max() > 1
    assert events.was_struck.any()
    assert 0 < events.was_intended.sum() < len(events.was_intended)
    assert (sample_case("across the road").events.spin == 40).sum() >= 30
    assert (sample_case("excerpt").events.began_before_recording == 0).any()
