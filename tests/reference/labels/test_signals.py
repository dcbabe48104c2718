"""The engine computes the signals of the readable reference, bit for bit, for any recording."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.reference.labels.readable_recordings import (
    every_recording,
    handwritten_recordings,
    have_same_bits,
    readable_runs,
    sample_case,
)
from tests.reference.labels.readable_signals import (
    SignalArray,
    SingleRun,
    encounter,
    is_ahead,
    signals_of,
    target_signals,
)

from overtaking import _core
from overtaking.core import arrays
from overtaking.core.errors import ConfigError
from overtaking.core.native import SIMD_VARIABLE
from overtaking.labels import signals as compiled
from overtaking.labels.event_detection import case_from_trajectories
from overtaking.labels.snapshots import (
    VehicleInstants,
    lateral_position_and_gap,
    lateral_speed_at,
    left_lane_occupancy,
    vehicle_snapshot,
)
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.trajectories import NO_VEHICLE

if TYPE_CHECKING:
    from overtaking.model.ego_signals import EgoSignals

SIMD_LEVELS = [name for name, available in _core.simd_levels() if available]


def differing_signals(signals: EgoSignals, row: int, expected: dict[str, SignalArray]) -> list[str]:
    """The names of the signals of a simulation that differ in a recorded frame."""
    num_frames = len(expected["lane"])
    return [
        name
        for name, values in expected.items()
        if not have_same_bits(
            np.ascontiguousarray(getattr(signals, name)[row][..., :num_frames]), values
        )
    ]


@pytest.mark.parametrize("level", SIMD_LEVELS)
@every_recording
def test_signals_of_recordings_have_the_bits_of_the_reference(name, level, monkeypatch):
    monkeypatch.setenv(SIMD_VARIABLE, level)
    signals = case_from_trajectories(sample_case(name).trajectories).signals
    for row, (_, expected) in enumerate(readable_runs(name)):
        assert not differing_signals(signals, row, expected), row


def test_reused_memory_is_cleared_beyond_the_recorded_frames(monkeypatch):
    monkeypatch.setattr(arrays, "MIN_POOLED_BYTES", 0)
    long, addresses = sample_case("pinto2023").trajectories, set[int]()
    short = dataclasses.replace(long, num_frames=(long.num_frames + 1) // np.int32(2))
    for trajectories in (long, short, long, short):
        signals = case_from_trajectories(trajectories).signals
        frame = np.arange(trajectories.stage.shape[1])
        # The engine computes sixteen frames at a time, so only those after the last step are 0.
        is_beyond = frame >= -(-trajectories.num_frames[:, None] // 16) * 16
        values_beyond = [
            getattr(signals, name)[is_beyond]
            for name in (*compiled.SIGNALS_FOR_ENGINE, "accel")
            if name != "neighbour_slot"
        ]
        assert not any(values.any() for values in values_beyond)
        slots = signals.neighbour_slot
        assert not slots[np.broadcast_to(is_beyond[:, None], slots.shape)].any()
        addresses.add(signals.speed.ctypes.data)
        del slots, signals  # Returns the memory for the next recording.
    assert len(addresses) == 1


@pytest.mark.ci
def test_signals_of_handwritten_overtakes_have_the_bits_of_the_reference():
    for trajectories in handwritten_recordings():
        signals = case_from_trajectories(trajectories).signals
        assert not differing_signals(signals, 0, signals_of(SingleRun(trajectories, 0)))


@pytest.mark.ci
@every_recording
def test_signals_of_targets_have_the_bits_of_the_reference(name):
    target, num_compared = sample_case(name).target, 0
    for row, (run, signals) in enumerate(readable_runs(name)):
        slot = target.slot[row]
        if slot == NO_VEHICLE:
            assert not target.valid[row].any()
            continue
        expected = target_signals(run, signals, int(slot))
        is_recorded = expected["valid"]
        num_compared += is_recorded.sum()
        for signal, values in expected.items():
            compiled_values = getattr(target, signal)[row, : run.num_frames]
            frames = slice(None) if signal in ("valid", "overlaps") else is_recorded
            assert have_same_bits(compiled_values[frames], values[frames]), (row, signal)
    assert num_compared


@every_recording
def test_encounters_at_single_frames_have_the_bits_of_the_reference(name):
    case, generator = sample_case(name), np.random.default_rng(5)
    rows = generator.integers(0, case.signals.num_simulations, 400)
    frames = (case.events.last[rows] * generator.random(400)).astype(np.intp)
    roles = generator.integers(0, len(NeighbourRole), 400)
    encounters = compiled.encounters_at(case, roles, rows, frames)
    assert encounters.valid.any()
    assert not encounters.valid.all()
    for k, (row, role, frame) in enumerate(zip(rows, roles, frames, strict=True)):
        run, _ = readable_runs(name)[row]
        slot = run.neighbour(NeighbourRole(role), int(frame))
        assert encounters.valid[k] == (slot is not None)
        if slot is not None:
            expected = encounter(run, [(int(frame), slot)], ahead=is_ahead(role))
            for measure, value in expected.items():
                assert have_same_bits(getattr(encounters, measure)[k : k + 1], value)


@every_recording
def test_snapshots_of_single_frames_equal_the_signals_of_these_frames(name):
    case, generator = sample_case(name), np.random.default_rng(6)
    trajectories, signals = case.trajectories, case.signals
    last, slots = case.events.last, case.target.slot
    rows, frames = np.arange(len(last)), (last * generator.random(len(last))).astype(np.int32)
    left_lane = left_lane_occupancy(trajectories, frames)
    assert have_same_bits(left_lane.occupancy, signals.left_occupancy[rows, frames])
    assert have_same_bits(left_lane.count, signals.left_count[rows, frames])
    is_recorded = case.target.valid[rows, frames]
    rows, frames, slots = rows[is_recorded], frames[is_recorded], slots[is_recorded]
    snapshot = vehicle_snapshot(trajectories, slots, rows, frames)
    assert snapshot.valid.all()
    vehicles = VehicleInstants(rows, slots.astype(np.intp), frames)
    lateral_position, lateral_gap = lateral_position_and_gap(trajectories, signals, vehicles)
    values_by_signal = {
        "ego_lead": snapshot.ego_lead,
        "gap": snapshot.gap,
        "speed": snapshot.speed,
        "lateral_position": lateral_position,
        "lateral_gap": lateral_gap,
        "lateral_speed": lateral_speed_at(trajectories, vehicles),
    }
    for signal, values in values_by_signal.items():
        assert have_same_bits(values, getattr(case.target, signal)[rows, frames]), signal


def test_frames_that_are_not_recorded_are_zero_in_reused_memory():
    trajectories = sample_case("pinto2023").trajectories
    assert case_from_trajectories(trajectories).signals.speed.any()
    num_frames = np.full_like(trajectories.num_frames, 40)
    signals = case_from_trajectories(
        dataclasses.replace(trajectories, num_frames=num_frames)
    ).signals
    # The engine computes sixteen frames at a time, so only those after the third step are 0.
    assert not signals.speed[:, 48:].any()
    assert not signals.gap[..., 48:].any()


def test_an_unknown_simd_level_is_refused(monkeypatch):
    monkeypatch.setenv(SIMD_VARIABLE, "abacus")
    with pytest.raises(ConfigError, match=r"SIMD level: .* got abacus"):
        case_from_trajectories(sample_case("pinto2023").trajectories)


def test_frames_that_do_not_exist_are_refused():
    case = sample_case("pinto2023")
    rows = np.zeros(3, np.intp)
    for frames in (rows + case.signals.num_frames, rows - 1):
        with pytest.raises(ValueError, match="expected recorded frames"):
            compiled.encounters_at(case, NeighbourRole.LEADER, rows, frames)


def test_a_vehicle_that_does_not_exist_is_refused():
    case = sample_case("pinto2023")
    trajectories, slots = case.trajectories, case.signals.neighbour_slot.copy()
    slots[0, NeighbourRole.LEADER] = trajectories.states.s.shape[1]
    signals = case.signals.replace(neighbour_slot=slots)
    with pytest.raises(ValueError, match="neighbour_slot: no vehicle"):
        compiled.target_signals(trajectories, signals, case.target.slot).gap  # noqa: B018
    with pytest.raises(ValueError, match="target: no vehicle"):
        compiled.target_signals(trajectories, case.signals, slots[:, NeighbourRole.LEADER, 0])
