"""Drives a million kilometres and more: how many accidents, of which kind, and what was believed.

    python benchmarks/accidents.py                          # 3 million km of motorway
    python benchmarks/accidents.py --km 1e5 --json > accidents.json
    python benchmarks/accidents.py --kept kept.json         # can be stopped, and goes on from there

Printed are the rate per million vehicle-km with its exact Poisson interval, of accidents and of
simulations with any, since one accident may lead to others; how hard they were; and each one: the
number of its simulation, its mechanism, the change of speed, and what the first two vehicles
believed of each other at the decisive moment. For that the simulations with accidents run once more
with the readable twin of the engine, whose beliefs are open; it records the same bits.

The decisive moment of a lane change is its begin; of a rear-end collision the first instant after
which only hard braking would have avoided it.
"""

import argparse
import collections
import json
import math
import os
import sys
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from threading import local
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.validation.accidents import Accident, Severity, accidents
from overtaking.analysis.validation.poisson import poisson_limits
from overtaking.analysis.validation.traffic import Batch, limit
from overtaking.cli.arguments import overrides
from overtaking.core.arrays import Buffers, Mask
from overtaking.core.units import kmh_from_mps
from overtaking.model.road import Road
from overtaking.model.trajectories import Trajectories
from overtaking.model.vehicles import VehicleKind
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.scenarios.specification import Specification
from overtaking.sim import engine, reference
from overtaking.sim.reference import perception
from overtaking.sim.reference.decision_context import Neighbours
from overtaking.sim.reference.state import State
from overtaking.world.step_parameters import StepParameters

BATCH = 64
REPLAYED = 16
"""Simulations that are run once more at a time: every belief of theirs is in memory."""

MILLION_KM = 1e9
ROLES = ("ahead", "behind", "ahead left", "behind left", "ahead right", "behind right")
"""Where a neighbour is, in the order of the model; left is the fast side."""

LOOKS_BACK_S = 1.5
"""Drivers glance at other lanes once a second: what they believe is what the last glance said."""

CHANGE_S, LOST_RAD = 8.0, 0.15
"""How long before a contact a lane change still counts, and the angle of who has lost control."""


@dataclass
class Tally:
    """What was driven so far, and the accidents with the numbers of their simulations."""

    profile: str
    changes: dict[str, Any]
    seed: int
    done: int
    metres: float
    found: list[dict[str, Any]]


# --- Driving ------------------------------------------------------------------------------------


def drive(
    given: Specification, road: Road, seed: int, first: int, own: local
) -> tuple[float, list[Any]]:
    """Metres driven, and accidents, of the simulations from a number on."""
    if not hasattr(own, "buffers"):
        own.buffers = Buffers()
    index = np.arange(first, first + BATCH, dtype=np.uint64)
    runs = engine.simulate(ScenarioSource(given, road, seed).sample(index), buffers=own.buffers)
    found = [asdict(one) | {"simulation": first + one.simulation} for one in accidents(runs)]
    return float(Batch.of(runs).metres().sum()), found


def driven(given: Specification, road: Road, so_far: Tally, workers: int) -> Iterator[Tally]:
    """The tally after each batch, in the order of the simulations."""
    own, waiting = local(), collections.deque[Future[Any]]()
    first = so_far.done
    with ThreadPoolExecutor(workers) as pool:
        while True:
            while len(waiting) <= workers:
                waiting.append(pool.submit(drive, given, road, so_far.seed, first, own))
                first += BATCH
            metres, found = waiting.popleft().result()
            so_far.done, so_far.metres = so_far.done + BATCH, so_far.metres + metres
            so_far.found += found
            try:
                yield so_far
            except GeneratorExit:
                pool.shutdown(cancel_futures=True)
                raise


def drive_far(given: Specification, road: Road, so_far: Tally, asked: argparse.Namespace) -> None:
    """Drive until the distance is reached; tell how far, and keep what was found."""
    target, begun, before = 1e3 * asked.km, time.monotonic(), so_far.metres
    if so_far.metres >= target:
        return
    last_told = begun
    for now in driven(given, road, so_far, asked.workers):
        elapsed = time.monotonic() - begun
        if asked.kept:
            keep(asked.kept, now)
        if time.monotonic() - last_told > asked.every_s:
            last_told = time.monotonic()
            rate = (now.metres - before) / elapsed
            left = (target - now.metres) / rate
            print(
                f"{1e-3 * now.metres:,.0f} of {asked.km:,.0f} km, {len(now.found)} accidents, "
                f"{1e-3 * rate:,.0f} km/s, {left:,.0f} s left",
                file=sys.stderr,
                flush=True,
            )
        if now.metres >= target:
            return


