"""Rules about the distance to the vehicle ahead: L3, L28."""

import numpy as np

from overtaking.core.arrays import F32, I32, IndexArray
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.beliefs import belief_at, pull_out_percept
from overtaking.labels.law.case import (
    judged_span,
    last_driven_frame,
    neighbour_at,
    scans,
    span_after_gap_recovery,
)
from overtaking.labels.law.margins import (
    MIN_RATE_OF_CHANGE,
    UNCONSTRAINED,
    finding_at_instants,
    finding_not_applicable,
    finding_of_minimum,
)
from overtaking.labels.law.measurement_errors import (
    GAP_ERROR_FORMULA,
    MeasurementErrors,
    deciding_frame,
    gap_error,
)
from overtaking.labels.law.numbers import GAP_REGAIN_TIME, amount
from overtaking.labels.law.rule import Grade, Rule, Spread
from overtaking.labels.law.safe_distance import (
    REACTION_AND_DECEL,
    decel_for_safe_distance,
    margin_to_leader,
)
from overtaking.labels.signals import encounters_at
from overtaking.labels.snapshots import FrameSpan, at_frame
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.trajectories import NO_VEHICLE, PerceivedVehicle
from overtaking.model.vehicles import EGO_SLOT, VehicleKind
from overtaking.model.verdicts import Case, Finding


def _following(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
    """Of the gap to the leader, in the frame in which it lacks most."""

    def margin(rows: IndexArray, frames: IndexArray) -> F32:
        ahead = encounters_at(case, NeighbourRole.LEADER, rows, frames)
        decel = decel_for_safe_distance(case.signals.friction[rows, frames])
        speed = case.signals.speed[rows, frames]
        value = margin_to_leader(ahead.gap, speed, ahead.closing_speed, decel)
        return np.where(ahead.valid, value, UNCONSTRAINED)

    frame = deciding_frame(span_after_gap_recovery(case), margin, finding)
    error = gap_error(case, NeighbourRole.LEADER, frame, margin_to_leader, errors)
    leaving = _leaving(case, frame, errors)
    return np.sqrt(error * error + leaving * leaving)


def _leaving(case: Case, frame: I32, errors: MeasurementErrors) -> F32:
    """Error of a gap because the ego leaves the lane sooner or later than it was seen to [m].

    Where a gap closes until the ego has left the lane, the last frame in the lane decides.
    """
    signals, next_one = case.signals, np.minimum(frame + 1, case.events.last)
    leaves = at_frame(signals.lane, next_one) != at_frame(signals.lane, frame)
    closing = neighbour_at(case, NeighbourRole.LEADER, frame).closing_speed
    across = np.maximum(np.abs(at_frame(signals.lateral_speed, frame)), MIN_RATE_OF_CHANGE)
    return np.where(leaves, closing * np.float32(errors.position_std) / across, np.float32(0.0))


FOLLOWING = Spread(
    formula=f"{GAP_ERROR_FORMULA}, in the frame of the smallest margin; where that is the last one "
    "in the lane, the square of sp (v - u) / (speed across the road) is added to the variance",
    standard_error=_following,
)


def _follows_safely(case: Case) -> Finding:
    """The gap to the leader is lawful, but for 3 s after it cut in or all began."""
    believed = belief_at(case, pull_out_percept(case), {PerceivedVehicle.LEADER: margin_to_leader})
    return finding_of_minimum(scans(case).following, span_after_gap_recovery(case), belief=believed)


L3 = Rule(
    id="pt.ce.18-1@2013",
    code="L3",
    article="Article 18(1)",
    title="Safe distance",
    gloss="Keep a distance to the vehicle ahead that avoids a collision if it stops or slows "
    "suddenly.",
    predicate=(
        "At every frame: gap to the leader in the ego's lane >= v t + v^2 / (2 b) - v_lead^2 / (2 "
        f"b), {REACTION_AND_DECEL}; not in the {GAP_REGAIN_TIME} after the "
        "leader cut in or the recording began."
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    required_inputs=frozenset(["weather"]),
    applies_without_attempt=True,
    check=_follows_safely,
    spread=FOLLOWING,
)


def _leaves_room(case: Case) -> Finding:
    """A slow heavy vehicle that does not overtake keeps 50 m to the one ahead."""
    trajectories, signals, events = case.trajectories, case.signals, case.events
    in_town = trajectories.road.kind == "town" and "road_kind" not in trajectories.unknown
    if not trajectories.road.is_two_way or trajectories.road.num_lanes > 1 or in_town:
        return finding_not_applicable(signals.num_simulations)
    heavy = trajectories.scenario.vehicles.kind[:, EGO_SLOT] == VehicleKind.TRUCK
    heavy |= "kinds" in trajectories.unknown
    # A driver who is about to overtake may close up (paragraph 2).
    span, end = judged_span(case), last_driven_frame(case)
    stop = np.where(heavy & ~events.has_attempt, np.minimum(span.last, end), span.first - 1)
    rows, frames = FrameSpan(first=span.first, last=stop).instants()
    slow = signals.speed[rows, frames] <= constant("law.slow.speed")
    slow &= signals.neighbour_slot[rows, NeighbourRole.LEADER, frames] != NO_VEHICLE
    rows, frames = rows[slow], frames[slow]
    gap = encounters_at(case, NeighbourRole.LEADER, rows, frames).gap
    return finding_at_instants(
        gap - constant("law.slow.distance"), rows, frames, signals.num_simulations
    )


L28 = Rule(
    id="pt.ce.40@2013",
    code="L28",
    article="Article 40",
    title="Slow vehicles leave room",
    gloss="Outside localities, on roads with one lane in each direction, heavy and other vehicles "
    f"that drive slowly keep at least {amount('law.slow.distance')} to the vehicle ahead, so that "
    "they can be overtaken; not who is about to overtake.",
    predicate=(
        f"At every frame at {amount('law.slow.speed')} or less, the ego being a truck that does "
        "not begin to overtake, on a two-way road with one lane each way outside localities: gap "
        f"to the leader in its lane >= {amount('law.slow.distance')}."
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    required_inputs=frozenset(["kinds", "road_kind"]),
    applies_without_attempt=True,
    check=_leaves_room,
    spread=Spread(
        formula="sqrt(2) sp",
        standard_error=lambda _, found, errors: np.full_like(
            found.margin, np.sqrt(2.0) * errors.position_std, np.float32
        ),
    ),
    only_two_way_roads=True,
)
