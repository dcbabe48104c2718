"""Fixtures of the tests of recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def write(tmp_path: Path):
    def _write(text: str) -> Path:
        path = tmp_path / "scene.xml"
        path.write_text(text, encoding="utf-8")
        return path

    return _write
