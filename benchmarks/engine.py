"""Compares the engine's speed with that of its peers, in the same run.

    python benchmarks/engine.py
    python benchmarks/engine.py --turns 12 --seconds 2

The comparison: five live vehicles for exactly 200 frames at 20 Hz without an early end, with the
whole model and every field of the states written into memory that is used again. The peers simulate
as many vehicles for as long, with a process on each core: libsumo (`sumo.py`) and highway-env
(`highway.py`). README.md beside this file says what differs. Further rows: scenarios drawn as well,
full slots, the profiles as they are, and the other SIMD levels.

All take turns, so that all meet the same machine. A rate is the median of the turns. A ratio
compares, within a turn, the processor's time for a second of one vehicle; its median stands beside
the least and the greatest, which with six turns are a 97 % interval of the median.
"""

import dataclasses
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from statistics import median
from typing import Any

import numpy as np

from measure import ROOT, Measure, number, parser, report
from overtaking import _core
from overtaking.core.arrays import Buffers
from overtaking.model.scenario import SLOT_CAPACITIES, Scenario
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification, profile_names
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.scenarios.specification import Specification
from overtaking.sim import engine
from overtaking.world.step_parameters import StepParameters, step_parameters

SIMULATIONS, VEHICLES, FRAMES = 1024, 5, 200
STEP = 0.05  # Between frames [s].
VEHICLE_SECONDS = VEHICLES * FRAMES * STEP  # Of a simulation in the comparison.
OF_PROFILE = 128  # Simulations of a profile; those of motorway last for minutes.
SPACING_M = 60.0  # Room on the road for each vehicle of a crowd.
TURNS, SECONDS = 6, 0.5
NEVER = 1000.0

OURS = f"engine, {VEHICLES} vehicles, {FRAMES * STEP:.0f} s"
GETTERS = "libsumo, getters"
PEERS = {
    GETTERS: ("sumo.py",),
    "libsumo, nothing read": ("sumo.py", "--unread"),
    "libsumo, sub-lane model, getters": ("sumo.py", "--lateral-resolution", "0.8"),
    "highway-env": ("highway.py",),
}
"""Programs beside this one, with options."""

INSTALL = {
    "sumo.py": "make bench",
    "highway.py": "python -m venv target/peers"
    " && target/peers/bin/python -m pip install highway-env==1.12.1",
}
PEERS_PYTHON = ROOT / "target" / "peers" / "bin" / "python"

