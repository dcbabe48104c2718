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

NAMES = [one.name for one in FEATURES] + ["CLASS"]
NAMED = [one.name for one in NOMINAL] + ["CLASS"]
NUMBERS = [one.name for one in NUMERIC]


@pytest.fixture(scope="module")
def frame() -> pd.DataFrame:
    return synthetic_features().drop(columns="weight")


@pytest.fixture(scope="module")
def found(frame: pd.DataFrame) -> Associations:
    return associations(prepare(frame, policy="paper"))


def matrix(found: Associations, values: np.ndarray) -> Any:
    return pd.DataFrame(values, found.names, found.names).loc[NAMES, NAMES]


@pytest.mark.ci
def test_associations_are_those_of_dython(frame: pd.DataFrame):
    """With the paper's call; dython fills gaps with zeros, so there are none here."""
    from dython import nominal as dython

    whole = frame.dropna()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        expected = dython.associations(
            whole,
            nominal_columns=NAMED,
            nom_nom_assoc="cramer",
            num_num_assoc="spearman",
            nom_num_assoc="correlation_ratio",
            symmetric_nom_nom=True,
            cramers_v_bias_correction=True,
            compute_only=True,
        )["corr"]
    ours = associations(prepare(whole, policy="paper"))
    np.testing.assert_allclose(
        matrix(ours, ours.values).to_numpy(),
        expected.loc[NAMES, NAMES].to_numpy(dtype=float),
        rtol=1e-9,
        atol=1e-12,
    )


@pytest.mark.parametrize("one", NUMBERS)
@pytest.mark.parametrize("other", NUMBERS)
def test_spearman_and_its_p_value_are_scipys(
    frame: pd.DataFrame, found: Associations, one: str, other: str
):
    if one == other:
        return
    both = frame[[one, other]].dropna()
    expected: Any = scipy.stats.spearmanr(both[one], both[other])
    assert matrix(found, found.values).loc[one, other] == pytest.approx(
        expected.statistic, abs=1e-12
    )
    assert matrix(found, found.p_values).loc[one, other] == pytest.approx(
        expected.pvalue, rel=1e-8, abs=1e-300
    )


@pytest.mark.parametrize("name", NAMED)
@pytest.mark.parametrize("number", NUMBERS)
def test_kruskal_wallis_is_scipys(frame: pd.DataFrame, found: Associations, name: str, number: str):
    both = frame[[name, number]].dropna()
    groups = [of[number].to_numpy() for _, of in both.groupby(name)]
    expected: Any = scipy.stats.kruskal(*groups)
    assert matrix(found, found.p_values).loc[name, number] == pytest.approx(
        expected.pvalue, rel=1e-8, abs=1e-300
    )
    pair = next(one for one in found.pairs if {one.first, one.second} == {name, number})
    assert pair.effect == pytest.approx(expected.statistic / (len(both) - 1), rel=1e-9)
    assert pair.count == len(both)


def test_chi_squared_is_scipys(frame: pd.DataFrame, found: Associations):
    p_values = matrix(found, found.p_values)
    for one in NAMED:
        for other in NAMED:
            if one != other:
                crossed = pd.crosstab(frame[one], frame[other])
                expected: Any = scipy.stats.chi2_contingency(crossed)
                assert p_values.loc[one, other] == pytest.approx(expected.pvalue, rel=1e-9)


def test_the_correction_is_statsmodels(found: Associations):
    from statsmodels.stats import multitest

    upper = np.triu_indices(len(found.names), k=1)
    expected = multitest.multipletests(found.p_values[upper], method="fdr_bh")[1]
    assert found.q_values[upper] == pytest.approx(expected, rel=1e-12)
    assert (found.q_values[upper] >= found.p_values[upper]).all()


def test_published_artefacts_of_the_presets_are_seen(found: Associations):
    """Over the presets Spearman(PREC, WIND) is 1: the paper's first correlation."""
    values = matrix(found, found.values)
    assert values.loc["PREC", "WIND"] == pytest.approx(1.0)
    assert values.loc["FOG", "DN"] > 0.9
    place = {name: number for number, name in enumerate(found.names)}
    assert abs(place["PREC"] - place["WIND"]) == 1  # Clustered: they stand beside each other.
    assert abs(place["FOG"] - place["DN"]) == 1


def test_a_constant_column_has_no_association(frame: pd.DataFrame):
    found = associations(prepare(frame.assign(FOG=2.0, HL="No"), policy="paper"))
    assert set(found.constant) == {"FOG", "HL"}
    values = matrix(found, found.values)
    assert values.loc["FOG"].drop("FOG").isna().all()
    assert values.loc["SE"].drop(["FOG", "HL"]).notna().all()


@pytest.mark.parametrize("rows", [0, 1, 2, 3, 5])
def test_hardly_any_simulations_are_no_problem(frame: pd.DataFrame, rows: int):
    found = associations(prepare(frame.iloc[:rows], policy="paper"))
    assert len(found.names) == 16
    assert np.isnan(found.q_values).all() or rows > 2


def test_what_is_censored_is_left_out(frame: pd.DataFrame):
    changed = frame.copy()
    changed.loc[changed.index[-40:], "CLASS"] = "censored"
    one, other = (
        associations(prepare(changed, policy="paper")),
        associations(prepare(frame.iloc[:-40], policy="paper")),
    )
    np.testing.assert_array_equal(
        matrix(one, one.values).to_numpy(), matrix(other, other.values).to_numpy()
    )
