"""Fixtures of the commands and files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.support import commands

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture(scope="session")
def parent(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The process whose children run the commands of `tests.support.commands`."""
    with commands.parent(tmp_path_factory.mktemp("streams")):
        yield
