"""How far vehicles that keep their lane move to the left within a second, by class and wind.

    python benchmarks/lane_keeping.py                                     # a minute
    python benchmarks/lane_keeping.py --recordings ../shared/data/commonroad

The figures behind `[attempt.advance]` in `event_detection.toml`: simulations with the weather of
their profile and others in wind of 80 to 100 %, all their vehicles, away from changes of lane and
from indicators. A *swing* moves to the left, stays within the lane and comes back. The threshold of
a class is the smallest multiple of 0.05 m that its swings reach at most once an hour in the
strongest wind.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.errors import OvertakingError
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.snapshots import (
    VehicleInstants,
    lateral_footprint,
    lateral_speed_at,
    overtaking_sign,
)
from overtaking.model.trajectories import NO_VEHICLE, Lights, Trajectories
from overtaking.model.vehicles import VehicleKind
from overtaking.recordings.formats import read_recording
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine

BATCH = 256
BEFORE_S, AFTER_S = 6.0, 1.0
"""How long after a change of lane or an indicator, and how long before, a vehicle is left out."""

WINDS = (20.0, 50.0, 80.0)
"""Borders of the groups [%]."""

STORM = {"weather.wind_percent": [80.0, 100.0]}
SOURCES: tuple[tuple[str, dict[str, Any], int], ...] = (
    ("pinto2023-physical", {}, 20_480),
    ("motorway", {}, 768),
    ("pinto2023-physical", STORM | {"weather.mode": "independent"}, 6_144),
    ("motorway", STORM, 768),
)
STEP = 0.05
QUANTILES = (0.5, 0.9, 0.99)


@dataclass(frozen=True, kw_only=True)
class Swings:
    """Movements to the left of vehicles that keep their lane; arrays have shape (movement,).

    Attributes:
        kind: `VehicleKind`.
        wind: Group of the wind.
        advance: The farthest within a second [m].
        counts: Whether it stays within the lane and comes back.
        hours: Time that was looked at, shape (kind, group) [h].
        spread: Standard deviation of the position of each vehicle over its time, with its kind.
    """

    kind: NDArray[Any]
    wind: NDArray[Any]
    advance: NDArray[Any]
    counts: NDArray[Any]
    hours: NDArray[Any]
    spread: NDArray[Any]


def simulated() -> Iterator[Trajectories]:
    """All simulations that are looked at."""
    for profile, changes, count in SOURCES:
        given = load_specification(profile, changes)
        road = load_road(given.road)
        for first in range(0, count, BATCH):
            index = np.arange(first, min(first + BATCH, count), dtype=np.uint64)
            yield engine.simulate(ScenarioSource(given, road, 3).sample(index))


def recorded(folder: Path) -> Iterator[Trajectories]:
    """The recordings of a folder that have somebody with a leader."""
    for path in sorted(folder.glob("*.xml")):
        try:
            scenes = read_recording("commonroad", path, {}).scenes
        except OvertakingError as error:
            print(f"{path.name}: {error}")
            continue
        yield scenes.trajectories(range(len(scenes)))


def swings(run: Trajectories, slot: int) -> Swings:
    """The movements of one vehicle of each simulation."""
    interval = run.scenario.frame_interval_ms
    bodies, states = run.scenario.vehicles, run.states
    headings, direction = run.headings_and_origin
    lateral, reach = lateral_footprint(
        run.road,
        states.d[:, slot],
        (headings[:, slot], direction),
        bodies.length[:, slot, None],
        bodies.width[:, slot, None],
    )
    keeps = _keeps_lane(run, slot)
    speed = _lateral_speed(run, slot)
    found = _runs(keeps & (speed > constant("event_detection.motion.least_speed")))
    row, begin, end = found
    kind = bodies.kind[:, slot]
    wind = np.digitize(run.scenario.weather.wind, WINDS)
    hours = np.zeros((len(VehicleKind), len(WINDS) + 1))
    np.add.at(hours, (kind, wind), keeps.sum(axis=1) * interval / 3.6e6)
    wait = round(float(constant("event_detection.attempt.back_time")) * 1000.0 / interval)
    border = (float(overtaking_sign(run.road)) * run.road.lane_boundaries).tolist()
    lane = np.minimum(states.lane[row, slot, begin].astype(int) + 1, len(border) - 1)
    counts = [
        _comes_back(lateral[one, first:stop], reach[one, first:stop], last - first, border[line])
        for one, first, last, line in zip(row, begin, end, lane, strict=True)
        for stop in [min(last + wait, int(run.num_frames[one]))]
    ]
    return Swings(
        kind=kind[row],
        wind=wind[row],
        advance=_advances(lateral, found, round(1000.0 / interval)),
        counts=np.array(counts, np.bool_),
        hours=hours,
        spread=_spreads(lateral, keeps, kind, round(10_000.0 / interval)),
    )


def _lateral_speed(run: Trajectories, slot: int) -> NDArray[Any]:
    """Speed of a vehicle to the left in every frame, shape (simulation, time) [m/s]."""
    row, frame = (each.reshape(-1) for each in np.indices(run.stage.shape))
    speed = lateral_speed_at(run, VehicleInstants(row, np.full_like(row, slot), frame))
    return speed.reshape(run.stage.shape)


def _advances(
    lateral: NDArray[Any], found: tuple[NDArray[Any], NDArray[Any], NDArray[Any]], frames: int
) -> NDArray[Any]:
    """The farthest that each movement to the left leads within a number of frames [m].

    Args:
        lateral: Position across the road, shape (simulation, time) [m].
        found: Simulation, first and last frame of the movements, as `_runs` gives them.
        frames: How many frames a movement has for it; a shorter one has those that it lasts.

    Returns:
        Shape (movement,).
    """
    simulation, begin, end = found
    length = end - begin + 1
    if not length.size:
        return np.zeros(0, np.float32)
    row, last = np.repeat(simulation, length), np.repeat(end, length)
    first = np.cumsum(length) - length
    frame = np.arange(row.size, dtype=np.int32) + np.repeat(begin - first, length)
    ahead = lateral[row, np.minimum(frame + frames, last)] - lateral[row, frame]
    return np.maximum.reduceat(ahead, first)


def _runs(mask: NDArray[np.bool_]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """The unbroken runs of frames at which rows of `mask` hold.

    Returns:
        Simulation, first frame and last frame of each, shape (run,), in the order of simulations
        and frames.
    """
    padded = np.zeros((mask.shape[0], mask.shape[1] + 2), dtype=np.int8)
    padded[:, 1:-1] = mask
    change = np.diff(padded, axis=1)
    simulation, begin = np.nonzero(change == 1)
    _, end = np.nonzero(change == -1)
    return simulation.astype(np.int32), begin.astype(np.int32), (end - 1).astype(np.int32)


def _keeps_lane(run: Trajectories, slot: int) -> NDArray[np.bool_]:
    """Where a vehicle keeps its lane, shape (simulation, time)."""
    lane, interval = run.states.lane[:, slot], run.scenario.frame_interval_ms
    shown = int(Lights.INDICATOR_LEFT | Lights.INDICATOR_RIGHT)
    moves = (run.states.lights[:, slot] & shown) != 0
    there = run.state_mask[:, slot]
    moves[:, 1:] |= there[:, 1:] & there[:, :-1] & (lane[:, 1:] != lane[:, :-1])
    frame, last = np.arange(lane.shape[1]), lane.shape[1]
    total = np.pad(np.cumsum(moves, axis=1), ((0, 0), (1, 0)))
    until = np.minimum(frame + round(AFTER_S * 1000 / interval) + 1, last)
    since = np.maximum(frame - round(BEFORE_S * 1000 / interval), 0)
    near = total[:, until] > total[:, since]
    left = (there & (lane >= run.road.num_lanes)).any(axis=1)
    hit = run.contacts.partner[:, slot] != NO_VEHICLE
    return there & ~near & ~(left | hit)[:, None]


def _comes_back(lateral: NDArray[Any], reach: NDArray[Any], end: int, line: float) -> bool:
    """Whether a movement stays within its lane and ends where it began, or nearly."""
    back = lateral[end:] - lateral[0] <= constant("event_detection.motion.settled_shift")
    return bool(back.any()) and bool((lateral + reach <= line)[: end + back.argmax() + 1].all())


def _spreads(
    lateral: NDArray[Any], keeps: NDArray[np.bool_], kind: NDArray[Any], least: int
) -> NDArray[Any]:
    """Kind and standard deviation of the position of those that keep their lane long enough."""
    rows = np.flatnonzero(keeps.sum(axis=1) >= least)
    return np.array([(kind[k], lateral[k, keeps[k]].std()) for k in rows]).reshape(-1, 2)


def gathered(given: Iterator[Trajectories]) -> Swings:
    """All movements."""
    parts = [swings(run, slot) for run in given for slot in range(run.states.s.shape[1])]
    joined = {
        name: np.concatenate([getattr(one, name) for one in parts])
        for name in ("kind", "wind", "advance", "counts", "spread")
    }
    return Swings(hours=np.sum([one.hours for one in parts], axis=0), **joined)


def threshold(swung: Swings, kind: VehicleKind, group: int) -> float | None:
    """Smallest multiple of `STEP` reached at most once an hour, None if it was seen too little."""
    hours = swung.hours[kind, group]
    mine = swung.counts & (swung.kind == kind) & (swung.wind == group)
    if hours < 1.0:
        return None
    each = np.arange(1, 100) * STEP
    rate = (swung.advance[mine][None, :] >= each[:, None]).sum(axis=1) / hours
    return float(each[np.argmax(rate <= 1.0)])


def show(swung: Swings) -> None:
    """Print the tables."""
    print("class wind  hours swings  m/1 s: median 90% 99% most  once an hour")
    for kind in VehicleKind:
        for group in range(len(WINDS) + 1):
            mine = swung.advance[swung.counts & (swung.kind == kind) & (swung.wind == group)]
            if swung.hours[kind, group] == 0.0 or not mine.size:
                continue
            shown = " ".join(f"{one:5.2f}" for one in (*np.quantile(mine, QUANTILES), mine.max()))
            low = (0.0, *WINDS)[group]
            limit = threshold(swung, kind, group)
            print(
                f"{kind.code:5} {low:3.0f}+ {swung.hours[kind, group]:6.1f} {mine.size:6} "
                f" {shown}  {'-' if limit is None else f'{limit:.2f}'}"
            )
        own = swung.spread[swung.spread[:, 0] == kind, 1]
        if own.size:
            print(f"      {own.size} vehicles for 10 s or more: deviation {np.median(own):.3f} m")


def main() -> None:
    """Measure and print."""
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    options.add_argument("--recordings", type=Path, help="a folder of CommonRoad scenarios")
    folder = options.parse_args().recordings
    show(gathered(simulated() if folder is None else recorded(folder)))


if __name__ == "__main__":
    main()
