"""Compares the engine's speed with libsumo's, in the same run.

    python benchmarks/engine.py

The engine: five live vehicles, exactly 200 frames at 20 Hz without an early end, substeps of 10 ms,
the whole model, every field of the states into memory that is used again. libsumo: one process on
each core, as `sumo.py` describes. The two take turns, so that both meet the same machine; the best
of three rounds counts for each.
"""

import dataclasses
import json
import os
import subprocess
import sys
import time

import numpy as np

from measure import ROOT, Measure, parser, report
from overtaking import _core
from overtaking.exchange.roads import load_road
from overtaking.model.scenario import Scenario
from overtaking.scenarios import sample, spec
from overtaking.sim import engine
from overtaking.sim.parameters import Parameters, parameters

SIMULATIONS, VEHICLES, FRAMES = 1024, 5, 200
ROUNDS = 3
NEVER = 1000.0


def workload() -> tuple[Scenario, Parameters]:
    """Scenarios of five vehicles that all run for exactly 200 frames."""
    few = spec("pinto2023", overrides={"traffic.vehicles": f"{VEHICLES}..{VEHICLES}"})
    scenario = sample(few, load_road("town06"), 1, np.arange(SIMULATIONS, dtype=np.uint64))
    horizon = np.full(SIMULATIONS, (FRAMES - 1) * 0.05, np.float32)
    scenario = scenario.replace(horizon=horizon, attempt_deadline=horizon + np.float32(NEVER))
    given = parameters(scenario)
    endless = given.constants.replace(after_overtake=NEVER, after_collision=NEVER)
    return scenario, dataclasses.replace(given, constants=endless)


def engine_rate(scenario: Scenario, given: Parameters, seconds: float = 2.0) -> float:
    """Vehicle-frames a second of the engine."""
    buffers = engine.Buffers()
    engine.run(scenario, given, buffers=buffers)
    done, begin = 0, time.perf_counter()
    while time.perf_counter() - begin < seconds:
        runs = engine.run(scenario, given, buffers=buffers)
        if not (runs.num_frames == FRAMES).all():
            raise RuntimeError(f"engine: expected {FRAMES} frames everywhere")
        done += SIMULATIONS * VEHICLES * FRAMES
    return done / (time.perf_counter() - begin)


def sumo_rate() -> float | None:
    """Vehicle-frames a second of libsumo with one process on each core; None without libsumo."""
    command = [sys.executable, str(ROOT / "benchmarks" / "sumo.py")]
    started = [
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for _ in range(os.cpu_count() or 1)
    ]
    rates = []
    for process in started:
        out, error = process.communicate()
        if process.returncode:
            print(error.strip().rpartition("\n")[2], file=sys.stderr)
            return None
        told = json.loads(out.strip().rpartition("\n")[2])
        rates.append(told["vehicle_frames"] / told["seconds"])
    return sum(rates)


def measures() -> list[Measure]:
    """The engine's rate, libsumo's, and the ratio."""
    scenario, given = workload()
    ours, theirs = [], []
    for _ in range(ROUNDS):
        ours.append(engine_rate(scenario, given))
        theirs.append(sumo_rate())
    note = f"{_core.simd_level()}, {_core.num_threads()} threads"
    best = max(ours)
    found = [
        Measure(name="engine", value=best / 1e6, unit="M vehicle-frames/s", note=note),
        Measure(name="engine", value=best / (VEHICLES * FRAMES), unit="simulations/s"),
    ]
    peers = [rate for rate in theirs if rate is not None]
    if not peers:
        return found
    peer = max(peers)
    return [
        *found,
        Measure(
            name="libsumo, best arrangement",
            value=peer / (VEHICLES * FRAMES),
            unit="simulations/s",
        ),
        Measure(name="engine over libsumo", value=best / peer, unit="times", at_least=100.0),
    ]


if __name__ == "__main__":
    arguments = parser(__doc__).parse_args()
    sys.exit(report(measures(), as_json=arguments.json))
