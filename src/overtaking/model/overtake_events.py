"""Phases of an overtake as frame numbers, its outcome, and the detail of the outcome."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from overtaking.core.arrays import I32, U8, Mask
from overtaking.model.batch import Batch

NEVER = np.int32(-1)
"""Frame of an event that did not happen; a null in every table."""


class Outcome(IntEnum):
    """How the ego's overtake ended, legality aside.

    A collision at any recorded time decides, also before an attempt and after the return.
    """

    NO_ATTEMPT = 0
    COMPLETED = 1
    NOT_COMPLETED = 2
    COLLISION = 3


class OutcomeDetail(IntEnum):
    """Reason of the outcome; each member names the outcomes that it belongs to."""

    NONE = 0  # COMPLETED or NO_ATTEMPT, without loss of control.
    ABORTED_BEFORE_CROSSING = 1  # NOT_COMPLETED: back behind the target, no line crossed.
    ABORTED_AFTER_CROSSING = 2  # NOT_COMPLETED: back behind the target from the other lane.
    PASSED_NOT_RETURNED = 3  # NOT_COMPLETED: ahead of the target for 10 s, never back in the lane.
    OPEN_AT_HORIZON = 4  # NOT_COMPLETED: the recording ends in any other phase of the overtake.
    COLLISION_BEFORE_ATTEMPT = 5  # COLLISION, whichever vehicle ran into the other.
    RAN_INTO_OTHER = 6  # COLLISION after the start of an attempt.
    STRUCK_BY_OTHER = 7  # COLLISION after the start of an attempt.
    DEPARTED = 8  # NOT_COMPLETED or NO_ATTEMPT: the ego left the lanes, without a contact.
    SPUN = 9  # NOT_COMPLETED or NO_ATTEMPT: the ego spun, and had not left the lanes before.


@dataclass(frozen=True, slots=True, kw_only=True)
class OvertakeEvents(Batch):
    """Events of the attempt that decides each simulation; every array has shape (simulation,).

    The paper (`pinto-2023` in `docs/reference/sources.md`) has the symbols in brackets. Of
    several attempts the last one counts; `num_attempts` is their number. An event that did not
    happen is `NEVER`. `docs/explanation/events.md` defines every event, and
    `knowledge/data/event_detection.toml` states the thresholds.

    Left is the side of the faster lanes; on a two-way road the side of the oncoming traffic.

    Attributes:
        first: First recorded frame [t_0].
        last: Last recorded frame.
        target_slot: Slot of the vehicle to overtake. With an attempt: the leader at `attempt`, or
            without one the last leader of the 3 s before. Without an attempt: the first leader that
            the ego came closer to than 3 s, else its first leader. `NO_VEHICLE` (255) if it never
            had a leader.
        original_lane: Lane index of the ego at `attempt`, or at the first frame.
        following_begin: First frame, up to `attempt`, less than 3 s (`phases.follow_time_gap`)
            behind the target; the first frame if the ego never is [t_follow].
        attempt: Start of the movement to the left [t_a].
        line_crossed: First corner over the line on the left [t_x1].
        overlap_begin: First frame alongside the target [t_o1].
        overlap_end: First frame wholly ahead of it [t_o2].
        return_begin: Start of the movement back [t_b].
        return_end: First frame with the whole body in the original lane, ahead of it [t_x2].
        abort: Start of the movement back behind the target.
        abort_end: First frame with the whole body in the original lane after an abort.
        collision: First frame in which the ego has touched another vehicle. The contact lies at
            this frame, or between it and the frame before.
        road_departure: First frame with the ego's centre outside the driving lanes.
        spin: First frame in which the ego is turned away from the road by more than 0.8 rad
            (`departure.spin_angle` in `model.toml`), from which no driver recovers control.
        num_attempts: Number of attempts.
        num_passed: Vehicles that were ahead of the ego at `attempt` and are behind it at
            `return_end`, or at `last` without a return; the target among them.
        collision_slot: Slot of the vehicle that the ego collided with, or `NO_VEHICLE`.
        was_struck: Whether the other vehicle ran into the ego.
        drift: Start of the first drift: a movement to the left that is no attempt although a corner
            comes over the line, or although it lasts 0.5 s and leads 0.5 m away. Gusts and the end
            of a change into the lane cause drifts. Aborted attempts are no drifts, nor are lane
            changes without a vehicle ahead.
        num_drifts: Number of drifts, at most 255.
        began_before_recording: Equal to `first` if the recording begins within the attempt, so that
            `attempt`, the same frame, is too late; `NEVER` otherwise.
        was_intended: Whether the ego's driver meant to overtake: its stage was one of
            `OVERTAKING_STAGES` (`model.trajectories`) in a frame from `attempt` to `line_crossed`
            or `abort_end`, whichever is first. False without an attempt. In recordings without
            stages it has no meaning, and tables have null.
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
