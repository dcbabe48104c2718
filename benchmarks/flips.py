"""Flips every comparison, sign, extremum and role of the engine's step, one at a time.

    python benchmarks/flips.py                 # every flip; exits with 1 if one goes unnoticed
    python benchmarks/flips.py --file overtake.rs   # flips of one file
    python benchmarks/flips.py --again LOG     # those that an earlier output calls UNNOTICED

A copy of the crates is instrumented so that each operator asks whether it is the flipped one: one
build serves all flips. Unflipped, the copy records what the engine records. A flip is noticed if
any recorded array of any situation of `tests/reference/situations.py` differs from the reference,
if the engine panics, or if it does not end. `mutations.py` does the same to a few, by editing the
source and running the tests themselves.
"""

import argparse
import importlib
import importlib.util
import json
import multiprocessing
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
STEP_FILES = (
    "acceleration", "car_following", "collisions", "gap_acceptance", "lane_change",
    "math/elementary", "math/vectors", "neighbour_search", "oncoming", "overtake", "params",
    "pass_continuation", "passing", "perception", "recorder", "road_conditions", "run/engine",
    "run/step", "state", "steering", "vehicle_dynamics", "vehicle_handle",
)  # fmt: skip
"""What the step consists of, and what writes it down."""

VARIABLE = "OVERTAKING_FLIP"
PANIC = 100  # Exit code of a process in which the engine failed; situations count from 1.
LONGEST_RUN = 60  # Seconds, forty times what an unflipped run takes: a flip may never end.

INSTRUMENT = Path(__file__).with_name("flip.rs")
"""The operators that can be flipped, in Rust."""

OPERATORS = (
    ("comparison", re.compile(r"\.simd_(lt|gt|le|ge|eq|ne)\("), r".flip_\1(#, "),
    ("extremum", re.compile(r"(?<![\w.])(min|max|at_(?:least|most))\("), r"flip::flip_\1(#, "),
    ("sign", re.compile(r"(?<= )([-+]) (?=\S)"), r"\1 flip::sign(#) * "),
    ("sign", re.compile(r"(?<!\w)-(?=[a-z(\d])"), r"-flip::sign(#) * "),
    ("role", re.compile(r"\b((?:LEFT_|RIGHT_)?(?:LEADER|FOLLOWER))\b"), r"flip::role(#, \1)"),
)  # fmt: skip
"""Kind, where it stands, and the instrumented operator with # for the flip's number."""

EQUIVALENT = {
    "let offset = start «+ change * clamp_to(axis_enter, 0.0, 1.0);": (
        "only its sign is used: at the first contact the centres are on the side where they began"
    ),
    "let share_1 = clamp_to((film «- h0) / (h1 - h0), 0.0, 1.0);": "the first film knot is 0",
    "let share_1 = clamp_to((film - h0) / (h1 «- h0), 0.0, 1.0);": "the first film knot is 0",
    "is_detected: [zero«.simd_lt(zero); NUM_ROLES],": (
        "overwritten for every role before it is read"
    ),
    "let never = zero«.simd_lt(zero);": "no number is less or greater than itself",
    "tall_leader: tall_leader.as_ref().filter(|_| role != «LEADER),": (
        "a leader hides neither itself nor a vehicle behind the driver: `is_visible` tests both"
    ),
    "& state.lane_choice.wanted_side[slot]«.simd_eq(0.0)": (
        "a driver that wants a lane change has indicated for a moment, so another condition fails"
    ),
    "& state.controls.indicator[slot]«.simd_eq(0.0);": (
        "no driver has no plan then, so each one decides, which changes nothing"
    ),
    "splat(simd, road.boundaries[1] «- constants.corridor_margin),": (
        "more vehicles may be in the lane of oncoming ones; the search tests each of them again"
    ),
    "let drives_along = vehicle.travel_sign«.simd_gt(0.0);": (
        "both directions exchange their names, and each meets the other one"
    ),
    "search.as_seen_by_oncoming[j].on_road &= excluded_slot«.simd_ne(j as i32 as f32);": (
        "only external drivers observe the second oncoming vehicle, and nothing of it is recorded"
    ),
    "if lane«.simd_eq(0.0).all_true() {": (
        "drivers outside their lane overtake and meet no vehicle in it; others search more slots"
    ),
    "let accepts_every_gap = params.vehicles[EGO_SLOT].gap_demand_factor«.simd_le(0.0);": (
        "a factor of 0 passes both comparisons, and egos with a larger one only search more slots"
    ),
    "return sincos_reduced(x «+ 0.0);": "only the sign of a zero changes",
    "a«.simd_lt(b).select(a, b)": "only for other CPUs than x86",
    "a«.simd_gt(b).select(a, b)": "only for other CPUs than x86",
}
"""Flips that change nothing that is recorded, and why: no test can notice them."""

