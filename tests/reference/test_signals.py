"""The compiled signals are those of the readable reference, bit for bit, for any recording."""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.recordings import with_gaps

from overtaking import _core
from overtaking.core.memory import Buffers
from overtaking.labels.signals import engine, reference, target
from overtaking.recordings.roads import load_road
from overtaking.scenarios import sample, spec
from overtaking.sim import engine as simulator

if TYPE_CHECKING:
    from overtaking.model.signals import Signals
    from overtaking.model.trajectory import Trajectories

LEVELS = [name for name, available in _core.simd_levels() if available]


@cache
def recorded(interval_ms: int = 50, *, mirrored: bool = False) -> Trajectories:
    given = spec("pinto2023", {"profile.frame_interval_ms": interval_ms})
    road = load_road(given.road)
    road = road.mirrored() if mirrored else road
    return simulator.simulate(sample(given, road, 3, np.arange(96, dtype=np.uint64)))


def differences(one: Signals, other: Signals) -> list[str]:
    """The names of the signals that differ in a frame that was recorded."""
    return [
        field.name
        for field in dataclasses.fields(one)
        if isinstance(getattr(one, field.name), np.ndarray)
        and not _same(getattr(one, field.name), getattr(other, field.name), one.valid)
    ]


def _same(one: np.ndarray, other: np.ndarray, valid: np.ndarray) -> bool:
    there = np.broadcast_to(valid if one.ndim == 2 else valid[:, None], one.shape)
    return one.dtype == other.dtype and one[there].tobytes() == other[there].tobytes()


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize(
    "run",
    [recorded, lambda: recorded(40), lambda: recorded(100), lambda: recorded(mirrored=True)],
    ids=["20 Hz", "25 Hz", "10 Hz", "left-hand traffic"],
)
def test_engine_and_reference_see_the_same_bits(run, level):
    given = run()
    assert not differences(reference.signals(given), engine.signals(given, level=level))


@pytest.mark.parametrize("level", LEVELS)
def test_vehicles_that_come_and_go_are_seen_alike(level):
    given = with_gaps(recorded())
    assert not differences(reference.signals(given), engine.signals(given, level=level))


def test_what_is_not_recorded_is_zero_although_memory_is_used_again():
    buffers = Buffers()
    first = engine.signals(recorded(), buffers=buffers)
    assert first.speed[first.valid].all() or (first.speed[first.valid] > 0).any()
    short = recorded().select(np.arange(5))
    again = engine.signals(short, buffers=buffers)
    assert not differences(reference.signals(short), again)
    rest = ~again.valid
    # Sixteen frames are worked out at a time, so only what lies beyond them is cleared.
    beyond = rest & (np.arange(again.num_frames) >= again.valid.sum(axis=1)[:, None] + 15)
    assert not again.speed[beyond].any()


def test_an_unknown_level_is_refused():
    with pytest.raises(ValueError, match=r"SIMD level: .* got abacus"):
        engine.signals(recorded(), level="abacus")


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_vehicle_at_single_frames_is_what_it_is_among_all_frames(mirrored):
    run = recorded(mirrored=mirrored)
    seen, rows = engine.signals(run), np.arange(len(run.num_frames))
    vehicle = (1 + rows % (run.scenario.num_vehicles - 1)).astype(np.uint8)
    whole = target.signals_of(run, seen, vehicle)
    for frames in (rows * 0, run.num_frames // 2, run.num_frames - 1):
        found = target.signals_at(run, seen, rows, vehicle, frames)
        for field in dataclasses.fields(found):
            expected = getattr(whole, field.name)[rows, frames]
            np.testing.assert_array_equal(getattr(found, field.name), expected, field.name)
