"""A paragraph for each verdict, to be quoted: article, facts, margin, and what would be lawful.

The sentences are those of `knowledge/data/law_sentences.toml`; the numbers are those of
findings and explanation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from overtaking.core.units import kmh_from_mps
from overtaking.knowledge.toml_reader import load_toml
from overtaking.labels.law.rule import TextSource
from overtaking.model.verdicts import Verdict
from overtaking.show.description import describe
from overtaking.show.wording import BELIEFS, breach_words, words

if TYPE_CHECKING:
    from overtaking.labels.labelling import LabelledTrajectories
    from overtaking.labels.law.judging import Policy
    from overtaking.labels.law.rule import Pack, Rule

    Values = dict[str, Any]

_FILE = "law_sentences.toml"
_DASH = " to "


def paragraphs(
    labelled: LabelledTrajectories, number: int, pack: Pack, policies: tuple[Policy, ...]
) -> list[Values]:
    """A paragraph for each rule: the broken ones first, then the undecidable, kept and others.

    Args:
        labelled: A batch of one simulation, labelled by the pack.
        number: Its number in its data set.
        pack: The rules.
        policies: The policies of its labels.

    Returns:
        For each rule its code, law, verdict, margin, unit, text and paragraph. The margin is None
        where the verdict is neither legal nor illegal.
    """
    return paragraphs_of(labelled, describe(labelled, number, pack=pack, policies=policies), pack)


def paragraphs_of(labelled: LabelledTrajectories, values: Values, pack: Pack) -> list[Values]:
    """The same, from what is described already.

    Args:
        labelled: As in `paragraphs`.
        values: What `describe` says of it.
        pack: The rules.
    """
    order = (Verdict.ILLEGAL, Verdict.UNDECIDABLE, Verdict.LEGAL, Verdict.NOT_APPLICABLE)
    verdicts = [Verdict(int(one)) for one in labelled.findings.verdict[0]]
    places = sorted(range(len(verdicts)), key=lambda place: order.index(verdicts[place]))
    return [_told(pack.rules[k], verdicts[k], labelled, values) for k in places]


def _told(rule: Rule, verdict: Verdict, labelled: LabelledTrajectories, values: Values) -> Values:
    findings = labelled.findings
    margin = float(findings.margin[0, findings.rule_codes.index(rule.code)])
    sentences = load_toml(_FILE)["sentences"]
    whose = "the ego" if rule.is_duty_of_ego else "the overtaken vehicle"
    facts: Values = {
        "law": rule.article,
        "rule_set": findings.version,
        "gloss": rule.gloss,
        "code": rule.code,
        "simulation": values["simulation"],
        "limit": rule.limit_phrase,
        "amount": _amount(abs(margin), rule.unit),
        "whose": whose,
        "fine": rule.fine,
    }
    said = ["asks", verdict.name.lower()]
    if verdict is Verdict.ILLEGAL:
        one = next(one for one in values["broken"] if one["rule"] == rule.code)
        said += _of_breach(one, values, facts)
    elif verdict is Verdict.UNDECIDABLE:
        one = next(one for one in values["undecidable"] if one["rule"] == rule.code)
        facts["why"] = _why(one, sentences)
    if rule.text_source is not TextSource.READ:
        said.append("unread")
        facts["how"] = sentences[rule.text_source.value]
    is_decided = verdict in (Verdict.LEGAL, Verdict.ILLEGAL)
    return {
        "rule": rule.code,
        "law": rule.article,
        "verdict": verdict.name.lower(),
        "margin": round(margin, 4) if is_decided else None,
        "unit": rule.unit,
        "text": rule.text_source.value,
        "paragraph": " ".join(sentences[name].format(**facts) for name in said),
    }


def _of_breach(one: Values, values: Values, facts: Values) -> list[str]:
    """Sentences on a breach, with its facts filled in."""
    told = breach_words(one, values, _DASH)
    facts["severity"] = words(one["severity"])
    facts["when"] = f"from {one['from_s']:.2f} s to {one['to_s']:.2f} s"
    if one["first_frame"] == one["last_frame"]:
        facts["when"] = f"at {one['from_s']:.2f} s"
    said = ["remedy" if told.remedies else "nearer"]
    facts["remedies"] = ", or with ".join(told.remedies)
    if one["belief"]:
        said.append("belief")
        facts["belief"] = BELIEFS[one["belief"]]
    return said + (["fine"] if facts["fine"] else [])


def _why(one: Values, sentences: Values) -> str:
    """Why a rule cannot be decided."""
    if one["text_not_read"]:
        return sentences["no_text"]
    missing = ", ".join(words(name) for name in one["not_recorded"])
    return sentences["missing"].format(missing=missing) if missing else sentences["error"]


def _amount(value: float, unit: str) -> str:
    """A margin with its unit; speeds also in km/h."""
    if unit == "m/s":
        return f"{value:.2f} m/s ({kmh_from_mps(value):.1f} km/h)"
    return f"{value:.2f}" if unit == "1" else f"{value:.2f} {unit}"
