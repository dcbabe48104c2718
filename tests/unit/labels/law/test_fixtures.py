"""Each rule on overtakes written by hand: legal, illegal, not applicable, undecidable."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tests.support import german_fixtures
from tests.support.law_fixtures import FIXTURES
from tests.support.overtakes import crossing, overtake

from overtaking.labels.law.germany import GERMANY
from overtaking.labels.law.judging import judge_pack, judge_rule
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.overtake_events import NEVER
from overtaking.model.trajectories import UNKNOWNS
from overtaking.model.verdicts import Severity, Verdict

FIXTURES_OF_PACKS = ((PORTUGAL, FIXTURES), (GERMANY, german_fixtures.FIXTURES))


@pytest.mark.parametrize(
    ("pack", "code", "verdict", "make_case"),
    [
        pytest.param(pack, code, verdict, make_case, id=f"{code} {verdict.name.lower()}: {title}")
        for pack, fixtures in FIXTURES_OF_PACKS
        for code, verdict, title, make_case in fixtures
    ],
)
def test_a_rule_gives_the_verdict_of_its_fixture(pack, code, verdict, make_case):
    # A pack of this rule alone: the pack decides about rules whose text was not read.
    pack_of_rule = dataclasses.replace(pack, rules=(pack.rule(code),))
    findings = judge_pack(pack_of_rule, make_case())
    assert Verdict(int(findings.verdict[0, 0])) is verdict
    is_broken = verdict is Verdict.ILLEGAL
    assert (findings.margin[0, 0] < 0) == is_broken
    assert (findings.severity[0, 0] != Severity.NONE) == is_broken
    assert (findings.first_frame[0, 0] != NEVER) == is_broken
    assert (findings.last_frame[0, 0] != NEVER) == is_broken
    assert findings.last_frame[0, 0] >= findings.first_frame[0, 0]
    if verdict in (Verdict.NOT_APPLICABLE, Verdict.UNDECIDABLE):
        assert findings.margin[0, 0] == 0.0


@pytest.mark.parametrize(
    ("pack", "fixtures", "rule"),
    [
        pytest.param(pack, fixtures, rule, id=rule.code)
        for pack, fixtures in FIXTURES_OF_PACKS
        for rule in pack.rules
    ],
)
def test_every_rule_has_a_fixture_for_each_verdict_that_it_can_give(pack, fixtures, rule):
    verdicts = {verdict for code, verdict, _, _ in fixtures if code == rule.code}
    possible = set(Verdict)
    if not rule.required_inputs | rule.conditional_inputs:
        possible -= {Verdict.UNDECIDABLE}
    if rule not in pack.deciding_rules:
        possible = {Verdict.NOT_APPLICABLE, Verdict.UNDECIDABLE}
    assert verdicts == possible


@pytest.mark.parametrize("name", UNKNOWNS)
def test_an_unknown_input_changes_only_rules_that_name_it(name):
    codes_with_input = {
        rule.code
        for rule in PORTUGAL.rules
        if name in rule.required_inputs | rule.conditional_inputs
    }
    for make_case in (overtake, crossing):
        complete = judge_pack(PORTUGAL, make_case())
        incomplete = judge_pack(PORTUGAL, make_case(unknown=(name,)))
        changed = np.array(complete.rule_codes)[(complete.verdict != incomplete.verdict)[0]]
        assert {*changed.tolist()} <= codes_with_input


@pytest.mark.parametrize(
    "rule",
    [rule for rule in PORTUGAL.rules if rule.required_inputs],
    ids=lambda rule: rule.code,
)
def test_without_its_required_inputs_a_rule_is_undecidable(rule):
    for code, verdict, _, make_case in FIXTURES:
        if code != rule.code or verdict is Verdict.UNDECIDABLE:
            continue
        case = make_case()
        trajectories = case.trajectories.replace(unknown=rule.required_inputs)
        finding = judge_rule(rule, case.replace(trajectories=trajectories))
        assert finding.verdict[0] in (Verdict.UNDECIDABLE, Verdict.NOT_APPLICABLE)
        assert finding.margin[0] == 0.0
        if verdict is not Verdict.NOT_APPLICABLE:
            assert finding.verdict[0] == Verdict.UNDECIDABLE


def test_findings_have_the_types_of_their_columns():
    finding = judge_rule(PORTUGAL.rule("L3"), overtake())
    assert [finding.verdict.dtype, finding.severity.dtype, finding.belief.dtype] == [np.uint8] * 3
    assert [finding.first_frame.dtype, finding.last_frame.dtype] == [np.int32] * 2
    assert finding.margin.dtype == np.float32
