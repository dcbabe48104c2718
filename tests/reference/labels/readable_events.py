"""The events of one simulation, as `docs/explanation/events.md` defines them.

`events.rs` of `crates/overtaking-labels` computes the same faster.
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

    from tests.reference.labels.readable_signals import One, Row

Frame = int | None
LEAST_SPEED = np.float32(0.1)
"""Keeps time gaps finite [m/s]."""


def first(frames: Iterable[int], holds: Callable[[int], Any]) -> Frame:
    """The first of some frames at which something holds, None if it never does."""
    return next((frame for frame in frames if holds(frame)), None)


def first_change(num_frames: int, holds: Callable[[int], Any]) -> Frame:
    """The first frame in which a condition holds after a frame in which it did not hold."""
    before = first(range(num_frames), lambda t: not holds(t))
    return None if before is None else first(range(before, num_frames), holds)


def earlier(*frames: Frame) -> Frame:
    """The first of several events, None if none of them happened."""
    return min((frame for frame in frames if frame is not None), default=None)


class Drive:
    """One simulation up to an accident, and the small questions to it."""

    def __init__(self, one: One, seen: dict[str, Row]) -> None:
        """Find where the drive ends."""
        self.one, self.seen, self.limits = one, seen, event_thresholds(one.run)
        self.lane, self.lateral = one.lane[0], seen["lateral_position"]
        hit = one.run.collided_with[one.number]
        self.collision = first(range(one.frames), lambda t: hit[t] != NO_VEHICLE)
        self.departure = first_change(one.frames, lambda t: self.lane[t] >= one.num_lanes)
        self.spin = first_change(one.frames, self.is_across)
        accident = earlier(self.collision, self.departure, self.spin)
        self.end = one.frames if accident is None else accident
        self.partner = NO_VEHICLE if self.collision is None else hit[self.collision]
        self.out = self.frames_out()

    def is_across(self, t: int) -> bool:
        """Whether the ego stands so far across the road that no driver brings it back."""
        half_turn = round(1e4 * math.pi)
        heading = int(self.one.run.states.heading[self.one.number, 0, t])
        turned = heading - round(1e4 * float(self.one.road.heading))
        angle = (turned + half_turn) % (2 * half_turn) - half_turn
        return abs(angle) > round(1e4 * float(constant("model.departure.spin_angle")))

    def border(self, number: int) -> np.float32:
        """A lane border from the right to the left; the last one for what is beyond [m]."""
        borders = lane_borders(self.one.road)
        return borders[min(number, len(borders) - 1)]

    def left_line(self, lane: int) -> np.float32:
        """Left border of a lane [m]."""
        return self.border(lane + 1)

    def frames_out(self) -> list[bool]:
        """Where a corner is over the left line of a lane in which the whole left side has been.

        It has been there if it was for half a second since the centre came, or from the first
        frame on; a recording may also begin while the ego leaves its lane to the left.
        """
        out, inside, been, from_start = [], 0, False, True
        for t in range(self.one.frames):
            if t == 0 or self.lane[t] != self.lane[t - 1]:
                inside, from_start = 0, t == 0
                been = t == 0 and self.seen["lateral_speed"][0] > self.limits["min_speed"]
            line = self.left_line(self.lane[t]) + self.limits["over_line"]
            is_over = self.seen["left_edge"][t] > line
            inside, from_start = 0 if is_over else inside + 1, from_start and not is_over
            been = been or inside >= self.limits["min_frames"] or from_start
            out.append(bool(is_over and been))
        return out

    def leader(self, t: int) -> int | None:
        """Who is ahead in the ego's lane."""
        slot = int(self.seen["neighbour_slot"][NeighbourRole.LEADER, t])
        return None if slot == NO_VEHICLE else slot

    def lately_ahead(self, t: int) -> int | None:
        """The leader, or the last one of the seconds before in this lane that is still recorded."""
        for before in range(t, max(t - self.limits["window"], 0) - 1, -1):
            if self.lane[before] != self.lane[t]:
                return None
            slot = self.leader(before)
            if slot is not None:
                return slot if self.one.recorded[slot][t] else None
        return None

    def followed(self, t: int) -> int | None:
        """The leader, if the ego is close behind it."""
        slot = self.leader(t)
        if slot is None:
            return None
        gap = self.one.gap(slot, t) / np.maximum(self.seen["speed"][t], LEAST_SPEED)
        return slot if gap < self.limits["follow_time_gap"] else None

    def movements(self, moves: Callable[[int], Any]) -> list[tuple[int, int]]:
        """First and last frame of each unbroken run of frames in which the ego moves."""
        found: list[tuple[int, int]] = []
        for t in range(self.end):
            if not moves(t):
                continue
            if found and found[-1][1] == t - 1:
                found[-1] = found[-1][0], t
            else:
                found.append((t, t))
        return found

    def to_the_left(self) -> list[tuple[int, int]]:
        """Movements to the left; however slow where a corner is over the line."""
        speed, least = self.seen["lateral_speed"], self.limits["min_speed"]
        return self.movements(lambda t: speed[t] > least or (speed[t] > 0 and self.out[t]))

    def is_wide(self, begin: int, end: int, sign: float) -> bool:
        """Whether a movement lasts half a second and leads half a metre away from the median."""
        window = range(begin - self.limits["window"], begin + 1)
        # Before the recording it was where it was at first.
        median = np.median([self.lateral[max(t, 0)] for t in window]).astype(np.float32)
        shift = np.float32(sign) * (self.lateral[end] - median)
        long_enough = end - begin + 1 >= self.limits["min_frames"]
        return bool(long_enough and shift >= self.limits["min_shift"])

    def is_fast(self, begin: int, end: int) -> bool:
        """Whether the ego advances within a second by more than gusts and wandering move it."""
        least = self.limits["min_advance"][self.one.number]
        second = self.limits["advance"]
        ahead = [
            self.lateral[min(t + second, end)] - self.lateral[t] for t in range(begin, end + 1)
        ]
        return max(ahead) >= least

    def undone(self, begin: int, until: int) -> Frame:
        """Where a movement is undone: back within 0.25 m after having been 0.5 m away."""

        def shift(t: int) -> np.float32:
            return self.lateral[t] - self.lateral[begin]

        moved = first(range(begin, until), lambda t: shift(t) >= self.limits["min_shift"])
        if moved is None:
            return None
        return first(range(moved, until), lambda t: shift(t) <= self.limits["settled_shift"])

    def comes_to(self, begin: int, end: int) -> str:
        """What a movement to the left is: `leaves` the lane, `returns` into it, or `nothing`."""
        if self.lane[begin] >= self.limits["lanes_with_left"]:
            return "nothing"
        if any(self.out[begin : end + 1]):
            return "leaves"
        if not self.is_fast(begin, end):
            return "nothing"
        until = min(end + self.limits["follow_up"] + 1, self.end)
        crossed = first(range(begin, until), lambda t: self.out[t])
        undone = self.undone(begin, until)
        if crossed is None and undone is None:
            return "nothing"
        return (
            "leaves" if undone is None or (crossed is not None and crossed <= undone) else "returns"
        )


