"""Weighted rates beside natural ones: agreement, disagreement, and what is too rare to say."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy import stats

from overtaking.analysis.validation.comparison import Rate, student
from overtaking.analysis.validation.comparison import compare as compare_figures
from overtaking.analysis.validation.figures import DEFINITIONS
from overtaking.analysis.validation.overtakes import STRATA, cell
from overtaking.analysis.validation.tally import GROUPS, Tally
from overtaking.model.verdicts import OvertakeClass

NUMBER = 4000
BINS = len(STRATA) * len(OvertakeClass)


def counted(seed: int, success: float, *, enriched: bool, honest: bool = True) -> Tally:
    """Simulations of which a share succeeds, three times as often where half of them is drawn."""
    rng = np.random.default_rng(seed)
    bent = rng.random(NUMBER) < 0.5 * enriched
    succeeds = rng.random(NUMBER) < np.where(bent, 3.0 * success, success)
    odds = np.where(succeeds, 3.0, (1.0 - 3.0 * success) / (1.0 - success))
    weight = 1.0 / (0.5 + 0.5 * odds) if enriched and honest else np.ones(NUMBER)
    group = np.arange(NUMBER) % GROUPS
    tally = Tally()
    kind = np.where(succeeds, OvertakeClass.SUCCESS_L, OvertakeClass.NO_ATTEMPT)
    tally.add_binned("classes", group, cell(0, kind), weight, BINS)
    tally.add_binned("stratum", group, np.zeros(NUMBER, np.int64), weight, len(STRATA))
    return tally


def compare(weighted: Tally, natural: Tally) -> tuple[Rate, ...]:
    return compare_figures(weighted, natural, DEFINITIONS)


@pytest.mark.ci
def test_honest_weights_agree_about_as_often_as_the_interval_says():
    apart = sum(
        not all(rate.agrees for rate in compare(counted(2 * seed, 0.1, enriched=True), natural))
        for seed in range(100)
        for natural in [counted(2 * seed + 1, 0.1, enriched=False)]
    )
    assert apart <= 12  # 5 % of a hundred, and chance.


def test_weights_that_do_not_undo_the_proposal_are_found_out():
    rates = compare(counted(1, 0.1, enriched=True, honest=False), counted(2, 0.1, enriched=False))
    said = {rate.title: rate for rate in rates}["Success_L"]
    assert said.weighted == pytest.approx(0.2, abs=0.03)
    assert said.natural == pytest.approx(0.1, abs=0.02)
    assert not said.agrees
    assert said.low < said.weighted - said.natural < said.high
    assert json.loads(json.dumps(said.values()))["agrees"] is False


def test_what_is_rare_in_either_is_not_compared():
    rates = compare(counted(1, 0.1, enriched=True), counted(2, 0.0005, enriched=False))
    assert [rate.title for rate in rates] == ["No_attempt"]


@pytest.mark.parametrize("probability", [0.9, 0.975, 0.9995])
@pytest.mark.parametrize("freedom", [10, 19, 200])
def test_quantiles_are_those_of_student(probability: float, freedom: int):
    expected = stats.t.ppf(probability, freedom)
    assert student(probability, freedom) == pytest.approx(expected, rel=0.01)
