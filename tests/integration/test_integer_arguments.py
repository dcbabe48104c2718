"""Seeds and numbers are whatever is an integer for Python, and are recorded as such."""

from __future__ import annotations

import json
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.support.integers import INTEGER_TYPES, NO_INTEGERS

import overtaking as ot

if TYPE_CHECKING:
    from pathlib import Path

PROFILE = "pinto2023-physical"
SHORT = {"time.horizon_s": 2.0, "time.attempt_deadline_s": 1.0}


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> ot.Dataset:
    return ot.generate_dataset(
        PROFILE, num_simulations=4, seed=7, out=tmp_path_factory.mktemp("integers") / "data"
    )


def draw_scenarios(seed: Any = 7, simulations: Any = 2) -> ot.Scenario:
    return ot.sample(PROFILE, num_simulations=simulations, seed=seed, overrides=SHORT)


@pytest.mark.parametrize("kind", INTEGER_TYPES)
def test_a_seed_of_any_library_draws_the_same_scenarios(kind: str):
    convert = INTEGER_TYPES[kind]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        expected = ot.simulate(draw_scenarios()).trace_hash
        scenarios = [
            draw_scenarios(convert(7), convert(2)),
            draw_scenarios(1).replace(seed=convert(7)),
        ]
    assert [type(scenario.seed) for scenario in scenarios] == [int, int]
    assert scenarios[0].equals(draw_scenarios())
    replaced = draw_scenarios(1).replace(seed=7)
    for simulator in ("engine", "reference"):
        np.testing.assert_array_equal(
            ot.simulate(scenarios[0], simulator=simulator).trace_hash, expected
        )
        np.testing.assert_array_equal(
            ot.simulate(scenarios[1], simulator=simulator).trace_hash,
            ot.simulate(replaced).trace_hash,
        )


@pytest.mark.parametrize("value", [*NO_INTEGERS, None, -1, 2**64])
def test_another_value_is_no_seed(value: Any, tmp_path: Path):
    for call in (
        lambda: draw_scenarios(value),
        lambda: ot.simulate(draw_scenarios().replace(seed=value)),
        lambda: ot.validate_profile(PROFILE, num_simulations=1, seed=value),
        lambda: ot.generate_dataset(PROFILE, num_simulations=1, seed=value, out=tmp_path / "data"),
    ):
        with pytest.raises(ot.OvertakingError, match="seed"):
            call()


@pytest.mark.parametrize("kind", INTEGER_TYPES)
def test_a_data_set_takes_and_records_integers_of_any_library(
    kind: str, data: ot.Dataset, tmp_path: Path
):
    convert = INTEGER_TYPES[kind]
    dataset = ot.generate_dataset(
        PROFILE, num_simulations=convert(4), seed=convert(7), out=tmp_path / "data"
    )
    assert dataset.content_hash == data.content_hash
    balance = ot.ClassBalance(candidates=convert(20), allows_missing=True)
    ot.generate_dataset(
        PROFILE,
        num_simulations=convert(5),
        seed=convert(7),
        out=tmp_path / "balanced",
        balance=balance,
    )
    manifest = json.loads((tmp_path / "balanced" / "dataset.json").read_text(encoding="utf-8"))
    assert manifest["identity"]["balance"]["candidates"] == 20


@pytest.mark.parametrize("kind", INTEGER_TYPES)
def test_numbers_of_simulations_are_integers_of_any_library(kind: str, data: ot.Dataset):
    convert = INTEGER_TYPES[kind]
    assert data.verdict(convert(3)) == data.verdict(3)
    assert data[convert(3)].equals(data[3])
    assert data.scenario(convert(3)).equals(data.scenario(3))
    change = ot.Intervention(frame=convert(5), slot=convert(1), speed_change=1.0)
    assert json.dumps(change.to_dict())
    changes = [ot.Intervention(frame=5, slot=1, speed_change=1.0)]
    assert ot.whatif.counterfactual(
        data, convert(0), interventions=[change]
    ) == ot.whatif.counterfactual(data, 0, interventions=changes)


@pytest.mark.parametrize("kind", INTEGER_TYPES)
def test_a_driver_holds_its_answers_for_an_integer_of_any_library(kind: str):
    def stay(observation: ot.Observation) -> Any:
        return np.zeros((len(observation.is_running), 2))

    driver = ot.Driver(function=stay, observation="truth", action_repeat=INTEGER_TYPES[kind](5))
    assert (driver.action_repeat, type(driver.action_repeat)) == (5, int)
    with pytest.raises(ot.OvertakingError, match="action_repeat"):
        ot.Driver(function=stay, observation="truth", action_repeat=True)
