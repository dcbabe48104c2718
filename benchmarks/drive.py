"""How many decisions a second a policy can take, beside highway-env in the same run.

    python benchmarks/drive.py
    python benchmarks/drive.py --simulations 4096 --turns 6

A constant policy, asked 20 times a second in a batch: what is measured is the engine, the copies of
actions and observations, and nothing of a policy. Only decisions of simulations that run count.
`pinto2023-physical` has up to six vehicles, `motorway` up to 32. Two rows are calls of the stepper
alone, one a call of `overtaking.drive`, which checks, rounds and simulates again with the recorded
actions. highway-env steps its road with five vehicles, of which we count one for a driver of one's
own (`highway.py`; README.md beside this file says how to install it). All take turns; a rate is the
median of the turns.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from statistics import median
from typing import Any

import numpy as np

import overtaking as ot
from measure import ROOT, Measure, load_note, parser, report
from overtaking.model.driver_interface import MAX_ACTION_PARTS
from overtaking.sim.stepping import new_stepper
from overtaking.world.step_parameters import step_parameters

PEERS_PYTHON = ROOT / "target" / "peers" / "bin" / "python"
FRAMES = 200  # Of a simulation of `highway.py`, one for each decision.
TARGET = 300_000.0  # Decisions a second on two cores, of the profile of the study.

Rates = tuple[float, float]
"""Decisions a second by the clock, and for each second of a core."""


def timed(decisions: Callable[[], int]) -> Rates:
    """The rates of some work that says how many decisions it was."""
    wall, core = time.perf_counter(), time.process_time()
    count = decisions()
    return count / (time.perf_counter() - wall), count / (time.process_time() - core)


def steps(scenario: ot.Scenario, hold: int) -> int:
    """Drive a batch to its end with a constant action."""
    batch = new_stepper(step_parameters(scenario), "accel_lane", observes_truth=False)
    constant = np.zeros((scenario.num_simulations, MAX_ACTION_PARTS), np.int32)
    _, runs, _ = batch.observe_start()
    count = 0
    while runs.any():
        count += hold * int(runs.sum())
        _, runs, _ = batch.step(constant, hold)
    return count


def drives(scenario: ot.Scenario) -> int:
    """The same through the public function, with what it records."""
    answer = np.zeros((scenario.num_simulations, 2))
    run = ot.drive(scenario, lambda _: answer, observation="human")
    return int(run.num_frames.sum()) * scenario.frame_interval_ms // 50


def highway() -> Rates | None:
    """The rates of a process of highway-env on each core; None where it is not installed."""
    if not PEERS_PYTHON.exists():
        return None
    command = [str(PEERS_PYTHON), str(ROOT / "benchmarks" / "highway.py"), "--seconds", "2"]
    cores = [subprocess.Popen(command, stdout=subprocess.PIPE) for _ in range(os.cpu_count() or 1)]
    found = [json.loads(one.communicate()[0]) for one in cores]
    wall = sum(FRAMES * one["simulations"] / one["wall"] for one in found)
    return wall, sum(FRAMES * one["simulations"] / one["core"] for one in found) / len(found)


def measures(simulations: int, turns: int) -> list[Measure]:
    """Every row, all of them in turns."""
    study = ot.sample("pinto2023-physical", num_simulations=simulations, seed=3)
    short: dict[str, Any] = dict.fromkeys(("time.horizon_s", "time.attempt_deadline_s"), 20.0)
    busy = ot.sample("motorway", num_simulations=simulations // 8, seed=3, overrides=short)
    work: dict[str, Callable[[], Rates | None]] = {
        f"pinto2023-physical, {simulations} at a time": partial(timed, partial(steps, study, 1)),
        f"pinto2023-physical, {simulations}, held for 4": partial(timed, partial(steps, study, 4)),
        f"motorway, {simulations // 8} at a time": partial(timed, partial(steps, busy, 1)),
        "pinto2023-physical, overtaking.drive": partial(timed, partial(drives, study)),
        "highway-env, five vehicles, road alone": highway,
    }
    rates = [{name: one() for name, one in work.items()} for _ in range(turns)]
    found: list[Measure] = []
    for name in work:
        each = [rate for turn in rates if (rate := turn[name]) is not None]
        if not each:
            continue
        wall, core = (median(column) for column in zip(*each, strict=True))
        least = TARGET if name.endswith("at a time") and name.startswith("pinto") else None
        note = f"{core:,.0f} a second of a core"
        found.append(Measure(name=name, value=wall, unit="decisions/s", at_least=least, note=note))
    return found


def main() -> int:
    """Measure and print."""
    options = parser(__doc__)
    options.add_argument("--simulations", type=int, default=4096, help="in a batch")
    options.add_argument("--turns", type=int, default=3)
    given = options.parse_args()
    before = load_note()
    missed = report(measures(given.simulations, given.turns), as_json=given.json)
    if not given.json:
        print(before)
    return missed


if __name__ == "__main__":
    sys.exit(main())
