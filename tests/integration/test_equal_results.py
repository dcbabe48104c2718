"""Results of the public functions compare by content; recordings have `equals`."""

from __future__ import annotations

import dataclasses
import math
import pickle
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest

import overtaking as ot
from overtaking.analysis.stats.results import Statistics
from overtaking.core.equality import ContentEquality

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

DEFINITIONS = {"Attribute", "Column", "Endpoint", "Quantity", "Scale", "Statement", "Target"}
"""Classes of constants of the package, which are the same objects in all results."""

INPUTS = {
    *("CentreLineSpan", "Driver", "Intervention", "Lane", "MarkChange", "Pack", "Road"),
    *("RoadCourse", "RoadZone", "SpeedLimitSpan", "ArgumentType", "QueryVariable"),
}
"""Classes that hold only numbers which are checked to be finite, and texts."""


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> ot.Dataset:
    folder = tmp_path_factory.mktemp("results") / "data"
    return ot.generate_dataset("pinto2023-physical", num_simulations=300, seed=1, out=folder)


CALLS: dict[str, Callable[[ot.Dataset], Any]] = {
    "ask": lambda data: ot.logic.ask(data, "overtakes(S,ego,P,F)"),
    "compare": lambda _: ot.compare_simulators(
        "pinto2023", num_simulations=2, seed=1, simulators=("engine", "reference")
    ),
    "enough": lambda data: ot.whatif.sufficient_changes(data, _first(data, "Success_I")),
    "evaluate": lambda _: ot.evaluate(
        "rules", "pinto2023-physical", num_simulations=4, references=["stay"]
    ),
    "fan": lambda data: ot.whatif.outcome_fan(data, 0),
    "law_curve": lambda data: ot.law.tolerance_curve(data.path),
    "learn_factors": lambda data: ot.learning.learn_factors(data, features=["speed of the ego"]),
    "learn_rules": lambda data: ot.learning.learn_rules(data, "start"),
    "prove": lambda data: ot.logic.prove(data, _first(data, "Success_I")),
    "query": lambda data: ot.sql(data, "SELECT * FROM simulations"),
    "reproduce": lambda _: ot.reproduce_study("pinto2023", num_replicates=1),
    "statistics": ot.dataset_statistics,
    "twin": lambda data: ot.whatif.counterfactual(data, 0, stay=True),
    "validate": lambda _: ot.validate_profile("pinto2023-physical", num_simulations=4),
    "verdict": lambda data: data.verdict(0),
}


def _first(data: ot.Dataset, name: str) -> int:
    """The number of the first simulation of a class."""
    return int(np.flatnonzero(data.features()["CLASS"] == name)[0])


@pytest.mark.ci
@pytest.mark.parametrize("name", CALLS)
def test_a_function_returns_equal_results_for_equal_arguments(data: ot.Dataset, name: str):
    results = zip(*(as_tuple(CALLS[name](data)) for _ in range(2)), strict=True)
    for first, second in results:
        check_comparison(first, second)
        classes = {type(part) for part in parts_of(first)}
        by_fields = {cls.__name__ for cls in classes if not issubclass(cls, ContentEquality)}
        assert by_fields <= DEFINITIONS | INPUTS


def check_comparison(first: Any, second: Any) -> None:
    assert first is not second
    assert (first == second) is True
    assert (first != second) is False
    assert pickle.loads(pickle.dumps(first)) == second
    for change in changed_copies(first):
        assert (change == first) is False
        assert (first == change) is False


def as_tuple(result: Any) -> tuple[Any, ...]:
    return result if isinstance(result, tuple) else (result,)


def changed_copies(result: Any) -> Iterator[Any]:
    """Copies of a result, each with another value in one field."""
    for field in dataclasses.fields(result):
        value = getattr(result, field.name)
        if isinstance(value, np.ndarray | list | tuple | pd.DataFrame) and len(value):
            yield dataclasses.replace(result, **{field.name: value[:-1]})
        elif isinstance(value, int | float) and math.isfinite(value):
            yield dataclasses.replace(result, **{field.name: value + 1})


def parts_of(value: Any) -> Iterator[Any]:
    """All dataclasses in a value."""
    if dataclasses.is_dataclass(value):
        yield value
        for field in dataclasses.fields(value):
            yield from parts_of(getattr(value, field.name))
    elif isinstance(value, dict):
        for part in value.values():
            yield from parts_of(part)
    elif isinstance(value, list | tuple):
        for part in value:
            yield from parts_of(part)


def test_recordings_compare_by_identity_and_have_equals():
    short = {"time.horizon_s": 2.0, "time.attempt_deadline_s": 1.0}
    batch, equal_batch, different = (
        ot.label(
            ot.simulate(
                ot.sample("pinto2023-physical", num_simulations=3, seed=seed, overrides=short)
            )
        )
        for seed in (1, 1, 2)
    )
    check_equals(batch, equal_batch, different)
    check_equals(batch.trajectories, equal_batch.trajectories, different.trajectories)
    scenarios = [labelled.trajectories.scenario for labelled in (batch, equal_batch, different)]
    check_equals(*scenarios)


