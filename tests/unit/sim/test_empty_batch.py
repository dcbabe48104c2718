"""Batches without simulations are simulated, branched, driven and labelled like others."""

from __future__ import annotations

import numpy as np
import pytest

import overtaking as ot
from overtaking.core.arrays import ArrayLayout, Buffers
from overtaking.data.tables.encode_labels import contents
from overtaking.data.tables.schemas import SCHEMAS


def empty_scenarios(profile: str) -> ot.Scenario:
    return ot.sample(profile, num_simulations=2, seed=1).select(np.zeros(2, bool))


def stay(observation: ot.Observation) -> np.ndarray:
    return np.zeros((len(observation.is_running), 2))


@pytest.mark.parametrize("simulator", ["engine", "reference"])
@pytest.mark.parametrize("profile", ["pinto2023-physical", "rural"])
def test_an_empty_batch_is_simulated_branched_and_labelled(profile, simulator):
    scenarios = empty_scenarios(profile)
    runs = ot.simulate(scenarios, simulator=simulator)
    for batch in (runs, ot.branch(runs, 3, simulator=simulator)):
        assert batch.num_frames.shape == (0,)
        assert batch.states.s.shape == (0, scenarios.num_slots, 1)
        assert batch.trace_hash.shape == (0, 4)
        assert ot.label(batch).labels.outcome.shape == (0,)


def test_a_driver_drives_an_empty_batch():
    runs = ot.drive(empty_scenarios("rural"), stay, observation="truth")
    assert ot.label(runs).labels.outcome.shape == (0,)


def test_the_tables_of_an_empty_batch_have_no_rows():
    runs = ot.simulate(empty_scenarios("rural"))
    tables = contents(runs, np.array([], np.int64), tuple(SCHEMAS))
    assert {table.num_rows for table in tables.values()} == {0}


def test_a_negative_frame_is_rejected_for_an_empty_batch():
    with pytest.raises(ot.OvertakingError, match="frame"):
        ot.branch(empty_scenarios("rural"), -1)


def test_empty_arrays_of_one_layout_have_different_addresses():
    layouts = tuple(ArrayLayout(name, (0, 3), np.int32) for name in ("first", "second"))
    arrays = Buffers().arrays("both", layouts)
    assert arrays["first"].ctypes.data != arrays["second"].ctypes.data
