"""Labels by the readable reference of the tests alone, in place of the compiled engine."""

import sys
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # The reference lies in the tests.

from tests.reference.labels import readable_events, readable_scans, readable_signals

from overtaking import _core
from overtaking.labels import signals
from overtaking.labels.law import case as case_of_law
from overtaking.labels.law import margins
from overtaking.labels.law.case import Alongside
from overtaking.labels.law.margins import MarginMinimum, ScanResults
from overtaking.labels.snapshots import FrameSpan
from overtaking.model.ego_signals import EgoSignals, TargetSignals
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.safety_measures import Encounter
from overtaking.model.trajectories import NO_VEHICLE, Trajectories
from overtaking.model.verdicts import Case

SingleRun = readable_signals.SingleRun


def extract_signals_and_events(
    trajectories: Trajectories, _: Mapping[str, Any]
) -> tuple[EgoSignals, dict[str, Any]]:
    """Signals and events, one simulation after the other."""
    runs = _runs(trajectories)
    signals_by_run = [readable_signals.signals_of(run) for run in runs]
    events_by_run = [
        readable_events.find_events(run, run_signals)
        for run, run_signals in zip(runs, signals_by_run, strict=True)
    ]
    events = {
        name: np.array([run_events[name] for run_events in events_by_run], np.int32)
        for name in events_by_run[0]
    }
    # The package finds these three itself.
    del events["was_struck"], events["began_before_recording"], events["was_intended"]
    ego_signals = EgoSignals(
        frame_interval_ms=trajectories.scenario.frame_interval_ms,
        valid=trajectories.frame_mask,
        **_pad_to_batch(trajectories, signals_by_run),
    )
    return ego_signals, events


def target_signals(
    trajectories: Trajectories, ego_signals: EgoSignals, target_slot: Any
) -> TargetSignals:
    """Signals of each target; without a target, signals of the ego, marked invalid."""
    has_target = target_slot != NO_VEHICLE
    slots = np.where(has_target, target_slot, 0)
    names = ("lateral_position", "right_edge", "left_edge")
    rows = [
        readable_signals.target_signals(run, _signals_of_run(ego_signals, run, names), int(slot))
        for run, slot in zip(_runs(trajectories), slots, strict=True)
    ]
    arrays = _pad_to_batch(trajectories, rows)
    for name in ("valid", "overlaps"):
        arrays[name] &= has_target[:, None]
    length = trajectories.scenario.vehicles.length[np.arange(len(slots)), slots]
    return TargetSignals(slot=target_slot, length=length, **arrays)


def encounters_at(case: Case, role: Any, simulation: Any, frame: Any) -> Encounter:
    """The ego and a neighbour, one instant after the other."""
    roles = np.broadcast_to(np.int64(role), np.shape(simulation))
    names = _core.FIELD_NAMES["encounters"]
    measures = {name: np.zeros(len(simulation), np.float32) for name in names}
    valid = np.zeros(len(simulation), np.bool_)
    runs = {row: SingleRun(case.trajectories, int(row)) for row in np.unique(simulation)}
    for index, (row, role_code, t) in enumerate(zip(simulation, roles, frame, strict=True)):
        slot = runs[row].neighbour(NeighbourRole(int(role_code)), int(t))
        if slot is None:
            continue  # All measures stay 0.
        valid[index] = True
        ahead = readable_signals.is_ahead(role_code)
        values = readable_signals.encounter(runs[row], [(int(t), slot)], ahead=ahead)
        for name, value in values.items():
            measures[name][index] = value[0]
    return Encounter(valid=valid, **measures)


def scan_spans(case: Case, spans: dict[str, FrameSpan]) -> ScanResults:
    """All results about spans of frames, one simulation after the other."""
    names = (*signals.SIGNALS_FOR_ENGINE, "left_count")
    frames = {name: _frames(span) for name, span in spans.items()}
    results: list[dict[str, Any]] = []
    for run in _runs(case.trajectories):
        run_signals = _signals_of_run(case.signals, run, names)
        run_spans = {name: span_frames[run.row] for name, span_frames in frames.items()}
        results.append(readable_scans.scan_results(case, run, run_signals, run_spans))

    def minimum(name: str) -> MarginMinimum:
        return _margin_minimum([result[name] for result in results])

    def array(name: str) -> Any:
        return np.array([result[name] for result in results], np.int32)

    def table(name: str, kind: type) -> dict[str, Any]:
        keys = results[0][name]
        return {key: np.array([result[name][key] for result in results], kind) for key in keys}

    first_frame, num_frames = array("due").T
    return ScanResults(
        return_opportunity=(first_frame, num_frames),
        stop_lit=minimum("stop_lit"),
        stop_unlit=minimum("stop_unlit"),
        following=minimum("follow"),
        forced_braking=minimum("braking"),
        entry_arrival=array("entry_arrival"),
        return_arrival=array("return_arrival"),
        worst_measures=table("worst", np.float32),
        recorded_sums=table("sums", np.int64),
    )


