"""The compiled events are those of the readable definition, number for number."""

from __future__ import annotations

import dataclasses

import pytest
from tests.reference.labels.readable_events import find_events
from tests.reference.labels.readable_recordings import case, every_recording, readable, written
from tests.reference.labels.readable_signals import One, signals

from overtaking.labels.event_detection import case_from_trajectories
from overtaking.model.overtake_events import NEVER, OvertakeEvents

pytestmark = pytest.mark.ci


def of(events: OvertakeEvents, number: int) -> dict[str, int]:
    """The events of one simulation by name."""
    names = (field.name for field in dataclasses.fields(events))
    return {name: int(getattr(events, name)[number]) for name in names}


@every_recording
def test_every_event_is_the_same(name):
    given = case(name)
    for number, (one, seen) in enumerate(readable(name)):
        assert of(given.events, number) == find_events(one, seen), number


def test_events_of_overtakes_written_by_hand_are_the_same():
    for run in written():
        one = One(run, 0)
        assert of(case_from_trajectories(run).events, 0) == find_events(one, signals(one))


def test_what_they_agree_on_has_every_kind_of_event():
    found = case("pinto2023").events
    for name in (
        "attempt",
        "line_crossed",
        "return_end",
        "abort",
        "abort_end",
        "collision",
        "drift",
    ):
        happened = getattr(found, name) != NEVER
        assert happened.any(), name
        assert not happened.all(), name
    assert found.num_attempts.max() > 1
    assert found.num_passed.max() > 1
    assert found.was_struck.any()
    assert 0 < found.was_intended.sum() < len(found.was_intended)
    assert (case("across the road").events.spin == 40).sum() >= 30
    assert (case("excerpt").events.began_before_recording == 0).any()
