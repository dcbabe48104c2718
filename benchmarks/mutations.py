"""Breaks the engine's step in one place at a time, and runs the test of bit identity against it.

    python benchmarks/mutations.py            # all, about half a minute each

Each mutation is an edit of one operator, index or number in a copy of the crates, which is built
and put into a copy of the package; `tests/reference/test_engine.py` then runs with that package.
Exits with 1 if the tests pass with any of them. `flips.py` does so with every operator, much
faster, but without going through the tests.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from flips import ROOT, built_library, cargo, copy_workspace

TEST = "tests/reference/test_engine.py"
IGNORED = shutil.ignore_patterns("__pycache__", "*.so", "*.pyd")


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutation:
    """One edit of the engine's sources.

    Attributes:
        file: Where.
        old: What stands there, once.
        new: What it is replaced by.
        meaning: What it breaks.
    """

    file: str
    old: str
    new: str
    meaning: str


MUTATIONS = (
    Mutation(
        file="collisions.rs", old="approach.simd_gt(0.0)", new="approach.simd_lt(0.0)",
        meaning="comparison: boxes that separate collide, boxes that approach do not",
    ),
    Mutation(
        file="dynamics.rs", old="choose(z.simd_lt(0.0), -one, one)",
        new="choose(z.simd_lt(0.0), one, one)",
        meaning="sign: a sliding tyre pushes to the same side whatever its slip",
    ),
    Mutation(
        file="dynamics.rs", old="state.a_lat[i] - state.vx[i] * state.r[i]",
        new="state.a_lat[i] + state.vx[i] * state.r[i]",
        meaning="sign: of the centripetal term of the lateral velocity",
    ),
    Mutation(
        file="ego.rs", old="their_braking(w, view, FAST_REAR)",
        new="their_braking(w, view, FAST_LEAD)",
        meaning="role: the ego looks ahead where it should look back before pulling out",
    ),
    Mutation(
        file="environment.rs", old="choose(across.simd_lt(0.0), -force, force)",
        new="choose(across.simd_gt(0.0), -force, force)",
        meaning="comparison: the wind pushes against itself",
    ),
    Mutation(
        file="mobil.rs", old="(after - before) - p.bias", new="(after - before) + p.bias",
        meaning="sign: MOBIL's bias draws to the fast side",
    ),
    Mutation(
        file="following.rs", old="p.accel * (1.0 - z * z)", new="p.accel * (1.0 + z * z)",
        meaning="sign: nobody ever forces anybody to brake",
    ),
    Mutation(
        file="neighbours.rs", old="ahead.simd_ge(0.0)", new="ahead.simd_le(0.0)",
        meaning="comparison: who is behind counts as the leader",
    ),
    Mutation(
        file="perception.rs", old="effort.simd_le(1.0)", new="effort.simd_ge(1.0)",
        meaning="comparison: only what is beyond the limit of sight is seen",
    ),
    Mutation(
        file="perception.rs", old="[Some(4), Some(5), Some(0), Some(1), None, None]",
        new="[Some(4), Some(5), Some(1), Some(0), None, None]",
        meaning="roles swapped: after a change to the slow side leader and follower change places",
    ),
    Mutation(
        file="philox.rs", old="ROUNDS: usize = 10", new="ROUNDS: usize = 9",
        meaning="off by one: a round of the random numbers is missing",
    ),
    Mutation(
        file="recording.rs", old="state.s[i] * sine + d * cosine",
        new="state.s[i] * sine - d * cosine",
        meaning="sign: of the lateral offset in the recorded y",
    ),
    Mutation(
        file="steering.rs", old="accel + c.velocity_gain", new="accel - c.velocity_gain",
        meaning="sign: steering feeds lateral speed back the wrong way",
    ),
)  # fmt: skip
"""At least one in every part of the step."""


def mutate(sources: Path, mutation: Mutation) -> None:
    """Edit a copy of the sources.

    Raises:
        SystemExit: The place is not there, or not the only one: the engine was changed.
    """
    path = sources / mutation.file
    text = path.read_text(encoding="utf-8")
    if text.count(mutation.old) != 1:
        count = text.count(mutation.old)
        raise SystemExit(
            f"{mutation.file}: expected {mutation.old!r} once, got it {count} times; "
            "write the mutation anew in benchmarks/mutations.py"
        )
    path.write_text(text.replace(mutation.old, mutation.new), encoding="utf-8")


def build(folder: Path, package: Path) -> None:
    """Build the copy of the crates in `folder`, and put the engine into the copy of the package.

    Raises:
        SystemExit: The mutated engine does not compile.
    """
    done = cargo(folder)
    if done.returncode:
        raise SystemExit(done.stderr)
    library = built_library(folder)
    engine = package / ("_core.pyd" if library.suffix == ".dll" else "_core.abi3.so")
    # A new file: one that is overwritten while a process has it loaded would crash the process.
    engine.unlink(missing_ok=True)
    shutil.copy2(library, engine)


def failing_test(folder: Path) -> str:
    """Run the tests with the copy of the package; the first that fails, empty if all pass."""
    done = subprocess.run(
        [sys.executable, "-m", "pytest", TEST, "-q", "-x", "-p", "no:cacheprovider", "--tb=no"],
        cwd=ROOT, env={**os.environ, "PYTHONPATH": str(folder)}, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    found = re.search(r"^(?:FAILED|ERROR) \S+::(.+?)(?: - .*)?$", done.stdout, re.MULTILINE)
    if found is None and done.returncode:
        raise SystemExit(done.stdout + done.stderr)
    return found[1] if found else ""


def tried(mutation: Mutation | None, folder: Path) -> str:
    """Build the engine with a mutation and run the tests; the first that fails."""
    package = folder / "overtaking"
    if not package.exists():
        shutil.copytree(ROOT / "src" / "overtaking", package, ignore=IGNORED)
    sources = copy_workspace(folder)
    if mutation is not None:
        mutate(sources, mutation)
    build(folder, package)
    return failing_test(folder)


def main() -> int:
    """Break, test, print which test failed."""
    survivors = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if failed := tried(None, folder):
            raise SystemExit(f"{failed} fails with nothing broken")
        for mutation in MUTATIONS:
            failed = tried(mutation, folder)
            survivors += not failed
            print(f"| `{mutation.file}` | {mutation.meaning} | {failed or 'NONE'} |", flush=True)
    print(f"{len(MUTATIONS)} mutations, {survivors} unnoticed")
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