def keep(path: Path, tally: Tally) -> None:
    """Write what was found so far, whole or not at all."""
    partial = path.with_name(f".{path.name}.partial")
    partial.write_text(json.dumps(asdict(tally)), encoding="utf-8")
    partial.replace(path)


def begun(asked: argparse.Namespace, changes: dict[str, Any]) -> Tally:
    """The tally to go on from."""
    fresh = Tally(asked.profile, changes, asked.seed, 0, 0.0, [])
    if asked.kept is None or not asked.kept.exists():
        return fresh
    kept = Tally(**json.loads(asked.kept.read_text(encoding="utf-8")))
    if (kept.profile, kept.changes, kept.seed) != (fresh.profile, fresh.changes, fresh.seed):
        sys.exit(f"{asked.kept} is of {kept.profile}, seed {kept.seed}: give another --kept")
    return kept


# --- Beliefs ------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Seen:
    """What the drivers of a batch believed at one decision, (role, vehicle, simulation)."""

    slot: NDArray[np.int16]
    looked: NDArray[np.bool_]
    detected: NDArray[np.bool_]
    gap: NDArray[np.float32]
    closing: NDArray[np.float32]
    true_gap: NDArray[np.float32]


def replay(
    given: Specification, road: Road, seed: int, numbers: list[int]
) -> tuple[Trajectories, list[Seen]]:
    """The simulations of some numbers once more, with what was believed at each decision."""
    seen: list[Seen] = []
    form_beliefs = perception.form_beliefs

    def record_beliefs(
        state: State,
        params: StepParameters,
        neighbours: Neighbours,
        decision_index: int,
        checks_mirrors: Mask,
    ) -> perception.Beliefs:
        beliefs = form_beliefs(state, params, neighbours, decision_index, checks_mirrors)
        seen.append(
            Seen(
                slot=neighbours.slot.astype(np.int16),
                looked=checks_mirrors.copy(),
                detected=beliefs.is_detected.copy(),
                gap=beliefs.gap.copy(),
                closing=beliefs.closing_speed.copy(),
                true_gap=neighbours.gap.copy(),
            )
        )
        return beliefs

    index = np.array(numbers, np.uint64)
    with patch.object(perception, "form_beliefs", record_beliefs):
        runs = reference.simulate(ScenarioSource(given, road, seed).sample(index))
    return runs, seen


def belief(seen: list[Seen], of: int, other: int, row: int, decision: int) -> dict[str, Any] | None:
    """What one driver believed of another at a decision, or by the glance before.

    Args:
        seen: Every decision.
        of: Slot of the driver.
        other: Slot of the other.
        row: Place of the simulation.
        decision: Number of the decision.

    Returns:
        Place, whether it was noticed, believed and true values; None if it was no neighbour.
    """
    back = round(LOOKS_BACK_S / 0.05)
    newest: dict[str, Any] | None = None
    for number in range(decision, max(decision - back, 0) - 1, -1):
        one = seen[number]
        for role in np.flatnonzero(one.slot[:, of, row] == other):
            place = role, of, row
            found = {
                "where": ROLES[role],
                "looked_s_before": round(0.05 * (decision - number), 2),
                "noticed": bool(one.detected[place]),
                "believed_gap_m": float(one.gap[place]) if one.detected[place] else None,
                "believed_closing_mps": float(one.closing[place]) if one.detected[place] else None,
                "true_gap_m": float(one.true_gap[place]),
            }
            newest = newest or found
            if one.detected[place] or role == 0 or one.looked[of, row]:
                return found
    return newest


# --- Mechanisms ---------------------------------------------------------------------------------


def lateral(runs: Trajectories, row: int, slot: int) -> NDArray[np.float64]:
    """Lateral speed of a vehicle in each frame, shape (time,) [m/s]."""
    d = 1e-3 * runs.states.d[row, slot].astype(np.float64)
    half = max(1, round(250 / runs.scenario.frame_interval_ms))
    moved = np.zeros(d.shape)
    moved[half:-half] = (d[2 * half :] - d[: -2 * half]) * 1e3
    return moved / (2 * half * runs.scenario.frame_interval_ms)


