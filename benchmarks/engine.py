"""Compares the engine's speed with libsumo's, in the same run.

    python benchmarks/engine.py

The engine: five live vehicles, exactly 200 frames at 20 Hz without an early end, the whole model,
every field of the states into memory that is used again. libsumo: a process on each core, as
`sumo.py` describes. The two take turns, so that both meet the same machine, and the best of the
rounds counts for each. Beside the time on the clock stands the processor's: others on the machine
make the first worse, and the second by much less.
"""

import dataclasses
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from measure import ROOT, Measure, parser, report
from overtaking import _core
from overtaking.core.memory import Buffers
from overtaking.model.scenario import SLOTS, Scenario
from overtaking.recordings.roads import load_road
from overtaking.scenarios import sample, spec
from overtaking.sim import engine
from overtaking.world.parameters import Parameters, parameters

SIMULATIONS, VEHICLES, FRAMES = 1024, 5, 200
SPACING_M = 60.0  # Room on the road for each vehicle of a crowd.
ROUNDS = 3
SECONDS = 1.5  # An engine's round: some ten batches.
NEVER = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Rate:
    """Simulations of 5 vehicles and 200 frames a second.

    Attributes:
        wall: By the clock, all cores together.
        core: For each second of a core.
    """

    wall: float
    core: float

    def best(self, other: Self) -> "Rate":
        """The better of two, each number by itself."""
        return Rate(wall=max(self.wall, other.wall), core=max(self.core, other.core))


def scenarios() -> Scenario:
    """Scenarios of five vehicles that last for 200 frames."""
    five = spec("pinto2023", overrides={"traffic.vehicles": [VEHICLES, VEHICLES]})
    drawn = sample(five, load_road("town06"), 1, np.arange(SIMULATIONS, dtype=np.uint64))
    horizon = np.full(SIMULATIONS, (FRAMES - 1) * 0.05, np.float32)
    return drawn.replace(horizon=horizon, attempt_deadline=horizon + np.float32(NEVER))


def endless(scenario: Scenario) -> Parameters:
    """What the engine is given: neither an overtake nor a collision ends a simulation early."""
    given = parameters(scenario)
    constants = given.constants.replace(after_overtake=NEVER, after_collision=NEVER)
    return dataclasses.replace(given, constants=constants)


def rate_of(batch: Callable[[], int]) -> Rate:
    """The rate of something that simulates a batch and returns how many simulations it was."""
    done, begin, core = 0, time.perf_counter(), time.process_time()
    while time.perf_counter() - begin < SECONDS:
        done += batch()
    wall, core = time.perf_counter() - begin, time.process_time() - core
    return Rate(wall=done / wall, core=done / core)


def engine_batch(level: str | None = None) -> Callable[[], int]:
    """Simulates scenarios that were prepared before.

    Raises:
        RuntimeError: A simulation ended early.
    """
    scenario, buffers = scenarios(), Buffers()
    given = endless(scenario)

    def batch() -> int:
        runs = engine.run(scenario, given, buffers=buffers, level=level)
        if not (runs.num_frames == FRAMES).all():
            raise RuntimeError(f"engine: expected {FRAMES} frames everywhere")
        return SIMULATIONS

    batch()
    return batch


def whole_batch() -> Callable[[], int]:
    """Draws the scenarios and prepares them as well."""
    buffers = Buffers()

    def batch() -> int:
        scenario = scenarios()
        engine.run(scenario, endless(scenario), buffers=buffers)
        return SIMULATIONS

    batch()
    return batch


def libsumo_rate() -> Rate | None:
    """The rate of libsumo with one process on each core; None without libsumo."""
    command = [sys.executable, str(ROOT / "benchmarks" / "sumo.py")]
    started = [
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for _ in range(os.cpu_count() or 1)
    ]
    wall, core = 0.0, list[float]()
    for process in started:
        out, error = process.communicate()
        if process.returncode:
            print(error.strip().rpartition("\n")[2], file=sys.stderr)
            return None
        told = json.loads(out.strip().rpartition("\n")[2])
        simulations = told["vehicle_frames"] / (VEHICLES * FRAMES)
        wall += simulations / told["seconds"]
        core.append(simulations / told["core_seconds"])
    return Rate(wall=wall, core=sum(core) / len(core))


def in_turn() -> tuple[Rate, Rate | None]:
    """The best rates of engine and libsumo, measured in turn."""
    batch = engine_batch()
    ours, theirs = rate_of(batch), libsumo_rate()
    for _ in range(ROUNDS - 1):
        ours = ours.best(rate_of(batch))
        again = libsumo_rate() if theirs else None
        theirs = theirs.best(again) if theirs and again else theirs
    return ours, theirs


def crowd(vehicles: int) -> Callable[[], int]:
    """Simulates full slots on the motorway; returns vehicle-frames."""
    drawn = spec(
        "pinto2023",
        {
            "profile.road": "motorway",
            "traffic.vehicles": [vehicles, vehicles],
            "traffic.spawn_s_m": [50.0, 50.0 + SPACING_M * vehicles],
        },
    )
    count = SIMULATIONS // 4
    scenario = sample(drawn, load_road("motorway"), 1, np.arange(count, dtype=np.uint64))
    horizon = np.full(count, (FRAMES - 1) * 0.05, np.float32)
    scenario = scenario.replace(horizon=horizon, attempt_deadline=horizon + np.float32(NEVER))
    given, buffers = endless(scenario), Buffers()

    def batch() -> int:
        return int(engine.run(scenario, given, buffers=buffers).num_frames.sum()) * vehicles

    batch()
    return batch


def crowds() -> list[Measure]:
    """Time of a core for a vehicle in a frame, by the number of slots, all of them filled."""
    cost = {slots: 1e9 / rate_of(crowd(slots)).core for slots in SLOTS}
    found = [
        Measure(name=f"vehicle-frame in {slots} slots", value=cost[slots], unit="ns of a core")
        for slots in SLOTS
    ]
    ratio = cost[SLOTS[-1]] / cost[SLOTS[0]]
    return [
        *found,
        Measure(name="a frame in 32 slots over one in 8", value=ratio, unit="times", at_most=2.0),
    ]


def measures() -> list[Measure]:
    """The engine's rate, libsumo's, and the ratio."""
    ours, theirs = in_turn()
    whole = rate_of(whole_batch())
    note = (
        f"{_core.simd_level()}, {_core.num_threads()} threads; {VEHICLES} vehicles, {FRAMES} frames"
    )
    found = [
        _rate("engine", ours.wall, note=note),
        _rate("engine, a second of a core", ours.core),
        _rate("engine, scenarios drawn as well", whole.wall),
    ]
    for level, available in _core.simd_levels():
        if available and level != _core.simd_level():
            slower = rate_of(engine_batch(level))
            found.append(_rate(f"engine, {level}, a second of a core", slower.core))
    found += crowds()
    if theirs is None:
        return found
    return [
        *found,
        _rate("libsumo, a process on each core", theirs.wall),
        _rate("libsumo, a second of a core", theirs.core),
        _ratio("engine over libsumo", ours.wall / theirs.wall),
        _ratio("engine over libsumo, core by core", ours.core / theirs.core),
    ]


def _ratio(name: str, value: float) -> Measure:
    return Measure(name=name, value=value, unit="times", at_least=100.0)


def _rate(name: str, value: float, note: str = "") -> Measure:
    return Measure(name=name, value=value, unit="simulations/s", note=note)


if __name__ == "__main__":
    arguments = parser(__doc__).parse_args()
    sys.exit(report(measures(), as_json=arguments.json))