Batch = Callable[[], tuple[int, float]]
"""Simulates a batch; how many simulations it was, and the seconds that their vehicles lived."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """What was simulated in a turn, and in which time.

    Attributes:
        simulations: How many.
        vehicle_seconds: Seconds that their vehicles lived, together.
        wall: Time by the clock, all cores together [s].
        core: Time of the processor [s].
        version: Of the program that simulated.
    """

    simulations: int
    vehicle_seconds: float
    wall: float
    core: float
    version: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Row(Measure):
    """A rate by the clock, beside other numbers of the same turns.

    Attributes:
        core: Simulations for a second of a core.
        vehicle_seconds: Seconds of one vehicle for a second of a core.
        slower: Time of a core for a second of one vehicle, in that of the engine's five vehicles:
            least, median and greatest of the turns.
    """

    core: float
    vehicle_seconds: float
    slower: tuple[float, float, float]

    def line(self) -> str:
        """All numbers, on one line."""
        least, middle, greatest = map(number, self.slower)
        return (
            f"{self.name:<34} {number(self.value):>8} {self.unit}, {number(self.core):>8} a core,"
            f" {number(self.vehicle_seconds):>9} vehicle-s/s a core,"
            f" {middle:>6} times as slow ({least} to {greatest}); {self.note}"
        )


def scenarios() -> Scenario:
    """Scenarios of five vehicles that last for 200 frames."""
    five = load_specification(
        "pinto2023-physical", overrides={"traffic.vehicles": [VEHICLES, VEHICLES]}
    )
    return lasting(five, SIMULATIONS)


def crowd(vehicles: int, count: int = SIMULATIONS // 4) -> Scenario:
    """Scenarios with so many vehicles on the motorway that last for 200 frames."""
    drawn = load_specification(
        "pinto2023-physical",
        {
            "profile.road": "motorway",
            "traffic.vehicles": [vehicles, vehicles],
            "traffic.spawn_s_m": [50.0, 50.0 + SPACING_M * vehicles],
        },
    )
    return lasting(drawn, count)


def lasting(drawn: Specification, count: int) -> Scenario:
    """Scenarios of a specification that last for 200 frames."""
    scenario = first(drawn, count)
    horizon = np.full(count, (FRAMES - 1) * STEP, np.float32)
    return scenario.replace(horizon=horizon, attempt_deadline=horizon + np.float32(NEVER))


def first(drawn: Specification, count: int) -> Scenario:
    """The first scenarios of a specification."""
    return ScenarioSource(drawn, load_road(drawn.road), 1).sample(np.arange(count, dtype=np.uint64))


def endless(scenario: Scenario) -> StepParameters:
    """What the engine is given: neither an overtake nor a collision ends a simulation early."""
    given = step_parameters(scenario)
    constants = given.constants.replace(after_overtake=NEVER, after_collision=NEVER)
    return dataclasses.replace(given, constants=constants)


def engine_batch(scenario: Scenario, given: StepParameters, level: str | None = None) -> Batch:
    """Simulates scenarios that were prepared before."""
    buffers = Buffers()
    vehicles = scenario.vehicles.valid.sum(axis=1)

    def batch() -> tuple[int, float]:
        frames = engine.run(scenario, given, buffers=buffers, level=level).num_frames
        return len(frames), float((vehicles * frames).sum()) * STEP

    batch()
    return batch


def five_batch(level: str | None = None) -> Batch:
    """Simulates as many vehicles for as long as the peers.

    Raises:
        RuntimeError: A simulation ended early.
    """
    scenario = scenarios()
    batch = engine_batch(scenario, endless(scenario), level)
    if not math.isclose(batch()[1], SIMULATIONS * VEHICLE_SECONDS):
        raise RuntimeError(f"engine: expected {FRAMES} frames everywhere")
    return batch


def whole_batch() -> Batch:
    """Draws the scenarios and prepares them as well."""
    buffers = Buffers()

    def batch() -> tuple[int, float]:
        scenario = scenarios()
        engine.run(scenario, endless(scenario), buffers=buffers)
        return SIMULATIONS, SIMULATIONS * VEHICLE_SECONDS

    batch()
    return batch


def crowd_batch(vehicles: int) -> Batch:
    """Simulates full slots."""
    scenario = crowd(vehicles)
    return engine_batch(scenario, endless(scenario))


def profile_batch(name: str) -> Batch:
    """Simulates a profile as it is."""
    scenario = first(load_specification(name), OF_PROFILE)
    return engine_batch(scenario, step_parameters(scenario))


def engine_sample(batch: Batch, seconds: float, level: str | None = None) -> Sample:
    """Simulates batches for so many seconds of the processor."""
    simulations, vehicle_seconds = 0, 0.0
    wall, core = time.perf_counter(), time.process_time()
    while time.process_time() - core < seconds:
        done, lived = batch()
        simulations, vehicle_seconds = simulations + done, vehicle_seconds + lived
    return Sample(
        simulations=simulations,
        vehicle_seconds=vehicle_seconds,
        wall=time.perf_counter() - wall,
        core=time.process_time() - core,
        version=(
            f"{_core.VERSION}, {level or _core.default_simd_level()}, {_core.num_threads()} threads"
        ),
    )


def peer_sample(program: str, *options: str, seconds: float) -> Sample:
    """What a process on each core simulates in so many seconds of the processor.

    Raises:
        ModuleNotFoundError: The peer is missing.
    """
    python = PEERS_PYTHON if program == "highway.py" and PEERS_PYTHON.exists() else sys.executable
    command = [str(python), str(ROOT / "benchmarks" / program), "--seconds", str(seconds), *options]
    started = [
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for _ in range(os.cpu_count() or 1)
    ]
    told = list[dict[str, Any]]()
    for process in started:
        out, error = process.communicate()
        if "ModuleNotFoundError" in error:
            raise ModuleNotFoundError(
                f"{error.splitlines()[-1]}; to install it: {INSTALL[program]}"
            )
        if process.returncode:
            raise RuntimeError(error)
        told.append(json.loads(out.splitlines()[-1]))
    simulations = sum(each["simulations"] for each in told)
    return Sample(
        simulations=simulations,
        vehicle_seconds=simulations * VEHICLE_SECONDS,
        wall=max(each["wall"] for each in told),
        core=sum(each["core"] for each in told),
        version=told[0]["version"],
    )


def contenders() -> dict[str, Callable[..., Sample]]:
    """What is measured, by name: a function of the seconds to spend."""
    default = _core.default_simd_level()
    levels = [name for name, has in _core.simd_levels() if has and name != default]
    ours = {
        OURS: five_batch(),
        "engine, scenarios drawn as well": whole_batch(),
        **{_slots(slots): crowd_batch(slots) for slots in SLOT_CAPACITIES},
        **{f"engine, profile {name}": profile_batch(name) for name in profile_names()},
    }
    return {
        **{name: partial(engine_sample, batch) for name, batch in ours.items()},
        **{
            f"engine, {level}": partial(engine_sample, five_batch(level), level=level)
            for level in levels
        },
        **{name: partial(peer_sample, *command) for name, command in PEERS.items()},
    }


def in_turn(turns: int, seconds: float) -> dict[str, list[Sample]]:
    """A sample of each contender in each turn; peers that are missing are left out."""
    left = contenders()
    samples: dict[str, list[Sample]] = {name: [] for name in left}
    for _ in range(turns):
        for name in list(left):
            try:
                samples[name].append(left[name](seconds=seconds))
            except ModuleNotFoundError as error:
                print(f"{name} is left out: {error}", file=sys.stderr)
                del left[name], samples[name]
    return samples


def times(samples: list[Sample], base: list[Sample]) -> tuple[float, float, float]:
    """Time for a second of one vehicle in that of `base`: least, median, greatest of the turns."""
    ratios = [
        (one.core / one.vehicle_seconds) / (other.core / other.vehicle_seconds)
        for one, other in zip(samples, base, strict=True)
    ]
    return min(ratios), median(ratios), max(ratios)


def measures(turns: int = TURNS, seconds: float = SECONDS) -> list[Measure]:
    """A row for each contender, and two ratios that have targets."""
    samples = in_turn(turns, seconds)
    found: list[Measure] = [
        Row(
            name=name,
            value=median(one.simulations / one.wall for one in each),
            unit="simulations/s",
            note=each[0].version,
            core=median(one.simulations / one.core for one in each),
            vehicle_seconds=median(one.vehicle_seconds / one.core for one in each),
            slower=times(each, samples[OURS]),
        )
        for name, each in samples.items()
    ]
    crowded = times(samples[_slots(SLOT_CAPACITIES[-1])], samples[_slots(SLOT_CAPACITIES[0])])[1]
    found.append(
        Measure(name="a frame in 32 slots over one in 8", value=crowded, unit="times", at_most=2.0)
    )
    if GETTERS in samples:
        ratio = times(samples[GETTERS], samples[OURS])[1]
        found.append(Measure(name="engine over libsumo", value=ratio, unit="times", at_least=100.0))
    return found


def _slots(slots: int) -> str:
    return f"engine, {slots} vehicles in {slots} slots"


if __name__ == "__main__":
    given = parser(__doc__)
    given.add_argument("--turns", type=int, default=TURNS)
    given.add_argument("--seconds", type=float, default=SECONDS, help="of a processor, for each")
    arguments = given.parse_args()
    sys.exit(report(measures(arguments.turns, arguments.seconds), as_json=arguments.json))