def mechanism(runs: Trajectories, row: int, one: Accident) -> tuple[str, int]:
    """How an accident came about, and the frame of its decisive moment."""
    interval = runs.scenario.frame_interval_ms
    hit = max(math.ceil(1e3 * one.time / interval) - 1, 0)  # The last frame before it.
    if not one.is_contact:
        return ("spin" if one.is_spin else "departure"), max(hit - round(2e3 / interval), 0)
    pair, before = one.vehicles[:2], max(hit - round(300 / interval), 0)
    turned = [runs.states.heading[row, slot, before] * 1e-4 - runs.road.heading for slot in pair]
    if max(abs(angle) for angle in turned) > LOST_RAD:
        return "loss of control", max(hit - round(2e3 / interval), 0)
    begins = [changed(runs, row, slot, hit) for slot in pair]
    if any(begin is not None for begin in begins):
        return "lane change", max(begin for begin in begins if begin is not None)
    return "rear-end", too_late(runs, row, pair, hit)


def changed(runs: Trajectories, row: int, slot: int, hit: int) -> int | None:
    """Begin of the lane change that a vehicle was in at a contact or shortly before."""
    since = max(hit - round(1e3 * CHANGE_S / runs.scenario.frame_interval_ms), 0)
    speed, lane = lateral(runs, row, slot), runs.states.lane[row, slot]
    slow = np.abs(speed) < limit("moving_aside")
    recent = np.flatnonzero(~slow[max(hit - 20, since) : hit])
    crossed = np.flatnonzero(lane[since + 1 : hit + 1] != lane[since:hit])
    if not len(recent) or not (len(crossed) or np.abs(speed[hit - 10 : hit]).max(initial=0) > 0.3):
        return None
    last = max(hit - 20, since) + int(recent[-1])
    calm = np.flatnonzero(slow[:last])
    return int(calm[-1]) if len(calm) else 0


def too_late(runs: Trajectories, row: int, pair: tuple[int, ...], hit: int) -> int:
    """First frame of the last seconds after which only hard braking would have avoided it."""
    s, speed = (
        1e-3 * one[row, list(pair), : hit + 1].astype(np.float64)
        for one in (runs.states.s, runs.states.speed)
    )
    behind = int(s[1, -1] < s[0, -1])
    halves = 0.5 * float(runs.scenario.vehicles.length[row, list(pair)].sum())
    gap = np.maximum(np.abs(s[1] - s[0]) - halves, 0.1)
    closing = np.maximum(speed[behind] - speed[1 - behind], 0.0)
    easy = np.flatnonzero(0.5 * closing**2 / gap < limit("hard_braking"))
    return min(int(easy[-1]) + 1, hit) if len(easy) else 0


# --- Telling ------------------------------------------------------------------------------------


def told(given: Specification, road: Road, tally: Tally) -> list[dict[str, Any]]:
    """Every accident with its mechanism and the beliefs of the first two."""
    rows: list[dict[str, Any]] = []
    numbers = sorted({one["simulation"] for one in tally.found})
    for first in range(0, len(numbers), REPLAYED):
        chosen = numbers[first : first + REPLAYED]
        runs, seen = replay(given, road, tally.seed, chosen)
        again = accidents(runs)
        rows += [tell(runs, seen, one, chosen[one.simulation]) for one in again]
    return rows


