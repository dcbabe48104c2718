"""Counts what a driver who looks at simulations would call faults.

    python benchmarks/faults.py motorway -n 1000
    python benchmarks/faults.py pinto2023-physical -n 1000 --seed 5

Printed is how often each fault occurs, of how many chances, and how often trucks overtake trucks;
docs/explanation/motorway.md has the table.
"""

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.labels.labelling import label
from overtaking.model.overtake_events import NEVER
from overtaking.model.trajectories import Trajectories
from overtaking.model.vehicles import VehicleKind
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine

BATCH = 128
FIRST_S, LATER_S = 1.0, 5.0
BRAKES, IMPOSES = -1000, -6000  # [mm/s^2]
OVERSHOOT_MM, SETTLES_S = 300, 10.0
UNDONE_S = 15.0
DROP_MMPS, NEEDLESS_MM = 4167, 50_000  # 15 km/h, and a lane free so far to both sides.
BREEZE, SLOWS_MMPS = (20.0, 60.0), 1389  # Percent of wind; 5 km/h.

FAULTS = {
    "brakes": "vehicles that brake by more than 1 m/s^2 in the first second",
    "signals": "vehicles that signal in the first second",
    "changes": "vehicles that change lanes in the first second",
    "overshoots": "lane changes more than 0.3 m beyond the middle of the lane",
    "undone": "lane changes that are undone within 15 s",
    "imposes": "lane changes whose new follower brakes by more than 6 m/s^2 within 5 s",
    "drops": "overtakes before which the ego lost 15 km/h beside a lane that was free for 50 m",
    "breeze": "dry simulations with 20 to 60 % of wind in which most vehicles slow by 5 km/h",
}

Places = tuple[NDArray[np.intp], ...]


@dataclass(frozen=True)
class Batch:
    """A recorded batch: `seen` and `lane` have shape (simulation, vehicle, time)."""

    runs: Trajectories
    seen: NDArray[np.bool_]
    rate: int

    @classmethod
    def of(cls, runs: Trajectories) -> "Batch":
        """Prepare a batch."""
        seen = runs.scenario.vehicles.valid[:, :, None] & runs.frame_mask[:, None, :]
        on_road = runs.states.lane < runs.road.num_lanes
        return cls(runs, seen & on_road, round(1000 / runs.scenario.frame_interval_ms))


def faults(batch: Batch) -> Iterator[tuple[str, int, int]]:
    """Each fault of a batch: its name, how often it occurs, and of how many chances."""
    yield from _first_second(batch)
    yield from _lane_changes(batch)
    yield _drops(batch)
    yield _breeze(batch)


def _first_second(batch: Batch) -> Iterator[tuple[str, int, int]]:
    states, seen, first = batch.runs.states, batch.seen, round(FIRST_S * batch.rate)
    there = seen[:, :, 0]
    early = np.s_[:, :, :first]
    moved = states.lane[early] != states.lane[:, :, :1]
    for name, found in (
        ("brakes", states.accel_lon[early] < BRAKES),
        ("signals", (states.lights[early] & 3) != 0),
        ("changes", moved),
    ):
        yield name, int(((found & seen[early]).any(axis=2) & there).sum()), int(there.sum())


def _lane_changes(batch: Batch) -> Iterator[tuple[str, int, int]]:
    lane, seen = batch.runs.states.lane, batch.seen
    crossed = (lane[:, :, 1:] != lane[:, :, :-1]) & seen[:, :, 1:] & seen[:, :, :-1]
    at = np.nonzero(crossed)
    at = (at[0], at[1], at[2] + 1)
    yield _overshoots(batch, at)
    same = (np.diff(at[0]) == 0) & (np.diff(at[1]) == 0)
    back = lane[at][1:] == lane[at[0], at[1], at[2] - 1][:-1]
    soon = np.diff(at[2]) < UNDONE_S * batch.rate
    yield "undone", int((same & back & soon).sum()), len(at[0])
    yield _imposed(batch, at)


def _overshoots(batch: Batch, at: Places) -> tuple[str, int, int]:
    """The way beyond the middle of the new lane, of changes that stay in it for a while."""
    runs, reach = batch.runs, round(SETTLES_S * batch.rate)
    simulation, vehicle, frame = at
    whole = frame + reach < runs.num_frames[simulation]
    simulation, vehicle, frame = simulation[whole], vehicle[whole], frame[whole]
    later = (simulation[:, None], vehicle[:, None], frame[:, None] + np.arange(reach))
    new, old = (runs.states.lane[simulation, vehicle, frame - back].astype(int) for back in (0, 1))
    stays = (runs.states.lane[later] == new[:, None]).all(axis=1)
    lines = 1e3 * np.asarray(runs.road.lane_boundaries, np.float64)
    middle = 0.5 * (lines[:-1] + lines[1:])[np.minimum(new, len(lines) - 2)]
    towards = np.where(new > old, runs.road.overtaking_sign, -runs.road.overtaking_sign)
    beyond = ((runs.states.d[later] - middle[:, None]) * towards[:, None]).max(axis=1, initial=-9e9)
    return "overshoots", int((stays & (beyond > OVERSHOOT_MM)).sum()), int(stays.sum())


