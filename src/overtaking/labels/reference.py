"""The events of each simulation as a person reads them.

`crates/overtaking-core/src/events.rs` is the fast twin. Events are found in what was recorded;
never in what the ego meant to do.

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
from overtaking.labels.movements import Movements, movements, num_frames_of
from overtaking.model.batch import Batch
from overtaking.model.events import NEVER, Events
from overtaking.model.road import Road
from overtaking.model.signals import Around, Signals
from overtaking.model.trajectory import NO_VEHICLE, Trajectories
from overtaking.physics.constants import known
from overtaking.signals.frames import at, earliest, first_true, only, since, until
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
    view, lefts = _view(trajectories, seen, ended)
    attempts = _empty(len(seen.valid))
    begun = _first_attempt(view, lefts, np.zeros(len(seen.valid), np.int32))
    while (begun != NEVER).any():
        # Most of the work is done for those simulations alone in which there is something to see.
        tried = np.flatnonzero(begun != NEVER)
        found = _attempt(trajectories, view.select(tried), begun[tried])
        attempts = _replaced(attempts, found, tried)
        again = tried[found.back != NEVER]
        after = np.full(len(begun), seen.num_frames, np.int32)
        after[again] = attempts.back[again]
        begun = _first_attempt(view, lefts, after)
    return _events(trajectories, seen, ended, attempts)


@dataclass(frozen=True, slots=True, kw_only=True)
class _View(Batch):
    """What attempts are looked for in; arrays have shape (simulation, time).

    Attributes:
        simulation: Number of each simulation in the batch, shape (simulation,).
        valid: Frames before any accident.
        lane: As in `Signals`.
        lateral: As in `Signals`.
        left_reach: As in `Signals`.
        right_reach: As in `Signals`.
        treads: Frames with a corner of the ego over the left line of its lane.
        rights: Where movements to the right begin that were meant.
        lately_ahead: The leader, or who was it until a moment ago.
    """

    simulation: NDArray[np.int64]
    valid: Mask
    lane: U8
    lateral: F32
    left_reach: F32
    right_reach: F32
    treads: Mask
    rights: Mask
    lately_ahead: U8

    @property
    def num_frames(self) -> int:
        """Frames of the longest simulation."""
        return self.valid.shape[1]


def _view(trajectories: Trajectories, seen: Signals, ended: Accidents) -> tuple[_View, Movements]:
    """What attempts are looked for in, and the movements to the left that may be some."""
    valid = seen.valid & until(earliest(ended.collision, ended.road_departure), seen.num_frames)
    borders = _borders(trajectories.road)
    treads = valid & (seen.left_reach > _left_line(borders, seen.lane))
    speed, least = seen.lateral_speed, known("labels.motion.least_speed")
    # However slowly: who goes over the line leaves the lane.
    to_left = valid & ((speed > least) | (treads & (speed > 0)))
    rights = movements(seen, valid & (speed < -least), towards_left=False)
    view = _View(
        simulation=np.arange(len(valid)),
        valid=valid,
        lane=seen.lane,
        lateral=seen.lateral,
        left_reach=seen.left_reach,
        right_reach=seen.right_reach,
        treads=treads,
        rights=rights.as_mask(valid.shape),
        lately_ahead=_lately_ahead(seen),
    )
    return view, movements(seen, to_left, towards_left=True)


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


def _replaced(before: _Attempts, found: _Attempts, tried: NDArray[np.int64]) -> _Attempts:
    """The later attempts of some simulations in place of the earlier ones."""
    changes = {}
    for field in dataclasses.fields(_Attempts):
        changes[field.name] = getattr(before, field.name).copy()
        changes[field.name][tried] = getattr(found, field.name)
    changes["num"][tried] = before.num[tried] + 1
    return _Attempts(**changes)


def _first_attempt(view: _View, lefts: Movements, after: I32) -> I32:
    """Where the first movement to the left from a frame on begins that is an attempt.

    It is one if it was meant or crosses the line, and if there is somebody to overtake.
    """
    begin, end = (lefts.simulation, lefts.begin), (lefts.simulation, lefts.end)
    trodden = np.cumsum(view.treads, axis=1, dtype=np.int32)
    crosses = (trodden[end] > trodden[begin]) | view.treads[begin]
    ahead = view.lately_ahead[begin] != NO_VEHICLE
    later = lefts.begin >= after[lefts.simulation]
    chosen = (lefts.meant | crosses) & ahead & later
    first = np.full(len(after), NEVER)
    # In reverse, so that the first of several movements of a simulation is written last.
    first[lefts.simulation[chosen][::-1]] = lefts.begin[chosen][::-1]
    return first


def _attempt(trajectories: Trajectories, view: _View, begun: I32) -> _Attempts:
    """The phases of the attempts that begin at `begun`."""
    num_frames, borders = view.num_frames, _borders(trajectories.road)
    target, lane = at(view.lately_ahead, begun), at(view.lane, begun)
    other = alongside(trajectories, target, view.simulation)
    during = view.valid & since(begun, num_frames)
    crossed = first_true(during & (view.left_reach > _left_line(borders, lane)[:, None]))
    undone = _undone(view, during, begun, crossed)
    during = during & until(undone, num_frames)
    overlap_begin = first_true(during & other.overlaps)
    is_past = other.valid & (other.lead > 0) & (other.gap >= 0)
    overlap_end = first_true(during & since(overlap_begin, num_frames) & is_past)
    home = during & since(crossed, num_frames) & _is_inside(view, borders, lane)
    return_end = first_true(home & since(overlap_end, num_frames) & is_past)
    behind = first_true(home & other.valid & (other.lead < 0))
    back = earliest(undone, only(behind, _not_after(behind, return_end)))
    return_end = only(return_end, back == NEVER)
    turned = _turning(view, begun, earliest(return_end, back))
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
        num=np.ones(len(begun), np.uint8),
    )


def _not_after(frame: I32, end: I32) -> Mask:
    """Whether something happened no later than an end, if there is one."""
    return (end == NEVER) | (frame <= end)


def _is_inside(view: _View, borders: F32, lane: U8) -> Mask:
    """Whether the whole body is in a lane of each simulation, shape (simulation, time)."""
    right = borders[np.minimum(lane, len(borders) - 1)][:, None]
    left = _left_line(borders, lane)[:, None]
    return (view.right_reach >= right) & (view.left_reach <= left)


def _undone(view: _View, during: Mask, begun: I32, crossed: I32) -> I32:
    """Where a movement is undone that never came to the line, `NEVER` if it is not."""
    shift = view.lateral - at(view.lateral, begun)[:, None]
    moved = first_true(during & (shift >= known("labels.motion.least_shift")))
    settled = shift <= known("labels.motion.settled_shift")
    undone = first_true(during & since(moved, view.num_frames) & settled)
    return only(undone, (crossed == NEVER) | (undone < crossed))


def _turning(view: _View, begun: I32, end: I32) -> I32:
    """Where the movement back begins, after the ego was farthest to the left."""
    num_frames = view.num_frames
    during = view.valid & since(begun, num_frames)
    stopped = np.where(end == NEVER, np.int32(num_frames), end + 1)
    during = during & until(stopped, num_frames)
    place = np.where(during, view.lateral, np.float32(-np.inf))
    farthest = place.argmax(axis=1).astype(np.int32)
    meant = first_true(during & since(farthest, num_frames) & view.rights)
    # A short way back can be too short to be a movement of its own.
    return np.where((meant == NEVER) & (end != NEVER), farthest, meant)


def _events(
    trajectories: Trajectories, seen: Signals, ended: Accidents, found: _Attempts
) -> Events:
    """The attempts that decide, with what lies before and after them."""
    attempted = found.attempt != NEVER
    target = np.where(attempted, found.target, _prospect(seen))
    last = np.maximum(trajectories.num_frames - 1, 0).astype(np.int32)
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
        num_passed=_num_passed(trajectories, found, last),
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
