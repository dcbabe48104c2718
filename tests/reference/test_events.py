"""The compiled events and targets are those of the readable reference, number for number."""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.recordings import with_gaps

from overtaking import _core
from overtaking.labels.events import engine, reference
from overtaking.labels.signals import engine as signals
from overtaking.labels.signals import target
from overtaking.model.events import NEVER
from overtaking.recordings.roads import load_road
from overtaking.scenarios import sample, spec
from overtaking.sim import engine as simulator

if TYPE_CHECKING:
    from overtaking.model.trajectory import Trajectories

LEVELS = [name for name, available in _core.simd_levels() if available]
FRAMES_OF_TARGETS = ("valid", "overlaps")


@cache
def recorded(interval_ms: int = 50, *, mirrored: bool = False) -> Trajectories:
    given = spec("pinto2023", {"profile.frame_interval_ms": interval_ms})
    road = load_road(given.road)
    road = road.mirrored() if mirrored else road
    return simulator.simulate(sample(given, road, 11, np.arange(256, dtype=np.uint64)))


def risky() -> Trajectories:
    given = spec("motorway-risk")
    road = load_road(given.road)
    return simulator.simulate(sample(given, road, 12, np.arange(128, dtype=np.uint64)))


def gappy() -> Trajectories:
    return with_gaps(recorded())


def nowhere() -> Trajectories:
    """A recording in which the ego is beyond the lanes for a while, and soon ends."""
    run = recorded()
    states = run.states.lane.copy()
    states[::2, 0, 40:60] = 255
    lanes = dataclasses.replace(run.states, lane=states)
    return dataclasses.replace(run, states=lanes, num_frames=run.num_frames - np.int32(20))


RECORDINGS = {
    "20 Hz": recorded,
    "25 Hz": lambda: recorded(40),
    "10 Hz": lambda: recorded(100),
    "left-hand traffic": lambda: recorded(mirrored=True),
    "risk": risky,
    "gaps": gappy,
    "off the road": nowhere,
}
every_recording = pytest.mark.parametrize("run", RECORDINGS.values(), ids=list(RECORDINGS))


def differences(one: object, other: object) -> list[str]:
    """The names of the arrays that differ in a type or a bit."""
    pairs = {
        field.name: (getattr(one, field.name), getattr(other, field.name))
        for field in dataclasses.fields(one)  # type: ignore[arg-type]
    }
    return [
        name
        for name, (a, b) in pairs.items()
        if a.dtype != b.dtype or a.shape != b.shape or a.tobytes() != b.tobytes()
    ]


@every_recording
def test_engine_and_reference_find_the_same_events(run):
    given = run()
    seen = signals.signals(given)
    assert not differences(reference.find_events(given, seen), engine.find_events(given, seen))


def test_what_they_agree_on_has_every_kind_of_event():
    given = recorded()
    found = engine.find_events(given, signals.signals(given))
    for name in ("attempt", "line_crossed", "return_end", "abort", "back", "collision", "drift"):
        happened = getattr(found, name) != NEVER
        assert happened.any(), name
        assert not happened.all(), name
    assert found.num_attempts.max() > 1
    assert found.num_passed.max() > 1


@pytest.mark.parametrize("level", LEVELS)
@every_recording
def test_engine_and_reference_follow_the_target_alike(run, level):
    given = run()
    seen = signals.signals(given)
    events = engine.find_events(given, seen)
    expected = target.target_signals(given, seen, events)
    found = signals.target_signals(given, seen, events, level=level)
    there = expected.valid
    for field in dataclasses.fields(expected):
        a, b = getattr(expected, field.name), getattr(found, field.name)
        assert a.dtype == b.dtype, field.name
        where = there if a.ndim == 2 and field.name not in FRAMES_OF_TARGETS else ...
        assert a[where].tobytes() == b[where].tobytes(), field.name


def test_a_neighbour_that_does_not_exist_is_refused():
    given = recorded()
    seen = signals.signals(given)
    wrong = seen.vehicle.copy()
    wrong[0, 0, 0] = given.states.s.shape[1]
    with pytest.raises(ValueError, match="expected slots of the recording"):
        engine.find_events(given, seen.replace(vehicle=wrong))


def test_a_target_that_does_not_exist_is_refused():
    given = recorded()
    seen = signals.signals(given)
    events = engine.find_events(given, seen)
    wrong = np.full_like(events.target, given.states.s.shape[1])
    with pytest.raises(ValueError, match="target: no vehicle"):
        signals.target_signals(given, seen, events.replace(target=wrong))
