"""Flips every comparison, sign, extremum and role of the engine's step, one at a time.

    python benchmarks/flips.py                 # every flip; exits with 1 if one goes unnoticed
    python benchmarks/flips.py --file ego.rs   # those of one file

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
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
STEP_FILES = (
    "collisions", "control", "dynamics", "ego", "elementary", "engine", "environment", "following",
    "lanes", "mobil", "neighbours", "perception", "recording", "state", "steering",
)  # fmt: skip
"""What the step consists of, and what writes it down."""

VARIABLE = "OVERTAKING_FLIP"
PANIC = 100  # Exit code of a process in which the engine failed; situations count from 1.
LONGEST_RUN = 60  # Seconds, forty times what an unflipped run takes: a flip may never end.

INSTRUMENT = """//! Operators that can be flipped one at a time; only in this copy.
use std::sync::LazyLock;
use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x16, i32x16, mask32x16};
use crate::lanes;
static FLIPPED: LazyLock<u32> = LazyLock::new(|| {
    std::env::var("OVERTAKING_FLIP").ok().and_then(|text| text.parse().ok()).unwrap_or(u32::MAX)
});
#[inline(always)]
fn is_flipped(number: u32) -> bool { *FLIPPED == number }
#[inline(always)]
pub fn sign(number: u32) -> f32 { if is_flipped(number) { -1.0 } else { 1.0 } }
#[inline(always)]
pub fn role(number: u32, role: usize) -> usize { if is_flipped(number) { role ^ 1 } else { role } }
type V<S> = f32x16<S>;
#[inline(always)]
pub fn flip_min<S: Simd>(number: u32, a: V<S>, b: V<S>) -> V<S> {
    if is_flipped(number) { lanes::max(a, b) } else { lanes::min(a, b) }
}
#[inline(always)]
pub fn flip_max<S: Simd>(number: u32, a: V<S>, b: V<S>) -> V<S> {
    if is_flipped(number) { lanes::min(a, b) } else { lanes::max(a, b) }
}
#[inline(always)]
pub fn flip_at_most<S: Simd>(number: u32, a: V<S>, b: f32) -> V<S> {
    if is_flipped(number) { lanes::at_least(a, b) } else { lanes::at_most(a, b) }
}
#[inline(always)]
pub fn flip_at_least<S: Simd>(number: u32, a: V<S>, b: f32) -> V<S> {
    if is_flipped(number) { lanes::at_most(a, b) } else { lanes::at_least(a, b) }
}
macro_rules! comparisons { ($($own:ident: $normal:ident $flipped:ident),*) => {
    pub trait Flip<S: Simd>: Sized {
        $(fn $own(self, number: u32, other: impl SimdInto<Self, S>) -> mask32x16<S>;)*
    }
    macro_rules! for_kind { ($kind:ident) => { impl<S: Simd> Flip<S> for $kind<S> { $(
        #[inline(always)]
        fn $own(self, number: u32, other: impl SimdInto<Self, S>) -> mask32x16<S> {
            let other: Self = other.simd_into(self.simd);
            if is_flipped(number) { self.$flipped(other) } else { self.$normal(other) }
        }
    )* } } }
    for_kind!(f32x16);
    for_kind!(i32x16);
} }
comparisons!(flip_lt: simd_lt simd_gt, flip_gt: simd_gt simd_lt, flip_le: simd_le simd_ge,
    flip_ge: simd_ge simd_le, flip_eq: simd_eq simd_ne, flip_ne: simd_ne simd_eq);
"""

OPERATORS = (
    ("comparison", re.compile(r"\.simd_(lt|gt|le|ge|eq|ne)\("), r".flip_\1(#, "),
    ("extremum", re.compile(r"(?<![\w.])(min|max|at_(?:least|most))\("), r"flip::flip_\1(#, "),
    ("sign", re.compile(r"(?<= )([-+]) (?=\S)"), r"\1 flip::sign(#) * "),
    ("sign", re.compile(r"(?<!\w)-(?=[a-z(\d])"), r"-flip::sign(#) * "),
    ("role", re.compile(r"\b((?:FAST_|SLOW_)?(?:LEAD|REAR))\b"), r"flip::role(#, \1)"),
)  # fmt: skip
"""Kind, where it stands, and the instrumented operator with # for the flip's number."""

EQUIVALENT = {
    "let facing = start «+ change * clamp_to(begin, 0.0, 1.0);": (
        "only its sign is used: at the first contact the centres are on the side where they began"
    ),
    "choose(x.simd_lt(0.0), «-y, y)": "the step asks for angles of numbers that are not negative",
    "let a = clamp_to((film «- h0) / (h1 - h0), 0.0, 1.0);": "the first film knot is 0",
    "let a = clamp_to((film - h0) / (h1 «- h0), 0.0, 1.0);": "the first film knot is 0",
    "let row = then «- HISTORY as f32 * floor(then * (1.0 / HISTORY as f32));": (
        "`recall` takes the row modulo the length of the history once more"
    ),
    "detected: [zero«.simd_lt(zero); ROLES],": "overwritten for every role before it is read",
    "(self.vx[i] * cosine - self.vy[i] * sine, self.vx[i] * sine «+ self.vy[i] * cosine)": (
        "nobody reads the speed across the road"
    ),
}
"""Flips that change nothing that is recorded, and why: no test can notice them."""

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
        """The line with a mark before the operator."""
        return f"{self.text[: self.column]}«{self.text[self.column :]}".strip()

    def __str__(self) -> str:
        """Where it is, and what it is."""
        return f"{self.file}:{self.line} {self.kind}: {self.marked}"


