"""Turns round one operator of the engine's step at a time, and shows which test notices.

    python benchmarks/mutations.py            # one build, then half a minute each

The engine is built once with operators that can be flipped (see `flips.py`) and put into a copy of
the package; `tests/reference/test_engine.py` then runs with each of the flips below. Exits with 1
if the tests pass with any of them. `flips.py` tries every operator, much faster, but without going
through the tests.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from flips import ROOT, VARIABLE, Flip, instrumented_engine

TEST = "tests/reference/test_engine.py"
IGNORED = shutil.ignore_patterns("__pycache__", "*.so", "*.pyd")


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutation:
    """One flip of the engine.

    Attributes:
        file: Where.
        marked: The line, with a mark before the operator that is turned round.
        meaning: What it breaks.
    """

    file: str
    marked: str
    meaning: str


MUTATIONS = (
    Mutation(
        file="collisions.rs", marked="let hit = near & within & approach«.simd_gt(0.0) & runs;",
        meaning="comparison: boxes that separate collide, boxes that approach do not",
    ),
    Mutation(
        file="car_following.rs",
        marked="let brakes = leader_accel«.simd_lt(-constants.stop_lamp_decel);",
        meaning="comparison: drivers heed leaders that do not brake, and ignore those that do",
    ),
    Mutation(
        file="vehicle_dynamics.rs", marked="select(z.simd_lt(0.0), size, «-size),",
        meaning="sign: a tyre pushes to the same side whatever its slip",
    ),
    Mutation(
        file="vehicle_dynamics.rs",
        marked="(side + rear_y + state.friction_and_wind.wind_force[i]) * vehicle.inverse_mass "
        "«- speed * r;",
        meaning="sign: of the centripetal term of the lateral velocity",
    ),
    Mutation(
        file="gap_acceptance.rs",
        marked="let rear = imposed«.simd_ge(-view.acceptable_imposed_decel);",
        meaning="comparison: the ego pulls out only before those whom it makes brake hard",
    ),
    Mutation(
        file="road_conditions.rs",
        marked="state.friction_and_wind.wind_force[i] = "
        "select(across«.simd_lt(0.0), -force, force);",
        meaning="comparison: the wind pushes against itself",
    ),
    Mutation(
        file="car_following.rs", marked="at_most(vehicle.accel * (1.0 «- z * z), 0.0)",
        meaning="sign: nobody ever forces anybody to brake",
    ),
    Mutation(
        file="lane_change.rs",
        marked="let to_fast = fast - here + vehicle.politeness * (after - before) "
        "«- vehicle.keep_right_bias;",
        meaning="sign: MOBIL's bias draws to the fast side",
    ),
    Mutation(
        file="lane_change.rs",
        marked="room & braking«.simd_ge(-vehicle.safe_decel) & own.simd_ge(-vehicle.safe_decel)",
        meaning="comparison: only who makes the follower brake hard may change lanes",
    ),
    Mutation(
        file="neighbour_search.rs",
        marked="let shows = other.visibly_changes_lane "
        "& state.lane_choice.lane[j]«.simd_eq(lane);",
        meaning="comparison: who moves over is seen in every lane but the one that he makes for",
    ),
    Mutation(
        file="perception.rs",
        marked="let mut visible = slot.simd_ge(0.0) & effort«.simd_le(1.0) & gap.simd_lt(reach);",
        meaning="comparison: only what is beyond the limit of sight is seen",
    ),
    Mutation(
        file="recorder.rs",
        marked="to_recorded_integers(y0 + s * sine «+ d * cosine, INTEGERS_PER_UNIT, INT32_LIMIT),",
        meaning="sign: of the lateral offset in the recorded y",
    ),
    Mutation(
        file="steering.rs",
        marked="let wanted = accel «+ constants.velocity_gain * (speed - sideways);",
        meaning="sign: steering feeds lateral speed back the wrong way",
    ),
)  # fmt: skip
"""At least one in every part of the step."""


def flip_of(mutation: Mutation, flips: list[Flip]) -> Flip:
    """The one flip that a mutation is.

    Raises:
        SystemExit: The place is not there, or not the only one: the engine was changed.
    """
    found = [flip for flip in flips if (flip.file, flip.marked) == (mutation.file, mutation.marked)]
    if len(found) != 1:
        raise SystemExit(
            f"{mutation.file}: expected {mutation.marked!r} once, got it {len(found)} times; "
            "write the mutation anew in benchmarks/mutations.py"
        )
    return found[0]


def package_with(library: Path, folder: Path) -> None:
    """Copy the package into a folder, with another engine in it."""
    package = folder / "overtaking"
    shutil.copytree(ROOT / "src" / "overtaking", package, ignore=IGNORED)
    shutil.copy2(library, package / ("_core.pyd" if os.name == "nt" else "_core.abi3.so"))


def failing_test(folder: Path, flip: Flip | None) -> str:
    """Run the tests with the copy of the package; the first that fails, empty if all pass."""
    settings = {"PYTHONPATH": str(folder), VARIABLE: str(flip.number) if flip else ""}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", TEST, "-q", "-x", "-p", "no:cacheprovider", "--tb=no"],
        cwd=ROOT, env={**os.environ, **settings}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    found = re.search(r"^(?:FAILED|ERROR) \S+::(.+?)(?: - .*)?$", done.stdout, re.MULTILINE)
    if found is None and done.returncode:
        raise SystemExit(done.stdout + done.stderr)
    return found[1] if found else ""


def main() -> int:
    """Break, test, print which test failed."""
    survivors = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        workspace = folder / "workspace"
        workspace.mkdir()
        library, flips, _ = instrumented_engine(workspace)
        chosen = [(mutation, flip_of(mutation, flips)) for mutation in MUTATIONS]
        package_with(library, folder)
        if failed := failing_test(folder, None):
            raise SystemExit(f"{failed} fails with nothing broken")
        for mutation, flip in chosen:
            failed = failing_test(folder, flip)
            survivors += not failed
            print(f"| `{mutation.file}` | {mutation.meaning} | {failed or 'NONE'} |", flush=True)
    print(f"{len(MUTATIONS)} mutations, {survivors} unnoticed")
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
