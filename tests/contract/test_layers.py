"""Dependencies point down, and the checker that says so is itself checked with something wrong.

The contracts are in pyproject.toml (`[tool.importlinter]`). Its graph holds Python sources only, so
what concerns the compiled module `overtaking._core` and the package root is checked here.
"""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

COMPILED = "overtaking._core"
BINDINGS = (
    "overtaking.core.native",
    "overtaking.data.tables.digest",
    "overtaking.labels.law.margins",
    "overtaking.labels.signals",
    "overtaking.show.video.canvas",
    "overtaking.show.video.encode",
    "overtaking.sim",
    "overtaking.simulators.carla_server.camera",
)
REFERENCE = "overtaking.sim.reference"

LOAD_REFERENCE = f"""
import importlib, pkgutil, sys
sys.modules["{COMPILED}"] = None  # makes every import of it fail
package = importlib.import_module("{REFERENCE}")
names = [m.name for m in pkgutil.walk_packages(package.__path__, package.__name__ + ".")]
for name in names:
    importlib.import_module(name)
"""


@pytest.fixture
def copy(repository: Path, tmp_path: Path) -> Path:
    """A copy of our Python sources, to be spoiled by a test."""
    source = tmp_path / "src" / "overtaking"
    ignore = shutil.ignore_patterns("__pycache__", "*.so", "*.pyd")
    shutil.copytree(repository / "src" / "overtaking", source, ignore=ignore)
    return source


def run(source: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """Run a command that sees this copy of the package instead of the installed one."""
    return subprocess.run(
        command,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        cwd=source.parents[1],
        env={**os.environ, "PYTHONPATH": str(source.parent)},
    )


def lint(source: Path, repository: Path) -> subprocess.CompletedProcess[str]:
    """Check a copy against the contracts of pyproject.toml."""
    linter = Path(sys.executable).with_name("lint-imports")
    return run(source, str(linter), "--no-cache", "--config", str(repository / "pyproject.toml"))


def add(source: Path, module: str, line: str) -> None:
    """Append a statement to a module of the copy, making the module if needed."""
    path = source / module
    path.parent.mkdir(exist_ok=True)
    with path.open("a", encoding="utf-8") as file:
        file.write(f"\n{line}\n")


@cache  # Copies of the package differ in one file.
def imports_of(text: str, package: tuple[str, ...]) -> tuple[str, ...]:
    """Every module or name that a module imports, in full: `a.b` for `from a import b`."""
    return tuple(_imports_of(text, package))


def _imports_of(text: str, package: tuple[str, ...]) -> Iterator[str]:
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else []
            base = [*above, *([node.module] if node.module else [])]
            yield from (".".join([*base, alias.name]) for alias in node.names)


def importers(source: Path) -> Iterator[tuple[str, str]]:
    """Every pair (module of the package, what it imports)."""
    for path in sorted(source.rglob("*.py")):
        parts = path.relative_to(source.parent).with_suffix("").parts
        module = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        names = imports_of(path.read_text(encoding="utf-8"), parts[:-1])
        yield from ((module, name) for name in names)


def inside(name: str, package: str) -> bool:
    """Whether a module or name is a package or lies in it."""
    return name == package or name.startswith(f"{package}.")


def loaders_of_compiled_code(source: Path) -> set[str]:
    """The modules that import `overtaking._core`."""
    return {module for module, name in importers(source) if inside(name, COMPILED)}


def users_of_the_root(source: Path) -> set[tuple[str, str]]:
    """The modules that take a public name from the root, and so may reach any layer unseen."""
    packages = {path.stem for path in source.iterdir()} | {"_core"}
    return {
        (module, name)
        for module, name in importers(source)
        if name == "overtaking"
        or (name.startswith("overtaking.") and name.split(".")[1] not in packages)
    }


def test_dependencies_point_down(repository: Path, copy: Path):
    done = lint(copy, repository)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.ci
@pytest.mark.parametrize(
    ("module", "line", "contract"),
    [
        ("core/spoiled.py", "import overtaking.cli", "dependencies point down"),
        ("labels/spoiled.py", "import overtaking.sim", "dependencies point down"),
        ("labels/law/spoiled.py", "import overtaking.labels.labelling", "dependencies of labels"),
        ("utils/__init__.py", "", "dependencies point down"),
        ("model/spoiled.py", "import pyarrow", "no table library below the data sets"),
        ("sim/spoiled.py", "from pandas import DataFrame", "no table library below the data sets"),
        ("knowledge/spoiled.py", "import pydantic", "no pydantic below the scenarios"),
        ("data/spoiled.py", "import rich.progress", "no terminal library outside"),
        ("sim/spoiled.py", "import overtaking.sim.reference.state", "no module of production"),
        (
            "simulators/spoiled.py",
            "def late():\n    from overtaking.sim.reference import steering",
            "no module of production",
        ),
    ],
)
def test_the_linter_catches(module: str, line: str, contract: str, repository: Path, copy: Path):
    add(copy, module, line)
    done = lint(copy, repository)
    broken = [row for row in done.stdout.splitlines() if row.endswith("BROKEN")]
    assert done.returncode == 1, done.stdout + done.stderr
    assert any(row.startswith(contract) for row in broken), done.stdout


@pytest.mark.ci
def test_only_the_binding_loads_compiled_code(copy: Path):
    loaders = loaders_of_compiled_code(copy)
    assert {m for m in loaders if not any(inside(m, each) for each in BINDINGS)} == set()
    assert not any(inside(module, REFERENCE) for module in loaders)


@pytest.mark.parametrize(
    "line",
    [
        "import overtaking._core",
        "from overtaking import _core",
        "from overtaking._core import simulate",
        "from .. import _core",
        "def late():\n    from overtaking import _core",
    ],
)
def test_every_way_to_load_compiled_code_is_seen(line: str, copy: Path):
    add(copy, "world/spoiled.py", line)
    assert "overtaking.world.spoiled" in loaders_of_compiled_code(copy)


def test_no_module_takes_public_names_from_the_root(copy: Path):
    assert users_of_the_root(copy) == set()


@pytest.mark.parametrize("line", ["import overtaking", "from overtaking import simulate"])
def test_a_detour_through_the_root_is_seen(line: str, copy: Path):
    add(copy, "core/spoiled.py", line)
    assert "overtaking.core.spoiled" in {module for module, _ in users_of_the_root(copy)}


@pytest.mark.ci
def test_the_reference_runs_without_compiled_code(copy: Path):
    done = run(copy, sys.executable, "-c", LOAD_REFERENCE)
    assert done.returncode == 0, done.stderr


@pytest.mark.ci
def test_compiled_code_below_the_reference_is_seen(copy: Path):
    add(copy, "model/spoiled.py", "from overtaking import _core")
    add(copy, "sim/reference/spoiled.py", "import overtaking.model.spoiled")
    done = run(copy, sys.executable, "-c", LOAD_REFERENCE)
    assert done.returncode == 1
    assert "_core" in done.stderr.splitlines()[-1]
