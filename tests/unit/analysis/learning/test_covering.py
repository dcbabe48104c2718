"""Covering finds the rules that the test hides in its examples, and keeps few rules."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from sklearn import metrics
from tests.support.learning import planted

from overtaking.analysis.learning import covering
from overtaking.analysis.learning.conditions import conditions_of
from overtaking.analysis.learning.covering import cover, f_measure

EXAMPLES = planted()


def has_class(*classes: str) -> np.ndarray:
    """Whether an example has one of some classes, shape (example,)."""
    return EXAMPLES.classes.isin(classes).to_numpy()


def test_covering_finds_the_hidden_rule_of_collisions():
    positive = has_class("Unsuccess_col")
    rule_set = cover(EXAMPLES, positive, conditions_of(EXAMPLES, positive))
    assert not rule_set.is_negated
    assert len(rule_set.rules) == 1
    parts = set(rule_set.rules[0].text.split(" and "))
    assert "it is night" in parts
    gap_condition = next(
        condition
        for condition in rule_set.rules[0].conditions
        if condition.attribute.scale.unit == "m"
    )
    # In `planted`, a gap behind below 40 m at night ends in a collision.
    assert gap_condition.value == pytest.approx(40.0, abs=2.0)
    assert not gap_condition.is_least


def test_rules_of_legal_overtakes_name_the_exceptions():
    positive = has_class("Success_L")
    rule_set = cover(EXAMPLES, positive, conditions_of(EXAMPLES, positive))
    assert rule_set.is_negated
    texts = [rule.text for rule in rule_set.rules]
    assert "the vehicle ahead is a bicycle" in texts
    assert "the ego is above its limit" in texts
    assert f_measure(rule_set.says(EXAMPLES), positive) > 0.95


def test_rules_of_a_rare_outcome_name_its_conditions(monkeypatch):
    values = dict(
        zip((attribute.name for attribute in EXAMPLES.attributes), EXAMPLES.values.T, strict=True)
    )
    is_near_at_night = (values["leader_gap_m"] < 40.0) & (values["night"] > 0.0)
    positive = is_near_at_night & (values["over_limit"] < -4.0) & (values["rain_mmph"] < 4.0)
    assert 0.03 < positive.mean() < 0.1
    conditions = conditions_of(EXAMPLES, positive)
    assert not cover(EXAMPLES, positive, conditions).is_negated
    monkeypatch.setattr(covering, "_RARE", 0.0)
    assert cover(EXAMPLES, positive, conditions).is_negated


def test_numbers_of_rules_and_conditions_are_bounded():
    positive = has_class("Success_L")
    conditions = conditions_of(EXAMPLES, positive)
    rule_set = cover(EXAMPLES, positive, conditions, max_rules=2, max_conditions=1)
    assert 1 <= len(rule_set.rules) <= 2
    assert all(len(rule.conditions) == 1 for rule in rule_set.rules)


def test_rules_of_random_outcomes_predict_no_better_than_a_constant_answer():
    rng = np.random.default_rng(3)
    positive = rng.random(len(EXAMPLES)) < 0.1
    rule_set = cover(EXAMPLES, positive, conditions_of(EXAMPLES, positive))
    constant_f_measure = f_measure(np.ones(len(EXAMPLES), np.bool_), positive)
    assert f_measure(rule_set.says(EXAMPLES), positive) < constant_f_measure + 0.05


def test_the_beam_search_finds_the_best_pair_of_conditions():
    positive = has_class("Unsuccess_col")
    conditions = conditions_of(EXAMPLES, positive)
    holds = np.column_stack([condition.holds(EXAMPLES) for condition in conditions])
    cost, least_gain = 0.5, 0.005 * positive.sum()

    def gain(indices: tuple[int, ...]) -> float:
        covered = holds[:, list(indices)].all(axis=1)
        num_true = int((covered & positive).sum())
        return num_true - cost * (int(covered.sum()) - num_true)

    search = covering._Search(
        is_negated=False,
        holds=holds.astype(np.float32),
        may_join=covering._may_join(
            holds.astype(np.float32), [condition.attribute.name for condition in conditions]
        ),
        wanted=positive,
        gain=1.0,
        cost=cost,
        least=least_gain,
        max_rules=1,
        max_conditions=2,
    )
    best_rule = search.best_rule(np.ones(len(EXAMPLES), np.bool_))
    best_gain = max(gain(pair) for pair in combinations(range(len(conditions)), 2))
    assert gain(best_rule) >= best_gain - least_gain


def test_a_second_search_replaces_a_rule_that_is_too_broad():
    positive = has_class("Unsuccess_col")
    conditions = conditions_of(EXAMPLES, positive)
    searches = covering._searches(EXAMPLES, positive, conditions, (1, 2))
    search = next(search for search in searches if not search.is_negated)
    night_index = next(
        index for index, condition in enumerate(conditions) if condition.text == "it is night"
    )
    improved = search.bettered([(night_index,)])
    assert improved == search.rules()
    assert search.worth(improved) > search.worth([(night_index,)]) + search.least


def test_a_second_search_loses_less_worth_than_the_least_gain():
    positive = has_class("Success_L")
    conditions = conditions_of(EXAMPLES, positive)
    for search in covering._searches(EXAMPLES, positive, conditions, (4, 2)):
        rules = search.rules()
        improved = search.bettered(rules)
        assert len(improved) <= 4
        assert search.worth(improved) > search.worth(rules) - search.least


def test_rules_are_in_descending_order_of_their_hits():
    positive = has_class("Success_L")
    rule_set = cover(EXAMPLES, positive, conditions_of(EXAMPLES, positive))
    # The rules are negated: they hold where an overtake is not legal.
    num_hits = [int((rule.holds(EXAMPLES) & ~positive).sum()) for rule in rule_set.rules]
    assert len(num_hits) > 1
    assert num_hits == sorted(num_hits, reverse=True)


def test_the_f_measure_equals_scikit_learn():
    rng = np.random.default_rng(4)
    predicted, positive = rng.random(200) < 0.4, rng.random(200) < 0.3
    assert f_measure(predicted, positive) == pytest.approx(metrics.f1_score(positive, predicted))
