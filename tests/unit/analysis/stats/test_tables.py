"""The tables of the paper equal a calculation with plain pandas."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from tests.support.features import synthetic_features

from overtaking.analysis.stats.columns import FEATURES, NUMERIC, PAPER_CLASSES
from overtaking.analysis.stats.results import statistics
from overtaking.analysis.stats.sample import prepare
from overtaking.analysis.stats.tables import ALL, class_table, dynamic_table, static_table
from overtaking.core.errors import SchemaError


@pytest.fixture(scope="module")
def frame() -> pd.DataFrame:
    return synthetic_features()


def rows_of_statistic(rows: pd.DataFrame, statistic: str) -> Any:
    """The rows of one statistic, by feature."""
    selected = rows[rows["statistic"] == statistic].set_index("feature")
    return selected[[*PAPER_CLASSES, ALL]].astype(float)


@pytest.mark.parametrize("word", ["min", "mean", "max", "σ"])
def test_minimum_mean_maximum_and_deviation_equal_plain_pandas(frame: pd.DataFrame, word: str):
    sample = prepare(frame, policy="paper")
    rows = pd.concat([static_table(sample).rows, dynamic_table(sample).rows])
    names = [feature.name for feature in NUMERIC if feature.name != "NV"]
    function = {"σ": "std"}.get(word, word)
    expected = frame.groupby("CLASS")[names].agg(function).T
    expected[ALL] = frame[names].agg(function)
    table = rows_of_statistic(rows, word)
    pd.testing.assert_frame_equal(
        table.loc[names], expected[table.columns].loc[names], check_names=False, rtol=1e-12
    )


@pytest.mark.parametrize("name", ["DN", "HL", "TE", "TP", "NV"])
def test_counts_of_static_features_equal_plain_pandas(frame: pd.DataFrame, name: str):
    rows = static_table(prepare(frame, policy="paper")).rows
    table: Any = rows[rows["feature"] == name].set_index("statistic")
    expected: Any = pd.crosstab(frame[name].fillna("none").astype(str), frame["CLASS"])
    for level, counts in expected.iterrows():
        assert (
            table.loc[level, list(PAPER_CLASSES)].tolist() == counts[list(PAPER_CLASSES)].tolist()
        )
        assert table.loc[level, ALL] == counts.sum()
    assert table[ALL].sum() == len(frame)


def test_frequencies_count_only_simulations_with_a_value(frame: pd.DataFrame):
    rows = dynamic_table(prepare(frame, policy="paper")).rows
    absolute, relative = rows_of_statistic(rows, "af"), rows_of_statistic(rows, "rf")
    counts = frame.groupby("CLASS")["SP"].count()
    assert counts.sum() < len(frame)
    for name in PAPER_CLASSES:
        assert absolute.loc["SP", name] == counts[name]
        assert relative.loc["SP", name] == pytest.approx(counts[name] / counts.sum())


def test_weights_change_means_deviations_and_shares(frame: pd.DataFrame):
    sample = prepare(frame, weighted=True, policy="paper")
    rows = dynamic_table(sample).rows
    legal = frame[frame["CLASS"] == "Success_L"]
    mean = np.average(legal["SE"], weights=legal["weight"])
    variance = np.cov(legal["SE"], aweights=legal["weight"])
    assert rows_of_statistic(rows, "mean").loc["SE", "Success_L"] == pytest.approx(mean)
    assert rows_of_statistic(rows, "σ").loc["SE", "Success_L"] == pytest.approx(np.sqrt(variance))
    shares = class_table(sample).rows.set_index("class")["share"]
    expected = frame.groupby("CLASS")["weight"].sum() / frame["weight"].sum()
    assert shares["Success_L"] == pytest.approx(expected["Success_L"])
    assert class_table(sample).rows["count"].sum() == len(frame)


def test_equal_weights_change_no_table(frame: pd.DataFrame):
    plain = statistics(frame.assign(weight=7.0), policy="paper")
    weighted = statistics(frame.assign(weight=7.0), weighted=True, policy="paper")
    for table, weighted_table in zip(plain.tables, weighted.tables, strict=True):
        pd.testing.assert_frame_equal(table.rows, weighted_table.rows, rtol=1e-12)


def test_rates_exclude_censored_simulations(frame: pd.DataFrame):
    changed = frame.copy()
    changed.loc[changed.index[:50], "CLASS"] = "censored"
    result = statistics(changed, policy="paper")
    shares: Any = result.classes.rows.set_index("class")["share"]
    assert np.isnan(shares["censored"])
    assert shares.drop("censored").sum() == pytest.approx(1.0)
    relative = rows_of_statistic(result.dynamic.rows, "rf")
    assert relative.loc["SE", list(PAPER_CLASSES)].sum() == pytest.approx(1.0)
    assert any("censored" in note for note in result.notes)


def test_a_note_names_a_class_of_the_paper_without_simulations(frame: pd.DataFrame):
    result = statistics(frame.loc[frame["CLASS"] != "Success_L"], policy="paper")
    assert result.classes.rows["class"].tolist() == list(PAPER_CLASSES)
    assert np.isnan(rows_of_statistic(result.dynamic.rows, "mean").loc["SE", "Success_L"])
    assert any("Success_L" in note for note in result.notes)


@pytest.mark.parametrize("rows", [0, 1, 2])
def test_statistics_of_zero_one_or_two_simulations_are_possible(frame: pd.DataFrame, rows: int):
    result = statistics(frame.iloc[:rows], policy="paper")
    assert result.classes.rows["count"].sum() == rows
    assert any("fewer than two" in note for note in result.notes) == (rows < 2)


def test_a_note_names_constant_columns(frame: pd.DataFrame):
    result = statistics(frame.assign(FOG=2.0, SP=np.nan), policy="paper")
    note = next(note for note in result.notes if "The same in all" in note)
    assert "FOG" in note
    assert "SP" in note
    assert "SE" not in note


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"DN": "Dusk"}, "column DN"),
        ({"CLASS": None}, "column CLASS"),
        ({"SE": "fast"}, "column SE"),
        ({"SE": np.inf}, "column SE"),
        ({"weight": -1.0}, "column weight"),
        ({"weight": np.nan}, "column weight"),
    ],
)
def test_an_impossible_value_is_refused_with_its_column(
    frame: pd.DataFrame, change: dict, message: str
):
    with pytest.raises(SchemaError, match=message):
        statistics(frame.assign(**change), weighted=True, policy="paper")


def test_a_missing_column_is_refused_with_its_name(frame: pd.DataFrame):
    with pytest.raises(SchemaError, match="OLR"):
        statistics(frame.drop(columns="OLR"), policy="paper")
    statistics(frame.drop(columns="weight"), policy="paper")
    with pytest.raises(SchemaError, match="weight"):
        statistics(frame.drop(columns="weight"), weighted=True, policy="paper")


def test_static_and_dynamic_features_are_those_of_the_paper():
    static = " ".join(feature.name for feature in FEATURES if feature.is_static)
    dynamic = " ".join(feature.name for feature in FEATURES if not feature.is_static)
    assert static == "DN HL TE TP WT OT NV"
    assert dynamic == "SE SP DSEP D OLR PREC WIND FOG"


def test_collisions_before_any_attempt_are_counted_beside_the_class(frame: pd.DataFrame):
    changed = frame.copy()
    collided = changed.index[changed["CLASS"] == "Unsuccess_col"]
    changed.loc[collided, "OT"] = 2.0
    assert not any(
        "before any attempt" in note for note in statistics(changed, policy="paper").notes
    )
    changed.loc[collided[:7], "OT"] = 0.0
    (attempt_note,) = (
        note for note in statistics(changed, policy="paper").notes if "before any attempt" in note
    )
    assert attempt_note.startswith(f"7 of the {len(collided)} simulations of class Unsuccess_col")
    assert attempt_note.endswith("these are No_attempt.")
