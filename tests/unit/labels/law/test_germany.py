"""The German rules on overtakes written by hand."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.cases import Track, case, ramp
from tests.support.german_fixtures import behind
from tests.support.overtakes import alone, overtake

from overtaking.labels.law.germany import GERMANY
from overtaking.labels.law.judging import assess_legality, judge_pack, policies_of_law
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.rule import TextSource
from overtaking.model.verdicts import Severity, Verdict


def test_each_rule_has_an_article_a_source_and_the_state_of_its_text():
    assert not {*GERMANY.codes} & {*PORTUGAL.codes}
    assert len({rule.id for rule in GERMANY.rules}) == len(GERMANY.rules)
    for rule in GERMANY.rules:
        assert rule.id.startswith("de.stvo.")
        assert "§" in rule.article
        assert rule.consulted_source
        assert rule.source == "de-stvo-2013"
    assert {rule.code for rule in GERMANY.rules if rule.text_source is not TextSource.READ} == {
        "F2",
        "G1",
    }


def test_no_policy_requires_a_rule_whose_text_was_not_read():
    rules = {rule.code: rule for rule in GERMANY.rules}
    for policy in policies_of_law("de"):
        assert all(rules[code].text_source is TextSource.READ for code in policy.required)
        assert all(rules[code].is_duty_of_ego for code in policy.required)


@pytest.mark.parametrize(("seconds", "margin"), [(1.0, 2.0), (2.9, 0.1), (3.1, -0.1), (5.0, -2.0)])
def test_a_short_distance_is_fined_after_three_seconds(seconds, margin):
    # The leader is 26.5 m ahead at 108 km/h. The driver has 3 s to regain the distance; the leader
    # jumps away after 3 s and the tested duration.
    departure_time = 3.05 + seconds
    speed = ramp((departure_time, 30.0), (departure_time + 0.05, 90.0), frames=200)
    following = case(Track(speed=30.0), Track(s=26.5 + 4.4, speed=speed), events={})
    findings = judge_pack(GERMANY, following)
    fined_margin = float(findings.margin[0, findings.rule_codes.index("A2")])
    assert fined_margin == pytest.approx(margin, abs=0.11)


def test_the_fine_counts_after_140_m_at_a_speed_at_which_they_take_less_than_3_s():
    # 140 m take 2.33 s at 216 km/h.
    following = behind(50.0, 60.0)
    findings = judge_pack(GERMANY, following)
    margin = findings.margin[0, findings.rule_codes.index("A2")]
    num_close_frames = int(following.events.last[0]) - 60
    assert margin == pytest.approx(140.0 / 60.0 - num_close_frames * 0.05, abs=0.06)


@pytest.mark.parametrize(
    ("speed", "severity"),
    [(34.0, Severity.LIGHT), (39.5, Severity.SERIOUS), (45.0, Severity.VERY_SERIOUS)],
)
def test_the_severity_grows_with_the_excess_over_the_speed_limit(speed, severity):
    findings = judge_pack(GERMANY, alone(ego={"speed": speed}))
    assert findings.severity[0, findings.rule_codes.index("V2")] == severity


def test_a_lawful_overtake_is_lawful_under_every_policy():
    lawful_overtake = overtake()
    findings = judge_pack(GERMANY, lawful_overtake)
    for policy in policies_of_law("de"):
        legality = assess_legality(findings, policy, GERMANY, lawful_overtake)
        broken_codes = np.array(findings.rule_codes)[findings.verdict[0] == Verdict.ILLEGAL]
        assert legality.is_legal[0], (policy.name, broken_codes)
        assert legality.num_undecidable[0] == 0
