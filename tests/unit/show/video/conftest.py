"""One small recording and its film, for all tests of films."""

from __future__ import annotations

import pytest
from tests.support.worlds import Vehicle, scenario

import overtaking as ot
from overtaking.show.video.film import Film


@pytest.fixture(scope="session")
def run():
    """A car behind a slower truck, and a motorcycle in the next lane, by day; two seconds."""
    vehicles = [
        Vehicle(kind="M", s=100.0, lane=1, speed=28.0, body={"colour": 2.0}),
        Vehicle(kind="T", s=131.5, lane=1, speed=22.0, body={"colour": 6.0}),
        Vehicle(kind="MC", s=90.0, lane=2, speed=30.0),
    ]
    return ot.simulate(scenario(vehicles, horizon=2.0))


@pytest.fixture(scope="session")
def film(run) -> Film:
    return Film(run, title="Simulation 0")
