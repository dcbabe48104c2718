"""Counts lane changes: how often, how long, with which gaps, and which are undone or given up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.validation import paths
from overtaking.analysis.validation.places import Moments, next_to
from overtaking.analysis.validation.traffic import Batch, limit
from overtaking.model.trajectories import Lights

if TYPE_CHECKING:
    from overtaking.analysis.validation.tally import Array, Tally

CHANGE_BINS, CHANGE_WIDTH = 400, 0.05
"""Bins of the durations of lane changes [s]."""

PEAK_BINS, PEAK_WIDTH = 400, 0.01
"""Bins of the largest lateral speeds [m/s]."""

SPACE_BINS, SPACE_WIDTH = 400, 0.5
"""Bins of gaps [m]."""

HEADWAY_BINS, HEADWAY_WIDTH = 500, 0.02
"""Bins of the time gaps at the start and after the return [s]."""

LONGEST_CHANGE_S = 20.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Changes:
    """Lane changes; arrays have shape (change,).

    Attributes:
        at: The vehicles, and the first frame in the new lane.
        before: Lane that is left.
        after: Lane that is entered.
    """

    at: Moments
    before: Array
    after: Array

    def where(self, chosen: Array) -> Changes:
        """Some of them."""
        return Changes(
            at=self.at.where(chosen), before=self.before[chosen], after=self.after[chosen]
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """Measurements of lane changes that are recorded from begin to end; shape (change,).

    Attributes:
        of: Which ones.
        begin: Frame in which the visible motion begins.
        end: Frame in which it ends.
        over: Frame in which the body comes over the line.
        duration: Between the two [s].
        crossing: Time with the body over the line; NaN if not recorded whole [s].
        settled: From the begin until the vehicle moves no more to any side; NaN likewise [s].
        peak: Largest lateral speed [m/s].
    """

    of: Changes
    begin: Array
    end: Array
    over: Array
    duration: Array
    crossing: Array
    settled: Array
    peak: Array


def count_rate(tally: Tally, batch: Batch, counted: Array) -> Changes:
    """Add the lane changes and distances of the counted vehicles and frames."""
    found = lane_changes(batch, counted)
    simulation = found.at.simulation
    tally.add("changes", batch.group[simulation], batch.weight[simulation])
    tally.add("changed_metres", batch.group, batch.weight * batch.metres(counted))
    return found


def count(tally: Tally, batch: Batch) -> None:
    """Add the lane changes of all sound vehicles, with all that is measured of them."""
    found = count_rate(tally, batch, batch.sound)
    measured = measure(batch, found)
    simulation = measured.of.at.simulation
    group, weight = batch.group[simulation], batch.weight[simulation]
    for name, values, width, bins in (
        ("durations", measured.duration, CHANGE_WIDTH, CHANGE_BINS),
        ("crossings", measured.crossing, CHANGE_WIDTH, CHANGE_BINS),
        ("settlings", measured.settled, CHANGE_WIDTH, CHANGE_BINS),
        ("peaks", measured.peak, PEAK_WIDTH, PEAK_BINS),
    ):
        there = ~np.isnan(values)
        place = np.round(values[there] / width)
        tally.add_binned(name, group[there], place, weight[there], bins)
    _room(tally, batch, measured)
    _undone(tally, batch, found)
    _given_up(tally, batch, found)


def lane_changes(batch: Batch, counted: Array) -> Changes:
    """The lane changes of the counted vehicles and frames, by simulation, vehicle and time."""
    lane = batch.runs.states.lane
    crossed = (lane[:, :, 1:] != lane[:, :, :-1]) & counted[:, :, 1:] & counted[:, :, :-1]
    simulation, vehicle, frame = np.nonzero(crossed)
    at = Moments(simulation=simulation, vehicle=vehicle, frame=frame + 1)
    return Changes(at=at, before=lane[simulation, vehicle, frame], after=lane[at.place])


def measure(batch: Batch, found: Changes) -> Measured:
    """Durations and speeds of the lane changes that are recorded from begin to end."""
    reach = round(LONGEST_CHANGE_S / batch.interval_s)
    path, recorded = _paths(batch, found, reach)
    speed = np.where(recorded, paths.lateral_speed(path, batch.interval_s), np.nan)
    begin, end = paths.moving(speed)
    whole = (begin < reach) & (end > reach) & (speed[:, reach] > 0.0)
    found, path, speed, begin, end = (
        found.where(whole),
        path[whole],
        speed[whole],
        begin[whole],
        end[whole],
    )
    at, interval = found.at, batch.interval_s
    width = batch.runs.scenario.vehicles.width[at.simulation, at.vehicle]
    over, clear = paths.straddling(np.where(np.isnan(speed), np.nan, path), 0.5 * width)
    still = paths.settled(speed, interval)
    return Measured(
        of=found,
        begin=at.frame - reach + begin,
        end=at.frame - reach + end,
        over=at.frame - reach + over + 1,
        duration=(end - begin - 1) * interval,
        crossing=np.where((over < reach) & (clear > reach), (clear - over - 1) * interval, np.nan),
        settled=np.where(still > reach, (still - begin - 1) * interval, np.nan),
        peak=paths.peak(np.nan_to_num(speed, nan=-np.inf), begin, end),
    )


def _paths(batch: Batch, found: Changes, reach: int) -> tuple[Array, Array]:
    """Distance of each centre from the line [m], and whether it and its speed are recorded."""
    at, runs = found.at, batch.runs
    frame = at.frame[:, None] + np.arange(-reach, reach + 1)[None, :]
    half = max(1, round(paths.SMOOTHING_S / batch.interval_s))
    last = runs.num_frames[at.simulation, None] - 1
    inside = np.clip(frame, 0, last)
    place = (at.simulation[:, None], at.vehicle[:, None], inside)
    line = np.asarray(runs.road.lane_boundaries, np.float64)[np.maximum(found.before, found.after)]
    path = 1e-3 * runs.states.d[place] - line[:, None]
    towards = np.where(
        found.after > found.before, runs.road.overtaking_sign, -runs.road.overtaking_sign
    )
    recorded = (frame > half) & (frame < last - half) & batch.sound[place]
    return path * towards[:, None], recorded


def _room(tally: Tally, batch: Batch, measured: Measured) -> None:
    """Add the gaps to who is followed when a pull-out begins, and to who follows after a return."""
    out = measured.of.after > measured.of.before
    for name, chosen, frame, ahead in (
        ("start", out, measured.begin, True),
        ("return", ~out, measured.end, False),
    ):
        found = measured.of.where(chosen)
        at = Moments(simulation=found.at.simulation, vehicle=found.at.vehicle, frame=frame[chosen])
        gap, slot = next_to(batch, at, found.before if ahead else found.after, ahead=ahead)
        behind = at.vehicle if ahead else slot
        speed = 1e-3 * batch.runs.states.speed[at.simulation, behind, at.frame]
        near = gap < limit("room_counted")
        group, weight = batch.group[at.simulation[near]], batch.weight[at.simulation[near]]
        metres = np.maximum(gap[near], 0.0)
        seconds = metres / np.maximum(speed[near], 1.0)
        place = (metres / SPACE_WIDTH).astype(np.int64)
        tally.add_binned(f"{name}_gaps", group, place, weight, SPACE_BINS)
        place = (seconds / HEADWAY_WIDTH).astype(np.int64)
        tally.add_binned(f"{name}_headways", group, place, weight, HEADWAY_BINS)


def _undone(tally: Tally, batch: Batch, found: Changes) -> None:
    """Add the changes whose next seconds are recorded, and those that are undone in them."""
    at, within = found.at, round(limit("undone_time") / batch.interval_s)
    count = len(at.frame)
    follows, back = np.zeros(count, np.bool_), np.arange(count)
    follows[:-1] = (np.diff(at.simulation) == 0) & (np.diff(at.vehicle) == 0)
    back[:-1] += follows[:-1]
    soon = follows & (at.frame[back] - at.frame <= within)
    undone = soon & (found.after[back] == found.before)
    undone &= ~_passes(batch, at, at.frame[back])
    later = np.minimum(at.frame + within, batch.sound.shape[2] - 1)
    known = batch.sound[at.simulation, at.vehicle, later] & (later == at.frame + within)
    group, weight = batch.group[at.simulation], batch.weight[at.simulation]
    tally.add("watched", group, weight * (known | undone))
    tally.add("undone", group, weight * undone)


def _passes(batch: Batch, at: Moments, until: Array) -> Array:
    """Whether each passes another vehicle between its frame and a later one."""
    s, sound = batch.runs.states.s, batch.sound
    ahead = [
        s[at.simulation, :, frame] > s[at.simulation, at.vehicle, frame][:, None]
        for frame in (at.frame, until)
    ]
    there = sound[at.simulation, :, at.frame] & sound[at.simulation, :, until]
    return np.any(ahead[0] & ~ahead[1] & there, axis=1)


def _given_up(tally: Tally, batch: Batch, found: Changes) -> None:
    """Add the lane changes that are begun, and those that are given up before the line.

    One is begun when a vehicle that signals has moved half a metre to that side. It is given up if
    the centre has not crossed the line soon after the signal ends.
    """
    wait = round(limit("given_up_after") / batch.interval_s)
    for light, towards in ((Lights.INDICATOR_LEFT, 1.0), (Lights.INDICATOR_RIGHT, -1.0)):
        chosen = (found.after > found.before) == (towards == batch.runs.road.overtaking_sign)
        at, end = _signals(batch, int(light))
        moved = _farthest(batch, at, end, towards)
        until = end + wait
        crosses = _crosses_within(found.where(chosen), at, until)
        last = np.minimum(until, batch.sound.shape[2] - 1)
        known = batch.sound[at.simulation, at.vehicle, last] & (last == until)
        begun = (moved >= limit("begun_shift")) & (crosses | known)
        group, weight = batch.group[at.simulation], batch.weight[at.simulation]
        tally.add("begun", group, weight * begun)
        tally.add("given_up", group, weight * (begun & ~crosses))


def _signals(batch: Batch, light: int) -> tuple[Moments, Array]:
    """The first frames in which vehicles signal to one side only, and the frames after the last."""
    both = int(Lights.INDICATOR_LEFT | Lights.INDICATOR_RIGHT)
    on = ((batch.runs.states.lights & both) == light) & batch.sound
    edge = np.zeros((*on.shape[:2], 1), np.bool_)
    steps = np.diff(np.concatenate([edge, on, edge], axis=2).astype(np.int8), axis=2)
    simulation, vehicle, begin = np.nonzero(steps > 0)
    end = np.nonzero(steps < 0)[2]
    return Moments(simulation=simulation, vehicle=vehicle, frame=begin), end


def _farthest(batch: Batch, at: Moments, end: Array, towards: float) -> Array:
    """How far each moves to a side between its frame and a later one, shape (moment,) [m]."""
    reach = int(np.max(end - at.frame, initial=1))
    frame = at.frame[:, None] + np.arange(reach)[None, :]
    place = (at.simulation[:, None], at.vehicle[:, None], np.minimum(frame, end[:, None] - 1))
    d = batch.runs.states.d
    return 1e-3 * (towards * (d[place] - d[at.place][:, None])).max(axis=1, initial=0)


def _crosses_within(found: Changes, at: Moments, until: Array) -> Array:
    """Whether each makes one of some lane changes between its frame and a later one."""
    changes = found.at
    same = (changes.simulation[None, :] == at.simulation[:, None]) & (
        changes.vehicle[None, :] == at.vehicle[:, None]
    )
    inside = (changes.frame[None, :] >= at.frame[:, None]) & (
        changes.frame[None, :] <= until[:, None]
    )
    return (same & inside).any(axis=1)
