"""Scenarios have the same bits on every machine and at every level of SIMD."""

import hashlib
import json
import os
import subprocess
import sys

import numpy as np
import pytest

from overtaking.model.known_roads import known_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource

pytestmark = pytest.mark.ci

# SHA-256 of the arrays of 2,000 scenarios. These change when a profile, a population, a vehicle
# class, the friction or the sampler itself changes, and then all data sets do: put the new ones
# here together with an entry in the changelog. They must not change for any other reason.
GOLDEN = {
    "vehicles": "ec1a373d99cd6106",
    "drivers": "c5b831b2b99ac752",
    "weather": "a8e8ed2212f60cef",
    "starts": "8700f52e8a10c1d1",
}

PARTS = ("vehicles", "drivers", "weather", "starts")


def hashes():
    """A hash for each part of a batch."""
    batch = ScenarioSource(
        load_specification("pinto2023-physical"), known_road("town06"), seed=1
    ).sample(np.arange(2_000))
    starts = [batch.start_s, batch.start_lane, batch.start_speed]
    return {
        part: digest(starts if part == "starts" else fields(getattr(batch, part))) for part in PARTS
    }


def fields(batch):
    return [getattr(batch, name) for name in batch.__dataclass_fields__]


def digest(arrays):
    together = hashlib.sha256()
    for values in arrays:
        little_endian = values.astype(values.dtype.newbyteorder("<"), copy=False)
        together.update(np.ascontiguousarray(little_endian).tobytes())
    return together.hexdigest()[:16]


@pytest.mark.parametrize("part", PARTS)
def test_the_bits_are_those_of_the_first_machine(part):
    assert hashes()[part] == GOLDEN[part]


def dispatched_features():
    """CPU features beyond the baseline for which NumPy has code of its own on this machine."""
    return list(np.show_config(mode="dicts")["SIMD Extensions"].get("found", []))


@pytest.mark.parametrize("drop", [2, 10])
def test_the_bits_do_not_depend_on_simd(drop):
    features = dispatched_features()
    if not features:
        pytest.skip("NumPy has one code path only for this kind of processor")
    environment = os.environ | {"NPY_DISABLE_CPU_FEATURES": " ".join(features[-drop:])}
    command = [sys.executable, "-W", "ignore", __file__]
    answer = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert json.loads(answer.stdout) == hashes()


if __name__ == "__main__":
    sys.stdout.write(json.dumps(hashes()))
