"""Fixtures of the commands and files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.support import commands

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser
    from tests.support.carla import Address


@pytest.fixture(scope="session")
def parent(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The process whose children run the commands of `tests.support.commands`."""
    with commands.parent(tmp_path_factory.mktemp("streams")):
        yield


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """A browser without a window."""
    from tests.support.browser import chromium

    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def server() -> Iterator[Address]:
    """A headless server for CARLA's clients."""
    from tests.support.carla import headless_server

    with headless_server() as address:
        yield address
