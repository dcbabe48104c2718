"""Compares the engine with the readable reference, bit by bit, in many simulations.

    python benchmarks/identity.py                       # 4,224 simulations, one or two minutes
    python benchmarks/identity.py --simulations 576     # a quick look

The situations are those of `tests/reference/situations.py`, more of each. Every recorded array is
compared: at every SIMD level of this CPU, and with the simulations in another order and in batches
of other sizes; and for each level with 1 and 2 threads, in a process of its own, a digest over all
arrays. Exits with 1 at the first difference.
"""

import dataclasses
import importlib
import os
import subprocess
import sys
import time
from typing import Any

import numpy as np

from measure import ROOT, Measure, parser, report
from overtaking import _core
from overtaking.sim import engine, reference

sys.path.insert(0, str(ROOT))
situations: Any = importlib.import_module("tests.reference.situations")

BATCHES = (1, 7, 16, 33, 100)
"""Sizes of the batches that a shuffled set is cut into, taken in turn."""


def levels() -> tuple[list[str], list[str]]:
    """SIMD levels that this CPU has, and those that it lacks."""
    every = _core.simd_levels()
    return [name for name, has in every if has], [name for name, has in every if not has]


def differences(situation: Any, count: int) -> list[str]:
    """What differs between engine and reference in `count` simulations of a situation."""
    scenario = situation.scenario(count)
    expected = situation.run(scenario, reference.run)
    found = list[str]()
    for level in levels()[0]:

        def run(*given: Any, level: str = level) -> Any:
            return engine.run(*given, level=level)

        found.append(f"{level}: {situations.difference(situation.run(scenario, run), expected)}")
    found.append(f"order: {shuffled_difference(situation, expected)}")
    return [f"{situation.name}, {text}" for text in found if not text.endswith(": ")]


def shuffled_difference(situation: Any, expected: Any) -> str:
    """The first difference when the simulations come in another order and in small batches."""
    scenario = expected.scenario
    order = np.random.default_rng(1).permutation(scenario.num_simulations)
    begin = turn = 0
    while begin < len(order):
        part = order[begin : begin + BATCHES[turn % len(BATCHES)]]
        run = situation.run(scenario.select(part), engine.run)
        if found := situations.difference(run, shortened(expected.select(part))):
            return f"batch of {len(part)}: {found}"
        begin, turn = begin + len(part), turn + 1
    return ""


def shortened(run: Any) -> Any:
    """A part of a batch without the frames that only the rest of the batch has."""
    longest = int(run.num_frames.max())
    states = {
        name: values[:, :, :longest] for name, values in situations.arrays(run.states).items()
    }
    return dataclasses.replace(
        run,
        states=run.states.replace(**states),
        stage=run.stage[:, :longest],
        collided_with=run.collided_with[:, :longest],
    )


def digests_of(level: str, threads: int, scale: int) -> list[str]:
    """Digests of all situations as another process simulates them."""
    settings = {"OVERTAKING_SIMD": level, "RAYON_NUM_THREADS": str(threads)}
    done = subprocess.run(
        [sys.executable, "-m", "tests.reference.situations", str(scale)],
        cwd=ROOT, env={**os.environ, **settings}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return done.stdout.splitlines()


def compare(simulations: int) -> tuple[int, list[str]]:
    """Compare everything; how many simulations, and every difference."""
    scale = -(-simulations // situations.SMALL)
    wrong, expected = list[str](), situations.digests(scale)
    for situation in situations.SITUATIONS:
        wrong += differences(situation, situation.share * scale)
    for level in levels()[0]:
        for threads in (1, 2):
            if digests_of(level, threads, scale) != expected:
                wrong.append(f"{level} with {threads} threads differs")
    return scale * situations.SMALL, wrong


def measures(simulations: int) -> list[Measure]:
    """Compare, and say so in numbers."""
    start = time.perf_counter()
    compared, wrong = compare(simulations)
    has, lacks = levels()
    for text in wrong:
        print(text, file=sys.stderr)
    note = f"{compared:,} simulations; {', '.join(has)}; 1 and 2 threads; any order; "
    note += f"{time.perf_counter() - start:.0f} s"
    note += f"; skipped, as this CPU lacks them: {', '.join(lacks)}" if lacks else ""
    return [
        Measure(
            name="engine and reference: differences",
            value=len(wrong),
            unit="",
            at_most=0,
            note=note,
        )
    ]


def main() -> int:
    """Compare and print."""
    arguments = parser(__doc__)
    arguments.add_argument("--simulations", type=int, default=4224)
    given = arguments.parse_args()
    return report(measures(given.simulations), as_json=given.json)


if __name__ == "__main__":
    sys.exit(main())
