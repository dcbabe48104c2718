"""Events of an overtake as frame numbers, its outcome, and the reason of the outcome.

`labels.event_detection` finds the events in recorded positions and bodies, never in the intention
of a simulated driver, so recordings of real traffic and simulations are read alike. Rules of the
law, features and the table `events` use them; `Outcome` and `OutcomeDetail` are columns of the
table `labels`.

The ego is the vehicle under study. Its target is the vehicle that it overtakes. Left is the side of
the faster lanes, on a two-way road the side of the oncoming traffic, also in left-hand traffic.
Frame 0 is the first frame of a simulation. The events of a completed overtake usually have this
order:

    attempt, line_crossed, overlap_begin, overlap_end, return_begin, return_end

If the ego gives up, `abort` and `abort_end` replace the last two.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from overtaking.core.arrays import I32, U8, Mask
from overtaking.model.batch import Batch

NEVER = np.int32(-1)
"""Frame of an event that did not happen; a null in every table."""


class Outcome(IntEnum):
    """How the ego's overtake ended, whether or not it was legal.

    A collision decides the outcome whenever it happens: before an attempt, which it prevents, and
    also after the return. Simulations continue for 3 s after the return, and this time still
    belongs to the overtake.
    """

    NO_ATTEMPT = 0  # The ego did not begin to overtake.
    COMPLETED = 1  # It is back in its lane, ahead of the target.
    NOT_COMPLETED = 2  # It began, and is not back ahead of the target.
    COLLISION = 3  # It touched another vehicle.


class OutcomeDetail(IntEnum):
    """Reason of the outcome; the comment of each member begins with its possible outcomes.

    A collision comes before all other reasons. Next comes leaving the lanes or spinning, also after
    the return; the outcome is then not COMPLETED.
    """

    NONE = 0  # COMPLETED or NO_ATTEMPT, without loss of control.
    ABORTED_BEFORE_CROSSING = 1  # NOT_COMPLETED: back behind the target, no line crossed.
    ABORTED_AFTER_CROSSING = 2  # NOT_COMPLETED: back behind the target from the other lane.
    # NOT_COMPLETED: ahead of the target for the last 10 s of the recording or longer, but not back
    # in the lane. Chosen: a driver that stays out for so long does not mean to return.
    PASSED_NOT_RETURNED = 3
    OPEN_AT_HORIZON = 4  # NOT_COMPLETED: the recording ends in any other phase of the overtake.
    COLLISION_BEFORE_ATTEMPT = 5  # COLLISION, whichever vehicle ran into the other.
    RAN_INTO_OTHER = 6  # COLLISION after the start of an attempt, by the ego.
    STRUCK_BY_OTHER = 7  # COLLISION after the start of an attempt, by the other vehicle.
    DEPARTED = 8  # NOT_COMPLETED or NO_ATTEMPT: the ego left the lanes, without a collision.
    SPUN = 9  # NOT_COMPLETED or NO_ATTEMPT: the ego spun, and had not left the lanes before.


@dataclass(frozen=True, slots=True, kw_only=True)
class OvertakeEvents(Batch):
    """Events of the attempt that decides each simulation; every array has shape (simulation,).

    Of several attempts the last one decides; `num_attempts` is their number. Every int32 field is
    the number of a frame, or `NEVER` if the event did not happen. A slot is the number of a vehicle
    in its simulation, and a leader is the nearest vehicle ahead in the ego's lane. The reproduced
    paper (`pinto-2023` in `docs/reference/sources.md`) has the symbols in brackets.
    `docs/explanation/events.md` decides doubtful cases, such as a change of the leader, and
    `knowledge/data/event_detection.toml` gives the thresholds and their reasons.

    Attributes:
        first: First recorded frame, always 0; the table `events` lists it beside the others [t_0].
        last: Last recorded frame.
        target_slot: Slot of the target. With an attempt it is the leader at `attempt`, or, if there
            is no leader in that frame, the last leader of the 3 s before, which has just left the
            lane. Without an attempt it is the first leader that held up the ego (a time gap below 3
            s, as for `following_begin`), or, if no leader did, its first leader. `NO_VEHICLE` (255)
            if the ego never had a leader.
        original_lane: Lane index of the ego at `attempt`, or at `first` without an attempt; 0 is
            the slowest lane.
        following_begin: First frame, not later than `attempt`, in which the ego is less than 3 s
            (`phases.follow_time_gap`) behind the target; `first` if there is no such frame
            [t_follow].
        attempt: First frame of the movement to the left that begins the overtake. The movement
            leads over the line, or within a second as far to the left as gusts and wandering move a
            vehicle of this type at most once an hour: 0.45 m for trucks to 1.2 m for bicycles
            [t_a].
        line_crossed: First frame in which a corner of the ego is over the line on its left [t_x1].
        overlap_begin: First frame in which the ego is alongside the target [t_o1].
        overlap_end: First frame in which the ego is wholly ahead of the target [t_o2].
        return_begin: First frame of the movement back, after the ego was farthest left [t_b].
        return_end: First frame with the whole body in the original lane, ahead of the target
            [t_x2].
        abort: First frame of a movement back that ends behind the target.
        abort_end: First frame after an abort with the whole body in the original lane, behind the
            target. If no line was crossed, the first frame in which the ego is back within 0.25 m
            of its lateral position at `attempt`; chosen: half the 0.5 m from which on a movement
            can be a `drift`.
        collision: First frame in which the ego has touched another vehicle. The contact lies at
            this frame, or between it and the frame before.
        road_departure: First frame with the ego's centre beyond all lanes; the opposing lane of a
            two-way road is one of them.
        spin: First frame in which the ego is turned away from the road by more than 0.8 rad
            (`departure.spin_angle` in `model.toml`), from which no driver recovers control.
        num_attempts: Number of attempts.
        num_passed: Number of vehicles that were ahead of the ego at `attempt` and are behind it at
            `return_end`, or at `last` without a return; includes the target if the ego passed it.
        collision_slot: Slot of the vehicle that the ego collided with, or `NO_VEHICLE`.
        was_struck: Whether that vehicle ran into the ego; False if the ego ran into that vehicle,
            or without a collision.
        drift: First frame of the first drift. A drift is a movement to the left that is no attempt
            and is yet large: a corner comes over the line, or the movement lasts at least 0.5 s and
            leads at least 0.5 m to the left. Gusts cause drifts, and so does the end of a change
            into the lane. Aborted attempts and lane changes without a vehicle ahead are no drifts.
        num_drifts: Number of drifts; 255 stands for 255 or more, the largest uint8.
        began_before_recording: Frame `first` if the attempt was under way when the recording began,
            a frame number like all events. The true attempt was then earlier than `attempt`, so
            times since the attempt are unknown. `NEVER` otherwise, and always in simulations.
        was_intended: Whether the simulated driver meant to overtake: its stage was one of
            `OVERTAKING_STAGES` (`model.trajectories`) in a frame from `attempt` to `line_crossed`
            or `abort_end`, whichever is first. False without an attempt. Only for analysis: no
            event depends on it. Recordings have no stages; their value is meaningless, and null in
            tables.
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
        """Whether the ego began to overtake, shape (simulation,)."""
        return self.attempt != NEVER

    @property
    def lost_control(self) -> Mask:
        """Whether the ego left the lanes or spun, at any time, without a collision.

        Shape (simulation,). The reason of the outcome is then `DEPARTED` or `SPUN`.
        """
        out_of_control = (self.road_departure != NEVER) | (self.spin != NEVER)
        return out_of_control & (self.collision == NEVER)

    @property
    def is_completed(self) -> Mask:
        """Whether the outcome is `Outcome.COMPLETED`: overtaken, and no accident at any time.

        Shape (simulation,).
        """
        return (self.return_end != NEVER) & (self.collision == NEVER) & ~self.lost_control
