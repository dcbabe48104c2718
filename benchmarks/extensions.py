"""Makes an extension of each kind in a copy of the project, and sees that it works there.

    python benchmarks/extensions.py               # all six; two of them build the engine
    python benchmarks/extensions.py rule page     # some of them

ARCHITECTURE's table "To add" names the files that an extension touches. Each of `extensions.toml`
must touch no other file, and five at most, apart from tests and generated files. Exits with 1 if
one does not, and fails if one does not work.
"""

import argparse
import json
import os
import re
import runpy
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

from flips import ROOT, built_library, cargo

MOST_FILES = 5
BASES = ("", "src/overtaking/", "crates/overtaking-core/src/", "crates/overtaking-labels/src/")
"""The folders to which ARCHITECTURE's paths are relative."""

COPIED = ("benchmarks", "calibration", "crates", "docs", "src")
EXTENSIONS: dict[str, dict[str, Any]] = tomllib.loads(
    Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
)


def _data() -> Any:
    import overtaking as ot

    return ot.generate_dataset("motorway", num_simulations=40, seed=1, out="data", keep="features")


def rule() -> None:
    """It judges nights alone, and tells which speed would have been lawful."""
    import overtaking as ot

    data = _data()
    found = data.findings().query("rule == 'L99'").set_index("simulation")["verdict"]
    night = data.attempts().set_index("simulation")["night"]
    assert set(found.index[found != "not_applicable"]) == set(night.index[night])
    broken = int(found.index[found == "illegal"][0])
    said = ot.law.explain(data.path, broken, rules=["L99"])
    assert "100" in str(said), said


def feature() -> None:
    """Its column is the difference of two others."""
    found = _data().attempts()
    lacking = found["ego_desired_speed_mps"] - found["ego_speed_mps"]
    assert (found["ego_lacking_speed_mps"] - lacking).abs().max() < 1e-4


def measure() -> None:
    """It is longer than the gap, and over the manoeuvre no longer than at any moment."""
    found = _data().safety().dropna(subset=["leader_spacing_m"])
    assert (found["leader_spacing_m"] > found["leader_gap_m"] + 1.5).all()
    least = found.groupby("simulation")["leader_spacing_m"].min()
    whole = found.query("moment == 'manoeuvre'").set_index("simulation")["leader_spacing_m"]
    assert len(whole) > 10
    assert (whole <= least[whole.index]).all()


def trait() -> None:
    """A specification may fix it, and both engines obey with the same bits."""
    import overtaking as ot

    hashes: list[Any] = []
    for value in (0.0, 1.0):
        given = {"drivers.fixed": {"coolness": value}}
        scenarios = ot.sample("pinto2023-physical", num_simulations=16, seed=1, overrides=given)
        runs, twin = (ot.simulate(scenarios, simulator=one) for one in ("engine", "reference"))
        assert (runs.trace_hash == twin.trace_hash).all()
        hashes.append(runs.trace_hash)
    assert (hashes[0] != hashes[1]).any()


def format() -> None:  # noqa: A001
    """A file of it becomes a data set in which one vehicle overtakes another."""
    import numpy as np

    import overtaking as ot

    time = np.arange(0.0, 20.0, 0.1)
    out = np.clip((time - 3.0) / 4.0, 0.0, 1.0) - np.clip((time - 12.0) / 4.0, 0.0, 1.0)
    ego = {"s": (10.0 + 30.0 * time).tolist(), "d": (1.75 + 3.5 * out).tolist()}
    other = {"s": (60.0 + 20.0 * time).tolist(), "d": [1.75] * len(time)}
    Path("one.tracks.json").write_text(json.dumps({"ego": ego, "other": other}), encoding="utf-8")
    data = ot.import_recording("jsontracks", "one.tracks.json", "data")
    assert "completed" in set(data.labels()["outcome"])


def page() -> None:
    """It is in the menu of the site, and the list of pages leads there."""
    root = Path(__file__).resolve().parents[1]
    site = runpy.run_path(str(root / "docs" / "site.py"))
    assert "docs/how-to/listen.md" in site["nav"](root)
    assert "](how-to/listen.md)" in (root / "docs" / "README.md").read_text(encoding="utf-8")


