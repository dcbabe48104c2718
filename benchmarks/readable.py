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

One = readable_signals.One


def watch(run: Trajectories, _: Mapping[str, Any]) -> tuple[EgoSignals, dict[str, Any]]:
    """Signals and events, one simulation after the other."""
    ones = _ones(run)
    seen = [readable_signals.signals(one) for one in ones]
    found = [readable_events.find_events(*pair) for pair in zip(ones, seen, strict=True)]
    events = {name: np.array([one[name] for one in found], np.int32) for name in found[0]}
    del events["was_struck"], events["began_before_recording"], events["was_intended"]
    interval = run.scenario.frame_interval_ms
    arrays = _padded(run, seen)
    return EgoSignals(frame_interval_ms=interval, valid=run.frame_mask, **arrays), events


def target_signals(run: Trajectories, seen: EgoSignals, vehicle: Any) -> TargetSignals:
    """Signals of each target; without a target those of the ego, marked invalid."""
    slots, own = (
        np.where(vehicle == NO_VEHICLE, 0, vehicle),
        ("lateral", "right_edge", "left_edge"),
    )
    rows = [
        readable_signals.target_signals(one, _row(seen, one, own), int(slot))
        for one, slot in zip(_ones(run), slots, strict=True)
    ]
    arrays = _padded(run, rows)
    for name in ("valid", "overlaps"):
        arrays[name] &= (vehicle != NO_VEHICLE)[:, None]
    length = run.scenario.vehicles.length[np.arange(len(slots)), slots]
    return TargetSignals(slot=vehicle, length=length, **arrays)


def encounter(case: Case, place: Any, rows: Any, at: Any) -> Encounter:
    """The ego and a neighbour, one instant after the other."""
    places = np.broadcast_to(np.int64(place), np.shape(rows))
    found = {name: np.zeros(len(rows), np.float32) for name in _core.FIELD_NAMES["encounters"]}
    none_there = {"time_gap": 0.0, "ttc": 0.0, "mttc": 0.0}  # Of two vehicles at one place.
    valid = np.zeros(len(rows), np.bool_)
    ones = {row: One(case.trajectories, int(row)) for row in np.unique(rows)}
    for k, (row, where, frame) in enumerate(zip(rows, places, at, strict=True)):
        slot = ones[row].neighbour(NeighbourRole(int(where)), int(frame))
        valid[k] = slot is not None
        measures: Mapping[str, Any] = none_there
        if slot is not None:
            met = [(int(frame), slot)]
            measures = readable_signals.encounter(ones[row], met, ahead=where % 2 == 0)
        for name, value in measures.items():
            found[name][k] = np.ravel(value)[0]
    return Encounter(valid=valid, **found)


def answers(case: Case, spans: dict[str, FrameSpan]) -> ScanResults:
    """Everything about stretches of frames, one simulation after the other."""
    names = (*signals.SIGNALS_FOR_ENGINE, "left_count")
    stretched = {name: _frames(span) for name, span in spans.items()}
    found = []
    for one in _ones(case.trajectories):
        own = {name: each[one.number] for name, each in stretched.items()}
        found.append(readable_scans.answers_of(case, one, _row(case.signals, one, names), own))

    def rows(name: str) -> Any:
        return zip(*(one[name] for one in found), strict=True)

    def stretch(name: str) -> MarginMinimum:
        return _stretch([one[name] for one in found])

    due, length = (np.array(each, np.int32) for each in rows("due"))

    def table(name: str, kind: type) -> dict[str, Any]:
        return {key: np.array([one[name][key] for one in found], kind) for key in found[0][name]}

    return ScanResults(
        return_opportunity=(due, length),
        stop_lit=stretch("stop_lit"),
        stop_unlit=stretch("stop_unlit"),
        following=stretch("follow"),
        forced_braking=stretch("braking"),
        entry_arrival=np.array([one["entry_arrival"] for one in found], np.int32),
        return_arrival=np.array([one["return_arrival"] for one in found], np.int32),
        worst_measures=table("worst", np.float32),
        recorded_sums=table("sums", np.int64),
    )


def limited(signal: Any, limit: Any, span: FrameSpan, *, is_most: bool) -> MarginMinimum:
    """Margins to a limit, one simulation after the other."""
    limits = np.full(len(signal), limit, np.float32)
    each = zip(signal, limits, _frames(span), strict=True)
    return _stretch([readable_scans.limited(*one, is_most=is_most) for one in each])


def bits_within(values: Any, span: FrameSpan) -> tuple[Any, Any]:
    """Bits that are set ever and always, one simulation after the other."""
    each = zip(values, _frames(span), strict=True)
    found = [readable_scans.bits_within(*one) for one in each]
    ever, always = zip(*found, strict=True)
    return np.array(ever, np.uint8), np.array(always, np.uint8)


def overlaps(case: Case, span: FrameSpan) -> Alongside:
    """Frames in which ego and target overlap, from the signals of the target."""
    target = target_signals(case.trajectories, case.signals, case.target.slot)
    every = np.arange(case.signals.num_simulations)
    rows, at = np.nonzero(target.overlaps & span.mask(every, case.signals.num_frames))
    said = {name: getattr(target, name)[rows, at] for name in ("lane", "lateral_gap", "accel")}
    return Alongside(simulation=rows, frame=at, **said)


def _stretch(found: list[readable_scans.Lowest]) -> MarginMinimum:
    low, first, last, longest = zip(*found, strict=True)
    return MarginMinimum(
        min_margin=np.array(low, np.float32),
        first_frame=np.array(first, np.int32),
        last_frame=np.array(last, np.int32),
        longest_run=np.array(longest, np.int32),
    )


def _frames(span: FrameSpan) -> list[range]:
    ends = zip(span.first.tolist(), span.last.tolist(), strict=True)
    return [range(start, stop + 1) for start, stop in ends]


def _ones(run: Trajectories) -> list[One]:
    return [One(run, number) for number in range(len(run.num_frames))]


def _row(seen: EgoSignals, one: One, names: tuple[str, ...]) -> dict[str, Any]:
    """Some signals of one simulation in its recorded frames."""
    return {name: getattr(seen, name)[one.number][..., : one.frames] for name in names}


def _padded(run: Trajectories, rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Arrays of all simulations, zero beyond the end of each."""
    arrays: dict[str, Any] = {}
    for name, first in rows[0].items():
        shape = (len(rows), *first.shape[:-1], run.stage.shape[1])
        arrays[name] = np.zeros(shape, first.dtype)
        for k, row in enumerate(rows):
            arrays[name][k][..., : row[name].shape[-1]] = row[name]
    return arrays


TWINS: dict[Callable[..., Any], Callable[..., Any]] = {
    signals.extract_signals_and_events: watch,
    signals.target_signals: target_signals,
    signals.encounters_at: encounter,
    margins.scan_spans: answers,
    margins.minimum_to_limit: limited,
    margins.flags_any_and_all: bits_within,
    case_of_law.overlaps_in: overlaps,
}
"""Compiled functions and what a person reads instead."""


@contextmanager
def readable() -> Generator[None]:
    """While it lasts, whoever imported a compiled function calls the readable one."""
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
