"""A big sample of the study's scenes, drawn once for all tests."""

import numpy as np
import pytest

from overtaking.model.known_roads import known_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource

SIMULATIONS = 50_000


@pytest.fixture(scope="session")
def town06():
    return known_road("town06")


@pytest.fixture(scope="session")
def pinto(town06):
    return ScenarioSource(load_specification("pinto2023-physical"), town06, seed=2023).sample(
        np.arange(SIMULATIONS)
    )
