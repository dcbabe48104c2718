"""Weighted and natural rates agree or differ; rates of rare outcomes are not compared."""

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

NUM_SIMULATIONS = 4000
NUM_BINS = len(STRATA) * len(OvertakeClass)


def simulated_tally(seed: int, success: float, *, enriched: bool, honest: bool = True) -> Tally:
    """Simulations of which a share `success` succeeds.

    Args:
        seed: Seed of the random numbers.
        success: Natural share of successes [1].
        enriched: Whether half of the simulations are drawn with three times that share.
        honest: Whether weights undo this; otherwise all weights are 1.
    """
    rng = np.random.default_rng(seed)
    is_enriched = rng.random(NUM_SIMULATIONS) < 0.5 * enriched
    succeeds = rng.random(NUM_SIMULATIONS) < np.where(is_enriched, 3.0 * success, success)
    likelihood_ratio = np.where(succeeds, 3.0, (1.0 - 3.0 * success) / (1.0 - success))
    weight = (
        1.0 / (0.5 + 0.5 * likelihood_ratio) if enriched and honest else np.ones(NUM_SIMULATIONS)
    )
    group = np.arange(NUM_SIMULATIONS) % GROUPS
    tally = Tally()
    outcome_class = np.where(succeeds, OvertakeClass.SUCCESS_L, OvertakeClass.NO_ATTEMPT)
    tally.add_binned("classes", group, cell(0, outcome_class), weight, NUM_BINS)
    tally.add_binned("stratum", group, np.zeros(NUM_SIMULATIONS, np.int64), weight, len(STRATA))
    return tally


def compare(weighted: Tally, natural: Tally) -> tuple[Rate, ...]:
    return compare_figures(weighted, natural, DEFINITIONS)


@pytest.mark.ci
def test_correct_weights_agree_with_natural_rates_in_most_comparisons():
    num_disagreements = sum(
        not all(
            rate.agrees for rate in compare(simulated_tally(2 * seed, 0.1, enriched=True), natural)
        )
        for seed in range(100)
        for natural in [simulated_tally(2 * seed + 1, 0.1, enriched=False)]
    )
    assert num_disagreements <= 12  # Five of a hundred are expected; chance may add some.


def test_weights_that_do_not_undo_the_proposal_disagree_with_natural_rates():
    rates = compare(
        simulated_tally(1, 0.1, enriched=True, honest=False),
        simulated_tally(2, 0.1, enriched=False),
    )
    success_rate = {rate.title: rate for rate in rates}["Success_L"]
    # Half of the simulations succeed with 30 %, the others with 10 %.
    assert success_rate.weighted == pytest.approx(0.2, abs=0.03)
    assert success_rate.natural == pytest.approx(0.1, abs=0.02)
    assert not success_rate.agrees
    assert success_rate.low < success_rate.weighted - success_rate.natural < success_rate.high
    assert json.loads(json.dumps(success_rate.values()))["agrees"] is False


def test_an_outcome_that_is_rare_in_natural_simulations_is_not_compared():
    rates = compare(
        simulated_tally(1, 0.1, enriched=True), simulated_tally(2, 0.0005, enriched=False)
    )
    assert [rate.title for rate in rates] == ["No_attempt"]


@pytest.mark.parametrize("probability", [0.9, 0.975, 0.9995])
@pytest.mark.parametrize("freedom", [10, 19, 200])
def test_quantiles_approximate_students_t_distribution_within_1_percent(
    probability: float, freedom: int
):
    expected = stats.t.ppf(probability, freedom)
    assert student(probability, freedom) == pytest.approx(expected, rel=0.01)