def flips_of(folder: Path) -> list[Flip]:
    """Every place in the engine's step that can be flipped."""
    found: list[Flip] = []
    for name in STEP_FILES:
        lines = (folder / f"{name}.rs").read_text(encoding="utf-8").splitlines()
        for number, text in enumerate(lines, 1):
            if text.startswith("#[cfg(test)]"):
                break
            if _LEFT_ALONE.match(text):
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
    (folder / "flip.rs").write_text(INSTRUMENT, encoding="utf-8")
    library = folder / "lib.rs"
    library.write_text(library.read_text(encoding="utf-8") + "\nmod flip;\n", encoding="utf-8")
    for name in {flip.file for flip in flips}:
        lines = (folder / name).read_text(encoding="utf-8").splitlines()
        for flip in sorted(flips, key=lambda one: -one.column):
            if flip.file == name:
                lines[flip.line - 1] = _instrumented(lines[flip.line - 1], flip)
        first = next(at for at, text in enumerate(lines) if not text.startswith("//!"))
        lines.insert(first, "#[allow(unused_imports)]\nuse crate::flip::{self, Flip};")
        (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")


def _instrumented(text: str, flip: Flip) -> str:
    for kind, pattern, replacement in OPERATORS:
        match = pattern.match(text, flip.column)
        if kind == flip.kind and match:
            changed = match.expand(replacement).replace("#", str(flip.number))
            return text[: flip.column] + changed + text[match.end() :]
    raise AssertionError(flip)


def build(folder: Path) -> tuple[Path | None, set[tuple[str, int]]]:
    """Build a copy of the workspace; the library, or the (file, line)s that do not compile."""
    command = [
        *("cargo", "build", "--release", "--locked", "-p", "overtaking-py"),
        *("--features", "pyo3/extension-module", "--message-format", "json"),
    ]
    settings = {"CARGO_TARGET_DIR": str(folder / "target"), "PYO3_PYTHON": sys.executable}
    settings |= {"CARGO_PROFILE_RELEASE_LTO": "off", "CARGO_PROFILE_RELEASE_OPT_LEVEL": "1"}
    done = subprocess.run(
        command,
        cwd=folder,
        env={**os.environ, **settings},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode == 0:
        library = next((folder / "target" / "release").glob("*_core.*[!d]"))
        return library, set()
    wrong: set[tuple[str, int]] = set()
    for line in done.stdout.splitlines():
        message = json.loads(line).get("message") or {}
        if message.get("level") == "error":
            spans = [span for span in message["spans"] if span["is_primary"]]
            wrong |= {(Path(span["file_name"]).name, span["line_start"]) for span in spans}
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
        # The instrumented files have two more lines before the code.
        bad = {(file, line - 2) for file, line in wrong}
        on_bad_line = {flip for flip in left if (flip.file, flip.line) in bad}
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


class Sweep:
    """Runs the instrumented engine in a process for each flip, and compares with the reference."""

    def __init__(self, situations: Any) -> None:
        """Simulate every situation with the reference."""
        self.situations = situations
        self.engine = importlib.import_module("overtaking.sim.engine")
        reference = importlib.import_module("overtaking.sim.reference")
        self.expected = [
            (one, one.run(one.scenario(one.share), reference.run)) for one in situations.SITUATIONS
        ]

    def noticed(self) -> int:
        """Number of the first situation that differs, from 1; 0 if none does."""
        for number, (situation, expected) in enumerate(self.expected, 1):
            run = situation.run(expected.scenario, self.engine.run)
            if self.situations.difference(run, expected):
                return number
        return 0

    def start(self, flip: Flip | None) -> int:
        """Start a process in which `flip` is flipped; its number."""
        child = os.fork()
        if child:
            return child
        code = PANIC
        try:
            os.environ[VARIABLE] = str(flip.number) if flip else ""
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # A panic would print where it happened.
            code = self.noticed()
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
                return self.expected[code - 1][0].name if 0 < code < PANIC else "panic"
            time.sleep(0.005)
        os.kill(child, 9)
        os.waitpid(child, 0)
        return "endless"


def main() -> int:
    """Flip, compare, print what noticed and what did not."""
    parser = argparse.ArgumentParser(description="Flip every operator of the engine's step.")
    parser.add_argument("--file", help="only those of one file, such as ego.rs")
    given = parser.parse_args()
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    with tempfile.TemporaryDirectory() as name:
        library, flips, left_out = instrumented_engine(Path(name))
        sweep = Sweep(load_engine(library))
        if sweep.result(sweep.start(None)):
            raise SystemExit(
                "the instrumented engine differs from the reference with nothing flipped"
            )
        chosen = [flip for flip in flips if given.file in (None, flip.file)]
        survivors, by = list[Flip](), Counter[str]()
        for flip in chosen:
            found = sweep.result(sweep.start(flip))
            by[found or "nobody"] += 1
            if not found and flip.marked in EQUIVALENT:
                print(f"equivalent {flip}: {EQUIVALENT[flip.marked]}", flush=True)
            elif not found:
                survivors.append(flip)
                print(f"UNNOTICED  {flip}", flush=True)
    kinds = Counter(flip.kind for flip in chosen)
    print(f"{len(chosen)} flips ({', '.join(f'{kinds[kind]} {kind}' for kind in sorted(kinds))})")
    print(f"noticed by: {dict(by)}; {len(survivors)} unnoticed that should not be")
    print(f"{len(left_out)} places left out because they are not on vectors or floats")
    for flip in left_out:
        print(f"left out   {flip}")
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
