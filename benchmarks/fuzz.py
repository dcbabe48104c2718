"""Gives damaged input to the package: only its own errors may come of it, and little memory.

    python benchmarks/fuzz.py                                # each target 5,000 times
    python benchmarks/fuzz.py --target manifest -n 300 --seed 2
    python benchmarks/fuzz.py --target manifest --case 17    # that one alone

A case is a function of target, seed and number. Targets are listed in `fuzzed.py`; each runs in a
process of its own, whose memory is measured. Exits with 1 if anything but an `OvertakingError` was
raised, a case took too long, or the process needed too much memory.
"""

import argparse
import faulthandler
import random
import resource
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path

from fuzzed import TARGETS, Target
from overtaking.core.errors import OvertakingError, RecordingWarning

MOST_MEMORY_MB = 500
MOST_SECONDS = 60.0
"""A case that takes longer hangs."""

_ADDRESS_SPACE = 4 << 30
"""What a process may ask for, so that a fault cannot take the memory of the machine [bytes]."""

_SHOWN = 5
"""Failures with a traceback."""


def fuzz(target: Target, cases: Iterable[int], seed: int) -> int:
    """Try cases of a target, and say what came of them; returns the number of failures."""
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        corpus = target.corpus(folder)
        for case in cases:
            chance = random.Random(f"{target.name} {seed} {case}")
            given = target.damaged(chance.choice(corpus), chance)
            faulthandler.dump_traceback_later(MOST_SECONDS, exit=True)
            outcome, said = outcome_of(lambda given=given: target.call(given, folder))
            faulthandler.cancel_dump_traceback_later()
            counts[outcome] += 1
            if outcome == "failed":
                print(f"{target.name}, seed {seed}, case {case}: {said.splitlines()[-1]:.200}")
                print(said if counts[outcome] <= _SHOWN else "", flush=True)
    print(f"{target.name}: {dict(counts)}", flush=True)
    return counts["failed"]


def outcome_of(call: Callable[[], object]) -> tuple[str, str]:
    """What became of a call, and what was said."""
    try:
        call()
    except OvertakingError as error:
        # What was damaged must not break the line, nor reach the terminal as a command.
        return ("refused" if str(error).isprintable() else "failed"), repr(error)
    except Exception:
        return "failed", traceback.format_exc(limit=-4)
    return "passed", ""


def peak_memory_mb() -> float:
    """Most memory of this process; `ru_maxrss` counts that of the parent before the start."""
    status = Path("/proc/self/status")
    if not status.exists():
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    lines = status.read_text(encoding="ascii").splitlines()
    return next(float(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM:"))


def alone(target: Target, cases: Iterable[int], seed: int) -> bool:
    """Whether this process, which does nothing else, keeps to what it may."""
    resource.setrlimit(resource.RLIMIT_AS, (_ADDRESS_SPACE, _ADDRESS_SPACE))
    warnings.simplefilter("error")
    # A finding about a recording is an answer to damaged input, as an error is.
    warnings.simplefilter("ignore", RecordingWarning)
    begin = time.monotonic()
    failed = fuzz(target, cases, seed)
    memory_mb = peak_memory_mb()
    print(f"{target.name}: {memory_mb:.0f} MB, {time.monotonic() - begin:.0f} s")
    return not failed and memory_mb <= MOST_MEMORY_MB


def main() -> int:
    """Fuzz one target here, or each of them in a process of its own."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--target", choices=[one.name for one in TARGETS])
    parser.add_argument("-n", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--case", type=int)
    given = parser.parse_args()
    if given.target is None:
        command = [sys.executable, __file__, "-n", str(given.n), "--seed", str(given.seed)]
        runs = [subprocess.run([*command, "--target", one.name], check=False) for one in TARGETS]
        return max(run.returncode for run in runs)
    (target,) = (one for one in TARGETS if one.name == given.target)
    cases = range(given.n) if given.case is None else [given.case]
    return 0 if alone(target, cases, given.seed) else 1


if __name__ == "__main__":
    sys.exit(main())
