"""Each rule on overtakes written by hand: lawful, unlawful, none of its business, unknown."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.law_fixtures import FIXTURES
from tests.support.overtakes import crossing, overtake

from overtaking.labels.law.judging import judge_pack, judge_rule
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.overtake_events import NEVER
from overtaking.model.trajectories import UNKNOWNS
from overtaking.model.verdicts import Severity, Verdict

if TYPE_CHECKING:
    from overtaking.labels.law.rule import Rule
    from overtaking.model.verdicts import Finding

RULES = {rule.code: rule for rule in PORTUGAL.rules}


def judged(rule: Rule, make) -> Finding:
    return judge_rule(rule, make())


@pytest.mark.parametrize(
    ("code", "verdict", "make"),
    [
        pytest.param(code, verdict, make, id=f"{code} {verdict.name.lower()}: {what}")
        for code, verdict, what, make in FIXTURES
    ],
)
def test_a_rule_says_what_it_should_of(code, verdict, make):
    found = judged(RULES[code], make)
    assert Verdict(int(found.verdict[0])) is verdict
    broken = verdict is Verdict.ILLEGAL
    assert (found.margin[0] < 0) == broken
    assert (found.severity[0] != Severity.NONE) == broken
    assert (found.first_frame[0] != NEVER) == broken
    assert (found.last_frame[0] != NEVER) == broken
    assert found.last_frame[0] >= found.first_frame[0]
    if verdict in (Verdict.NOT_APPLICABLE, Verdict.UNDECIDABLE):
        assert found.margin[0] == 0.0


@pytest.mark.parametrize("rule", PORTUGAL.rules, ids=lambda rule: rule.code)
def test_every_rule_has_a_fixture_for_each_verdict_that_it_can_give(rule):
    has = {verdict for code, verdict, _, _ in FIXTURES if code == rule.code}
    possible = set(Verdict)
    if not rule.required_inputs | rule.conditional_inputs:
        possible -= {Verdict.UNDECIDABLE}
    assert has == possible


@pytest.mark.parametrize("name", UNKNOWNS)
def test_what_a_rule_does_not_name_it_does_not_need(name):
    named = {
        rule.code
        for rule in PORTUGAL.rules
        if name in rule.required_inputs | rule.conditional_inputs
    }
    for make in (overtake, crossing):
        known, unknown = judge_pack(PORTUGAL, make()), judge_pack(PORTUGAL, make(unknown=(name,)))
        changed = (known.verdict != unknown.verdict)[0]
        assert {
            code for code, is_it in zip(known.rule_codes, changed, strict=True) if is_it
        } <= named


@pytest.mark.parametrize(
    "rule", [r for r in PORTUGAL.rules if r.required_inputs], ids=lambda r: r.code
)
def test_without_what_it_needs_a_rule_decides_nothing(rule):
    for code, verdict, _, make in FIXTURES:
        if code != rule.code or verdict is Verdict.UNDECIDABLE:
            continue
        one = make()
        blind = one.replace(trajectories=one.trajectories.replace(unknown=rule.required_inputs))
        found = judge_rule(rule, blind)
        assert found.verdict[0] in (Verdict.UNDECIDABLE, Verdict.NOT_APPLICABLE)
        assert found.margin[0] == 0.0
        if verdict is not Verdict.NOT_APPLICABLE:
            assert found.verdict[0] == Verdict.UNDECIDABLE


def test_checks_are_of_the_types_that_tables_have():
    found = judge_rule(RULES["L3"], overtake())
    assert [found.verdict.dtype, found.severity.dtype, found.belief.dtype] == [np.uint8] * 3
    assert [found.first_frame.dtype, found.last_frame.dtype] == [np.int32] * 2
    assert found.margin.dtype == np.float32