WORKS = {one.__name__: one for one in (rule, feature, measure, trait, format, page)}
"""What must hold of each in its copy; runs in an empty folder."""


def files_of(kind: str) -> list[str]:
    """The files that an extension touches."""
    return sorted({change["file"] for change in EXTENSIONS[kind]["changes"]})


def unnamed(kind: str) -> list[str]:
    """The files that an extension touches and its row of the table does not name.

    Raises:
        SystemExit: There is no such row.
    """
    text, row = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8"), EXTENSIONS[kind]["row"]
    found = re.search(rf"^\| {row} \| (.+?) \|", text, re.MULTILINE)
    if found is None:
        raise SystemExit(f'ARCHITECTURE.md: no row "{row}" in the table "To add"')
    paths = [base + path for path in re.findall(r"`([\w./-]+)`", found[1]) for base in BASES]
    return [
        file
        for file in files_of(kind)
        if not any(file == path or (path[-1] == "/" and file.startswith(path)) for path in paths)
    ]


def copy(folder: Path) -> None:
    """Copy the project, without its tests."""
    for name in COPIED:
        shutil.copytree(ROOT / name, folder / name)
    for file in ROOT.iterdir():
        if file.is_file() and not file.name.startswith("."):
            shutil.copy2(file, folder)


def make(kind: str, folder: Path, target: Path) -> None:
    """Change a copy of the project, build what must be built, write what is generated.

    Args:
        kind: Of the extension.
        folder: Of the copy.
        target: What cargo builds goes there.
    """
    for change in EXTENSIONS[kind]["changes"]:
        path, text, count = folder / change["file"], change["then"], 1
        if where := change.get("where"):
            text, count = re.subn(where, change["then"], path.read_text(encoding="utf-8"))
        if not count:
            raise SystemExit(f"{change['file']}: nothing is like {where!r}; see extensions.toml")
        path.write_text(text, encoding="utf-8")
    if any(file.endswith(".rs") for file in files_of(kind)):
        run(folder, folder, "crates/engine_names.py")
        done = cargo(folder, target)
        if done.returncode:
            raise SystemExit(done.stderr)
        shutil.copy2(built_library(target.parent), folder / "src/overtaking/_core.abi3.so")
    if "page" in EXTENSIONS[kind]:
        run(folder, folder, "docs/generate.py")


def run(folder: Path, where: Path, script: str, *arguments: str) -> None:
    """Run a script of a copy, with the copy of the package.

    Raises:
        CalledProcessError: It fails.
    """
    settings = {**os.environ, "PYTHONPATH": str(folder / "src")}
    command = [sys.executable, folder / script, *arguments]
    subprocess.run(command, cwd=where, env=settings, check=True, stdout=subprocess.DEVNULL)


def faults(kind: str, folder: Path) -> list[str]:
    """What is wrong with an extension that works."""
    found = [f"{file} is not in the table" for file in unnamed(kind)]
    if len(files_of(kind)) > MOST_FILES:
        found.append(f"more than {MOST_FILES} files")
    shown = EXTENSIONS[kind].get("page")
    if shown and EXTENSIONS[kind]["says"] not in (folder / shown).read_text(encoding="utf-8"):
        found.append(f"{shown} does not tell of it")
    return found


def main() -> int:
    """Make each, see that it works, print its files."""
    parser = argparse.ArgumentParser(description="Make one extension of each kind in a copy.")
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=", ".join(EXTENSIONS))
    parser.add_argument("--works", choices=WORKS, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.works:
        WORKS[given.works]()
        return 0
    wrong = 0
    with tempfile.TemporaryDirectory() as name:
        for kind in given.kinds or EXTENSIONS:
            folder, empty = Path(name) / kind, Path(name) / f"{kind}-empty"
            empty.mkdir()
            copy(folder)
            make(kind, folder, Path(name) / "target")
            run(folder, empty, f"benchmarks/{Path(__file__).name}", "--works", kind)
            found, files = faults(kind, folder), files_of(kind)
            wrong += bool(found)
            print(f"{kind}: {len(files)} files: {', '.join(files)}", *found, sep="\n  ", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