def _imposed(batch: Batch, at: Places) -> tuple[str, int, int]:
    """The braking of the next vehicle behind in the lane that was entered."""
    states, span = batch.runs.states, round(LATER_S * batch.rate)
    found = 0
    for simulation, vehicle, frame in zip(*at, strict=True):
        s = states.s[simulation, :, frame].astype(np.int64)
        behind = batch.seen[simulation, :, frame] & (s < s[vehicle])
        behind &= states.lane[simulation, :, frame] == states.lane[simulation, vehicle, frame]
        if behind.any():
            slot = int(np.where(behind, s, np.iinfo(np.int64).min).argmax())
            braking = states.accel_lon[simulation, slot, frame : frame + span]
            found += bool((braking < IMPOSES).any())
    return "imposes", found, len(at[0])


def _drops(batch: Batch) -> tuple[str, int, int]:
    """Loss of speed between approach and pull-out while the next lane is free."""
    runs = batch.runs
    events = label(runs).events
    begun = np.flatnonzero((events.attempt != NEVER) & (events.following_begin != NEVER))
    found = 0
    for simulation in begun:
        span = slice(int(events.following_begin[simulation]), int(events.attempt[simulation]) + 1)
        speed = runs.states.speed[simulation, 0, span].astype(np.int64)
        s = runs.states.s[simulation, :, span].astype(np.int64)
        next_lane = (
            runs.states.lane[simulation, :, span] == runs.states.lane[simulation, 0, span] + 1
        )
        beside = next_lane & (np.abs(s - s[:1]) < NEEDLESS_MM) & batch.seen[simulation, :, span]
        lost = np.maximum.accumulate(speed) - speed
        found += bool(lost.size and lost[-1] > DROP_MMPS and not beside.any())
    return "drops", found, len(begun)


def _breeze(batch: Batch) -> tuple[str, int, int]:
    """Simulations in which nothing but wind can be why most drivers slow down."""
    runs, weather = batch.runs, batch.runs.scenario.weather
    dry = (weather.rain == 0) & (weather.fog < 1.0) & ~weather.night
    windy = dry & (weather.wind >= BREEZE[0]) & (weather.wind <= BREEZE[1])
    speed = runs.states.speed.astype(np.int64)
    least = np.where(batch.seen, speed, np.iinfo(np.int64).max)[:, :, : 10 * batch.rate].min(axis=2)
    there = batch.seen[:, :, 0]
    slowed = ((speed[:, :, 0] - least > SLOWS_MMPS) & there).sum(axis=1) > 0.5 * there.sum(axis=1)
    return "breeze", int((windy & slowed).sum()), int(windy.sum())


def truck_overtakes(batch: Batch) -> tuple[int, float]:
    """How often a truck passes another one on its right, and the way of all trucks [km]."""
    runs, passes, way = batch.runs, 0, 0.0
    trucks = runs.scenario.vehicles.valid & (runs.scenario.vehicles.kind == VehicleKind.TRUCK)
    for simulation, slots in enumerate(trucks):
        frames = slice(int(runs.num_frames[simulation]))
        s = runs.states.s[simulation, slots, frames].astype(np.int64)
        lane = runs.states.lane[simulation, slots, frames]
        ahead = s[:, None] > s[None]
        left = lane[:, None, 1:] > lane[None, :, 1:]
        passes += int((ahead[:, :, 1:] & ~ahead[:, :, :-1] & left).sum())
        way += 1e-6 * float((s[:, -1] - s[:, 0]).sum())
    return passes, way


def main() -> None:
    """Count and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("profile", nargs="?", default="motorway")
    parser.add_argument("-n", "--simulations", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=5)
    asked = parser.parse_args()
    given = load_specification(asked.profile)
    road, counts, chances = load_road(given.road), Counter[str](), Counter[str]()
    passes, way = 0, 0.0
    for first in range(0, asked.simulations, BATCH):
        index = range(first, min(first + BATCH, asked.simulations))
        batch = Batch.of(engine.simulate(ScenarioSource(given, road, asked.seed).sample(index)))
        for name, found, of in faults(batch):
            counts[name] += found
            chances[name] += of
        more, further = truck_overtakes(batch)
        passes, way = passes + more, way + further
    print(f"{asked.profile}, {asked.simulations:,} simulations of seed {asked.seed}")
    for name, words in FAULTS.items():
        share = counts[name] / max(chances[name], 1)
        print(f"{counts[name]:>7,} of {chances[name]:>7,}  {share:7.2%}  {words}")
    print(f"{passes:>7,} overtakes of trucks by trucks in {way:,.0f} truck-km")


if __name__ == "__main__":
    main()
