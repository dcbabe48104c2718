"""Margins of the law at decisions of the ego's driver, by true and by believed values.

A percept records a decision: gaps and closing speeds of the neighbours as they were, and as the
driver believed them. For the belief, a vehicle that the driver had not noticed does not exist. An
event such as `attempt` is a frame, `NEVER` (-1) if it does not occur.
"""

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
"""Time after `attempt` up to which the decision to pull out may follow [s], a choice.

A driver decides before the vehicle moves. But `attempt` is the start of a movement to the
overtaking side, and a gust may have started it before the driver decided.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class ManoeuvrePercept:
    """The decision that led to the judged manoeuvre, one for each simulation.

    Attributes:
        percept: Index of the decision among the percepts of the simulation, shape (simulation,).
        exists: Whether there is such a decision, same shape; otherwise the rest is undefined.
        speed: Speed of the ego at the decision, same shape [m/s].
        decel: `decel_for_safe_distance` at the decision, same shape [m/s^2].
    """

    percept: IndexArray
    exists: Mask
    speed: F32
    decel: F32


@cached_per_batch
def pull_out_percept(case: Case) -> ManoeuvrePercept:
    """The last decision to pull out before the ego crosses the line.

    If it crosses no line, decisions until `_LATEST_PULL_OUT_S` after the attempt count.
    """
    events = case.events
    latest_without_crossing = events.attempt + num_frames_in(case, _LATEST_PULL_OUT_S)
    until = np.where(events.line_crossed != NEVER, events.line_crossed, latest_without_crossing)
    return _last_percept(case, ManoeuvreKind.PULL_OUT, np.where(events.has_attempt, until, NEVER))


@cached_per_batch
def return_percept(case: Case) -> ManoeuvrePercept:
    """The last decision to return before the ego is back in the original lane."""
    return _last_percept(case, ManoeuvreKind.RETURN, case.events.return_end)


def belief_at(
    case: Case, decision: ManoeuvrePercept, conditions: dict[PerceivedVehicle, GapMargin]
) -> U8:
    """`Belief` of each simulation, shape (simulation,): true verdict beside the believed one.

    Args:
        case: The batch.
        decision: The decision of each simulation.
        conditions: For each neighbour that the rule is about, the margin that must not be negative.

    Returns:
        `Belief.NONE` without a decision or without any of these neighbours.
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
    """Margin to a neighbour at a decision by the true values, then by the believed values.

    Args:
        percepts: Percepts of the batch.
        entry: Index into the arrays of neighbours: simulations, percepts and role.
        decision: The decision of each simulation.
        margin: Margin of the rule as a function of gap, speed, closing speed and deceleration.

    Returns:
        Two arrays of shape (simulation,), in the unit of the rule.
    """

    def margin_with(gap_mm: I32, closing_mmps: I32) -> F32:
        gap = as_f32(gap_mm[entry]) * METRES_PER_MM
        closing_speed = as_f32(closing_mmps[entry]) * METRES_PER_MM
        return margin(gap, decision.speed, closing_speed, decision.decel)

    true_margin = margin_with(percepts.true_gap, percepts.true_closing_speed)
    return true_margin, margin_with(percepts.gap, percepts.closing_speed)


def percept_at(case: Case, index: IndexArray, exists: Mask, time_ms: I32) -> ManoeuvrePercept:
    """Decisions with the speed of the ego and the deceleration in their frames.

    Args:
        case: The batch.
        index: Index of the decision among the percepts of each simulation, shape (simulation,).
        exists: Whether there is such a decision, same shape.
        time_ms: Instant of the decision, same shape [ms].
    """
    # The bounds matter only without a decision, where the time is arbitrary.
    frame = np.maximum(time_ms, 0) // case.signals.frame_interval_ms
    frame = np.minimum(frame, case.events.last)
    decel = decel_for_safe_distance(at_frame(case.signals.friction, frame))
    return ManoeuvrePercept(
        percept=index, exists=exists, speed=at_frame(case.signals.speed, frame), decel=decel
    )


def _last_percept(case: Case, kind: ManoeuvreKind, until: I32) -> ManoeuvrePercept:
    """The last decision of a kind up to a frame of each simulation; none where it is `NEVER`."""
    percepts, interval = case.trajectories.percepts, case.signals.frame_interval_ms
    max_time = until[:, None] * interval  # [ms]; negative for `NEVER`, before all decisions.
    is_candidate = percepts.valid & (percepts.kind == kind) & (percepts.time <= max_time)
    if "percepts" in case.trajectories.unknown or not is_candidate.shape[1]:
        is_candidate = np.zeros((len(until), 1), np.bool_)
    # Percepts are in the order of time: the last candidate is the first from the end.
    last = is_candidate.shape[1] - 1 - is_candidate[:, ::-1].argmax(axis=1)
    # Without any percept in the batch there are no times; 0 stands for them.
    time = percepts.time[np.arange(len(last)), last] if percepts.time.shape[1] else until * 0
    return percept_at(case, last, np.asarray(is_candidate.any(axis=1)), time)