def find_events(one: One, seen: dict[str, Row]) -> dict[str, int]:
    """The events of the attempt that decides, by the names of `Events`; -1 did not happen."""
    drive = Drive(one, seen)
    last_attempt: dict[str, Any] | None = None
    num_attempts, drifts, after = 0, [], 0
    for begin, end in drive.to_the_left():
        if after is None or begin < after:
            continue  # Part of an attempt.
        what, target = drive.comes_to(begin, end), drive.lately_ahead(begin)
        if what != "nothing" and target is not None:
            last_attempt = _attempt(drive, target, begin)
            num_attempts, after = num_attempts + 1, last_attempt["abort_end"]
        elif what != "leaves" and (
            any(drive.out[begin : end + 1]) or drive.is_wide(begin, end, 1.0)
        ):
            drifts.append(begin)  # To leave a lane with nobody ahead is neither.
    last = one.frames - 1
    found = last_attempt or {"target_slot": _prospect(drive), "original_lane": one.lane[0][0]}
    until = found.get("attempt", last)
    found["following_begin"] = (
        first(range(until + 1), lambda t: drive.followed(t) == found["target_slot"]) or 0
    )
    found["num_passed"] = _num_passed(one, found, last) if last_attempt else 0
    begun = found.get("attempt") == 0 and one.run.is_excerpt
    found |= {
        "first": 0,
        "last": last,
        "num_attempts": num_attempts,
        "collision": drive.collision,
        "road_departure": drive.departure,
        "spin": drive.spin,
        "collision_slot": int(drive.partner),
        "was_struck": _struck(drive),
        "drift": drifts[0] if drifts else None,
        "num_drifts": min(len(drifts), 255),
        "began_before_recording": 0 if begun else None,
        "was_intended": _intended(one, found),
    }
    names = ("attempt", "line_crossed", "overlap_begin", "overlap_end", "return_begin")
    found = dict.fromkeys((*names, "return_end", "abort", "abort_end")) | found
    found["target_slot"] = int(NO_VEHICLE) if found["target_slot"] is None else found["target_slot"]
    return {name: int(NEVER if value is None else value) for name, value in found.items()}


class Beside:
    """The ego seen from its target and from the lane in which its attempt began."""

    def __init__(self, drive: Drive, target: int, begun: int) -> None:
        """Look from a vehicle, at an attempt that began at a frame."""
        self.drive, self.one, self.target = drive, drive.one, target
        self.right, self.left = drive.border(drive.lane[begun]), drive.left_line(drive.lane[begun])

    def is_there(self, t: int) -> bool:
        """Whether the target was recorded."""
        return self.one.recorded[self.target][t]

    def lead(self, t: int) -> np.float32:
        """Centre of the ego minus that of the target [m]."""
        return np.float32(self.one.s[0][t] - self.one.s[self.target][t]) * np.float32(1e-3)

    def overlaps(self, t: int) -> bool:
        """Whether the two are alongside."""
        return bool(self.is_there(t) and np.abs(self.lead(t)) - self.one.halves(self.target) < 0)

    def is_past(self, t: int) -> bool:
        """Whether the ego is wholly ahead."""
        return bool(self.is_there(t) and self.lead(t) > 0 and not self.overlaps(t))

    def is_behind(self, t: int) -> bool:
        """Whether the centre of the ego is behind."""
        return bool(self.is_there(t) and self.lead(t) < 0)

    def is_over(self, t: int) -> bool:
        """Whether a corner of the ego is over the line on its left."""
        return bool(self.drive.seen["left_edge"][t] > self.left)

    def is_home(self, t: int) -> bool:
        """Whether its whole body is in the lane in which it began."""
        return bool(self.drive.seen["right_edge"][t] >= self.right and not self.is_over(t))


