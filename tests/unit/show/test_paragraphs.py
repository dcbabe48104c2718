"""Paragraphs on verdicts agree with the findings, and every rule has its words."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support import german_fixtures, law_fixtures

import overtaking as ot
from overtaking.labels.labelling import label
from overtaking.labels.law.germany import GERMANY
from overtaking.labels.law.judging import policies_of_law
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.rule import TextSource
from overtaking.model.verdicts import Verdict
from overtaking.show.paragraphs import paragraphs

pytestmark = pytest.mark.ci

PACKS = {"pt": PORTUGAL, "de": GERMANY}


@pytest.fixture(scope="module")
def runs():
    return ot.simulate(ot.sample("motorway", num_simulations=40, seed=1))


@pytest.mark.parametrize("law", PACKS)
def test_every_rule_names_its_limit(law):
    assert all(rule.limit_phrase != "its limit" for rule in PACKS[law].rules)


@pytest.mark.parametrize("law", PACKS)
def test_a_paragraph_has_article_margin_and_verdict_of_the_findings(runs, law):
    pack, policies = PACKS[law], policies_of_law(law)
    all_of = label(runs, pack=pack, policies=policies)
    kinds = set()
    for simulation in range(len(runs.num_frames)):
        one = all_of.select(np.array([simulation]))
        told = paragraphs(one, simulation, pack, policies)
        assert {each["rule"] for each in told} == {*pack.codes}
        for each in told:
            place, rule = one.findings.rule_codes.index(each["rule"]), pack.rule(each["rule"])
            verdict = Verdict(int(one.findings.verdict[0, place]))
            kinds.add(verdict)
            text = each["paragraph"]
            assert each["verdict"] == verdict.name.lower()
            assert rule.article in text
            assert f"simulation {simulation} " in text
            assert ("text of the law was not read" in text) == (
                rule.text_source is not TextSource.READ
            )
            assert ("was broken" in text) == (verdict is Verdict.ILLEGAL)
            assert ("was kept" in text) == (verdict is Verdict.LEGAL)
            assert ("cannot be decided" in text) == (verdict is Verdict.UNDECIDABLE)
            if verdict in (Verdict.LEGAL, Verdict.ILLEGAL):
                assert f"{abs(one.findings.margin[0, place]):.2f}" in text
                assert each["margin"] == pytest.approx(one.findings.margin[0, place], abs=1e-4)
            assert "{" not in text
    assert {Verdict.LEGAL, Verdict.ILLEGAL, Verdict.NOT_APPLICABLE} <= kinds


@pytest.mark.parametrize("law", PACKS)
def test_every_breach_written_by_hand_says_what_would_have_been_lawful(law):
    fixtures = {"pt": law_fixtures, "de": german_fixtures}[law].FIXTURES
    for code, verdict, what, make in fixtures:
        if verdict is not Verdict.ILLEGAL:
            continue
        one = label(make().trajectories, pack=PACKS[law], policies=policies_of_law(law))
        place = one.findings.rule_codes.index(code)
        if one.findings.verdict[0, place] != Verdict.ILLEGAL:
            continue  # Its events were stated, and are found otherwise in its tracks.
        told = paragraphs(one, 0, PACKS[law], policies_of_law(law))
        (text,) = (each["paragraph"] for each in told if each["rule"] == code)
        assert "would have been lawful with" in text, (code, what, text)


def test_a_german_remedy_names_the_lawful_value(runs):
    all_of = label(runs, pack=GERMANY, policies=policies_of_law("de"))
    seen = 0
    for simulation in range(len(runs.num_frames)):
        one = all_of.select(np.array([simulation]))
        for each in paragraphs(one, simulation, GERMANY, policies_of_law("de")):
            if each["rule"] == "V2" and each["verdict"] == "illegal":
                speed = 120.0 if "120 km/h instead" in each["paragraph"] else 80.0
                assert f"{speed:.0f} km/h instead of" in each["paragraph"]
                seen += 1
            if each["rule"] == "A1" and each["verdict"] == "illegal":
                assert f"with {abs(each['margin']):.1f} m more to" in each["paragraph"]
                seen += 1
    assert seen > 10