def minimum_to_limit(signal: Any, limit: Any, span: FrameSpan, *, is_most: bool) -> MarginMinimum:
    """Margins to a limit, one simulation after the other."""
    limits = np.full(len(signal), limit, np.float32)
    return _margin_minimum(
        [
            readable_scans.minimum_to_limit(values, row_limit, frames, is_most=is_most)
            for values, row_limit, frames in zip(signal, limits, _frames(span), strict=True)
        ]
    )


def flags_any_and_all(values: Any, span: FrameSpan) -> tuple[Any, Any]:
    """Bits that are set in any frame and in all, one simulation after the other."""
    flags = [
        readable_scans.flags_any_and_all(row, frames)
        for row, frames in zip(values, _frames(span), strict=True)
    ]
    any_bits, all_bits = np.array(flags, np.uint8).T
    return any_bits, all_bits


def overlaps_in(case: Case, span: FrameSpan) -> Alongside:
    """Frames in which ego and target overlap, from the signals of the target."""
    target = target_signals(case.trajectories, case.signals, case.target.slot)
    rows = np.arange(case.signals.num_simulations)
    is_alongside = target.overlaps & span.mask(rows, case.signals.num_frames)
    index = simulation, frame = np.nonzero(is_alongside)
    values = {name: getattr(target, name)[index] for name in ("lane", "lateral_gap", "accel")}
    return Alongside(simulation=simulation, frame=frame, **values)


def _margin_minimum(minima: list[readable_scans.ReferenceMinimum]) -> MarginMinimum:
    min_margin, first, last, longest = zip(*minima, strict=True)
    return MarginMinimum(
        min_margin=np.array(min_margin, np.float32),
        first_frame=np.array(first, np.int32),
        last_frame=np.array(last, np.int32),
        longest_run=np.array(longest, np.int32),
    )


def _frames(span: FrameSpan) -> list[range]:
    ends = zip(span.first.tolist(), span.last.tolist(), strict=True)
    return [range(first, last + 1) for first, last in ends]


def _runs(trajectories: Trajectories) -> list[SingleRun]:
    return [SingleRun(trajectories, row) for row in range(len(trajectories.num_frames))]


def _signals_of_run(
    ego_signals: EgoSignals, run: SingleRun, names: tuple[str, ...]
) -> dict[str, Any]:
    """Some signals of one simulation in its recorded frames."""
    return {name: getattr(ego_signals, name)[run.row][..., : run.num_frames] for name in names}


def _pad_to_batch(trajectories: Trajectories, rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Arrays of all simulations, zero beyond the end of each."""
    arrays: dict[str, Any] = {}
    for name, first in rows[0].items():
        shape = (len(rows), *first.shape[:-1], trajectories.stage.shape[1])
        arrays[name] = np.zeros(shape, first.dtype)
        for index, row in enumerate(rows):
            arrays[name][index][..., : row[name].shape[-1]] = row[name]
    return arrays


TWINS: dict[Callable[..., Any], Callable[..., Any]] = {
    signals.extract_signals_and_events: extract_signals_and_events,
    signals.target_signals: target_signals,
    signals.encounters_at: encounters_at,
    margins.scan_spans: scan_spans,
    margins.minimum_to_limit: minimum_to_limit,
    margins.flags_any_and_all: flags_any_and_all,
    case_of_law.overlaps_in: overlaps_in,
}
"""Functions that call the engine, and their readable twins."""


@contextmanager
def readable() -> Generator[None]:
    """Replace each function that calls the engine by its readable twin, in every module."""
    undo: list[Callable[[], None]] = []
    for module in list(sys.modules.values()):
        for name, value in list(vars(module).items()):
            if module.__name__.startswith("overtaking.") and _is_twin(value):
                setattr(module, name, TWINS[value])
                undo.append(partial(setattr, module, name, value))
    try:
        yield
    finally:
        for step in undo:
            step()


def _is_twin(value: object) -> bool:
    return callable(value) and getattr(value, "__hash__", None) is not None and value in TWINS