def since(begin: Frame, end: int) -> range:
    """The frames from an event on; none where it did not happen."""
    return range(end if begin is None else begin, end)


def before(frame: Frame, limit: Frame) -> Frame:
    """An event, if it happened no later than another, or there is no other."""
    return None if frame is not None and limit is not None and frame > limit else frame


def _attempt(drive: Drive, target: int, begun: int) -> dict[str, Any]:
    """The phases of the attempt that begins at a frame."""
    ego = Beside(drive, target, begun)
    crossed = first(range(begun, drive.end), ego.is_over)
    undone = drive.undone(begun, drive.end)
    undone = undone if crossed is None or undone is None or undone < crossed else None
    end = drive.end if undone is None else undone
    overlap_begin = first(range(begun, end), ego.overlaps)
    overlap_end = first(since(overlap_begin, end), ego.is_past)
    out_and_past = None if None in (crossed, overlap_end) else max(crossed, overlap_end)  # type: ignore[type-var]
    return_end = first(since(out_and_past, end), lambda t: ego.is_home(t) and ego.is_past(t))
    behind = first(since(crossed, end), lambda t: ego.is_home(t) and ego.is_behind(t))
    back = earlier(undone, before(behind, return_end))
    return_end = return_end if back is None else None
    turned = _turning(drive, begun, earlier(return_end, back))
    gave_up = back is not None or overlap_end is None
    return {
        "target_slot": target,
        "original_lane": drive.lane[begun],
        "attempt": begun,
        "line_crossed": before(crossed, back),
        "overlap_begin": before(overlap_begin, back),
        "overlap_end": before(overlap_end, back),
        "return_begin": None if gave_up else turned,
        "return_end": return_end,
        "abort": turned if gave_up else None,
        "abort_end": back,
    }


def _turning(drive: Drive, begun: int, end: Frame) -> Frame:
    """Where the movement back begins, after the ego was farthest to the left."""
    until = drive.end if end is None else min(end + 1, drive.end)
    farthest = max(range(begun, until), key=lambda t: drive.lateral[t])
    least = np.float32(drive.limits["min_speed"])
    for begin, last in drive.movements(lambda t: drive.seen["lateral_speed"][t] < -least):
        if farthest <= begin < until and drive.is_wide(begin, last, -1.0):
            return begin
    # A short way back can be too short to be a movement of its own.
    return None if end is None else farthest


def _intended(one: One, found: dict[str, Any]) -> bool:
    """Whether the driver was overtaking at any time between the attempt and the line or back."""
    if "attempt" not in found:
        return False
    end = earlier(found["line_crossed"], found["abort_end"])
    until = one.frames - 1 if end is None else end
    overtaking = {"PULL_OUT", "PASS", "RETURN", "ABORT"}
    return any(
        Stage(one.run.stage[one.number, t]).name in overtaking
        for t in range(found["attempt"], until + 1)
    )


def _prospect(drive: Drive) -> int | None:
    """Whom an ego that attempts nothing might have overtaken."""
    for who in (drive.followed, drive.leader):
        frame = first(range(drive.one.frames), lambda t, who=who: who(t) is not None)
        if frame is not None:
            return who(frame)
    return None


def _num_passed(one: One, found: dict[str, Any], last: int) -> int:
    """Vehicles that were ahead at the attempt and are behind at the end of the overtake."""
    begin = found["attempt"]
    end = last if found["return_end"] is None else found["return_end"]
    return sum(
        one.recorded[slot][begin]
        and one.recorded[slot][end]
        and one.s[0][begin] < one.s[slot][begin]
        and one.s[0][end] > one.s[slot][end]
        for slot in range(1, one.slots)
    )


def _struck(drive: Drive) -> bool:
    """Whether the other one ran into the ego, in the last frame before the contact.

    Apart along the road the one behind runs into the one ahead; side by side, the one that moves
    towards the other faster does.
    """
    if drive.collision is None:
        return False
    one, t, slot = drive.one, max(drive.collision - 1, 0), int(drive.partner)
    (across, reach), (own, own_reach) = one.across(slot), one.across(0)
    gap = one.gap(slot, t)
    aside = np.abs(across[t] - own[t]) - (own_reach[t] + reach[t])
    if gap < 0 and aside > gap:
        sign = 1 if own[t] > across[t] else -1
        towards = -sign * drive.seen["lateral_speed"][t]
        return bool(sign * one.lateral_speed(slot)[t] > towards)
    return one.s[0][t] > one.s[slot][t]
