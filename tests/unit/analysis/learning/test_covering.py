"""Rules are found where they are planted, and few are kept."""

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


def about(*classes: str) -> np.ndarray:
    return EXAMPLES.classes.isin(classes).to_numpy()


def test_a_planted_rule_is_found_in_words():
    positive = about("Unsuccess_col")
    found = cover(EXAMPLES, positive, conditions_of(EXAMPLES, positive))
    assert not found.is_negated
    assert len(found.rules) == 1
    parts = set(found.rules[0].text.split(" and "))
    assert "it is night" in parts
    gap = next(one for one in found.rules[0].conditions if one.attribute.scale.unit == "m")
    assert gap.value == pytest.approx(40.0, abs=2.0)
    assert not gap.is_least


def test_what_takes_many_things_at_once_is_told_by_what_forbids_it():
    positive = about("Success_L")
    found = cover(EXAMPLES, positive, conditions_of(EXAMPLES, positive))
    assert found.is_negated
    texts = [one.text for one in found.rules]
    assert "the vehicle ahead is a bicycle" in texts
    assert "the ego is above its limit" in texts
    assert f_measure(found.says(EXAMPLES), positive) > 0.95


def test_of_what_is_rare_rules_say_when_it_is_so(monkeypatch):
    values = dict(zip((one.name for one in EXAMPLES.attributes), EXAMPLES.values.T, strict=True))
    near = (values["leader_gap_m"] < 40.0) & (values["night"] > 0.0)
    positive = near & (values["over_limit"] < -4.0) & (values["rain_mmph"] < 4.0)
    assert 0.03 < positive.mean() < 0.1
    conditions = conditions_of(EXAMPLES, positive)
    assert not cover(EXAMPLES, positive, conditions).is_negated
    monkeypatch.setattr(covering, "_RARE", 0.0)
    assert cover(EXAMPLES, positive, conditions).is_negated


def test_numbers_of_rules_and_conditions_are_bounded():
    positive = about("Success_L")
    conditions = conditions_of(EXAMPLES, positive)
    found = cover(EXAMPLES, positive, conditions, max_rules=2, max_conditions=1)
    assert 1 <= len(found.rules) <= 2
    assert all(len(one.conditions) == 1 for one in found.rules)


def test_noise_is_foretold_no_better_than_by_saying_it_always():
    draw = np.random.default_rng(3)
    positive = draw.random(len(EXAMPLES)) < 0.1
    found = cover(EXAMPLES, positive, conditions_of(EXAMPLES, positive))
    always = f_measure(np.ones(len(EXAMPLES), np.bool_), positive)
    assert f_measure(found.says(EXAMPLES), positive) < always + 0.05


def test_the_beam_finds_the_best_pair_of_conditions():
    positive = about("Unsuccess_col")
    conditions = conditions_of(EXAMPLES, positive)
    holds = np.column_stack([one.holds(EXAMPLES) for one in conditions])
    cost, least = 0.5, 0.005 * positive.sum()

    def gain(chosen: tuple[int, ...]) -> float:
        covered = holds[:, list(chosen)].all(axis=1)
        hits = int((covered & positive).sum())
        return hits - cost * (int(covered.sum()) - hits)

    search = covering._Search(
        is_negated=False,
        holds=holds.astype(np.float32),
        may_join=covering._may_join(
            holds.astype(np.float32), [one.attribute.name for one in conditions]
        ),
        wanted=positive,
        gain=1.0,
        cost=cost,
        least=least,
        max_rules=1,
        max_conditions=2,
    )
    found = search.best_rule(np.ones(len(EXAMPLES), np.bool_))
    best = max(gain(pair) for pair in combinations(range(len(conditions)), 2))
    assert gain(found) >= best - least


def test_a_rule_that_came_out_too_broad_is_looked_for_again():
    positive = about("Unsuccess_col")
    conditions = conditions_of(EXAMPLES, positive)
    searches = covering._searches(EXAMPLES, positive, conditions, (1, 2))
    search = next(one for one in searches if not one.is_negated)
    night = next(n for n, one in enumerate(conditions) if one.text == "it is night")
    found = search.bettered([(night,)])
    assert found == search.rules()
    assert search.worth(found) > search.worth([(night,)]) + search.least


def test_looking_again_costs_no_more_than_what_is_dropped():
    positive = about("Success_L")
    conditions = conditions_of(EXAMPLES, positive)
    for search in covering._searches(EXAMPLES, positive, conditions, (4, 2)):
        once = search.rules()
        again = search.bettered(once)
        assert len(again) <= 4
        assert search.worth(again) > search.worth(once) - search.least


def test_the_rule_that_is_worth_most_comes_first():
    positive = about("Success_L")
    found = cover(EXAMPLES, positive, conditions_of(EXAMPLES, positive))
    caught = [int((one.holds(EXAMPLES) & ~positive).sum()) for one in found.rules]
    assert len(caught) > 1
    assert caught == sorted(caught, reverse=True)


def test_the_f_measure_is_that_of_scikit_learn():
    draw = np.random.default_rng(4)
    said, positive = draw.random(200) < 0.4, draw.random(200) < 0.3
    assert f_measure(said, positive) == pytest.approx(metrics.f1_score(positive, said))
