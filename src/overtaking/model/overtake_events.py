"""Phases of an overtake as frame numbers, its outcome, and the detail of the outcome."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from overtaking.core.arrays import I32, U8, Mask
from overtaking.model.batch import Batch

NEVER = np.int32(-1)
"""Frame of an event that did not happen; a null in every table."""


class Outcome(IntEnum):
    """How the ego's overtake ended, legality aside."""

    NO_ATTEMPT = 0
    COMPLETED = 1
    NOT_COMPLETED = 2
    COLLISION = 3


class OutcomeDetail(IntEnum):
    """Reason of the outcome."""

    NONE = 0
    ABORTED_BEFORE_CROSSING = 1
    ABORTED_AFTER_CROSSING = 2
    PASSED_NOT_RETURNED = 3
    OPEN_AT_HORIZON = 4
    COLLISION_BEFORE_ATTEMPT = 5
    RAN_INTO_OTHER = 6
    STRUCK_BY_OTHER = 7
    DEPARTED = 8
    SPUN = 9


@dataclass(frozen=True, slots=True, kw_only=True)
class OvertakeEvents(Batch):
    """Events of the attempt that decides each simulation; every array has shape (simulation,).

    The paper's symbols are in brackets. Of several attempts the last one counts; `num_attempts` is
    their number.

    Attributes:
        first: First recorded frame [t_0].
        last: Last recorded frame.
        target_slot: Slot of the vehicle to overtake: the nearest vehicle ahead at `attempt`;
            without an attempt the leader at `following_begin`, else the last leader; `NO_VEHICLE`
            if the ego never had a leader.
        original_lane: Lane index of the ego at `attempt`, or at the first frame.
        following_begin: First frame less than 3 s behind the target, or the first frame [t_follow].
        attempt: Start of the movement to the left [t_a].
        line_crossed: First corner over the line on the left [t_x1].
        overlap_begin: First frame alongside the target [t_o1].
        overlap_end: First frame wholly ahead of it [t_o2].
        return_begin: Start of the movement back [t_b].
        return_end: First frame with the whole body in the original lane, ahead of it [t_x2].
        abort: Start of the movement back behind the target.
        abort_end: First frame with the whole body in the original lane after an abort.
        collision: First frame after the ego's first contact.
        road_departure: First frame with the ego's centre outside the driving lanes.
        spin: First frame in which the ego stands so far across the road that no driver recovers
            control.
        num_attempts: Number of attempts.
        num_passed: Vehicles that were ahead of the ego at `attempt` and are behind at the end of
            the overtake, the target among them.
        collision_slot: Slot of the vehicle that the ego collided with, or `NO_VEHICLE`.
        was_struck: Whether the other vehicle ran into the ego.
        drift: Start of the first movement to the left outside attempts that ends in the same lane.
        num_drifts: Number of such movements, at most 255.
        began_before_recording: First frame, if the attempt had begun before the recording:
            `attempt` is then that frame and too late.
        was_intended: Whether the ego's driver meant to overtake: it was in a stage of an overtake
            between `attempt` and the line, or `abort_end`. It is undefined without an attempt, and
            in recordings without stages.
    """

    first: I32
    last: I32
    target_slot: U8
    original_lane: U8
    following_begin: I32
    attempt: I32
    line_crossed: I32
    overlap_begin: I32
    overlap_end: I32
    return_begin: I32
    return_end: I32
    abort: I32
    abort_end: I32
    collision: I32
    road_departure: I32
    spin: I32
    num_attempts: U8
    num_passed: U8
    collision_slot: U8
    was_struck: Mask
    drift: I32
    num_drifts: U8
    began_before_recording: I32
    was_intended: Mask

    @property
    def has_attempt(self) -> Mask:
        """Whether the ego began to overtake."""
        return self.attempt != NEVER

    @property
    def lost_control(self) -> Mask:
        """Whether the ego left the lanes or spun, and touched no other vehicle."""
        out_of_control = (self.road_departure != NEVER) | (self.spin != NEVER)
        return out_of_control & (self.collision == NEVER)

    @property
    def is_completed(self) -> Mask:
        """Whether it ended in the original lane ahead of the target, without an accident."""
        return (self.return_end != NEVER) & (self.collision == NEVER) & ~self.lost_control
