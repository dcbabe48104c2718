"""Associations against dython, p-values against SciPy, their correction against statsmodels."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pandas as pd
import pytest
import scipy.stats
from tests.support.features import synthetic_features

from overtaking.analysis.stats.associations import Associations, associations
from overtaking.analysis.stats.columns import FEATURES, NOMINAL, NUMERIC
from overtaking.analysis.stats.sample import prepare

NAMES = [column.name for column in FEATURES] + ["CLASS"]
NAMED = [column.name for column in NOMINAL] + ["CLASS"]
NUMBERS = [column.name for column in NUMERIC]


@pytest.fixture(scope="module")
def frame() -> pd.DataFrame:
    return synthetic_features().drop(columns="weight")


@pytest.fixture(scope="module")
def paper_associations(frame: pd.DataFrame) -> Associations:
    return associations(prepare(frame, policy="paper"))


def matrix(result: Associations, values: np.ndarray) -> Any:
    return pd.DataFrame(values, result.names, result.names).loc[NAMES, NAMES]


@pytest.mark.ci
def test_associations_equal_dython(frame: pd.DataFrame):
    """The call of the paper. dython fills gaps with zeros, so rows with gaps are dropped here."""
    from dython import nominal as dython

    complete_rows = frame.dropna()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        expected = dython.associations(
            complete_rows,
            nominal_columns=NAMED,
            nom_nom_assoc="cramer",
            num_num_assoc="spearman",
            nom_num_assoc="correlation_ratio",
            symmetric_nom_nom=True,
            cramers_v_bias_correction=True,
            compute_only=True,
        )["corr"]
    ours = associations(prepare(complete_rows, policy="paper"))
    np.testing.assert_allclose(
        matrix(ours, ours.values).to_numpy(),
        expected.loc[NAMES, NAMES].to_numpy(dtype=float),
        rtol=1e-9,
        atol=1e-12,
    )


@pytest.mark.parametrize("first", NUMBERS)
@pytest.mark.parametrize("second", NUMBERS)
def test_spearman_and_its_p_value_equal_scipy(
    frame: pd.DataFrame, paper_associations: Associations, first: str, second: str
):
    if first == second:
        return
    columns = frame[[first, second]].dropna()
    expected: Any = scipy.stats.spearmanr(columns[first], columns[second])
    assert matrix(paper_associations, paper_associations.values).loc[
        first, second
    ] == pytest.approx(expected.statistic, abs=1e-12)
    assert matrix(paper_associations, paper_associations.p_values).loc[
        first, second
    ] == pytest.approx(expected.pvalue, rel=1e-8, abs=1e-300)


@pytest.mark.parametrize("name", NAMED)
@pytest.mark.parametrize("number", NUMBERS)
def test_kruskal_wallis_equals_scipy(
    frame: pd.DataFrame, paper_associations: Associations, name: str, number: str
):
    columns = frame[[name, number]].dropna()
    groups = [group[number].to_numpy() for _, group in columns.groupby(name)]
    expected: Any = scipy.stats.kruskal(*groups)
    assert matrix(paper_associations, paper_associations.p_values).loc[
        name, number
    ] == pytest.approx(expected.pvalue, rel=1e-8, abs=1e-300)
    pair = next(
        entry for entry in paper_associations.pairs if {entry.first, entry.second} == {name, number}
    )
    assert pair.effect == pytest.approx(expected.statistic / (len(columns) - 1), rel=1e-9)
    assert pair.count == len(columns)


def test_chi_squared_equals_scipy(frame: pd.DataFrame, paper_associations: Associations):
    p_values = matrix(paper_associations, paper_associations.p_values)
    for first in NAMED:
        for second in NAMED:
            if first != second:
                crossed = pd.crosstab(frame[first], frame[second])
                expected: Any = scipy.stats.chi2_contingency(crossed)
                assert p_values.loc[first, second] == pytest.approx(expected.pvalue, rel=1e-9)


def test_the_correction_of_p_values_equals_statsmodels(paper_associations: Associations):
    from statsmodels.stats import multitest

    upper = np.triu_indices(len(paper_associations.names), k=1)
    expected = multitest.multipletests(paper_associations.p_values[upper], method="fdr_bh")[1]
    assert paper_associations.q_values[upper] == pytest.approx(expected, rel=1e-12)
    assert (paper_associations.q_values[upper] >= paper_associations.p_values[upper]).all()


def test_the_associations_show_the_published_artefacts_of_the_presets(
    paper_associations: Associations,
):
    """Over the presets Spearman(PREC, WIND) is 1: the paper's first correlation."""
    values = matrix(paper_associations, paper_associations.values)
    assert values.loc["PREC", "WIND"] == pytest.approx(1.0)
    assert values.loc["FOG", "DN"] > 0.9
    position = {name: number for number, name in enumerate(paper_associations.names)}
    assert abs(position["PREC"] - position["WIND"]) == 1  # The order is by clusters.
    assert abs(position["FOG"] - position["DN"]) == 1


def test_a_constant_column_has_no_association(frame: pd.DataFrame):
    result = associations(prepare(frame.assign(FOG=2.0, HL="No"), policy="paper"))
    assert set(result.constant) == {"FOG", "HL"}
    values = matrix(result, result.values)
    assert values.loc["FOG"].drop("FOG").isna().all()
    assert values.loc["SE"].drop(["FOG", "HL"]).notna().all()


@pytest.mark.parametrize("rows", [0, 1, 2, 3, 5])
def test_associations_of_a_few_simulations_are_computed_or_undefined(
    frame: pd.DataFrame, rows: int
):
    result = associations(prepare(frame.iloc[:rows], policy="paper"))
    assert len(result.names) == 16
    assert np.isnan(result.q_values).all() or rows > 2


def test_censored_simulations_are_left_out(frame: pd.DataFrame):
    changed = frame.copy()
    changed.loc[changed.index[-40:], "CLASS"] = "censored"
    with_censored, without_censored = (
        associations(prepare(changed, policy="paper")),
        associations(prepare(frame.iloc[:-40], policy="paper")),
    )
    np.testing.assert_array_equal(
        matrix(with_censored, with_censored.values).to_numpy(),
        matrix(without_censored, without_censored.values).to_numpy(),
    )
