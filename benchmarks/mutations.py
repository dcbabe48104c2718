"""Flips single operators of the engine's step, and shows which test notices each of them.

    python benchmarks/mutations.py            # one build, then half a minute each

The engine is built once with operators that can be flipped (see `flips.py`) and put into a copy of
the package. `tests/reference/test_engine.py` then runs with each of the mutations below. The exit
status is 1 if the tests pass with any of them. `flips.py` flips every operator in less time each,
because it compares recordings with the reference and does not run the tests.
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
        file: File below the sources of the engine's crate.
        marked: The line, with « before the operator that is flipped.
        meaning: The kind of the operator, and the effect of the flip.
    """

    file: str
    marked: str
    meaning: str


MUTATIONS = (
    Mutation(
        file="collisions.rs",
        marked="let exists = touches & overlap.is_within_step() & closing_speed«.simd_gt(0.0) "
        "& is_running;",
        meaning="comparison: separating vehicles collide, approaching vehicles do not",
    ),
    Mutation(
        file="car_following.rs",
        marked="let stop_lamps_are_on = leader.accel«.simd_lt(-constants.stop_lamp_decel);",
        meaning="comparison: stop lamps are on while the leader does not brake",
    ),
    Mutation(
        file="vehicle_dynamics.rs",
        marked="force: select(z.simd_lt(0.0), size, «-size),",
        meaning="sign: a tyre pushes to the same side for slip to the left and to the right",
    ),
    Mutation(
        file="vehicle_dynamics.rs",
        marked="let vy_rate = side_force * vehicle.inverse_mass «- mid.speed * yaw_rate;",
        meaning="sign: the centripetal term of the lateral velocity",
    ),
    Mutation(
        file="gap_acceptance.rs",
        marked="let is_free_behind = follower_accel«.simd_ge(-inputs.acceptable_imposed_decel)",
        meaning="comparison: the ego pulls out only if the new follower must brake too hard",
    ),
    Mutation(
        file="road_conditions.rs",
        marked="let force = select(across«.simd_lt(0.0), -force, force);",
        meaning="comparison: the wind pushes against its own direction",
    ),
    Mutation(
        file="car_following.rs",
        marked="at_most(vehicle.accel * (1.0 «- z * z), 0.0)",
        meaning="sign: a lane change never forces a follower to brake",
    ),
    Mutation(
        file="lane_change.rs",
        marked="to_left: to_left «- vehicle.keep_right_bias,",
        meaning="sign: the keep-right bias of MOBIL draws to the left",
    ),
    Mutation(
        file="lane_change.rs",
        marked="has_space & rear_accel«.simd_ge(-vehicle.safe_decel) & "
        "accel.simd_ge(-vehicle.safe_decel)",
        meaning="comparison: a driver changes lanes only if the follower must brake too hard",
    ),
    Mutation(
        file="neighbour_search.rs",
        marked="body.visibly_changes_lane & state.lane_choice.lane[j]«.simd_eq(lane_strip.lane);",
        meaning="comparison: a vehicle that changes lanes counts in every lane except its new one",
    ),
    Mutation(
        file="perception.rs",
        marked="neighbour_slot.simd_ge(0.0) & gaze.sight_range_ratio«.simd_le(1.0) & "
        "gap.simd_lt(range);",
        meaning="comparison: a driver sees only vehicles beyond the range of sight",
    ),
    Mutation(
        file="recorder.rs",
        marked="to_recorded_integers(y0 + s * sine «+ d * cosine, INTEGERS_PER_UNIT, INT32_LIMIT),",
        meaning="sign: the lateral position in the recorded y",
    ),
    Mutation(
        file="steering.rs",
        marked="let accel = feedforward «+ constants.velocity_gain * (path.velocity - velocity_d);",
        meaning="sign: the steering feeds the error of the lateral speed back with the wrong sign",
    ),
)
"""At least one mutation for each part of the step."""


def flip_of(mutation: Mutation, flips: list[Flip]) -> Flip:
    """The flip at the line of a mutation.

    Raises:
        SystemExit: The line does not occur exactly once, because the engine was changed.
    """
    matches = [
        flip for flip in flips if (flip.file, flip.marked) == (mutation.file, mutation.marked)
    ]
    if len(matches) != 1:
        raise SystemExit(
            f"{mutation.file}: expected {mutation.marked!r} once, got it {len(matches)} times; "
            "change the mutation in benchmarks/mutations.py to the present line"
        )
    return matches[0]


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
