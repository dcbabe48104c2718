"""Rules about ego and target side by side: L1, L10, L11, L22."""

from collections.abc import Callable

import numpy as np

from overtaking.core.arrays import F32, IndexArray, Mask
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.case import alongside, lane_index, target_may_be
from overtaking.labels.law.margins import ENDLESS
from overtaking.labels.law.measurement_errors import MeasurementErrors, lane_error
from overtaking.labels.law.numbers import amount, bare
from overtaking.labels.law.rule import Grade, Rule, Spread
from overtaking.labels.snapshots import across_at, at, num_slow, slot_of, vehicle_at
from overtaking.model.verdicts import Case, Finding

_HALF_LANE = np.float32(0.5)

_LANE_AND_HALF = np.float32(1.5)

_LEAST_SPEED = np.float32(1e-3)
"""One step of recorded speed, so that a start from rest can be divided by [m/s]."""


def _on_the_left(case: Case) -> Finding:
    """While alongside the target the ego is in the lane to its left, unless both are in queues."""
    found = alongside(case)
    own = lane_index(case.signals.lane)[found.rows, found.frames]
    other = lane_index(found.lane)
    # A target that makes room to the right causes no breach.
    entered = np.maximum(other, lane_index(case.events.original_lane)[found.rows])
    margin = np.minimum(own - other - _HALF_LANE, entered + _LANE_AND_HALF - own)
    wrong = np.flatnonzero(margin < 0)
    margin[wrong[in_queue(case, found.rows[wrong], found.frames[wrong])]] = ENDLESS
    return found.check(case, margin)


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
    slow = num_slow(case, rows, frames, below=below, reach=reach)
    target = vehicle_at(case.trajectories, case.target.slot[rows], rows, frames)
    faster = case.signals.speed[rows, frames] - target.speed
    return (slow >= constant("law.queue.vehicles")) & (faster <= constant("law.queue.faster"))


def _lane_of_both(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
    """Error of being left of the target: by the ways of both centres to the next border [lanes].

    A breach is sure where one of its frames is; no breach is sure where all frames are.
    """
    over, run = alongside(case), case.trajectories
    rows, frames = over.rows, over.frames
    borders = (run.road.overtaking_sign * run.road.lane_boundaries).astype(np.float32)
    slot = slot_of(case.target.slot)[rows]
    target = across_at(run, case.signals, rows, slot, frames)[0]
    away = [
        np.abs(centre[:, None] - borders).min(axis=1)
        for centre in (case.signals.lateral_position[rows, frames], target)
    ]
    nearest = np.minimum(*away)
    low = np.full(len(found.margin), ENDLESS)
    np.minimum.at(low, rows, nearest)
    broken = (frames >= found.first_frame[rows]) & (frames <= found.last_frame[rows])
    high = np.zeros(len(found.margin), np.float32)
    np.maximum.at(high, rows[broken], nearest[broken])
    return lane_error(np.where(found.margin < 0, high, low), errors)


L1 = Rule(
    id="pt.ce.36@2013",
    code="L1",
    law="Articles 36 and 38(3); exceptions 37 and 42",
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
        of=_lane_of_both,
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
    return frames_alongside.check(case, margin, target_may_be(case, bicycle=bicycle))


def _of_two_places(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
    """Error of a distance across the road [m]."""
    del case
    return np.full_like(found.margin, np.sqrt(2.0) * errors.position_std)


L10 = Rule(
    id="pt.ce.18-2@2013",
    code="L10",
    law="Article 18(2)",
    title="Lateral distance",
    gloss="Keep a lateral distance to vehicles on the same carriageway that avoids accidents.",
    predicate=(
        "While ego and target overlap, the target being no bicycle: distance between their sides "
        f">= {amount('law.side.motor')}."
    ),
    unit="m",
    grade=Grade.BY_ROAD,
    needs=frozenset(["kinds"]),
    check=_apart_from_motor,
    spread=Spread(formula="sqrt(2) sp", of=_of_two_places),
)


def _apart_from_bicycle(case: Case) -> Finding:
    """Alongside a bicycle, the bodies are 1.5 m apart and the ego no faster than at the start."""
    frames_alongside, speed, limit = alongside(case), case.signals.speed, bicycle_distance(case)
    start = np.maximum(at(speed, case.events.attempt), _LEAST_SPEED)[frames_alongside.rows]
    room = (frames_alongside.lateral_gap - limit) / limit
    slower = (start - speed[frames_alongside.rows, frames_alongside.frames]) / start
    return frames_alongside.check(case, np.minimum(room, slower), target_may_be(case, bicycle=True))


def _bicycle_error(case: Case, found: Finding, errors: MeasurementErrors) -> F32:
    """Error of the share of room or of speed, whichever decides [1]."""
    over, limit = alongside(case), bicycle_distance(case)
    room = np.full(len(found.margin), ENDLESS)
    np.minimum.at(room, over.rows, (over.lateral_gap - limit) / limit)
    start = np.maximum(at(case.signals.speed, case.events.attempt), _LEAST_SPEED)
    # Both speeds have the same error, which changes their ratio alone.
    of_speed = np.abs(found.margin) / start * np.float32(errors.speed_std)
    is_room = np.abs(room - found.margin) < np.float32(1e-6)
    return np.where(is_room, np.float32(np.sqrt(2.0) * errors.position_std) / limit, of_speed)


L11 = Rule(
    id="pt.ce.18-3@2013",
    code="L11",
    law="Articles 18(3) and 38(2)(e)",
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
    needs=frozenset(["kinds"]),
    check=_apart_from_bicycle,
    spread=Spread(
        formula=f"sqrt(2) sp / {amount('law.side.bicycle')} where the room decides, "
        "else margin sv / v",
        of=_bicycle_error,
    ),
)


def _target_keeps_speed(case: Case) -> Finding:
    """While ego and target overlap, the target accelerates at no more than 0.3 m/s^2."""
    found = alongside(case)
    return found.check(case, constant("law.overtaken.accel") - found.accel)


L22 = Rule(
    id="pt.ce.39@2013",
    code="L22",
    law="Article 39",
    title="Let others overtake",
    gloss="Who is overtaken gives way to the right as far as possible and does not accelerate.",
    predicate=TARGET_KEEPS_SPEED,
    unit="m/s^2",
    grade=Grade.BY_ROAD,
    of_ego=False,
    check=_target_keeps_speed,
)