def check_equals(batch: Any, equal_batch: Any, different: Any) -> None:
    assert (batch == equal_batch) is False
    assert len({batch, equal_batch}) == 2
    assert batch.equals(equal_batch) is True
    assert batch.equals(pickle.loads(pickle.dumps(batch)))
    assert batch.equals(different) is False
    assert batch.equals(batch.select(slice(1))) is False
    assert batch.equals("text") is False


def test_one_different_value_makes_recordings_unequal():
    runs = ot.simulate(ot.sample("pinto2023-physical", num_simulations=2, seed=1))
    speed = runs.states.speed.copy()
    changed = runs.replace(states=runs.states.replace(speed=speed))
    assert runs.equals(changed)
    speed[1, 0, 3] += 1
    assert not runs.equals(changed)
    assert runs.states != changed.states
    assert runs.scenario.weather == changed.scenario.weather


@pytest.mark.ci
def test_statistics_show_and_give_their_tables(data: ot.Dataset):
    statistics = ot.dataset_statistics(data)
    frames = statistics.to_pandas()
    assert list(frames) == ["classes", "static-features", "dynamic-features", "waiting-time"]
    counts = data.features()["CLASS"].value_counts()
    classes = frames["classes"].set_index("class")["count"]
    assert {name: count for name, count in classes.items() if count} == counts.to_dict()
    frames["classes"].loc[0, "count"] = -1
    assert statistics.to_pandas()["classes"].loc[0, "count"] != -1
    assert frames["waiting-time"]["at_risk"].iloc[0] == 300
    text, page = repr(statistics), statistics._repr_html_()
    for words in ("Success_I", "DSEP", "Waiting time (Kaplan-Meier)"):
        assert words in text
        assert words in page
    assert page.count("<table>") == 3


@pytest.mark.ci
def test_statistics_without_a_waiting_time_have_no_table_of_it(data: ot.Dataset):
    statistics = ot.dataset_statistics(data, policy="default")
    assert isinstance(statistics, Statistics)
    assert statistics.waiting is None
    assert list(statistics.to_pandas()) == ["classes", "static-features", "dynamic-features"]


@pytest.mark.ci
def test_an_answer_shows_and_gives_its_rows(data: ot.Dataset):
    answer = ot.sql(
        data,
        "SELECT simulation, simulation AS number, '<b>' AS mark, "
        "CASE WHEN simulation > 0 THEN 9007199254740993 END AS large, "
        "CASE WHEN simulation > 0 THEN 170141183460469231731687303715884105727 END AS larger, "
        "CASE WHEN simulation > 0 THEN 0.5::DOUBLE END AS share FROM simulations ORDER BY 1",
        max_rows=2,
    )
    frame = answer.to_pandas()
    assert list(frame.columns) == ["simulation", "number", "mark", "large", "larger", "share"]
    assert frame["simulation"].tolist() == [0, 1]
    assert frame["large"].tolist() == [pd.NA, 9007199254740993]
    assert frame["larger"].tolist() == [None, 2**127 - 1]
    assert frame["share"].dtype == np.float64
    assert np.isnan(frame["share"][0])
    assert repr(answer).startswith("Answer(columns=6, rows=2, is_cut=True)\n")
    assert "9007199254740993" in repr(answer)
    assert "&lt;b&gt;" in answer._repr_html_()
    assert "<td>9007199254740993</td>" in answer._repr_html_()
    with pd.option_context("display.notebook_repr_html", False):
        assert "9007199254740993" in answer._repr_html_()


@pytest.mark.ci
def test_an_answer_keeps_columns_without_rows_and_columns_of_one_name(data: ot.Dataset):
    empty = ot.sql(data, "SELECT simulation FROM simulations WHERE false").to_pandas()
    assert (list(empty.columns), len(empty)) == (["simulation"], 0)
    double = ot.sql(data, "SELECT 1 AS a, 2.5 AS a").to_pandas()
    assert list(double.columns) == ["a", "a"]
    assert double.iloc[0].tolist() == [1, 2.5]


@pytest.mark.ci
def test_answers_of_the_logic_show_and_give_their_rows(data: ot.Dataset):
    answers = ot.logic.ask(data, "overtakes(S,ego,P,F)")
    frame = answers.to_pandas()
    assert list(frame.columns) == ["S", "P", "F"]
    assert [tuple(row) for row in frame.to_numpy().tolist()] == answers.rows
    assert str(answers.rows[0][2]) in repr(answers)
    assert "<th>S</th>" in answers._repr_html_()
