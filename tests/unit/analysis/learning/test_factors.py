"""Models, calibration and the order of factors, on examples with a known answer."""

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

NUMBER = 600
FACTORS = {
    "rain": ("rain_mmph",),
    "room behind": ("left_follower_gap_m", "night"),
    "speed": ("over_limit",),
    "ahead": ("leader_kind",),
}
FEW = {name: FACTORS[name] for name in ("speed", "ahead")}


@pytest.fixture(scope="module")
def found():
    leaks = {"C": ("it is the outcome", np.zeros((NUMBER, 1)))}
    leaks["C"][1][:, 0] = planted(NUMBER).classes == "Unsuccess_col"
    return learn_factors(planted(NUMBER), FACTORS, seed=3, leaks=leaks)


def test_what_decides_comes_first_and_what_does_not_comes_last(found):
    order = [one.factor for one in found.ranking]
    assert order[0] == "speed"
    assert order[3] == "rain"
    assert abs(found.ranking[3].gain) < 0.03
    assert found.ranking[0].gain > found.ranking[2].gain
    assert found.ranking[1].accuracy_low > found.most_frequent_accuracy


def test_every_model_beats_the_most_frequent_outcome(found):
    assert [one.name for one in found.models] == list(MODELS)
    assert all(one.accuracy_low > found.most_frequent_accuracy for one in found.models)
    assert found.models[1].accuracy > 0.9


def test_confusion_adds_up_to_what_was_kept_back(found):
    for one in found.models:
        assert one.confusion.sum() == found.held_out
        assert np.trace(one.confusion) == round(one.accuracy * found.held_out)
    assert found.learned_from + found.held_out == NUMBER


def test_a_leak_shows(found):
    assert [one.feature for one in found.leakage] == ["C"]
    assert found.leakage[0].gain > 0.0


def test_kin_stay_on_one_side():
    groups = planted(kin=7).groups
    known, kept = split(groups, seed=1)
    assert set(groups[known]).isdisjoint(groups[kept])
    for first, second in folds(groups, 3):
        assert set(groups[first]).isdisjoint(groups[second])
        assert len(first) + len(second) == len(groups)


def test_calibration_is_judged_as_on_paper():
    sure = np.array([[0.95, 0.05]] * 4 + [[0.55, 0.45]] * 4)
    truth = np.array([0, 0, 0, 1, 0, 0, 1, 1])
    bins = reliability(sure, truth)
    assert [(one.right, one.examples) for one in bins] == [(0.5, 4), (0.75, 4)]
    assert [one.confidence for one in bins] == pytest.approx([0.55, 0.95])
    assert calibration_error(bins) == pytest.approx(0.5 * 0.2 + 0.5 * 0.05)


def test_every_model_calibrates_with_threads_of_any_number():
    from threadpoolctl import threadpool_limits

    from overtaking.analysis.learning.models import fit, probabilities

    examples = planted(200)
    outcomes = examples.classes.to_numpy(dtype=object)
    for name in MODELS:
        model = model_of(name, examples.attributes, 1)
        first = probabilities(fit(model, examples.values, outcomes), examples.values)
        with threadpool_limits(2):
            second = probabilities(fit(model, examples.values, outcomes), examples.values)
        assert np.array_equal(first, second), name


def test_rules_are_judged_beside_the_limit_and_a_black_box():
    found = learn_rules(planted(), TARGETS["collision"], seed=2)
    rules, baseline, box = found.comparison
    assert baseline.name == BASELINE
    assert rules.num == baseline.num == box.num == 360
    assert rules.f_measure > box.f_measure - 0.05
    assert rules.f_measure > baseline.f_measure + 0.3


def test_counterexamples_are_where_a_rule_holds_and_is_wrong():
    examples = planted()
    found = learn_rules(examples, TARGETS["collision"], seed=2)
    for one in found.rules:
        wrong = one.rule.holds(examples) & (examples.classes != "Unsuccess_col").to_numpy()
        assert one.num_counterexamples == wrong.sum()
        assert set(one.counterexamples) <= set(examples.simulations[wrong])
    overlooked = ~np.logical_or.reduce([one.rule.holds(examples) for one in found.rules])
    overlooked &= (examples.classes == "Unsuccess_col").to_numpy()
    assert found.num_missed == overlooked.sum()


def test_factors_that_the_examples_lack_are_refused():
    factors = {"sight of the other side": ("oncoming_sight_m",)}
    with pytest.raises(DatasetError, match="got sight of the other side; take a data set of a two"):
        learn_factors(planted(NUMBER), factors)


def test_the_same_seed_gives_the_same_numbers_without_factors_that_the_examples_lack():
    lacking = {"sight of the other side": ("oncoming_sight_m",)}
    one, other = (learn_factors(planted(250), each, seed=3) for each in (FEW, FEW | lacking))
    assert one.values() == other.values()
