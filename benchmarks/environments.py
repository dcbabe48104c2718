"""What environments of Gymnasium cost: steps a second, and whether memory grows.

    python benchmarks/environments.py
    python benchmarks/environments.py --envs 64 --profile motorway --hold 10 --steps 500

Steps all environments with a constant wish to go on, 20 times a second unless held, while episodes
begin and end at their own times. Memory is what the process holds after every 20 steps; the largest
of the last half is compared with that of the first. Verdicts are left out (`with_labels=False`):
they cost a simulation and its labels at the end of each episode. Needs the extra [gym]. Linux only.
"""

import os
import sys
import time
from pathlib import Path

import numpy as np

from measure import Measure, load_note, parser, report
from overtaking.gym import OvertakingVectorEnv

EVERY = 20
MIB = 2**20


def held() -> float:
    """Memory of this process [MiB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / MIB


def main() -> int:
    """Measure and print."""
    options = parser(__doc__)
    options.add_argument("--profile", default="pinto2023-physical")
    options.add_argument("--envs", type=int, default=10_000)
    options.add_argument("--steps", type=int, default=2000)
    options.add_argument("--hold", type=int, default=1)
    given = options.parse_args()
    before = load_note()
    envs = OvertakingVectorEnv(
        given.profile,
        given.envs,
        observation="human",
        action_repeat=given.hold,
        reward="progress",
        with_labels=False,
    )
    envs.reset(seed=1)
    wish, memory, ended = np.zeros((given.envs, 2)), list[float](), 0
    wall, core = time.perf_counter(), time.process_time()
    for step in range(given.steps):
        *_, terminated, truncated, _ = envs.step(wish)
        ended += int((terminated | truncated).sum())
        if (step + 1) % EVERY == 0:
            memory.append(held())
    wall, core = time.perf_counter() - wall, time.process_time() - core
    decisions, half = given.envs * given.steps * given.hold, len(memory) // 2
    first, last = max(memory[:half]), max(memory[half:])
    name = f"{given.profile}, {given.envs} at a time"
    note = f"{decisions / core:,.0f} a second of a core"
    measures = [
        Measure(name=name, value=decisions / wall, unit="decisions/s", note=note),
        Measure(name="episodes that have ended", value=ended, unit=""),
        Measure(name="memory, first half", value=first, unit="MiB"),
        Measure(name="memory, last half", value=last, unit="MiB", at_most=1.02 * first),
    ]
    missed = report(measures, as_json=given.json)
    if not given.json:
        print(before)
    return missed


if __name__ == "__main__":
    sys.exit(main())
