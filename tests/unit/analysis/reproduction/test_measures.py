"""What is measured of replicates, against SciPy, pandas and counting by hand."""

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
def some() -> Replicates:
    """Replicates of noise, in which features have ties and gaps."""
    noise = np.random.default_rng(5)
    columns = {
        name: noise.integers(0, 9, (SETS, SIZE)).astype(float) for name in (*FEATURES, "FLYING")
    }
    columns["NIGHT"] = (columns["NIGHT"] > 3).astype(float)
    columns["D"][noise.random((SETS, SIZE)) < 0.2] = np.nan
    classes = noise.integers(0, 5, (SETS, SIZE)).astype(np.uint8)
    classes[0][classes[0] == OvertakeClass.SUCCESS_L] = OvertakeClass.SUCCESS_I
    return Replicates(classes={"paper": classes, "strict": classes[::-1]}, columns=columns)


def statement(measure: str, **given: object) -> Statement:
    like = statements()["se_success_i"]
    plain = {
        "outcome_class": "all",
        "feature": "SE",
        "other_feature": "D",
        "low": math.nan,
        "high": math.nan,
    }
    return dataclasses.replace(like, **{**plain, "measure": measure, **given})


def frame(of: Replicates, number: int) -> pd.DataFrame:
    table = pd.DataFrame({name: values[number] for name, values in of.columns.items()})
    return table.assign(CLASS=[OvertakeClass(one).title for one in of.classes["paper"][number]])


@pytest.mark.parametrize("number", range(SETS))
def test_means_sums_and_counts_are_those_of_pandas(some: Replicates, number: int):
    table = frame(some, number)
    inside = table[table["CLASS"] == "Unsuccess_col"]
    for one, expected in (
        (statement("count", outcome_class="Unsuccess_col"), len(inside)),
        (statement("mean", outcome_class="Unsuccess_col", feature="D"), inside["D"].mean()),
        (statement("sum", feature="NIGHT"), table["NIGHT"].sum()),
        (statement("within", low=2.0, high=4.0), table["SE"].between(2.0, 4.0).sum()),
        (
            statement("ratio", feature="D", other_feature="SE"),
            table["D"].mean() / table["SE"].mean(),
        ),
        (statement("spearman"), table["SE"].corr(table["D"], method="spearman")),
    ):
        assert measured(some, one)[number] == pytest.approx(expected)


def test_an_empty_class_has_no_mean_and_no_warning(some: Replicates):
    found = measured(some, statement("mean", outcome_class="Success_L"))
    assert np.isnan(found).tolist() == [True, False, False, False]


def test_a_constant_has_no_correlation():
    one = np.ones((1, 20))
    assert np.isnan(spearman(one, np.arange(20.0)[None])).all()


def test_correlations_are_those_of_scipy_with_ties_and_gaps(some: Replicates):
    found = spearman(some.columns["WT"], some.columns["D"])
    for number in range(SETS):
        pair = (some.columns["WT"][number], some.columns["D"][number])
        expected: Any = stats.spearmanr(*pair, nan_policy="omit")
        assert found[number] == pytest.approx(expected.statistic)


@pytest.mark.parametrize("rho", [0.0, 0.075, -0.3, 0.9, 1.0, -1.0])
@pytest.mark.parametrize("size", [6, 30, SIZE])
def test_p_values_are_those_of_student(rho: float, size: int):
    freedom = size - 2
    t = rho * math.sqrt(freedom / max(1.0 - rho**2, 1e-300))
    expected = 2.0 * stats.t.sf(abs(t), freedom)
    assert p_value(np.array([rho]), size)[0] == pytest.approx(expected, abs=1e-12)


def test_the_printed_p_does_not_belong_to_the_printed_correlation():
    at = float(p_value(np.array([statements()["rho_nv_se"].quoted]), SIZE)[0])
    assert at == pytest.approx(0.214, abs=0.0005)
    assert statements()["p_nv_se"].quoted == pytest.approx(0.284)


@pytest.mark.parametrize(("kinds", "size"), [(1, 5), (2, 7), (4, 6), (5, 30)])
def test_there_are_as_many_splits_as_there_must_be_and_each_once(kinds: int, size: int):
    found = splits(kinds, size)
    assert len(found) == math.comb(size + kinds - 1, kinds - 1)
    assert (found.sum(axis=1) == size).all()
    assert found.min() >= 0
    assert len(np.unique(found, axis=0)) == len(found)


def test_the_legal_overtakes_of_the_paper_are_all_by_day():
    legal, none = inferences()
    assert (legal.scope, legal.splits, legal.nights) == ("Success_L", 1, (0, 0))
    by_hand = [
        (a, b, c, d)
        for a, b, c in product(range(30), repeat=3)
        if (d := 29 - a - b - c) >= 0
        and abs((2 * a + 7 * b + 60 * c + 100 * d) / 29 - 3.90) < 0.005
    ]
    assert by_hand == [(18, 11, 0, 0)]
    assert (none.scope, none.nights) == ("No_attempt", (26, 26))


def test_the_paper_has_four_fogs_and_each_is_of_one_light():
    assert weathers(("FOG",)) == ((2.0, 0.0), (7.0, 0.0), (60.0, 1.0), (100.0, 1.0))


def test_lawful_overtakes_are_counted_by_light_and_policy(some: Replicates):
    found = {(one.policy, one.is_night): one for one in lawful(some)}
    every = Counter[tuple[str, bool]]()
    for number in range(SETS):
        table = frame(some, number)
        for name, night in zip(table["CLASS"], table["NIGHT"] > 0, strict=True):
            every[name, night] += 1
    for night in (False, True):
        one = found["paper", night]
        assert one.legal == every["Success_L", night]
        assert one.completed == one.legal + every["Success_I", night]
    assert set(found) == {(name, night) for name in ("paper", "strict") for night in (False, True)}
