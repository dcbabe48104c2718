"""A data set, its server, and a client that was let in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.support.serving import Client, serving

import overtaking as ot

if TYPE_CHECKING:
    from collections.abc import Iterator

    from overtaking.data.load import Dataset


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Without frames: what is shown is simulated again."""
    folder = tmp_path_factory.mktemp("server") / "data"
    return ot.generate_dataset(
        "pinto2023-physical", num_simulations=60, seed=1, out=folder, keep="features"
    )


@pytest.fixture(scope="module")
def url(data: Dataset) -> Iterator[str]:
    with serving(data) as found:
        yield found


@pytest.fixture(scope="module")
def client(url: str) -> Client:
    return Client(url).enter()
