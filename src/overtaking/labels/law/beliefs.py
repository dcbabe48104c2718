"""Beliefs of the ego at its decision, beside the true values."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from overtaking.core.arrays import F32, I32, U8, IndexArray, Mask
from overtaking.core.float32_math import as_f32
from overtaking.labels.law.margins import frames_of
from overtaking.labels.law.safe_distance import GapMargin, sure_decel
from overtaking.labels.snapshots import METRES, at
from overtaking.model.batch import cached_per_batch
from overtaking.model.overtake_events import NEVER
from overtaking.model.trajectories import NO_VEHICLE, ManoeuvreKind, PerceivedVehicle, Percepts
from overtaking.model.verdicts import Belief, Case

_LATEST_PULL_OUT = 1.0
"""A pull-out is decided before it can be seen, and gusts may be taken for its start [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """The decision that led to the judged manoeuvre, one for each simulation.

    Attributes:
        row: Row of its percepts, shape (simulation,).
        exists: Whether there is one, same shape.
        speed: Of the ego [m/s], same shape.
        decel: `sure_decel` there [m/s^2], same shape.
    """

    row: IndexArray
    exists: Mask
    speed: F32
    decel: F32


@cached_per_batch
def pull_out(case: Case) -> Decision:
    """The decision to pull out that led to the attempt."""
    events = case.events
    seen = events.attempt + frames_of(case, _LATEST_PULL_OUT)
    until = np.where(events.line_crossed != NEVER, events.line_crossed, seen)
    return _last(case, ManoeuvreKind.PULL_OUT, np.where(events.has_attempt, until, NEVER))


@cached_per_batch
def going_back(case: Case) -> Decision:
    """The decision to return that ended in the original lane."""
    return _last(case, ManoeuvreKind.RETURN, case.events.return_end)


def belief(case: Case, decision: Decision, conditions: dict[PerceivedVehicle, GapMargin]) -> U8:
    """`Belief` of each simulation.

    Args:
        case: The batch.
        decision: Where to look.
        conditions: For each vehicle that the rule is about, the margin that must not be negative.
    """
    percepts = case.trajectories.percepts
    simulation = np.arange(len(decision.row))
    if not decision.exists.any():
        return np.full(len(simulation), Belief.NONE, np.uint8)
    right = believed = np.ones(len(decision.row), np.bool_)
    anybody = np.zeros(len(decision.row), np.bool_)
    for vehicle, margin in conditions.items():
        place = (simulation, decision.row, vehicle)
        there = percepts.slot[place] != NO_VEHICLE
        noticed = there & percepts.is_detected[place]
        true, thought = margins_of(percepts, place, decision, margin)
        right = right & (~there | (true >= 0))
        believed = believed & (~noticed | (thought >= 0))
        anybody = anybody | there
    wrong = np.where(believed, np.uint8(Belief.MISTAKEN), np.uint8(Belief.KNOWINGLY_ILLEGAL))
    fine = np.where(believed, np.uint8(Belief.LEGAL), np.uint8(Belief.LUCKY))
    known = decision.exists & anybody
    return np.where(known, np.where(right, fine, wrong), np.uint8(Belief.NONE))


def margins_of(
    percepts: Percepts, place: tuple[Any, ...], decision: Decision, margin: GapMargin
) -> tuple[F32, F32]:
    """The margin to a vehicle at a decision: in truth, and as believed.

    Args:
        percepts: What was believed in the batch.
        place: Simulations, rows of percepts and vehicle.
        decision: Where to look.
        margin: Of the rule.
    """

    def by(gap_mm: I32, closing_mmps: I32) -> F32:
        gap, closing = as_f32(gap_mm[place]) * METRES, as_f32(closing_mmps[place]) * METRES
        return margin(gap, decision.speed, closing, decision.decel)

    true = by(percepts.true_gap, percepts.true_closing_speed)
    return true, by(percepts.gap, percepts.closing_speed)


def decision_at(case: Case, row: IndexArray, exists: Mask, time_ms: I32) -> Decision:
    """A row of percepts with speed and friction of the frame in which it was decided."""
    frame = np.maximum(time_ms, 0) // case.signals.frame_interval_ms
    frame = np.minimum(frame, case.events.last)
    decel = sure_decel(at(case.signals.friction, frame))
    return Decision(row=row, exists=exists, speed=at(case.signals.speed, frame), decel=decel)


def _last(case: Case, kind: ManoeuvreKind, until: I32) -> Decision:
    """The last decision of a kind up to a frame; none where that is `NEVER`."""
    percepts, interval = case.trajectories.percepts, case.signals.frame_interval_ms
    limit = np.where(until != NEVER, until, -1)[:, None] * interval
    fits = percepts.valid & (percepts.kind == kind) & (percepts.time <= limit)
    if "percepts" in case.trajectories.unknown or not fits.shape[1]:
        fits = np.zeros((len(until), 1), np.bool_)
    row = fits.shape[1] - 1 - fits[:, ::-1].argmax(axis=1)
    time = percepts.time[np.arange(len(row)), row] if percepts.time.shape[1] else until * 0
    return decision_at(case, row, np.asarray(fits.any(axis=1)), time)
