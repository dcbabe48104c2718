"""Importing the package is free: what is not used is not loaded."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

HEAVY = {"duckdb", "numpy", "pandas", "pyarrow", "pydantic", "rich", "typer"}


def loaded_after(statement: str) -> set[str]:
    """The modules that a fresh interpreter has loaded after a statement."""
    code = f"{statement}\nimport json, sys\nprint(json.dumps(sorted(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    return set(json.loads(done.stdout))


@pytest.fixture(scope="module")
def loaded_by_import() -> set[str]:
    return loaded_after("import overtaking")


def test_importing_the_package_loads_no_heavy_library(loaded_by_import: set[str]):
    assert "overtaking" in loaded_by_import
    assert HEAVY & loaded_by_import == set()


def test_importing_the_package_loads_nothing_else_of_ours(loaded_by_import: set[str]):
    ours = {name for name in loaded_by_import if name.split(".")[0] == "overtaking"}
    assert ours == {"overtaking"}


def test_listing_the_public_names_loads_nothing():
    loaded = loaded_after("import overtaking; dir(overtaking)")
    assert HEAVY & loaded == set()
    assert not [name for name in loaded if name.startswith("overtaking.")]


def test_using_a_public_name_loads_what_it_needs():
    """The check above sees a library that is loaded: it would fail if the root were not lazy."""
    loaded = loaded_after("import overtaking; overtaking.Scenario")
    assert {"numpy", "overtaking.model.scenario"} <= loaded
