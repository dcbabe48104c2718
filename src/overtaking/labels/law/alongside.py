"""Rules about ego and target side by side: L1, L10, L11, L22."""

from collections.abc import Callable

import numpy as np

from overtaking.core.arrays import F32, IndexArray, Mask
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.case import alongside, signed_lane, target_may_be
from overtaking.labels.law.margins import UNCONSTRAINED
from overtaking.labels.law.measurement_errors import MeasurementErrors, lane_margin_error
from overtaking.labels.law.numbers import amount, bare
from overtaking.labels.law.rule import Grade, Rule, Spread
from overtaking.labels.snapshots import (
    at_frame,
    lateral_position_and_gap,
    num_slow_vehicles,
    slot_or_ego,
    vehicle_snapshot,
)
from overtaking.model.verdicts import Case, Finding

_HALF_LANE = np.float32(0.5)

_LANE_AND_HALF = np.float32(1.5)

_LEAST_SPEED = np.float32(1e-3)
"""One step of recorded speed, so that a start from rest can be divided by [m/s]."""


def _on_the_left(case: Case) -> Finding:
    """While alongside the target the ego is in the lane to its left, unless both are in queues."""
    frames_alongside = alongside(case)
    ego_lane = signed_lane(case.signals.lane)[frames_alongside.simulation, frames_alongside.frame]
    target_lane = signed_lane(frames_alongside.lane)
    # A target that makes room to the right causes no breach.
    reference_lane = np.maximum(
        target_lane, signed_lane(case.events.original_lane)[frames_alongside.simulation]
    )
    margin = np.minimum(
        ego_lane - target_lane - _HALF_LANE, reference_lane + _LANE_AND_HALF - ego_lane
    )
    breaches = np.flatnonzero(margin < 0)
    margin[
        breaches[
            in_queue(case, frames_alongside.simulation[breaches], frames_alongside.frame[breaches])
        ]
    ] = UNCONSTRAINED
    return frames_alongside.finding(case, margin)


NOT_IN_QUEUES = (
    f"Not where at least {bare('law.queue.vehicles')} others within {amount('law.queue.reach')} "
    f"are slower than {amount('law.queue.speed', unit='km/h')} and the ego is at most "
    f"{amount('law.queue.faster', unit='km/h')} faster than the target."
)
"""The exception for queues, shared by the predicates of all laws."""

TARGET_KEEPS_SPEED = (
    f"While ego and target overlap: acceleration of the target <= {amount('law.overtaken.accel')}. "
    "The duty is the target's; a breach never makes the ego's overtake illegal."
)


def in_queue(case: Case, rows: IndexArray, frames: IndexArray) -> Mask:
    """Whether queues go on side by side at different speeds, which is no overtaking (42)."""
    below, reach = float(constant("law.queue.speed")), float(constant("law.queue.reach"))
    slow = num_slow_vehicles(case.trajectories, rows, frames, below=below, reach=reach)
    target = vehicle_snapshot(case.trajectories, case.target.slot[rows], rows, frames)
    faster = case.signals.speed[rows, frames] - target.speed
    return (slow >= constant("law.queue.vehicles")) & (faster <= constant("law.queue.faster"))


