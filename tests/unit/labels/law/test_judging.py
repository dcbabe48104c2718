"""The policies paper, default and strict, and the legality that each derives from findings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.support.overtakes import alone, crossing, overtake

from overtaking.core.errors import ConfigError
from overtaking.labels.law.judging import (
    STORED_POLICIES,
    Policy,
    assess_legality,
    exceeds_tolerance,
    judge_pack,
    policies_of_law,
    stored_policy,
)
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.rule import Pack, TextSource, Tolerance
from overtaking.model.verdicts import Findings, Severity, Verdict


def findings(**verdicts: Verdict) -> Findings:
    """Findings of one simulation: the given verdicts, and legal for all other rules."""
    findings_of_overtake = judge_pack(PORTUGAL, overtake())
    verdict_table = np.full((1, len(findings_of_overtake.rule_codes)), Verdict.LEGAL, np.uint8)
    for code, verdict in verdicts.items():
        verdict_table[0, findings_of_overtake.rule_codes.index(code)] = verdict
    return findings_of_overtake.replace(verdict=verdict_table)


PORTUGUESE_POLICIES = {policy.name: policy for policy in policies_of_law("pt")}


def test_rules_and_policies_have_unique_names():
    assert len(set(PORTUGAL.codes)) == len(PORTUGAL.rules)
    assert len({rule.id for rule in PORTUGAL.rules}) == len(PORTUGAL.rules)
    assert [policy.name for policy in STORED_POLICIES] == ["paper", "default", "strict"]


@pytest.mark.parametrize("name", ["paper", "default", "strict"])
def test_a_policy_requires_existing_rules_for_the_ego(name):
    rules = {rule.code: rule for rule in PORTUGAL.rules}
    assert len(set(stored_policy(name).required)) == len(stored_policy(name).required)
    assert all(rules[code].is_duty_of_ego for code in stored_policy(name).required)


def test_the_paper_policy_requires_only_rules_that_the_columns_of_the_study_can_decide():
    # The study records positions, sizes, speeds, lines, limits and weather, but no lamps and no
    # indicators.
    known_inputs = {"weather", "kinds", "marks", "speed_limit", "road_kind"}
    for rule in PORTUGAL.rules:
        if rule.code in stored_policy("paper").required:
            assert rule.required_inputs | rule.conditional_inputs <= known_inputs, rule.code


def test_each_policy_is_stricter_than_the_one_before():
    paper, default, strict = (set(policy.required) for policy in STORED_POLICIES)
    assert paper < default
    assert default - strict == {"L14", "L15"}
    assert strict - default == {
        "L14s",
        "L15s",
        "L6",
        "L7",
        "L18",
        "L19",
        "L21",
        "L23",
        "L26",
        "L28",
    }


def test_a_lawful_overtake_is_lawful_under_the_policies_for_which_it_was_written():
    findings = judge_pack(PORTUGAL, overtake())
    for policy in STORED_POLICIES:
        legality = assess_legality(findings, policy)
        assert legality.is_legal[0]
        assert legality.num_broken[0] == legality.num_undecidable[0] == 0


def test_a_breach_by_another_driver_leaves_the_ego_legal():
    others_breach = findings(L22=Verdict.ILLEGAL)
    assert all(assess_legality(others_breach, policy).is_legal[0] for policy in STORED_POLICIES)


def test_broken_and_undecidable_rules_are_counted_separately():
    mixed_findings = findings(
        L1=Verdict.ILLEGAL,
        L3=Verdict.ILLEGAL,
        L9=Verdict.UNDECIDABLE,
        L14=Verdict.UNDECIDABLE,
        L6=Verdict.UNDECIDABLE,
        L24=Verdict.NOT_APPLICABLE,
    )
    counts = {
        policy.name: (int(legality.num_broken[0]), int(legality.num_undecidable[0]))
        for policy in STORED_POLICIES
        for legality in [assess_legality(mixed_findings, policy)]
    }
    assert counts == {"paper": (2, 1), "default": (2, 2), "strict": (2, 2)}


def test_an_undecidable_rule_is_no_breach():
    legality = assess_legality(findings(L3=Verdict.UNDECIDABLE), stored_policy("default"))
    assert legality.is_legal[0]
    assert legality.num_undecidable[0] == 1


def test_only_the_paper_policy_allows_undecided_rules_open_overtakes_and_departures():
    assert [policy.allows_undecided for policy in STORED_POLICIES] == [True, False, False]
    assert [policy.censors_open for policy in STORED_POLICIES] == [False, True, True]
    assert [policy.names_departures for policy in STORED_POLICIES] == [False, True, True]


def test_a_pack_without_a_required_rule_is_refused():
    short = Pack(name="short", version="1", rules=PORTUGAL.rules[:3])
    with pytest.raises(ConfigError, match=r"none called L4, L5, .*; check a pack that has them"):
        assess_legality(judge_pack(short, overtake()), stored_policy("paper"))


def test_the_error_for_an_unknown_policy_lists_the_stored_policies():
    with pytest.raises(ConfigError, match="expected paper or default or strict, got lenient"):
        stored_policy("lenient")


def test_findings_name_their_rules_and_version():
    findings = judge_pack(PORTUGAL, overtake())
    assert findings.rule_codes == PORTUGAL.codes
    assert findings.version == PORTUGAL.version
    assert findings.verdict.shape == (1, len(PORTUGAL.rules))


def test_an_empty_batch_has_no_findings():
    findings = judge_pack(PORTUGAL, overtake().select(np.array([], np.intp)))
    assert findings.verdict.shape == (0, len(PORTUGAL.rules))
    assert assess_legality(findings, stored_policy("default")).is_legal.shape == (0,)


def test_three_policies_are_stored_and_the_others_require_the_rules_of_default():
    names = [policy.name for policy in policies_of_law("pt")]
    assert names == ["paper", "default", "strict", "serious", "enforced"]
    for name in names[3:]:
        assert set(PORTUGUESE_POLICIES[name].required) == set(
            PORTUGUESE_POLICIES["default"].required
        )
        assert PORTUGUESE_POLICIES[name].min_severity is Severity.SERIOUS
    assert policies_of_law("nowhere") == ()


def test_a_light_breach_counts_only_for_the_default_policy():
    # 34 m/s are 122.4 km/h; 2.4 km/h above the limit are a light breach.
    case = alone(ego={"speed": 34.0}, events={"attempt": 60})
    findings = judge_pack(PORTUGAL, case)
    broken = {
        name: int(
            assess_legality(findings, PORTUGUESE_POLICIES[name], PORTUGAL, case).num_broken[0]
        )
        for name in ("default", "serious", "enforced")
    }
    assert broken["default"] == broken["serious"] + 1 == broken["enforced"] + 1


@pytest.mark.parametrize(("speed", "is_fined"), [(126.2, False), (126.5, True), (131.0, True)])
def test_the_enforced_policy_deducts_five_percent_of_the_measured_speed(speed, is_fined):
    # 0.95 x 126.3158 = 120 km/h.
    case = alone(ego={"speed": speed / 3.6})
    findings = judge_pack(PORTUGAL, case)
    only_speed = replace(PORTUGUESE_POLICIES["enforced"], required=("L12",))
    assert bool(assess_legality(findings, only_speed, PORTUGAL, case).num_broken[0]) == is_fined


@pytest.mark.parametrize(("tolerance_s", "counts"), [(0.0, True), (4.9, True), (5.1, False)])
def test_a_policy_tolerates_a_breach_up_to_a_duration(tolerance_s, counts):
    # The ego is too near its leader for 100 frames of 50 ms.
    case = crossing(target={"s": 20.0, "speed": 30.0}, events={})
    findings = judge_pack(PORTUGAL, case)
    column = findings.rule_codes.index("L3")
    breach_s = (findings.last_frame[0, column] - findings.first_frame[0, column] + 1) * 0.05
    policy = Policy(
        name="patient",
        required=("L3",),
        tolerances={"L3": Tolerance(duration=float(breach_s) - 5.0 + tolerance_s)},
    )
    assert bool(assess_legality(findings, policy, PORTUGAL, case).num_broken[0]) == counts


def test_the_duration_of_an_interrupted_breach_is_the_duration_of_its_longest_part():
    # Above 120 km/h in two parts, of 1 s and of 2 s, with 2 s between.
    speed = np.full(200, 30.0)
    speed[20:40] = speed[80:120] = 40.0
    case = alone(ego={"speed": speed})
    findings = judge_pack(PORTUGAL, case)
    column = findings.rule_codes.index("L12")
    assert (findings.first_frame[0, column], findings.last_frame[0, column]) == (20, 119)
    assert findings.longest_run[0, column] == 40
    for duration, counts in ((1.95, True), (2.05, False)):
        tolerance = Tolerance(duration=duration)
        assert bool(exceeds_tolerance(findings, "L12", tolerance, PORTUGAL, case)[0]) == counts


def test_exactly_the_breaches_have_a_longest_part():
    findings = judge_pack(PORTUGAL, overtake())
    broken = findings.verdict == Verdict.ILLEGAL
    np.testing.assert_array_equal(findings.longest_run > 0, broken)


def test_each_rule_names_its_consulted_source():
    assert PORTUGAL.edition
    assert {rule.text_source for rule in PORTUGAL.rules} == set(TextSource)
    for rule in PORTUGAL.rules:
        assert rule.consulted_source, rule.code


def test_a_pack_that_accepts_only_read_texts_leaves_its_other_rules_undecidable():
    strict = replace(PORTUGAL, accepts_unread_articles=False)
    trusting, doubting = (judge_pack(pack, overtake()) for pack in (PORTUGAL, strict))
    for column, rule in enumerate(PORTUGAL.rules):
        trusted_verdict, strict_verdict = trusting.verdict[0, column], doubting.verdict[0, column]
        is_unread = (
            rule.text_source is not TextSource.READ and trusted_verdict != Verdict.NOT_APPLICABLE
        )
        assert strict_verdict == (Verdict.UNDECIDABLE if is_unread else trusted_verdict), rule.code
