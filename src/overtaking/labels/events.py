"""The events of each simulation, found in what was recorded; never in what the ego meant to do.

An attempt begins with a movement to the left behind a vehicle ahead, and ends by the return in
front of it, by the return behind it (an abort), or not at all. After an abort the ego may begin
again; its last attempt is the one that counts.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask, as_f32, maximum
from overtaking.labels.accidents import Accidents, accidents
from overtaking.labels.frames import at, earliest, first_true, only, since, until
from overtaking.labels.movements import Movements, movements, num_frames_of
from overtaking.model.events import NEVER, Events
from overtaking.model.road import Road
from overtaking.model.signals import Around, Signals
from overtaking.model.trajectory import NO_VEHICLE, Trajectories
from overtaking.physics.constants import known
from overtaking.signals.reference import side_of
from overtaking.signals.target import alongside

I32 = NDArray[np.int32]
U8 = NDArray[np.uint8]

_LEAST_SPEED = np.float32(0.1)
"""Keeps time gaps finite [m/s]."""


def find_events(trajectories: Trajectories, seen: Signals) -> Events:
    """The events of a batch.

    Args:
        trajectories: The recording.
        seen: Its signals.

    Returns:
        Events of the attempt that decides each simulation, see `model.events.Events`.
    """
    ended = accidents(trajectories, seen)
    watched = _watched(trajectories, seen, ended)
    attempts = _empty(len(seen.valid))
    begun = _first_attempt(watched, np.zeros(len(seen.valid), np.int32))
    while (begun != NEVER).any():
        found = _attempt(watched, begun)
        attempts = _replaced(attempts, found, begun != NEVER)
        begun = only(_first_attempt(watched, np.maximum(found.back, 0)), found.back != NEVER)
    return _events(watched, ended, attempts)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Watched:
    """What attempts are looked for in.

    Attributes:
        trajectories: The recording.
        seen: Its signals.
        valid: Frames before any accident.
        treads: Frames with a corner of the ego over the left line of its lane.
        lefts: Movements to the left.
        rights: Where movements to the right begin that were meant.
        lately_ahead: The leader, or who was it until a moment ago.
        borders: Lane borders from the right to the left [m].
    """

    trajectories: Trajectories
    seen: Signals
    valid: Mask
    treads: Mask
    lefts: Movements
    rights: Mask
    lately_ahead: U8
    borders: F32


def _watched(trajectories: Trajectories, seen: Signals, ended: Accidents) -> _Watched:
    valid = seen.valid & until(earliest(ended.collision, ended.road_departure), seen.num_frames)
    borders = _borders(trajectories.road)
    treads = valid & (seen.left_reach > _left_line(borders, seen.lane))
    speed, least = seen.lateral_speed, known("labels.motion.least_speed")
    # However slowly: who goes over the line leaves the lane.
    to_left = valid & ((speed > least) | (treads & (speed > 0)))
    rights = movements(seen, valid & (speed < -least), towards_left=False)
    return _Watched(
        trajectories=trajectories,
        seen=seen,
        valid=valid,
        treads=treads,
        lefts=movements(seen, to_left, towards_left=True),
        rights=rights.as_mask(valid.shape),
        lately_ahead=_lately_ahead(seen),
        borders=borders,
    )


def _left_line(borders: F32, lane: U8) -> F32:
    """Left border of lanes; the last border for what is beyond the lanes."""
    return borders[np.minimum(lane.astype(np.intp) + 1, len(borders) - 1)]


def _lately_ahead(seen: Signals) -> U8:
    """Slot of the leader, or of the last one if that was just now; shape (simulation, time).

    A leader that makes room to the right while the ego pulls out to the left is overtaken no less.
    """
    leader, has = seen.vehicle[:, Around.LEADER], seen.has(Around.LEADER)
    frame = np.arange(seen.num_frames, dtype=np.int32)
    latest = np.maximum.accumulate(np.where(has, frame, NEVER), axis=1)
    lately = (latest != NEVER) & (frame - latest <= num_frames_of(seen, "motion.median_window"))
    found = np.take_along_axis(leader, np.maximum(latest, 0), axis=1)
    return np.where(lately, found, NO_VEHICLE)


def _borders(road: Road) -> F32:
    """Lane borders from the right to the left, shape (lane + 1,) [m]."""
    return side_of(road) * as_f32(road.boundaries)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Attempts:
    """One attempt of each simulation, as in `Events`."""

    target: U8
    original_lane: U8
    attempt: I32
    line_crossed: I32
    overlap_begin: I32
    overlap_end: I32
    return_begin: I32
    return_end: I32
    abort: I32
    back: I32
    num: U8


def _empty(num: int) -> _Attempts:
    never = np.full(num, NEVER)
    times = {
        field.name: never
        for field in dataclasses.fields(_Attempts)
        if field.name not in ("target", "original_lane", "num")
    }
    zero = np.zeros(num, np.uint8)
    return _Attempts(target=np.full(num, NO_VEHICLE), original_lane=zero, num=zero, **times)


def _replaced(before: _Attempts, found: _Attempts, where: Mask) -> _Attempts:
    """The later attempts in place of the earlier ones."""
    names = [field.name for field in dataclasses.fields(_Attempts) if field.name != "num"]
    changes = {name: np.where(where, getattr(found, name), getattr(before, name)) for name in names}
    return _Attempts(**changes, num=before.num + where.astype(np.uint8))


def _first_attempt(watched: _Watched, after: I32) -> I32:
    """Where the first movement to the left from a frame on begins that is an attempt.

    It is one if it was meant or crosses the line, and if there is somebody to overtake.
    """
    lefts = watched.lefts
    begin, end = (lefts.simulation, lefts.begin), (lefts.simulation, lefts.end)
    trodden = np.cumsum(watched.treads, axis=1, dtype=np.int32)
    crosses = (trodden[end] > trodden[begin]) | watched.treads[begin]
    ahead = watched.lately_ahead[begin] != NO_VEHICLE
    later = lefts.begin >= after[lefts.simulation]
    chosen = (lefts.meant | crosses) & ahead & later
    first = np.full(len(after), NEVER)
    # In reverse, so that the first of several movements of a simulation is written last.
    first[lefts.simulation[chosen][::-1]] = lefts.begin[chosen][::-1]
    return first


def _attempt(watched: _Watched, begun: I32) -> _Attempts:
    """The phases of the attempts that begin at `begun`, `NEVER` where there is none."""
    seen, num_frames = watched.seen, watched.seen.num_frames
    target = np.where(begun == NEVER, NO_VEHICLE, at(watched.lately_ahead, begun))
    lane = at(seen.lane, begun)
    other = alongside(watched.trajectories, target)
    during = watched.valid & since(begun, num_frames)
    crossed = first_true(during & (seen.left_reach > _left_line(watched.borders, lane)[:, None]))
    undone = _undone(seen, during, begun, crossed)
    during = during & until(undone, num_frames)
    overlap_begin = first_true(during & other.overlaps)
    is_past = other.valid & (other.lead > 0) & (other.gap >= 0)
    overlap_end = first_true(during & since(overlap_begin, num_frames) & is_past)
    home = during & since(crossed, num_frames) & _is_inside(watched, lane)
    return_end = first_true(home & since(overlap_end, num_frames) & is_past)
    behind = first_true(home & other.valid & (other.lead < 0))
    back = earliest(undone, only(behind, _not_after(behind, return_end)))
    return_end = only(return_end, back == NEVER)
    turned = _turning(watched, begun, earliest(return_end, back))
    gave_up = (back != NEVER) | (overlap_end == NEVER)
    return _Attempts(
        target=target,
        original_lane=lane,
        attempt=begun,
        line_crossed=only(crossed, _not_after(crossed, back)),
        overlap_begin=only(overlap_begin, _not_after(overlap_begin, back)),
        overlap_end=only(overlap_end, _not_after(overlap_end, back)),
        return_begin=only(turned, ~gave_up),
        return_end=return_end,
        abort=only(turned, gave_up),
        back=back,
        num=(begun != NEVER).astype(np.uint8),
    )


def _not_after(frame: I32, end: I32) -> Mask:
    """Whether something happened no later than an end, if there is one."""
    return (end == NEVER) | (frame <= end)


def _is_inside(watched: _Watched, lane: U8) -> Mask:
    """Whether the whole body is in a lane of each simulation, shape (simulation, time)."""
    seen, last = watched.seen, len(watched.borders) - 1
    right = watched.borders[np.minimum(lane, last)][:, None]
    left = _left_line(watched.borders, lane)[:, None]
    return (seen.right_reach >= right) & (seen.left_reach <= left)


def _undone(seen: Signals, during: Mask, begun: I32, crossed: I32) -> I32:
    """Where a movement is undone that never came to the line, `NEVER` if it is not."""
    shift = seen.lateral - at(seen.lateral, begun)[:, None]
    moved = first_true(during & (shift >= known("labels.motion.least_shift")))
    settled = shift <= known("labels.motion.settled_shift")
    undone = first_true(during & since(moved, seen.num_frames) & settled)
    return only(undone, (crossed == NEVER) | (undone < crossed))


def _turning(watched: _Watched, begun: I32, end: I32) -> I32:
    """Where the movement back begins, after the ego was farthest to the left."""
    seen, num_frames = watched.seen, watched.seen.num_frames
    during = watched.valid & since(begun, num_frames)
    stopped = np.where(end == NEVER, np.int32(num_frames), end + 1)
    during = during & until(stopped, num_frames)
    place = np.where(during, seen.lateral, np.float32(-np.inf))
    farthest = place.argmax(axis=1).astype(np.int32)
    meant = first_true(during & since(farthest, num_frames) & watched.rights)
    # A short way back can be too short to be a movement of its own.
    turned = np.where((meant == NEVER) & (end != NEVER), farthest, meant)
    return only(turned, begun != NEVER)


def _events(watched: _Watched, ended: Accidents, found: _Attempts) -> Events:
    """The attempts that decide, with what lies before and after them."""
    seen = watched.seen
    attempted = found.attempt != NEVER
    target = np.where(attempted, found.target, _prospect(seen))
    last = np.maximum(watched.trajectories.num_frames - 1, 0).astype(np.int32)
    return Events(
        first=np.zeros_like(last),
        last=last,
        target=target,
        original_lane=np.where(attempted, found.original_lane, seen.lane[:, 0]),
        follow=_follow(seen, target, np.where(attempted, found.attempt, last)),
        attempt=found.attempt,
        line_crossed=found.line_crossed,
        overlap_begin=found.overlap_begin,
        overlap_end=found.overlap_end,
        return_begin=found.return_begin,
        return_end=found.return_end,
        abort=found.abort,
        back=found.back,
        collision=ended.collision,
        road_departure=ended.road_departure,
        num_attempts=found.num,
        num_passed=_num_passed(watched.trajectories, found, last),
        partner=ended.partner,
        struck=ended.struck,
    )


def _follows(seen: Signals) -> Mask:
    """Whether the ego is close behind a leader, shape (simulation, time)."""
    gap = seen.gap[:, Around.LEADER]
    time_gap = gap / maximum(seen.speed, _LEAST_SPEED)
    return seen.has(Around.LEADER) & (time_gap < known("labels.phases.follow_time_gap"))


def _prospect(seen: Signals) -> U8:
    """Whom an ego that attempts nothing might have overtaken, shape (simulation,)."""
    leader = seen.vehicle[:, Around.LEADER]
    close, any_one = first_true(_follows(seen)), first_true(seen.has(Around.LEADER))
    frame = np.where(close == NEVER, any_one, close)
    return np.where(frame == NEVER, NO_VEHICLE, at(leader, frame))


def _follow(seen: Signals, target: U8, before: I32) -> I32:
    """First frame close behind the target, up to `before`; else the first frame."""
    frame = np.arange(seen.num_frames, dtype=np.int32)
    close = _follows(seen) & (seen.vehicle[:, Around.LEADER] == target[:, None])
    return np.maximum(first_true(close & (frame <= before[:, None])), 0)


def _num_passed(trajectories: Trajectories, found: _Attempts, last: I32) -> U8:
    """Vehicles ahead at the attempt and behind at the end of the overtake."""
    s = trajectories.states.s
    row = np.arange(len(last))[:, None]
    slot = np.arange(s.shape[1])[None, :]
    begin = np.maximum(found.attempt, 0)[:, None]
    end = np.where(found.return_end == NEVER, last, found.return_end)[:, None]
    lead_before = s[row, 0, begin] - s[row, slot, begin]
    lead_after = s[row, 0, end] - s[row, slot, end]
    there = trajectories.state_valid
    passed = there[row, slot, begin] & there[row, slot, end] & (lead_before < 0) & (lead_after > 0)
    return np.where(found.attempt == NEVER, 0, passed.sum(axis=1)).astype(np.uint8)
