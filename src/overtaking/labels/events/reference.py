"""The events of each simulation as a person reads them.

`crates/overtaking-core/src/events.rs` is the fast twin. Events are found in what was recorded;
never in what the ego meant to do.

An attempt begins with a movement to the left behind a vehicle ahead (`attempts` says which ones),
and ends by the return in front of it, by the return behind it (an abort), or not at all. After an
abort the ego may begin again; its last attempt is the one that counts.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import Mask, maximum
from overtaking.labels.events.accidents import Accidents, accidents
from overtaking.labels.events.attempts import LeftMovements, left_movements, under_way, undone_at
from overtaking.labels.events.movements import movements
from overtaking.labels.events.view import View, borders_of, left_line, view_of
from overtaking.labels.signals.frames import at, earliest, first_true, only, since, until
from overtaking.labels.signals.target import alongside
from overtaking.model.events import NEVER, Events
from overtaking.model.road import Road
from overtaking.model.signals import Around, Signals
from overtaking.model.trajectory import NO_VEHICLE, Trajectories
from overtaking.world.constants import known

I32 = NDArray[np.int32]
U8 = NDArray[np.uint8]

_LEAST_SPEED = np.float32(0.1)
"""Keeps time gaps finite [m/s]."""

_MOST = 255
"""Drifts that are counted."""


def find_events(trajectories: Trajectories, seen: Signals) -> Events:
    """The events of a batch.

    Args:
        trajectories: The recording.
        seen: Its signals.

    Returns:
        Events of the attempt that decides each simulation, see `model.events.Events`.
    """
    ended = accidents(trajectories, seen)
    view = view_of(trajectories, seen, ended)
    lefts, rights = left_movements(view, seen), _rights(view, seen)
    attempts, trying = _empty(len(seen.valid)), np.zeros_like(seen.valid)
    begun = _first(lefts, np.zeros(len(seen.valid), np.int32))
    while (begun != NEVER).any():
        # Most of the work is done for those simulations alone in which there is something to see.
        tried = np.flatnonzero(begun != NEVER)
        found = _attempt(trajectories, view.select(tried), rights[tried], begun[tried])
        attempts = _replaced(attempts, found, tried)
        trying[tried] |= since(found.attempt, seen.num_frames) & until(found.back, seen.num_frames)
        again = tried[found.back != NEVER]
        after = np.full(len(begun), seen.num_frames, np.int32)
        after[again] = attempts.back[again]
        begun = _first(lefts, after)
    return _events(trajectories, seen, ended, attempts, _drifts(lefts, trying))


def _rights(view: View, seen: Signals) -> Mask:
    """Where wide movements to the right begin, shape (simulation, time)."""
    moving = view.valid & (seen.lateral_speed < -known("labels.motion.least_speed"))
    return movements(seen, moving, towards_left=False).as_mask(moving.shape)


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


def _first(lefts: LeftMovements, after: I32) -> I32:
    """Where the first attempt from a frame on begins, shape (simulation,)."""
    simulation, begin = lefts.all.simulation, lefts.all.begin
    return _earliest(simulation, begin, lefts.is_attempt & (begin >= after[simulation]), len(after))


def _earliest(simulation: I32, begin: I32, chosen: Mask, count: int) -> I32:
    """First frame of the first chosen movement of each simulation, `NEVER` without one."""
    first = np.full(count, NEVER)
    # In reverse, so that the first of several movements of a simulation is written last.
    first[simulation[chosen][::-1]] = begin[chosen][::-1]
    return first


@dataclass(frozen=True, slots=True, kw_only=True)
class _Drifts:
    """The drifts of each simulation, as in `Events`."""

    drift: I32
    num_drifts: U8


def _drifts(lefts: LeftMovements, trying: Mask) -> _Drifts:
    """The drifts that are no part of an attempt.

    Args:
        lefts: The movements to the left.
        trying: The frames of attempts, shape (simulation, time).
    """
    simulation, begin = lefts.all.simulation, lefts.all.begin
    chosen = lefts.is_drift & ~trying[simulation, begin]
    number = np.bincount(simulation[chosen], minlength=len(trying))
    return _Drifts(
        drift=_earliest(simulation, begin, chosen, len(trying)),
        num_drifts=np.minimum(number, _MOST).astype(np.uint8),
    )


def _attempt(trajectories: Trajectories, view: View, rights: Mask, begun: I32) -> _Attempts:
    """The phases of the attempts that begin at `begun`."""
    num_frames, road = view.num_frames, trajectories.road
    target, lane = at(view.lately_ahead, begun), at(view.lane, begun)
    other = alongside(trajectories, target, view.simulation)
    during = view.valid & since(begun, num_frames)
    crossed = first_true(during & (view.left_reach > left_line(road, lane)[:, None]))
    undone = undone_at(view, during, begun)
    undone = only(undone, (crossed == NEVER) | (undone < crossed))
    during = during & until(undone, num_frames)
    overlap_begin = first_true(during & other.overlaps)
    is_past = other.valid & (other.lead > 0) & (other.gap >= 0)
    overlap_end = first_true(during & since(overlap_begin, num_frames) & is_past)
    home = during & since(crossed, num_frames) & _is_inside(view, road, lane)
    return_end = first_true(home & since(overlap_end, num_frames) & is_past)
    behind = first_true(home & other.valid & (other.lead < 0))
    back = earliest(undone, only(behind, _not_after(behind, return_end)))
    return_end = only(return_end, back == NEVER)
    turned = _turning(view, rights, begun, earliest(return_end, back))
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


def _is_inside(view: View, road: Road, lane: U8) -> Mask:
    """Whether the whole body is in a lane of each simulation, shape (simulation, time)."""
    borders = borders_of(road)
    right = borders[np.minimum(lane, len(borders) - 1)][:, None]
    return (view.right_reach >= right) & (view.left_reach <= left_line(road, lane)[:, None])


def _turning(view: View, rights: Mask, begun: I32, end: I32) -> I32:
    """Where the movement back begins, after the ego was farthest to the left."""
    num_frames = view.num_frames
    during = view.valid & since(begun, num_frames)
    stopped = np.where(end == NEVER, np.int32(num_frames), end + 1)
    during = during & until(stopped, num_frames)
    place = np.where(during, view.lateral, np.float32(-np.inf))
    farthest = place.argmax(axis=1).astype(np.int32)
    back = first_true(during & since(farthest, num_frames) & rights)
    # A short way back can be too short to be a movement of its own.
    return np.where((back == NEVER) & (end != NEVER), farthest, back)


def _events(
    trajectories: Trajectories,
    seen: Signals,
    ended: Accidents,
    found: _Attempts,
    drifts: _Drifts,
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
        drift=drifts.drift,
        num_drifts=drifts.num_drifts,
        under_way=under_way(trajectories, found.attempt),
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
