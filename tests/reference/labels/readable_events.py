"""The events of one simulation, as `docs/explanation/events.md` defines them.

`events.rs` of `crates/overtaking-labels` computes the same events faster.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.knowledge.toml_reader import constant
from overtaking.labels.event_detection import event_thresholds
from overtaking.labels.snapshots import lane_borders
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.overtake_events import NEVER
from overtaking.model.trajectories import NO_VEHICLE, Stage

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from tests.reference.labels.readable_signals import SignalArray, SingleRun

Frame = int | None
"""A frame, or None for an event that does not happen."""

MIN_SPEED = np.float32(0.1)
"""Smallest speed in a time gap, which keeps it finite [m/s]."""


def first_frame(frames: Iterable[int], condition: Callable[[int], Any]) -> Frame:
    """The first of some frames in which a condition holds; None if it never holds."""
    return next((frame for frame in frames if condition(frame)), None)


def first_change(num_frames: int, condition: Callable[[int], Any]) -> Frame:
    """The first frame in which a condition holds after a frame in which it did not hold."""
    begin = first_frame(range(num_frames), lambda t: not condition(t))
    return None if begin is None else first_frame(range(begin, num_frames), condition)


def earliest(*frames: Frame) -> Frame:
    """The first of several events; None if no event happens."""
    return min((frame for frame in frames if frame is not None), default=None)


class EgoDrive:
    """The ego of one simulation up to its first accident.

    Attributes:
        run: The simulation.
        signals: Its signals.
        thresholds: Thresholds of the events.
        lane: Lane of the ego in each frame.
        lateral_position: Position of the ego to the left in each frame [m].
        collision: Frame of the first contact.
        departure: Frame in which the ego leaves the lanes.
        spin: Frame in which the ego comes to stand across the road.
        end: Number of frames before the first accident.
        partner: Slot of the vehicle that the ego touches, or `NO_VEHICLE`.
        is_out: For each frame, whether the ego is out of its lane on the left.
    """

    def __init__(self, run: SingleRun, signals: dict[str, SignalArray]) -> None:
        """Find the end of the drive, and the frames out of the lane."""
        self.run, self.signals = run, signals
        self.thresholds = event_thresholds(run.trajectories)
        self.lane, self.lateral_position = run.lane[0], signals["lateral_position"]
        partner = run.trajectories.collided_with[run.row]
        self.collision = first_frame(range(run.num_frames), lambda t: partner[t] != NO_VEHICLE)
        self.departure = first_change(run.num_frames, lambda t: self.lane[t] >= run.num_lanes)
        self.spin = first_change(run.num_frames, self.is_across)
        accident = earliest(self.collision, self.departure, self.spin)
        self.end = run.num_frames if accident is None else accident
        self.partner = NO_VEHICLE if self.collision is None else partner[self.collision]
        self.is_out = self._frames_out_of_lane()

    def is_across(self, t: int) -> bool:
        """Whether the ego stands so far across the road that no driver recovers."""
        half_turn = round(1e4 * math.pi)
        heading = int(self.run.trajectories.states.heading[self.run.row, 0, t])
        difference = heading - round(1e4 * float(self.run.road.heading))
        angle = (difference + half_turn) % (2 * half_turn) - half_turn
        return abs(angle) > round(1e4 * float(constant("model.departure.spin_angle")))

    def border(self, index: int) -> np.float32:
        """A lane border, counted from the right; the last one beyond the last lane [m]."""
        borders = lane_borders(self.run.road)
        return borders[min(index, len(borders) - 1)]

    def left_border(self, lane: int) -> np.float32:
        """Left border of a lane [m]."""
        return self.border(lane + 1)

    def _frames_out_of_lane(self) -> list[bool]:
        """Frames with a corner over the left border of a lane in which the left side has been.

        The left side counts as having been inside after half a second since the centre came into
        the lane, or if it is inside from the first frame on. A recording may also begin while the
        ego leaves its lane to the left.
        """
        is_out: list[bool] = []
        num_inside, has_been_inside, is_inside_from_start = 0, False, True
        for t in range(self.run.num_frames):
            if t == 0 or self.lane[t] != self.lane[t - 1]:
                num_inside, is_inside_from_start = 0, t == 0
                is_leaving = self.signals["lateral_speed"][0] > self.thresholds["min_speed"]
                has_been_inside = t == 0 and is_leaving
            border = self.left_border(self.lane[t]) + self.thresholds["over_line"]
            is_over = self.signals["left_edge"][t] > border
            num_inside = 0 if is_over else num_inside + 1
            is_inside_from_start = is_inside_from_start and not is_over
            is_long_inside = num_inside >= self.thresholds["min_frames"]
            has_been_inside = has_been_inside or is_long_inside or is_inside_from_start
            is_out.append(bool(is_over and has_been_inside))
        return is_out

    def leader(self, t: int) -> int | None:
        """Slot of the leader."""
        slot = int(self.signals["neighbour_slot"][NeighbourRole.LEADER, t])
        return None if slot == NO_VEHICLE else slot

    def recent_leader(self, t: int) -> int | None:
        """The leader, or the last one of the seconds before in this lane that is still recorded."""
        for frame in range(t, max(t - self.thresholds["window"], 0) - 1, -1):
            if self.lane[frame] != self.lane[t]:
                return None
            slot = self.leader(frame)
            if slot is not None:
                return slot if self.run.is_recorded[slot][t] else None
        return None

    def followed_leader(self, t: int) -> int | None:
        """The leader, if the ego is close behind it."""
        slot = self.leader(t)
        if slot is None:
            return None
        time_gap = self.run.gap(slot, t) / np.maximum(self.signals["speed"][t], MIN_SPEED)
        return slot if time_gap < self.thresholds["follow_time_gap"] else None

    def movements(self, is_moving: Callable[[int], Any]) -> list[tuple[int, int]]:
        """First and last frame of each unbroken run of frames in which the ego moves."""
        spans: list[tuple[int, int]] = []
        for t in range(self.end):
            if not is_moving(t):
                continue
            if spans and spans[-1][1] == t - 1:
                spans[-1] = spans[-1][0], t
            else:
                spans.append((t, t))
        return spans

    def movements_to_the_left(self) -> list[tuple[int, int]]:
        """Movements to the left; at any speed to the left while a corner is over the border."""
        speed, min_speed = self.signals["lateral_speed"], self.thresholds["min_speed"]
        return self.movements(lambda t: speed[t] > min_speed or (speed[t] > 0 and self.is_out[t]))

    def is_wide(self, begin: int, end: int, sign: float) -> bool:
        """Whether a movement lasts half a second and leads half a metre away from the median."""
        window = range(begin - self.thresholds["window"], begin + 1)
        # Frames before the recording count with the first position.
        median = np.median([self.lateral_position[max(t, 0)] for t in window]).astype(np.float32)
        shift = np.float32(sign) * (self.lateral_position[end] - median)
        is_long = end - begin + 1 >= self.thresholds["min_frames"]
        return bool(is_long and shift >= self.thresholds["min_shift"])

    def is_fast(self, begin: int, end: int) -> bool:
        """Whether the ego advances in a second by more than gusts and wandering move it."""
        min_advance = self.thresholds["min_advance"][self.run.row]
        second = self.thresholds["advance"]
        position = self.lateral_position
        advances = [position[min(t + second, end)] - position[t] for t in range(begin, end + 1)]
        return max(advances) >= min_advance

    def undoing_frame(self, begin: int, until: int) -> Frame:
        """Frame in which a movement is undone: 0.25 m from its begin after 0.5 m or more."""

        def shift(t: int) -> np.float32:
            return self.lateral_position[t] - self.lateral_position[begin]

        away = first_frame(range(begin, until), lambda t: shift(t) >= self.thresholds["min_shift"])
        if away is None:
            return None
        settled_shift = self.thresholds["settled_shift"]
        return first_frame(range(away, until), lambda t: shift(t) <= settled_shift)

    def kind_of_movement(self, begin: int, end: int) -> str:
        """Kind of a movement to the left: `leaves` the lane, `returns` into it, or `none`."""
        if self.lane[begin] >= self.thresholds["lanes_with_left"]:
            return "none"
        if any(self.is_out[begin : end + 1]):
            return "leaves"
        if not self.is_fast(begin, end):
            return "none"
        until = min(end + self.thresholds["follow_up"] + 1, self.end)
        crossing = first_frame(range(begin, until), lambda t: self.is_out[t])
        undoing = self.undoing_frame(begin, until)
        if crossing is None and undoing is None:
            return "none"
        is_crossing_first = undoing is None or (crossing is not None and crossing <= undoing)
        return "leaves" if is_crossing_first else "returns"


def find_events(run: SingleRun, signals: dict[str, SignalArray]) -> dict[str, int]:
    """The events of the attempt that decides, by field of `OvertakeEvents`; `NEVER` without one."""
    drive = EgoDrive(run, signals)
    last_attempt: dict[str, Any] | None = None
    num_attempts, drifts, next_begin = 0, [], 0
    for begin, end in drive.movements_to_the_left():
        if next_begin is None or begin < next_begin:
            continue  # The movement is part of an attempt.
        kind, target = drive.kind_of_movement(begin, end), drive.recent_leader(begin)
        if kind != "none" and target is not None:
            last_attempt = _attempt(drive, target, begin)
            num_attempts, next_begin = num_attempts + 1, last_attempt["abort_end"]
        elif kind != "leaves" and (
            any(drive.is_out[begin : end + 1]) or drive.is_wide(begin, end, 1.0)
        ):
            drifts.append(begin)  # Leaving a lane without a leader is no attempt and no drift.
    last = run.num_frames - 1
    events = last_attempt or {
        "target_slot": _target_without_attempt(drive),
        "original_lane": run.lane[0][0],
    }
    until = events.get("attempt", last)
    events["following_begin"] = (
        first_frame(range(until + 1), lambda t: drive.followed_leader(t) == events["target_slot"])
        or 0
    )
    events["num_passed"] = _num_passed(run, events, last) if last_attempt else 0
    is_under_way = events.get("attempt") == 0 and run.trajectories.is_excerpt
    events |= {
        "first": 0,
        "last": last,
        "num_attempts": num_attempts,
        "collision": drive.collision,
        "road_departure": drive.departure,
        "spin": drive.spin,
        "collision_slot": int(drive.partner),
        "was_struck": _was_struck(drive),
        "drift": drifts[0] if drifts else None,
        "num_drifts": min(len(drifts), 255),
        "began_before_recording": 0 if is_under_way else None,
        "was_intended": _was_intended(run, events),
    }
    names = ("attempt", "line_crossed", "overlap_begin", "overlap_end", "return_begin")
    events = dict.fromkeys((*names, "return_end", "abort", "abort_end")) | events
    if events["target_slot"] is None:
        events["target_slot"] = int(NO_VEHICLE)
    return {name: int(NEVER if value is None else value) for name, value in events.items()}


class TargetView:
    """The ego seen from its target and from the lane in which its attempt began.

    Attributes:
        drive: The drive of the ego.
        run: The simulation.
        target: Slot of the target.
        right_border: Right border of the lane in which the attempt began [m].
        left_border: Left border of that lane [m].
    """

    def __init__(self, drive: EgoDrive, target: int, attempt: int) -> None:
        """View the ego from a vehicle, for the attempt that begins in a frame."""
        self.drive, self.run, self.target = drive, drive.run, target
        self.right_border = drive.border(drive.lane[attempt])
        self.left_border = drive.left_border(drive.lane[attempt])

    def is_recorded(self, t: int) -> bool:
        """Whether the target is recorded."""
        return self.run.is_recorded[self.target][t]

    def ego_lead(self, t: int) -> np.float32:
        """Station of the ego minus station of the target [m]."""
        return np.float32(self.run.s[0][t] - self.run.s[self.target][t]) * np.float32(1e-3)

    def overlaps(self, t: int) -> bool:
        """Whether the two are alongside."""
        gap = np.abs(self.ego_lead(t)) - self.run.half_length_sum(self.target)
        return bool(self.is_recorded(t) and gap < 0)

    def is_past(self, t: int) -> bool:
        """Whether the whole ego is ahead."""
        return bool(self.is_recorded(t) and self.ego_lead(t) > 0 and not self.overlaps(t))

    def is_behind(self, t: int) -> bool:
        """Whether the centre of the ego is behind."""
        return bool(self.is_recorded(t) and self.ego_lead(t) < 0)

    def is_over_line(self, t: int) -> bool:
        """Whether a corner of the ego is over the left border of its lane."""
        return bool(self.drive.signals["left_edge"][t] > self.left_border)

    def is_back_in_lane(self, t: int) -> bool:
        """Whether the whole ego is in the lane in which it began."""
        is_inside_right = self.drive.signals["right_edge"][t] >= self.right_border
        return bool(is_inside_right and not self.is_over_line(t))


def frames_from(begin: Frame, end: int) -> range:
    """The frames from an event on; no frame if it does not happen."""
    return range(end if begin is None else begin, end)


def unless_later(frame: Frame, limit: Frame) -> Frame:
    """An event, if it is not later than another one, or there is no other one."""
    return None if frame is not None and limit is not None and frame > limit else frame


def _attempt(drive: EgoDrive, target: int, attempt: int) -> dict[str, Any]:
    """The phases of the attempt that begins in a frame."""
    ego = TargetView(drive, target, attempt)
    crossing = first_frame(range(attempt, drive.end), ego.is_over_line)
    undoing = drive.undoing_frame(attempt, drive.end)
    if crossing is not None and undoing is not None and undoing >= crossing:
        undoing = None
    end = drive.end if undoing is None else undoing
    overlap_begin = first_frame(range(attempt, end), ego.overlaps)
    overlap_end = first_frame(frames_from(overlap_begin, end), ego.is_past)
    out_and_past = None
    if crossing is not None and overlap_end is not None:
        out_and_past = max(crossing, overlap_end)
    return_end = first_frame(
        frames_from(out_and_past, end), lambda t: ego.is_back_in_lane(t) and ego.is_past(t)
    )
    back_behind = first_frame(
        frames_from(crossing, end), lambda t: ego.is_back_in_lane(t) and ego.is_behind(t)
    )
    abort_end = earliest(undoing, unless_later(back_behind, return_end))
    return_end = return_end if abort_end is None else None
    turning = _turning_frame(drive, attempt, earliest(return_end, abort_end))
    is_aborted = abort_end is not None or overlap_end is None
    return {
        "target_slot": target,
        "original_lane": drive.lane[attempt],
        "attempt": attempt,
        "line_crossed": unless_later(crossing, abort_end),
        "overlap_begin": unless_later(overlap_begin, abort_end),
        "overlap_end": unless_later(overlap_end, abort_end),
        "return_begin": None if is_aborted else turning,
        "return_end": return_end,
        "abort": turning if is_aborted else None,
        "abort_end": abort_end,
    }


def _turning_frame(drive: EgoDrive, attempt: int, end: Frame) -> Frame:
    """Frame in which the movement back begins, after the ego was farthest to the left."""
    until = drive.end if end is None else min(end + 1, drive.end)
    farthest = max(range(attempt, until), key=lambda t: drive.lateral_position[t])
    min_speed = np.float32(drive.thresholds["min_speed"])
    for begin, last in drive.movements(lambda t: drive.signals["lateral_speed"][t] < -min_speed):
        if farthest <= begin < until and drive.is_wide(begin, last, -1.0):
            return begin
    # The way back may be too short for a movement of its own.
    return None if end is None else farthest


def _was_intended(run: SingleRun, events: dict[str, Any]) -> bool:
    """Whether the driver was overtaking at any time between the attempt and the line or back."""
    if "attempt" not in events:
        return False
    end = earliest(events["line_crossed"], events["abort_end"])
    until = run.num_frames - 1 if end is None else end
    stages = run.trajectories.stage[run.row, events["attempt"] : until + 1]
    return any(Stage(stage).name in {"PULL_OUT", "PASS", "RETURN", "ABORT"} for stage in stages)


def _target_without_attempt(drive: EgoDrive) -> int | None:
    """The vehicle that an ego without an attempt could have overtaken."""
    for leader_at in (drive.followed_leader, drive.leader):
        for t in range(drive.run.num_frames):
            slot = leader_at(t)
            if slot is not None:
                return slot
    return None


def _num_passed(run: SingleRun, events: dict[str, Any], last: int) -> int:
    """Vehicles that are ahead at the attempt and behind at the end of the overtake."""
    begin = events["attempt"]
    end = last if events["return_end"] is None else events["return_end"]
    return sum(
        run.is_recorded[slot][begin]
        and run.is_recorded[slot][end]
        and run.s[0][begin] < run.s[slot][begin]
        and run.s[0][end] > run.s[slot][end]
        for slot in range(1, run.num_slots)
    )


def _was_struck(drive: EgoDrive) -> bool:
    """Whether the other vehicle ran into the ego, by the last frame before the contact.

    If the two are apart along the road, the one behind runs into the one ahead. If they are side by
    side, the one that moves towards the other faster does.
    """
    if drive.collision is None:
        return False
    run, t, slot = drive.run, max(drive.collision - 1, 0), int(drive.partner)
    position, reach = run.lateral_extent(slot)
    ego_position, ego_reach = run.lateral_extent(0)
    gap = run.gap(slot, t)
    lateral_gap = np.abs(position[t] - ego_position[t]) - (ego_reach[t] + reach[t])
    if gap < 0 and lateral_gap > gap:
        sign = 1 if ego_position[t] > position[t] else -1
        ego_approach = -sign * drive.signals["lateral_speed"][t]
        return bool(sign * run.lateral_speed(slot)[t] > ego_approach)
    return run.s[0][t] > run.s[slot][t]