EQUIVALENT_AT = {
    "avx512": {
        "let indices: i32x16<S> = «at_least(slot, 0.0).to_int();": (
            "a vector is as wide as a block there, so no value is loaded by its slot"
        ),
    },
}
"""Further flips that change nothing at one SIMD level."""

_LEFT_ALONE = re.compile(
    r"^\s*(//|#|use |pub use |const |pub const |(pub(\(crate\))? )?(fn|struct|type) |S: Simd)"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Flip:
    """One place that can be flipped.

    Attributes:
        number: What it is called by.
        kind: Which sort of operator.
        file: Where.
        line: Line there, from 1.
        column: Column there, from 0.
        text: The line.
    """

    number: int
    kind: str
    file: str
    line: int
    column: int
    text: str

    @property
    def marked(self) -> str:
        """The line without its comment, with a mark before the operator."""
        return f"{self.text[: self.column]}«{self.text[self.column :]}".partition(" //")[0].strip()

    def __str__(self) -> str:
        """Where it is, and what it is."""
        return f"{self.file}:{self.line} {self.kind}: {self.marked}"


def flips_of(folder: Path) -> list[Flip]:
    """Every place in the engine's step that can be flipped."""
    found: list[Flip] = []
    for name in STEP_FILES:
        lines = (folder / f"{name}.rs").read_text(encoding="utf-8").splitlines()
        imports = False
        for number, text in enumerate(lines, 1):
            if text.startswith("#[cfg(test)]"):
                break
            imports = text.startswith("use ") or (imports and not lines[number - 2].endswith(";"))
            if imports or _LEFT_ALONE.match(text):
                continue
            code = text.partition(" //")[0]
            for kind, pattern, _ in OPERATORS:
                for match in pattern.finditer(code):
                    if _is_index(code, match.start()):
                        continue
                    flip = Flip(
                        number=len(found), kind=kind, file=f"{name}.rs", line=number,
                        column=match.start(), text=text,
                    )  # fmt: skip
                    found.append(flip)
    return found


def _is_index(text: str, column: int) -> bool:
    """Whether a column is inside the brackets that pick an element of an array."""
    depth = 0
    for at in range(column - 1, 0, -1):
        depth += {"]": 1, "[": -1}.get(text[at], 0)
        if depth < 0:
            return text[at - 1].isalnum() or text[at - 1] in "_])"
    return False


def instrument(folder: Path, flips: list[Flip]) -> None:
    """Let every operator of `flips` in a copy of the sources ask whether it is the flipped one."""
    shutil.copy2(INSTRUMENT, folder / "flip.rs")
    library = folder / "lib.rs"
    library.write_text(library.read_text(encoding="utf-8") + "\nmod flip;\n", encoding="utf-8")
    for name in {flip.file for flip in flips}:
        lines = (folder / name).read_text(encoding="utf-8").splitlines()
        for flip in sorted(flips, key=lambda one: -one.column):
            if flip.file == name:
                lines[flip.line - 1] = _instrumented(lines[flip.line - 1], flip)
        lines.append("#[allow(unused_imports)]\nuse crate::flip::{self, Flip};")
        (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")


def _instrumented(text: str, flip: Flip) -> str:
    for kind, pattern, replacement in OPERATORS:
        match = pattern.match(text, flip.column)
        if kind == flip.kind and match:
            changed = match.expand(replacement).replace("#", str(flip.number))
            return text[: flip.column] + changed + text[match.end() :]
    raise AssertionError(flip)


def cargo(folder: Path, target: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Build the binding of a copy of the workspace, quickly rather than well.

    Args:
        folder: The copy.
        target: What is built goes there; `target` in the copy by default.
    """
    settings = {"CARGO_TARGET_DIR": str(target or folder / "target"), "PYO3_PYTHON": sys.executable}
    settings |= {"CARGO_PROFILE_RELEASE_LTO": "off", "CARGO_PROFILE_RELEASE_OPT_LEVEL": "1"}
    settings["OVERTAKING_LEVELS"] = "native"  # One is enough: all record the same bits.
    return subprocess.run(
        [
            *("cargo", "build", "--release", "--locked", "-p", "overtaking-py"),
            *("--features", "pyo3/extension-module", "--message-format", "json"),
        ],
        cwd=folder,
        env={**os.environ, **settings},
        capture_output=True,
        text=True,
        check=False,
    )


def built_library(folder: Path) -> Path:
    """What `cargo` built."""
    return next((folder / "target" / "release").glob("*_core.*[!d]"))


def build(folder: Path) -> tuple[Path | None, set[tuple[str, int]]]:
    """Build a copy of the workspace; the library, or the (file, line)s that do not compile."""
    done = cargo(folder)
    if done.returncode == 0:
        return built_library(folder), set()
    wrong: set[tuple[str, int]] = set()
    for line in done.stdout.splitlines():
        message = json.loads(line).get("message") or {}
        if message.get("level") == "error":
            spans = [span for span in message["spans"] if span["is_primary"]]
            paths = [span["file_name"].rpartition("overtaking-core/src/")[2] for span in spans]
            wrong |= set(zip(paths, (span["line_start"] for span in spans), strict=True))
    if not wrong:
        raise SystemExit(done.stderr)
    return None, wrong


def copy_workspace(folder: Path) -> Path:
    """Copy what cargo needs; the folder of the engine's sources."""
    for name in ("Cargo.toml", "Cargo.lock"):
        shutil.copy2(ROOT / name, folder / name)
    shutil.rmtree(folder / "crates", ignore_errors=True)
    shutil.copytree(ROOT / "crates", folder / "crates")
    return folder / "crates" / "overtaking-core" / "src"


def instrumented_engine(folder: Path) -> tuple[Path, list[Flip], list[Flip]]:
    """Build the engine with operators that can be flipped.

    Returns:
        The library, the flips, and those left out because they are not on vectors or floats:
        instrumented, they do not compile.
    """
    every = flips_of(ROOT / "crates" / "overtaking-core" / "src")
    left = list(every)
    for _ in range(8):
        sources = copy_workspace(folder)
        instrument(sources, left)
        library, wrong = build(folder)
        if library is not None:
            return library, left, [flip for flip in every if flip not in left]
        on_bad_line = {flip for flip in left if (flip.file, flip.line) in wrong}
        # Comparisons are rarely the reason; they are left out only if the line still is wrong.
        signs = {flip for flip in on_bad_line if flip.kind == "sign"}
        left = [flip for flip in left if flip not in (signs or on_bad_line)]
    raise SystemExit("the instrumented engine does not compile: see instrumented_engine")


def load_engine(library: Path) -> Any:
    """Import the package with `library` as its engine; the situations and how they are compared."""
    spec = importlib.util.spec_from_file_location("overtaking._core", library)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["overtaking._core"] = module
    spec.loader.exec_module(module)
    sys.path.insert(0, str(ROOT))
    return importlib.import_module("tests.reference.situations")


def _expected() -> list[Any]:
    """What the reference records of each situation."""
    situations = importlib.import_module("tests.reference.situations")
    reference = importlib.import_module("overtaking.sim.reference")
    return [one.run(one.scenario(one.share), reference.run) for one in situations.EVERY]


class Sweep:
    """Runs the instrumented engine in a process for each flip, and compares with the reference."""

    def __init__(self, situations: Any, memory: Path) -> None:
        """Simulate every situation with the reference."""
        self.situations = situations
        self.memory = memory
        self.engine = importlib.import_module("overtaking.sim.engine")
        # In a process of its own: an engine asks once which operator is flipped, and compiled code
        # draws the scenarios. What is forked from one that has asked would flip nothing.
        with multiprocessing.get_context("fork").Pool(1) as apart:
            self.expected = apart.apply(_expected)

    def noticed(self) -> int:
        """Number of the first situation that differs, from 1; 0 if none does."""
        known = zip(self.situations.EVERY, self.expected, strict=True)
        for number, (situation, expected) in enumerate(known, 1):
            run = situation.run(expected.scenario, self.engine.run)
            if self.situations.difference(run, expected):
                return number
        return 0

    def hashes(self, scale: int) -> int:
        """Write trace hashes and indices of `scale` times as many simulations to `self.memory`."""
        runs = [
            one.run(one.scenario(one.share * scale), self.engine.run)
            for one in self.situations.EVERY
        ]
        hashes = np.concatenate([run.trace_hash for run in runs])
        np.savez(
            self.memory,
            hashes=hashes,
            index=np.concatenate([run.scenario.scenario_index for run in runs]),
        )
        return 0

    def search(self, flip: Flip, scale: int) -> str:
        """Where, among `scale` times as many simulations, a flip would be noticed."""
        found: list[Any] = []
        for each in (None, flip):
            self.result(self.start(each, lambda: self.hashes(scale)))
            found.append(dict(np.load(self.memory)))
        hashes = [one["hashes"] for one in found]
        different = np.flatnonzero((hashes[0] != hashes[1]).any(axis=1))
        names = [one for one in self.situations.EVERY for _ in range(one.share * scale)]
        where = [f"{names[at].name} {found[0]['index'][at]}" for at in different[:4]]
        return ", ".join([f"{len(different)} of {len(names)}", *where])

    def start(self, flip: Flip | None, act: Callable[[], int] | None = None) -> int:
        """Start a process that does something with `flip` flipped; its number."""
        child = os.fork()
        if child:
            return child
        code = PANIC
        try:
            os.environ[VARIABLE] = str(flip.number) if flip else ""
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # A panic would print where it happened.
            code = (act or self.noticed)()
        finally:
            os._exit(code)

    def result(self, child: int) -> str:
        """Wait for a process; what noticed its flip, empty if nothing did."""
        until = time.monotonic() + LONGEST_RUN
        while time.monotonic() < until:
            ended, status = os.waitpid(child, os.WNOHANG)
            if ended:
                code = os.waitstatus_to_exitcode(status)
                if code == 0:
                    return ""
                return self.situations.EVERY[code - 1].name if 0 < code < PANIC else "panic"
            time.sleep(0.005)
        os.kill(child, 9)
        os.waitpid(child, 0)
        return "endless"


def main() -> int:
    """Flip, compare, print what noticed and what did not."""
    parser = argparse.ArgumentParser(description="Flip every operator of the engine's step.")
    parser.add_argument("--file", help="only those of one file, such as overtake.rs")
    parser.add_argument(
        "--again", type=Path, metavar="LOG", help="only those that went unnoticed in this output"
    )
    parser.add_argument(
        "--search", type=int, default=0, metavar="N",
        help="look for simulations, in N times as many, that would notice the unnoticed",
    )  # fmt: skip
    given = parser.parse_args()
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    with tempfile.TemporaryDirectory() as name:
        library, flips, left_out = instrumented_engine(Path(name))
        sweep = Sweep(load_engine(library), Path(name) / "hashes.npz")
        if sweep.result(sweep.start(None)):
            raise SystemExit(
                "the instrumented engine differs from the reference with nothing flipped"
            )
        chosen = [flip for flip in flips if given.file in (None, flip.file)]
        if given.again:
            before = given.again.read_text(encoding="utf-8")
            chosen = [flip for flip in chosen if f"UNNOTICED  {flip}  " in before]
        survivors, by = list[Flip](), Counter[str]()
        native = importlib.import_module("overtaking._core").default_simd_level()
        equivalent = EQUIVALENT | EQUIVALENT_AT.get(native, {})
        untrue = equivalent.keys() - {flip.marked for flip in flips}
        for flip in chosen:
            found = sweep.result(sweep.start(flip))
            by[found or "nobody"] += 1
            if flip.marked in equivalent:
                print(f"equivalent {flip}: {equivalent[flip.marked]}", flush=True)
                untrue |= {flip.marked} if found else set()
            elif not found:
                survivors.append(flip)
                where = sweep.search(flip, given.search) if given.search else ""
                print(f"UNNOTICED  {flip}  {where}", flush=True)
    kinds = Counter(flip.kind for flip in chosen)
    print(f"{len(chosen)} flips ({', '.join(f'{kinds[kind]} {kind}' for kind in sorted(kinds))})")
    print(f"noticed by: {dict(by)}; {len(survivors)} unnoticed that should not be")
    for marked in sorted(untrue):
        print(f"NOT SO     {marked}: it is noticed, or not there any more")
    print(f"{len(left_out)} places left out because they are not on vectors or floats")
    for flip in left_out:
        print(f"left out   {flip}")
    return 1 if survivors or untrue else 0


if __name__ == "__main__":
    sys.exit(main())
