"""Counts overtakes of the egos: how they begin and end, and in which weather."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.analysis.validation.traffic import CARS, Batch, limit
from overtaking.labels.labelling import label
from overtaking.model.overtake_events import NEVER, OvertakeEvents
from overtaking.model.trajectories import OVERTAKING_STAGES, Stage, Trajectories
from overtaking.model.verdicts import OvertakeClass

if TYPE_CHECKING:
    from overtaking.analysis.validation.tally import Array, Tally
    from overtaking.model.weather import Weather

STRATA = ("any weather", "dry day", "night", "rain", "fog", "wind", "low sun")
"""Strata of weather; a simulation may belong to several."""

POLICY = "default"
"""The policy whose classes are counted."""

SEEN_AHEAD_M, SEEN_BEHIND_M = 200.0, 100.0
"""An ego without a vehicle farther ahead, or behind, than this sees the end of the traffic [m]."""

_RAIN, _FOG, _WIND = 20.0, 20.0, 50.0  # Percent from which weather counts as such.


def count(tally: Tally, batch: Batch) -> None:
    """Add a batch of traffic in one direction to a tally."""
    events = count_classes(tally, batch)
    _passing(tally, batch, events)
    _approach(tally, batch, events)
    _edges(tally, batch)


def count_classes(tally: Tally, batch: Batch) -> OvertakeEvents:
    """Add attempts, how they end, and their classes by weather; returns the events."""
    runs = batch.runs
    labelled = label(runs)
    labels = labelled.labels
    ended = labels.classes[:, labels.policies.index(POLICY)]
    begun = (runs.stage == Stage.PULL_OUT).any(axis=1)
    tally.add("attempts", batch.group, batch.weight * begun)
    tally.add("attempts_squares", batch.group, batch.weight**2 * begun)
    last = runs.stage[np.arange(len(runs.num_frames)), runs.num_frames - 1]
    tally.add("open", batch.group, batch.weight * np.isin(last, OVERTAKING_STAGES))
    for number, inside in enumerate(strata(runs.scenario.weather)):
        group, weight, place = (
            batch.group[inside],
            batch.weight[inside],
            cell(number, ended[inside]),
        )
        bins = len(STRATA) * len(OvertakeClass)
        tally.add_binned("classes", group, place, weight, bins)
        tally.add_binned("raw_classes", group, place, np.ones(1), bins)
        tally.add_binned("stratum", group, np.full_like(place, number), weight, len(STRATA))
    tally.add("squares", batch.group, batch.weight**2)
    tally.add("number", batch.group, np.ones(1))
    return labelled.events


def cell(stratum: int, kind: Any) -> Any:
    """Bin of a class, or of an array of classes, in a stratum."""
    return stratum * len(OvertakeClass) + kind


def strata(weather: Weather) -> list[Array]:
    """Which simulations belong to each of `STRATA`."""
    rain, fog, wind = weather.rain >= _RAIN, weather.fog >= _FOG, weather.wind >= _WIND
    dry_day = ~(weather.night | rain | fog | wind | weather.low_sun)
    return [np.ones_like(dry_day), dry_day, weather.night, rain, fog, wind, weather.low_sun]


def _passing(tally: Tally, batch: Batch, events: OvertakeEvents) -> None:
    """Add the speed difference of a car and the car that it begins to pass."""
    kind = batch.runs.scenario.vehicles.kind
    at = np.flatnonzero(events.overlap_begin != NEVER)
    target, frame = events.target_slot[at], events.overlap_begin[at]
    cars = np.isin(kind[at, 0], CARS) & np.isin(kind[at, target], CARS)
    speed = batch.runs.states.speed
    faster = 1e-3 * (speed[at, 0, frame] - speed[at, target, frame].astype(np.float64))
    group, weight = batch.group[at][cars], batch.weight[at][cars]
    tally.add("passing", group, weight)
    tally.add("passing_speed", group, weight * faster[cars])


def _approach(tally: Tally, batch: Batch, events: OvertakeEvents) -> None:
    """Add overtakes whose approach is seen from its begin, and those of them that were flying.

    An overtake that follows from the start has waited for an unknown time, and long waits are met
    more often than short ones; an approach that begins late has no time to wait.
    """
    at, is_flying = flying(batch.runs, events)
    begin = events.following_begin[at] * batch.interval_s
    seen = (begin > 0.0) & (begin <= limit("approach_begins"))
    at, is_flying = at[seen], is_flying[seen]
    tally.add("overtakes", batch.group[at], batch.weight[at])
    tally.add("flying", batch.group[at], batch.weight[at] * is_flying)


def flying(runs: Trajectories, events: OvertakeEvents) -> tuple[Array, Array]:
    """Overtakes whose ego never slowed down to the speed of its target before it pulled out.

    Args:
        runs: Recorded simulations.
        events: Their events.

    Returns:
        The simulations with an overtake that came alongside, and whether each was flying.
    """
    at = np.flatnonzero((events.attempt != NEVER) & (events.overlap_begin != NEVER))
    speed = runs.states.speed
    frames = np.arange(speed.shape[2])[None, :]
    faster = speed[at, 0].astype(np.int64) - speed[at, events.target_slot[at]]
    near = (frames >= events.following_begin[at, None]) & (frames <= events.attempt[at, None])
    least = np.where(near, faster, np.iinfo(np.int64).max).min(axis=1, initial=2**62)
    return at, least > 1e3 * limit("flying_margin")


def _edges(tally: Tally, batch: Batch) -> None:
    """Add frames, and those in which the ego sees where the traffic ends."""
    runs = batch.runs
    frames = runs.frame_mask
    s, there = runs.states.s, runs.scenario.vehicles.valid[:, :, None] & frames[:, None, :]
    ahead = np.where(there, s, np.iinfo(np.int32).min).max(axis=1).astype(np.int64) - s[:, 0]
    behind = s[:, 0] - np.where(there, s, np.iinfo(np.int32).max).min(axis=1).astype(np.int64)
    sees = frames & ((ahead < 1e3 * SEEN_AHEAD_M) | (behind < 1e3 * SEEN_BEHIND_M))
    tally.add("frames", batch.group, batch.weight * frames.sum(axis=1))
    tally.add("edges", batch.group, batch.weight * sees.sum(axis=1))