def _lane_of_both(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
    """Error of being left of the target: by the ways of both centres to the next border [lanes].

    A breach is sure where one of its frames is; no breach is sure where all frames are.
    """
    over, trajectories = alongside(case), case.trajectories
    rows, frames = over.simulation, over.frame
    borders = (trajectories.road.overtaking_sign * trajectories.road.lane_boundaries).astype(
        np.float32
    )
    slot = slot_or_ego(case.target.slot)[rows]
    target = lateral_position_and_gap(trajectories, case.signals, rows, slot, frames)[0]
    away = [
        np.abs(centre[:, None] - borders).min(axis=1)
        for centre in (case.signals.lateral_position[rows, frames], target)
    ]
    nearest = np.minimum(*away)
    low = np.full(len(finding.margin), UNCONSTRAINED)
    np.minimum.at(low, rows, nearest)
    broken = (frames >= finding.first_frame[rows]) & (frames <= finding.last_frame[rows])
    high = np.zeros(len(finding.margin), np.float32)
    np.maximum.at(high, rows[broken], nearest[broken])
    return lane_margin_error(np.where(finding.margin < 0, high, low), errors)


L1 = Rule(
    id="pt.ce.36@2013",
    code="L1",
    article="Articles 36 and 38(3); exceptions 37 and 42",
    title="Overtake on the left",
    gloss="Overtaking is done on the left, in the lane next to that of the overtaken vehicle. "
    "Parallel queues that move at different speeds do not overtake each other.",
    predicate=(
        "While ego and target overlap: lane(ego) is left of lane(target), and at most one lane "
        "left of it or of the lane from which the overtake began, for the target may make room. "
        + NOT_IN_QUEUES
    ),
    unit="lanes",
    grade=Grade.BY_ROAD,
    check=_on_the_left,
    spread=Spread(
        formula="0.5 sp / way of either centre to the next border, in the frame that decides",
        standard_error=_lane_of_both,
    ),
)

LateralDistance = Callable[[Case], np.float32]
"""The smallest lawful distance between the sides of ego and target on the road of a batch [m]."""


def motor_vehicle_distance(case: Case) -> np.float32:
    """Smallest lawful distance to the side of a motor vehicle [m]."""
    del case
    return constant("law.side.motor")


def bicycle_distance(case: Case) -> np.float32:
    """Smallest lawful distance to the side of a bicycle [m]."""
    del case
    return constant("law.side.bicycle")


def _apart_from_motor(case: Case) -> Finding:
    """Check the lateral distance to a motor vehicle."""
    return check_lateral_distance(case, motor_vehicle_distance, bicycle=False)


def check_lateral_distance(case: Case, distance: LateralDistance, *, bicycle: bool) -> Finding:
    """Check the lateral distance to the target.

    Args:
        case: The batch.
        distance: The smallest lawful distance.
        bicycle: Whether the rule is about bicycles, or about all other targets.
    """
    frames_alongside = alongside(case)
    margin = frames_alongside.lateral_gap - distance(case)
    return frames_alongside.finding(case, margin, target_may_be(case, bicycle=bicycle))


def _of_two_places(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
    """Error of a distance across the road [m]."""
    del case
    return np.full_like(finding.margin, np.sqrt(2.0) * errors.position_std)


L10 = Rule(
    id="pt.ce.18-2@2013",
    code="L10",
    article="Article 18(2)",
    title="Lateral distance",
    gloss="Keep a lateral distance to vehicles on the same carriageway that avoids accidents.",
    predicate=(
        "While ego and target overlap, the target being no bicycle: distance between their sides "
        f">= {amount('law.side.motor')}."
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    required_inputs=frozenset(["kinds"]),
    check=_apart_from_motor,
    spread=Spread(formula="sqrt(2) sp", standard_error=_of_two_places),
)


def _apart_from_bicycle(case: Case) -> Finding:
    """Alongside a bicycle, the bodies are 1.5 m apart and the ego no faster than at the start."""
    frames_alongside, speed, limit = alongside(case), case.signals.speed, bicycle_distance(case)
    start = np.maximum(at_frame(speed, case.events.attempt), _LEAST_SPEED)[
        frames_alongside.simulation
    ]
    room = (frames_alongside.lateral_gap - limit) / limit
    slower = (start - speed[frames_alongside.simulation, frames_alongside.frame]) / start
    return frames_alongside.finding(
        case, np.minimum(room, slower), target_may_be(case, bicycle=True)
    )


def _bicycle_error(case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
    """Error of the share of room or of speed, whichever decides [1]."""
    over, limit = alongside(case), bicycle_distance(case)
    room = np.full(len(finding.margin), UNCONSTRAINED)
    np.minimum.at(room, over.simulation, (over.lateral_gap - limit) / limit)
    start = np.maximum(at_frame(case.signals.speed, case.events.attempt), _LEAST_SPEED)
    # Both speeds have the same error, which changes their ratio alone.
    of_speed = np.abs(finding.margin) / start * np.float32(errors.speed_std)
    is_room = np.abs(room - finding.margin) < np.float32(1e-6)
    return np.where(is_room, np.float32(np.sqrt(2.0) * errors.position_std) / limit, of_speed)


L11 = Rule(
    id="pt.ce.18-3@2013",
    code="L11",
    article="Articles 18(3) and 38(2)(e)",
    title="Overtaking a bicycle",
    gloss=f"Motor vehicles keep at least {amount('law.side.bicycle')} to the side of bicycles, and "
    "slow down to overtake them.",
    predicate=(
        "While ego and target overlap, the target being a bicycle: distance between their sides >= "
        f"{amount('law.side.bicycle')}, and speed <= that at attempt. The margin is the smaller of "
        "the two, each as a share of its limit."
    ),
    unit="1",
    grade=Grade.BY_ROAD,
    required_inputs=frozenset(["kinds"]),
    check=_apart_from_bicycle,
    spread=Spread(
        formula=f"sqrt(2) sp / {amount('law.side.bicycle')} where the room decides, "
        "else margin sv / v",
        standard_error=_bicycle_error,
    ),
)


def _target_keeps_speed(case: Case) -> Finding:
    """While ego and target overlap, the target accelerates at no more than 0.3 m/s^2."""
    frames_alongside = alongside(case)
    return frames_alongside.finding(case, constant("law.overtaken.accel") - frames_alongside.accel)


L22 = Rule(
    id="pt.ce.39@2013",
    code="L22",
    article="Article 39",
    title="Let others overtake",
    gloss="A driver being overtaken gives way to the right as far as possible and does not "
    "accelerate.",
    predicate=TARGET_KEEPS_SPEED,
    unit="m/s^2",
    grade=Grade.BY_ROAD,
    is_duty_of_ego=False,
    check=_target_keeps_speed,
)
