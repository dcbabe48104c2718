"""Texts of a law name only its own articles and rules, and print the numbers of its checks."""

from __future__ import annotations

import json
import re
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.support import german_fixtures, law_fixtures

import overtaking as ot
from overtaking.labels.labelling import label
from overtaking.labels.law.germany import GERMANY
from overtaking.labels.law.judging import policies_of_law
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.rule import Grade
from overtaking.model.verdicts import Verdict
from overtaking.show.description import describe
from overtaking.show.paragraphs import paragraphs
from overtaking.show.view.pack import pack as page_payload

if TYPE_CHECKING:
    from collections.abc import Iterator

    from overtaking.labels.labelling import LabelledTrajectories
    from overtaking.labels.law.rule import Rule

PACKS = {"pt": PORTUGAL, "de": GERMANY}
FIXTURES = {"pt": law_fixtures.FIXTURES, "de": german_fixtures.FIXTURES}
LAW_WORDS = {
    "pt": r"Articles? \d|Código|Highway Code|Portug|\bC14[abc]?\b",
    "de": r"§|StVO|BKat|Straßenverkehr|German",
}
"""Words that name the law of a pack; codes of its rules are added by `foreign_words`."""


def foreign_words(law: str) -> re.Pattern[str]:
    """A pattern of what no text of a law may contain: names and rule codes of the other law."""
    other_law = "de" if law == "pt" else "pt"
    codes = sorted(PACKS[other_law].codes, key=len, reverse=True)
    return re.compile(rf"\b(?:{'|'.join(codes)})\b|{LAW_WORDS[other_law]}")


def texts_of(value: Any) -> Iterator[str]:
    """All texts within plain values, keys of dictionaries included."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for name, item in value.items():
            yield name
            yield from texts_of(item)
    elif isinstance(value, (list, tuple)):
        for item in value:
            yield from texts_of(item)


def texts_of_rule(rule: Rule) -> Iterator[str]:
    """All texts of a rule."""
    for field in fields(rule):
        value = getattr(rule, field.name)
        if isinstance(value, (str, Grade)):
            yield str(value.value if isinstance(value, Grade) else value)
    yield rule.predicate
    yield rule.criterion.ERROR_FORMULA


def labelled_by(law: str, runs: Any) -> LabelledTrajectories:
    return label(runs, pack=PACKS[law], policies=policies_of_law(law))


@pytest.mark.parametrize("law", PACKS)
def test_no_text_of_a_rule_names_the_other_law(law):
    foreign = foreign_words(law)
    pack = PACKS[law]
    assert not [text for text in (pack.edition, pack.severities) if foreign.search(text)]
    for rule in pack.rules:
        foreign_texts = [text for text in texts_of_rule(rule) if foreign.search(text)]
        assert foreign_texts == [], rule.code


@pytest.mark.ci
@pytest.mark.parametrize("law", PACKS)
def test_no_explanation_names_the_other_law(law):
    foreign, pack, policies = foreign_words(law), PACKS[law], policies_of_law(law)
    runs = ot.simulate(ot.sample("pinto2023-physical", num_simulations=24, seed=5))
    labelled = labelled_by(law, runs)
    batches = [labelled.select(np.array([k])) for k in range(24)]
    breaches = [make for _, verdict, _, make in FIXTURES[law] if verdict is Verdict.ILLEGAL]
    batches += [labelled_by(law, make().trajectories) for make in breaches]
    for number, batch in enumerate(batches):
        values = describe(batch, number, pack=pack, policies=policies)
        sentences = paragraphs(batch, number, pack, policies)
        foreign_texts = [text for text in texts_of([values, sentences]) if foreign.search(text)]
        assert foreign_texts == []
        if law == "pt":  # The page shows the Portuguese law only.
            assert not foreign.search(json.dumps(page_payload(batch, number), ensure_ascii=False))


@pytest.mark.ci
def test_beliefs_are_compared_with_the_rules_of_the_law_that_judges():
    runs = ot.simulate(ot.sample("pinto2023-physical", num_simulations=24, seed=5))
    codes: dict[str, set[str]] = {}
    for law, pack in PACKS.items():
        labelled, policies = labelled_by(law, runs), policies_of_law(law)
        codes[law] = {
            neighbour["law"]["rule"]
            for k in range(24)
            for decision in describe(
                labelled.select(np.array([k])), k, pack=pack, policies=policies
            )["decisions"]
            for neighbour in decision["neighbours"].values()
            if neighbour is not None and neighbour["law"] is not None
        }
    # Only F2 of the German rules has one of these checks (L8), and its text was not read.
    assert codes == {"pt": {"L3", "L4", "L5", "L8"}, "de": set()}
