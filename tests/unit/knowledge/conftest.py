"""What the tests of the knowledge base share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


@pytest.fixture
def toml(tmp_path: Path) -> Callable[[str], Path]:
    """Writes a knowledge file of the given text and returns its path."""

    def write(text: str) -> Path:
        path = tmp_path / "example.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write
