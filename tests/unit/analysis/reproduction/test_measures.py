"""Measures of replicates equal SciPy, pandas and counts by hand."""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from overtaking.analysis.reproduction.hidden import inferences, lawful, splits, weathers
from overtaking.analysis.reproduction.measures import measured, p_value, spearman
from overtaking.analysis.reproduction.replicates import FEATURES, SIZE, Replicates
from overtaking.analysis.reproduction.statements import Statement, statements
from overtaking.model.verdicts import OvertakeClass

SETS = 4


@pytest.fixture(scope="module")
def replicates() -> Replicates:
    """Replicates of noise, in which features have ties and gaps."""
    rng = np.random.default_rng(5)
    columns = {
        name: rng.integers(0, 9, (SETS, SIZE)).astype(float) for name in (*FEATURES, "FLYING")
    }
    columns["NIGHT"] = (columns["NIGHT"] > 3).astype(float)
    columns["D"][rng.random((SETS, SIZE)) < 0.2] = np.nan
    classes = rng.integers(0, 5, (SETS, SIZE)).astype(np.uint8)
    classes[0][classes[0] == OvertakeClass.SUCCESS_L] = OvertakeClass.SUCCESS_I
    return Replicates(classes={"paper": classes, "strict": classes[::-1]}, columns=columns)


def statement(measure: str, **changes: object) -> Statement:
    """The statement `measure` of SE (and D) over all simulations, with changes."""
    template = statements()["se_success_i"]
    defaults = {
        "outcome_class": "all",
        "feature": "SE",
        "other_feature": "D",
        "low": math.nan,
        "high": math.nan,
    }
    return dataclasses.replace(template, **{**defaults, "measure": measure, **changes})


def replicate_frame(replicates: Replicates, number: int) -> pd.DataFrame:
    """One replicate as a data frame with class names."""
    table = pd.DataFrame({name: values[number] for name, values in replicates.columns.items()})
    return table.assign(
        CLASS=[OvertakeClass(code).title for code in replicates.classes["paper"][number]]
    )


@pytest.mark.parametrize("number", range(SETS))
def test_counts_means_sums_ratios_and_correlations_equal_pandas(
    replicates: Replicates, number: int
):
    table = replicate_frame(replicates, number)
    collided = table[table["CLASS"] == "Unsuccess_col"]
    for checked, expected in (
        (statement("count", outcome_class="Unsuccess_col"), len(collided)),
        (statement("mean", outcome_class="Unsuccess_col", feature="D"), collided["D"].mean()),
        (statement("sum", feature="NIGHT"), table["NIGHT"].sum()),
        (statement("within", low=2.0, high=4.0), table["SE"].between(2.0, 4.0).sum()),
        (
            statement("ratio", feature="D", other_feature="SE"),
            table["D"].mean() / table["SE"].mean(),
        ),
        (statement("spearman"), table["SE"].corr(table["D"], method="spearman")),
    ):
        assert measured(replicates, checked)[number] == pytest.approx(expected)


def test_an_empty_class_has_no_mean_and_raises_no_warning(replicates: Replicates):
    means = measured(replicates, statement("mean", outcome_class="Success_L"))
    assert np.isnan(means).tolist() == [True, False, False, False]


def test_a_constant_feature_has_no_correlation():
    constant = np.ones((1, 20))
    assert np.isnan(spearman(constant, np.arange(20.0)[None])).all()


def test_correlations_with_ties_and_gaps_equal_scipy(replicates: Replicates):
    correlations = spearman(replicates.columns["WT"], replicates.columns["D"])
    for number in range(SETS):
        pair = (replicates.columns["WT"][number], replicates.columns["D"][number])
        expected: Any = stats.spearmanr(*pair, nan_policy="omit")
        assert correlations[number] == pytest.approx(expected.statistic)


@pytest.mark.parametrize("rho", [0.0, 0.075, -0.3, 0.9, 1.0, -1.0])
@pytest.mark.parametrize("size", [6, 30, SIZE])
def test_p_values_follow_students_t_distribution(rho: float, size: int):
    freedom = size - 2
    t = rho * math.sqrt(freedom / max(1.0 - rho**2, 1e-300))
    expected = 2.0 * stats.t.sf(abs(t), freedom)
    assert p_value(np.array([rho]), size)[0] == pytest.approx(expected, abs=1e-12)


def test_the_printed_p_does_not_belong_to_the_printed_correlation():
    p_of_printed = float(p_value(np.array([statements()["rho_nv_se"].quoted]), SIZE)[0])
    assert p_of_printed == pytest.approx(0.214, abs=0.0005)
    # paper.toml notes the contradiction: 276 simulations with ρ = 0.075 have p = 0.214.
    assert statements()["p_nv_se"].quoted == pytest.approx(0.284)


@pytest.mark.parametrize(("kinds", "size"), [(1, 5), (2, 7), (4, 6), (5, 30)])
def test_every_split_of_a_class_over_weathers_occurs_once(kinds: int, size: int):
    all_splits = splits(kinds, size)
    # Stars and bars: ways to distribute `size` simulations over `kinds` weathers.
    assert len(all_splits) == math.comb(size + kinds - 1, kinds - 1)
    assert (all_splits.sum(axis=1) == size).all()
    assert all_splits.min() >= 0
    assert len(np.unique(all_splits, axis=0)) == len(all_splits)


def test_fog_means_imply_that_all_legal_overtakes_of_the_paper_are_by_day():
    legal, no_attempt = inferences()
    assert (legal.scope, legal.splits, legal.nights) == ("Success_L", 1, (0, 0))
    # 29 legal overtakes with a mean fog of 3.90 %, over presets with 2, 7, 60 and 100 % fog.
    by_hand = [
        (a, b, c, d)
        for a, b, c in product(range(30), repeat=3)
        if (d := 29 - a - b - c) >= 0
        and abs((2 * a + 7 * b + 60 * c + 100 * d) / 29 - 3.90) < 0.005
    ]
    assert by_hand == [(18, 11, 0, 0)]
    assert (no_attempt.scope, no_attempt.nights) == ("No_attempt", (26, 26))


def test_each_of_the_four_fog_densities_of_the_paper_occurs_only_by_day_or_only_at_night():
    # Fog density [%], and 1 for night.
    assert weathers(("FOG",)) == ((2.0, 0.0), (7.0, 0.0), (60.0, 1.0), (100.0, 1.0))


def test_legal_overtakes_are_counted_by_light_and_policy(replicates: Replicates):
    counts = {(count.policy, count.is_night): count for count in lawful(replicates)}
    expected = Counter[tuple[str, bool]]()
    for number in range(SETS):
        table = replicate_frame(replicates, number)
        for name, night in zip(table["CLASS"], table["NIGHT"] > 0, strict=True):
            expected[name, night] += 1
    for night in (False, True):
        paper_counts = counts["paper", night]
        assert paper_counts.legal == expected["Success_L", night]
        assert paper_counts.completed == paper_counts.legal + expected["Success_I", night]
    assert set(counts) == {(name, night) for name in ("paper", "strict") for night in (False, True)}
