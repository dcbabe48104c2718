"""The compiled signals are those of the readable reference, bit for bit, for any recording."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.reference.labels.readable_recordings import (
    case,
    every_recording,
    readable,
    same,
    written,
)
from tests.reference.labels.readable_signals import One, Row, encounter, signals, target_signals

from overtaking import _core
from overtaking.core import arrays
from overtaking.core.errors import ConfigError
from overtaking.core.native import SIMD_VARIABLE
from overtaking.labels import signals as compiled
from overtaking.labels.event_detection import case_from_trajectories
from overtaking.labels.snapshots import (
    lateral_position_and_gap,
    lateral_speed_at,
    left_lane_occupancy,
    vehicle_snapshot,
)
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.trajectories import NO_VEHICLE

if TYPE_CHECKING:
    from overtaking.model.ego_signals import EgoSignals

LEVELS = [name for name, available in _core.simd_levels() if available]


def differences(seen: EgoSignals, number: int, expected: dict[str, Row]) -> list[str]:
    """The names of the signals of a simulation that differ in a recorded frame."""
    frames = len(expected["lane"])
    return [
        name
        for name, values in expected.items()
        if not same(np.ascontiguousarray(getattr(seen, name)[number][..., :frames]), values)
    ]


@pytest.mark.parametrize("level", LEVELS)
@every_recording
def test_every_signal_is_the_same(name, level, monkeypatch):
    monkeypatch.setenv(SIMD_VARIABLE, level)
    seen = case_from_trajectories(case(name).trajectories).signals
    for number, (_, expected) in enumerate(readable(name)):
        assert not differences(seen, number, expected), number


def test_nothing_shows_of_what_the_memory_held_before(monkeypatch):
    monkeypatch.setattr(arrays, "MIN_POOLED_BYTES", 0)
    run, used = case("pinto2023").trajectories, set[int]()
    short = dataclasses.replace(run, num_frames=(run.num_frames + 1) // np.int32(2))
    for one in (run, short, run, short):
        seen, frame = case_from_trajectories(one).signals, np.arange(one.stage.shape[1])
        behind = frame >= -(-one.num_frames[:, None] // 16) * 16  # Sixteen are worked out together.
        narrow = [
            getattr(seen, name)[behind]
            for name in (*compiled.SIGNALS_FOR_ENGINE, "accel")
            if name != "neighbour_slot"
        ]
        assert not any(values.any() for values in narrow)
        assert not seen.neighbour_slot[
            np.broadcast_to(behind[:, None], seen.neighbour_slot.shape)
        ].any()
        used.add(seen.speed.ctypes.data)
        del seen
    assert len(used) == 1


@pytest.mark.ci
def test_signals_of_overtakes_written_by_hand_are_the_same():
    for run in written():
        assert not differences(case_from_trajectories(run).signals, 0, signals(One(run, 0)))


@pytest.mark.ci
@every_recording
def test_the_target_is_the_same(name):
    given, found = case(name), 0
    for number, (one, seen) in enumerate(readable(name)):
        vehicle = given.target.slot[number]
        if vehicle == NO_VEHICLE:
            assert not given.target.valid[number].any()
            continue
        expected = target_signals(one, seen, int(vehicle))
        there = expected["valid"]
        found += there.sum()
        for signal, values in expected.items():
            row = getattr(given.target, signal)[number, : one.frames]
            where = slice(None) if signal in ("valid", "overlaps") else there
            assert same(row[where], values[where]), (number, signal)
    assert found


@every_recording
def test_encounters_at_single_frames_are_the_same(name):
    given, draw = case(name), np.random.default_rng(5)
    rows = draw.integers(0, given.signals.num_simulations, 400)
    frames = (given.events.last[rows] * draw.random(400)).astype(np.intp)
    places = draw.integers(0, len(NeighbourRole), 400)
    found = compiled.encounters_at(given, places, rows, frames)
    assert found.valid.any()
    assert not found.valid.all()
    for k, (row, place, frame) in enumerate(zip(rows, places, frames, strict=True)):
        one, _ = readable(name)[row]
        slot = one.neighbour(NeighbourRole(place), int(frame))
        assert found.valid[k] == (slot is not None)
        if slot is not None:
            expected = encounter(one, [(int(frame), slot)], ahead=place % 2 == 0)
            for measure, value in expected.items():
                assert same(getattr(found, measure)[k : k + 1], value)


@every_recording
def test_single_frames_are_what_they_are_among_all_frames(name):
    given, draw = case(name), np.random.default_rng(6)
    run, seen, count = given.trajectories, given.signals, len(given.events.last)
    rows, vehicle = np.arange(count), given.target.slot
    frames = (given.events.last * draw.random(count)).astype(np.int32)
    lane = left_lane_occupancy(run, frames)
    assert same(lane.occupancy, seen.left_occupancy[rows, frames])
    assert same(lane.count, seen.left_count[rows, frames])
    there = given.target.valid[rows, frames]
    rows, frames, slot = rows[there], frames[there], vehicle[there].astype(np.intp)
    along = vehicle_snapshot(run, vehicle[there], rows, frames)
    assert along.valid.all()
    lateral, lateral_gap = lateral_position_and_gap(run, seen, rows, slot, frames)
    found = {
        "ego_lead": along.ego_lead,
        "gap": along.gap,
        "speed": along.speed,
        "lateral_position": lateral,
        "lateral_gap": lateral_gap,
        "lateral_speed": lateral_speed_at(run, rows, slot, frames),
    }
    for signal, values in found.items():
        assert same(values, getattr(given.target, signal)[rows, frames]), signal


def test_what_is_not_recorded_is_zero_although_memory_is_used_again():
    run = case("pinto2023").trajectories
    last = case_from_trajectories(run).signals.speed.copy()
    assert last.any()
    again = case_from_trajectories(
        dataclasses.replace(run, num_frames=np.full_like(run.num_frames, 40))
    ).signals
    # Sixteen frames are worked out at a time, so only what lies beyond them is cleared.
    assert not again.speed[:, 48:].any()
    assert not again.gap[..., 48:].any()


def test_an_unknown_level_is_refused(monkeypatch):
    monkeypatch.setenv(SIMD_VARIABLE, "abacus")
    with pytest.raises(ConfigError, match=r"SIMD level: .* got abacus"):
        case_from_trajectories(case("pinto2023").trajectories)


def test_frames_that_do_not_exist_are_refused():
    given = case("pinto2023")
    rows = np.zeros(3, np.intp)
    for frames in (rows + given.signals.num_frames, rows - 1):
        with pytest.raises(ValueError, match="expected recorded frames"):
            compiled.encounters_at(given, NeighbourRole.LEADER, rows, frames)


def test_a_vehicle_that_does_not_exist_is_refused():
    given = case("pinto2023")
    run, wrong = given.trajectories, given.signals.neighbour_slot.copy()
    wrong[0, NeighbourRole.LEADER] = run.states.s.shape[1]
    strange = given.signals.replace(neighbour_slot=wrong)
    with pytest.raises(ValueError, match="neighbour_slot: no vehicle"):
        compiled.target_signals(run, strange, given.target.slot).gap  # noqa: B018
    with pytest.raises(ValueError, match="target: no vehicle"):
        compiled.target_signals(run, given.signals, wrong[:, NeighbourRole.LEADER, 0])