def tell(runs: Trajectories, seen: list[Seen], one: Accident, number: int) -> dict[str, Any]:
    """One accident."""
    row, interval = one.simulation, runs.scenario.frame_interval_ms
    how, frame = mechanism(runs, row, one)
    decision = min(frame * interval // 50, len(seen) - 1)
    pair = one.vehicles[:2]
    weather = runs.scenario.weather
    return {
        "simulation": number,
        "time_s": round(one.time, 2),
        "mechanism": how,
        "vehicles": list(one.vehicles),
        "kinds": [VehicleKind(int(runs.scenario.vehicles.kind[row, s])).code for s in one.vehicles],
        "delta_v_kmh": round(float(kmh_from_mps(one.delta_v)), 1),
        "closing_kmh": round(float(kmh_from_mps(one.closing_speed)), 1),
        "severity": one.severity.name.lower(),
        "night": bool(weather.night[row]),
        "rain_percent": round(float(weather.rain[row])),
        "fog_percent": round(float(weather.fog[row])),
        "decisive_s_before": round(one.time - 1e-3 * frame * interval, 2),
        "speeds_kmh": [
            round(float(kmh_from_mps(1e-3 * runs.states.speed[row, slot, frame]))) for slot in pair
        ],
        "beliefs": [
            {"of": of, "about": other, "believed": belief(seen, of, other, row, decision)}
            for of, other in zip(pair, reversed(pair), strict=True)
            if of != other
        ],
    }


def summary(tally: Tally, rows: list[dict[str, Any]]) -> dict[str, Any]:
    """The rate with its interval, and counts by severity and mechanism."""
    scale = MILLION_KM / tally.metres

    def rated(count: int) -> dict[str, float]:
        low, high = poisson_limits(count)
        return {"count": count, "rate": count * scale, "low": low * scale, "high": high * scale}

    hard = [one.name.lower() for one in Severity]
    return {
        "profile": tally.profile,
        "changes": tally.changes,
        "seed": tally.seed,
        "simulations": tally.done,
        "km": 1e-3 * tally.metres,
        "all": rated(len(tally.found)),
        # Accidents of one simulation may follow from each other; simulations are independent.
        "simulations_with_any": rated(len({one["simulation"] for one in tally.found})),
        "by_severity": {name: rated(sum(one["severity"] == name for one in rows)) for name in hard},
        "by_mechanism": dict(collections.Counter(one["mechanism"] for one in rows)),
        "accidents": rows,
    }


def shown(found: dict[str, Any]) -> Iterable[str]:
    """The lines of the report."""
    every = found["all"]
    yield (
        f"{found['profile']}, seed {found['seed']}: {found['simulations']:,} simulations, "
        f"{found['km']:,.0f} vehicle-km, {every['count']} accidents"
    )
    counted = {"all": every, "simulations": found["simulations_with_any"], **found["by_severity"]}
    for name, one in counted.items():
        yield (
            f"  {name:<12} {one['count']:>4}   {one['rate']:.2f} per million km "
            f"(95 % exact Poisson {one['low']:.2f} .. {one['high']:.2f})"
        )
    for name, count in sorted(found["by_mechanism"].items()):
        yield f"  {name:<16} {count}"
    for one in found["accidents"]:
        yield ""
        yield (
            f"simulation {one['simulation']}, {one['time_s']} s: {one['mechanism']}, vehicles "
            f"{', '.join(map('{} ({})'.format, one['vehicles'], one['kinds']))}; "
            f"delta-v {one['delta_v_kmh']} km/h, closing at {one['closing_kmh']} km/h; "
            f"{'night' if one['night'] else 'day'}, rain {one['rain_percent']} %, "
            f"fog {one['fog_percent']} %"
        )
        yield f"  {one['decisive_s_before']} s before, at {one['speeds_kmh']} km/h:"
        for each in one["beliefs"]:
            yield f"    {each['of']} about {each['about']}: {in_words(each['believed'])}"


def in_words(believed: dict[str, Any] | None) -> str:
    """A belief in words."""
    if believed is None:
        return "no neighbour"
    truth = f"{believed['where']}, {believed['true_gap_m']:.1f} m away"
    if believed["looked_s_before"]:
        truth += f" at a look {believed['looked_s_before']} s before that"
    if not believed["noticed"]:
        return f"{truth}: not noticed"
    return (
        f"{truth}: believed at {believed['believed_gap_m']:.1f} m, closing at "
        f"{kmh_from_mps(believed['believed_closing_mps']):+.0f} km/h"
    )


def main() -> int:
    """Do what the command line says."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("profile", nargs="?", default="motorway")
    parser.add_argument("--km", type=float, default=3e6, help="vehicle-km to drive")
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--workers", type=int, default=min(4, os.cpu_count() or 1))
    parser.add_argument("--kept", type=Path, help="file to go on from, and to keep progress in")
    parser.add_argument("--every-s", type=float, default=10.0, help="seconds between two lines")
    parser.add_argument("--json", action="store_true", help="print everything as JSON")
    asked = parser.parse_args()
    changes = overrides(asked.set, None)
    given = load_specification(asked.profile, changes)
    road = load_road(given.road)
    tally = begun(asked, changes)
    drive_far(given, road, tally, asked)
    found = summary(tally, told(given, road, tally))
    print(json.dumps(found, indent=2) if asked.json else "\n".join(shown(found)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
