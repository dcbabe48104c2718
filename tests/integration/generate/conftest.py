"""Data sets that the tests of this folder look at; each file of tests has its own."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import pytest
from tests.support.small import generate

if TYPE_CHECKING:
    from pathlib import Path

    import overtaking as ot


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> ot.Dataset:
    return generate(tmp_path_factory.mktemp("frames") / "data")


@pytest.fixture(scope="module")
def summary(tmp_path_factory: pytest.TempPathFactory) -> ot.Dataset:
    return generate(tmp_path_factory.mktemp("summary") / "data", keep="features")


@pytest.fixture
def copy(data: ot.Dataset, tmp_path: Path) -> Path:
    """A copy of the data set, to be changed."""
    return shutil.copytree(data.path, tmp_path / "data")
