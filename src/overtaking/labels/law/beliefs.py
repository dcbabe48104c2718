"""Beliefs of the ego at its decision, beside the true values."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from overtaking.core.arrays import F32, I32, U8, IndexArray, Mask
from overtaking.core.float32_math import as_f32
from overtaking.labels.law.margins import num_frames_in
from overtaking.labels.law.safe_distance import GapMargin, decel_for_safe_distance
from overtaking.labels.snapshots import METRES_PER_MM, at_frame
from overtaking.model.batch import cached_per_batch
from overtaking.model.overtake_events import NEVER
from overtaking.model.trajectories import NO_VEHICLE, ManoeuvreKind, PerceivedVehicle, Percepts
from overtaking.model.verdicts import Belief, Case

_LATEST_PULL_OUT_S = 1.0
"""A pull-out is decided before it can be seen, and gusts may be taken for its start [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ManoeuvrePercept:
    """The decision that led to the judged manoeuvre, one for each simulation.

    Attributes:
        percept: Row of its percepts, shape (simulation,).
        exists: Whether there is one, same shape.
        speed: Of the ego [m/s], same shape.
        decel: `decel_for_safe_distance` there [m/s^2], same shape.
    """

    percept: IndexArray
    exists: Mask
    speed: F32
    decel: F32


@cached_per_batch
def pull_out_percept(case: Case) -> ManoeuvrePercept:
    """The decision to pull out that led to the attempt."""
    events = case.events
    signals = events.attempt + num_frames_in(case, _LATEST_PULL_OUT_S)
    until = np.where(events.line_crossed != NEVER, events.line_crossed, signals)
    return _last_percept(case, ManoeuvreKind.PULL_OUT, np.where(events.has_attempt, until, NEVER))


@cached_per_batch
def return_percept(case: Case) -> ManoeuvrePercept:
    """The decision to return that ended in the original lane."""
    return _last_percept(case, ManoeuvreKind.RETURN, case.events.return_end)


def belief_at(
    case: Case, decision: ManoeuvrePercept, conditions: dict[PerceivedVehicle, GapMargin]
) -> U8:
    """`Belief` of each simulation.

    Args:
        case: The batch.
        decision: Where to look.
        conditions: For each vehicle that the rule is about, the margin that must not be negative.
    """
    percepts = case.trajectories.percepts
    simulation = np.arange(len(decision.percept))
    if not decision.exists.any():
        return np.full(len(simulation), Belief.NONE, np.uint8)
    is_lawful = is_believed_lawful = np.ones(len(decision.percept), np.bool_)
    has_any_vehicle = np.zeros(len(decision.percept), np.bool_)
    for vehicle, margin in conditions.items():
        entry = (simulation, decision.percept, vehicle)
        has_vehicle = percepts.slot[entry] != NO_VEHICLE
        is_noticed = has_vehicle & percepts.is_detected[entry]
        true_margin, believed_margin = true_and_believed_margin(percepts, entry, decision, margin)
        is_lawful = is_lawful & (~has_vehicle | (true_margin >= 0))
        is_believed_lawful = is_believed_lawful & (~is_noticed | (believed_margin >= 0))
        has_any_vehicle = has_any_vehicle | has_vehicle
    belief_if_illegal = np.where(
        is_believed_lawful, np.uint8(Belief.MISTAKEN), np.uint8(Belief.KNOWINGLY_ILLEGAL)
    )
    belief_if_legal = np.where(is_believed_lawful, np.uint8(Belief.LEGAL), np.uint8(Belief.LUCKY))
    has_belief = decision.exists & has_any_vehicle
    return np.where(
        has_belief, np.where(is_lawful, belief_if_legal, belief_if_illegal), np.uint8(Belief.NONE)
    )


def true_and_believed_margin(
    percepts: Percepts, entry: tuple[Any, ...], decision: ManoeuvrePercept, margin: GapMargin
) -> tuple[F32, F32]:
    """The margin to a vehicle at a decision: in truth, and as believed.

    Args:
        percepts: Percepts of the batch.
        entry: Simulations, rows of percepts and vehicle.
        decision: Where to look.
        margin: Of the rule.
    """

    def by(gap_mm: I32, closing_mmps: I32) -> F32:
        gap, closing = (
            as_f32(gap_mm[entry]) * METRES_PER_MM,
            as_f32(closing_mmps[entry]) * METRES_PER_MM,
        )
        return margin(gap, decision.speed, closing, decision.decel)

    true = by(percepts.true_gap, percepts.true_closing_speed)
    return true, by(percepts.gap, percepts.closing_speed)


def percept_at(case: Case, row: IndexArray, exists: Mask, time_ms: I32) -> ManoeuvrePercept:
    """A row of percepts with speed and friction of the frame in which it was decided."""
    frame = np.maximum(time_ms, 0) // case.signals.frame_interval_ms
    frame = np.minimum(frame, case.events.last)
    decel = decel_for_safe_distance(at_frame(case.signals.friction, frame))
    return ManoeuvrePercept(
        percept=row, exists=exists, speed=at_frame(case.signals.speed, frame), decel=decel
    )


def _last_percept(case: Case, kind: ManoeuvreKind, until: I32) -> ManoeuvrePercept:
    """The last decision of a kind up to a frame; none where that is `NEVER`."""
    percepts, interval = case.trajectories.percepts, case.signals.frame_interval_ms
    max_time = np.where(until != NEVER, until, -1)[:, None] * interval
    is_candidate = percepts.valid & (percepts.kind == kind) & (percepts.time <= max_time)
    if "percepts" in case.trajectories.unknown or not is_candidate.shape[1]:
        is_candidate = np.zeros((len(until), 1), np.bool_)
    row = is_candidate.shape[1] - 1 - is_candidate[:, ::-1].argmax(axis=1)
    time = percepts.time[np.arange(len(row)), row] if percepts.time.shape[1] else until * 0
    return percept_at(case, row, np.asarray(is_candidate.any(axis=1)), time)
