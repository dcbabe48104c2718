"""Named simulations give the trace hashes that are written down."""

from __future__ import annotations

import json

import numpy as np
import pytest

from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine

from .trace_scenes import PINNED, SCENES, hexadecimal

HOW_TO = "if the model was changed on purpose: python -m tests.golden.trace_scenes, and review"
ENTRIES = json.loads(PINNED.read_text(encoding="utf-8"))


def simulated(entry):
    road = load_road(entry["road"])
    road = road.mirror() if entry["mirrored"] else road
    index = np.array([entry["index"]], np.uint64)
    return engine.simulate(
        ScenarioSource(
            load_specification(entry["profile"], entry["overrides"]), road, entry["seed"]
        ).sample(index)
    )


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry["name"])
def test_a_named_simulation_has_the_pinned_hash(entry):
    run = simulated(entry)
    assert int(run.num_frames[0]) == entry["frames"], HOW_TO
    assert hexadecimal(run) == entry["trace_hash"], HOW_TO


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry["name"])
def test_what_the_name_says_happens(entry):
    scene = next(one for one in SCENES if one.name == entry["name"])
    assert scene.happens(simulated(entry)).tolist() == [True]


def test_there_are_twenty_four_different_ones():
    assert len({entry["trace_hash"] for entry in ENTRIES}) == len(SCENES) == 24
