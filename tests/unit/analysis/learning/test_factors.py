"""Models, calibration and the ranking of factors, on examples with known causes."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.learning import planted

from overtaking.analysis.learning.factors import calibration_error, learn_factors, reliability
from overtaking.analysis.learning.models import MODELS, folds, model_of, split
from overtaking.analysis.learning.rules import BASELINE, learn_rules
from overtaking.analysis.learning.targets import TARGETS
from overtaking.core.errors import DatasetError

pytestmark = pytest.mark.ci

NUM_EXAMPLES = 600
FACTORS = {
    "rain": ("rain_mmph",),
    "room behind": ("left_follower_gap_m", "night"),
    "speed": ("over_limit",),
    "ahead": ("leader_kind",),
}
TWO_FACTORS = {name: FACTORS[name] for name in ("speed", "ahead")}


@pytest.fixture(scope="module")
def study():
    """A study of the factors, with the outcome itself as a leaking feature C."""
    leaks = {"C": ("it is the outcome", np.zeros((NUM_EXAMPLES, 1)))}
    leaks["C"][1][:, 0] = planted(NUM_EXAMPLES).classes == "Unsuccess_col"
    return learn_factors(planted(NUM_EXAMPLES), FACTORS, seed=3, leaks=leaks)


def test_the_ranking_has_the_deciding_factor_first_and_the_irrelevant_one_last(study):
    # In `planted`, speed decides on legality, and rain on nothing.
    order = [entry.factor for entry in study.ranking]
    assert order[0] == "speed"
    assert order[3] == "rain"
    assert abs(study.ranking[3].gain) < 0.03
    assert study.ranking[0].gain > study.ranking[2].gain
    assert study.ranking[1].accuracy_low > study.most_frequent_accuracy


def test_every_model_beats_the_most_frequent_outcome(study):
    assert [model.name for model in study.models] == list(MODELS)
    assert all(model.accuracy_low > study.most_frequent_accuracy for model in study.models)
    assert study.models[1].accuracy > 0.9


def test_the_confusion_matrix_counts_every_held_out_example(study):
    for model in study.models:
        assert model.confusion.sum() == study.held_out
        assert np.trace(model.confusion) == round(model.accuracy * study.held_out)
    assert study.learned_from + study.held_out == NUM_EXAMPLES


def test_a_feature_with_the_outcome_itself_improves_the_prediction(study):
    assert [leak.feature for leak in study.leakage] == ["C"]
    assert study.leakage[0].gain > 0.0


def test_examples_of_one_group_are_on_one_side_of_every_split():
    groups = planted(kin=7).groups
    training, held_out = split(groups, seed=1)
    assert set(groups[training]).isdisjoint(groups[held_out])
    for fold_training, fold_validation in folds(groups, 3):
        assert set(groups[fold_training]).isdisjoint(groups[fold_validation])
        assert len(fold_training) + len(fold_validation) == len(groups)


def test_the_calibration_error_equals_a_calculation_by_hand():
    probabilities = np.array([[0.95, 0.05]] * 4 + [[0.55, 0.45]] * 4)
    outcomes = np.array([0, 0, 0, 1, 0, 0, 1, 1])
    bins = reliability(probabilities, outcomes)
    assert [(reliability_bin.right, reliability_bin.examples) for reliability_bin in bins] == [
        (0.5, 4),
        (0.75, 4),
    ]
    assert [reliability_bin.confidence for reliability_bin in bins] == pytest.approx([0.55, 0.95])
    # Two bins of half of the examples each: |0.75 - 0.95| and |0.5 - 0.55|.
    assert calibration_error(bins) == pytest.approx(0.5 * 0.2 + 0.5 * 0.05)


def test_every_model_has_equal_probabilities_with_any_number_of_threads():
    from threadpoolctl import threadpool_limits

    from overtaking.analysis.learning.models import fit, probabilities

    examples = planted(200)
    outcomes = examples.classes.to_numpy(dtype=object)
    for name in MODELS:
        model = model_of(name, examples.attributes, 1)
        with_default_threads = probabilities(fit(model, examples.values, outcomes), examples.values)
        with threadpool_limits(2):
            with_two_threads = probabilities(fit(model, examples.values, outcomes), examples.values)
        assert np.array_equal(with_default_threads, with_two_threads), name


def test_rules_predict_better_than_the_limit_and_about_like_a_black_box():
    rule_study = learn_rules(planted(), TARGETS["collision"], seed=2)
    rules, baseline, black_box = rule_study.comparison
    assert baseline.name == BASELINE
    assert rules.num == baseline.num == black_box.num == 360  # 30 % of 1,200 are held out.
    assert rules.f_measure > black_box.f_measure - 0.05
    assert rules.f_measure > baseline.f_measure + 0.3


def test_counterexamples_are_where_a_rule_holds_and_is_wrong():
    examples = planted()
    rule_study = learn_rules(examples, TARGETS["collision"], seed=2)
    for learned in rule_study.rules:
        is_wrong = learned.rule.holds(examples) & (examples.classes != "Unsuccess_col").to_numpy()
        assert learned.num_counterexamples == is_wrong.sum()
        assert set(learned.counterexamples) <= set(examples.simulations[is_wrong])
    is_missed = ~np.logical_or.reduce(
        [learned.rule.holds(examples) for learned in rule_study.rules]
    )
    is_missed &= (examples.classes == "Unsuccess_col").to_numpy()
    assert rule_study.num_missed == is_missed.sum()


def test_a_factor_without_values_in_the_examples_is_refused():
    factors = {"sight of the other side": ("oncoming_sight_m",)}
    with pytest.raises(DatasetError, match="got sight of the other side; take a data set of a two"):
        learn_factors(planted(NUM_EXAMPLES), factors)


def test_a_factor_without_values_does_not_change_the_numbers_of_other_factors():
    absent_factor = {"sight of the other side": ("oncoming_sight_m",)}
    without_absent, with_absent = (
        learn_factors(planted(250), factors, seed=3)
        for factors in (TWO_FACTORS, TWO_FACTORS | absent_factor)
    )
    assert without_absent.values() == with_absent.values()
