"""Batches in memory give the same pandas tables as data sets."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest

import overtaking as ot
from overtaking.core.errors import NoSuchSimulationError

if TYPE_CHECKING:
    from pathlib import Path

SHORT = {"time.horizon_s": 2.0, "time.attempt_deadline_s": 2.0}


@pytest.fixture(scope="module")
def trajectories() -> ot.Trajectories:
    scenario = ot.sample("pinto2023-physical", num_simulations=3, seed=1, overrides=SHORT)
    return ot.simulate(scenario)


def test_states_and_labels_are_those_of_a_data_set(trajectories: ot.Trajectories, tmp_path: Path):
    dataset = ot.generate_dataset(
        "pinto2023-physical", num_simulations=3, seed=1, out=tmp_path / "data", overrides=SHORT
    )
    for row in range(3):
        pd.testing.assert_frame_equal(trajectories.to_pandas(row), dataset.states(row))
    labels = ot.label(trajectories).to_pandas()
    expected = dataset.labels().drop(columns="balance_weight")
    pd.testing.assert_frame_equal(labels, expected, check_categorical=False)
    assert labels["policy"].astype(str).tolist() == expected["policy"].astype(str).tolist()


def test_the_first_simulation_is_the_default(trajectories: ot.Trajectories):
    states = trajectories.to_pandas()
    pd.testing.assert_frame_equal(states, trajectories.to_pandas(0))
    first = states[(states["vehicle"] == 0) & (states["frame"] == 0)]
    speed_mmps = trajectories.states.speed[0, 0, 0]
    np.testing.assert_allclose(first["speed_mps"], speed_mmps / 1000.0)


def test_policies_of_any_law_have_their_names(trajectories: ot.Trajectories):
    labelled = ot.label(trajectories, law="de", policies=["default", "enforced"])
    frame = labelled.to_pandas()
    assert frame["policy"].tolist() == ["default", "enforced"] * 3
    classes = [ot.OvertakeClass(code).title for code in labelled.labels.classes.reshape(-1)]
    assert frame["class"].tolist() == classes


def test_a_row_that_does_not_exist_is_refused(trajectories: ot.Trajectories):
    with pytest.raises(NoSuchSimulationError):
        trajectories.to_pandas(3)
