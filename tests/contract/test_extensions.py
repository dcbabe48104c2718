"""The extensions that `make test-all` makes still fit the sources, and ARCHITECTURE's table."""

from __future__ import annotations

import importlib
import re
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))
MADE: Any = importlib.import_module("extensions")


@pytest.mark.parametrize("kind", MADE.EXTENSIONS)
def test_an_extension_touches_at_most_five_files_and_the_table_names_them(kind: str):
    assert MADE.unnamed(kind) == []
    assert len(MADE.files_of(kind)) <= MADE.MOST_FILES
    assert kind in MADE.WORKS


@pytest.mark.parametrize("kind", MADE.EXTENSIONS)
def test_every_change_of_an_extension_has_its_place(kind: str):
    for change in MADE.EXTENSIONS[kind]["changes"]:
        path = ROOT / change["file"]
        where = change.get("where")
        assert path.exists() == (where is not None), path
        assert where is None or re.search(where, path.read_text(encoding="utf-8")), where
