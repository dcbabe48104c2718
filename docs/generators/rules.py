"""The reference of the law: every rule, every policy, every number."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING

from generators.knowledge import source_link
from generators.markdown import page, section, table, unit

from overtaking.knowledge.quantities import Quantity
from overtaking.labels.law import numbers as law_numbers
from overtaking.labels.law.case import NO_GENERAL_LIMIT
from overtaking.labels.law.germany import GERMANY
from overtaking.labels.law.judging import policies_of_law
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.rule import TextSource

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from _typeshed import DataclassInstance

    from overtaking.labels.law.judging import Policy
    from overtaking.labels.law.rule import Pack, Rule

INTRODUCTION = f"""\
Two packs of rules: `{PORTUGAL.version}`, the Portuguese Highway Code and the regulation of signs,
and `{GERMANY.version}`, the German *Straßenverkehrs-Ordnung*, as far as overtaking goes. They are
interpretations by people who are no lawyers: where the law says *enough* or *in time*, we had to
put a number. What stands behind it is told in [the law](../explanation/law.md).

A rule says *legal*, *illegal*, *not applicable*, or *undecidable* where a recording does not tell
what it needs. The margin is how far the border of the law is, in the unit of the rule; it is
negative in a breach, and exactly at the border the law is kept. Its *standard error* follows from
the standard deviations sp of positions and sv of speeds, where they are stated; a margin within
two standard errors is undecidable ([more](../explanation/law.md#errors-of-measurement)).
"""
POLICY = """\
Which rules make an overtake illegal is the choice of a policy. Rules that no policy asks for are
recorded all the same.
"""
TOLERANCES = """\
`serious` and `enforced` are computed on request and never stored. In `enforced` a rule with a
tolerance counts at any severity beyond it; the others count as in `serious`.
"""
TEXTS = """\
A verdict of the Portuguese pack on a rule whose text was not read says so. The German pack leaves
such rules undecidable, and no policy asks for them.
"""
SHARED = """\
Numbers that rules of both laws read, in `labels/law/numbers.py`. A value whose source is *choice*
is ours, for the reason given.
"""
NUMBERS = """\
A value whose source is *choice* is ours, for the reason given.
"""


def content() -> str:
    """The page `reference/rules.md`."""
    return page(
        "Rules",
        INTRODUCTION,
        section(
            "Policies",
            POLICY,
            table(
                ("policy", "undecidable", "open", "off the road or spun", "counts from"),
                map(_policy, policies_of_law("pt")),
            ),
            TOLERANCES,
            table(("rule", "margin", "share", "source"), _tolerances((PORTUGAL, GERMANY))),
        ),
        section("How the text is known", TEXTS, table(("text", "meaning"), map(_text, TextSource))),
        section("Shared numbers", SHARED, _shared_numbers()),
        *_pack("Portugal", PORTUGAL),
        *_pack("Germany", GERMANY),
    )


def _pack(country: str, pack: Pack) -> tuple[str, ...]:
    """The overview of a pack, its rules, and their numbers."""
    names = [each.name for each in policies_of_law(pack.name)]
    overview = table(
        ("rule", "title", "law", "text", *names), [_line(rule, pack) for rule in pack.rules]
    )
    return (
        section(
            country,
            f"Edition: {pack.edition}.\n\nSeverity: {pack.severities}.\n",
            overview,
        ),
        section(f"The rules of {country}", *map(_rule, pack.rules)),
        section(f"Numbers of {country}", NUMBERS, _numbers_of_rules(pack)),
    )


def _numbers_of_rules(pack: Pack) -> str:
    """Every number of a criterion, with its unit, source and reason."""
    rows = [
        (rule.code, *_number(name, number))
        for rule in pack.rules
        for name, number in _quantities(rule.criterion)
    ]
    return table(("rule", "number", "value", "unit", "source", "why"), rows)


def _quantities(record: DataclassInstance) -> Iterator[tuple[str, Quantity]]:
    """Dotted name and value of each quantity of a record, through nested records."""
    for field in fields(record):
        value = getattr(record, field.name)
        if isinstance(value, Quantity):
            yield field.name, value
        elif is_dataclass(value) and not isinstance(value, type):
            for name, number in _quantities(value):
                yield f"{field.name}.{name}", number


def _tolerances(packs: Iterable[Pack]) -> list[tuple[str, ...]]:
    """Every tolerance of `enforced`, the only policy of these laws that has tolerances."""
    return [
        (
            rule.code,
            f"{tolerance.margin:.3g} {rule.unit}",
            f"{100.0 * tolerance.share:g} %",
            source_link(tolerance.source),
        )
        for pack in packs
        for rule in pack.rules
        for tolerance in rule.tolerances.values()
    ]


def _shared_numbers() -> str:
    """Every number of the module that both laws read."""
    rows = [
        _number(name, value)
        for name, value in vars(law_numbers).items()
        if isinstance(value, Quantity)
    ]
    return table(("number", "value", "unit", "source", "why"), rows)


def _number(name: str, number: Quantity) -> tuple[str, ...]:
    if number is NO_GENERAL_LIMIT:
        return f"`{name}`", "none", "", "", ""
    source = source_link(number.source)
    return f"`{name}`", number.bare(), unit(number.quoted_unit), source, number.rationale or ""


def _text(of: TextSource) -> tuple[str, str]:
    return f"`{of}`", of.meaning


def _line(rule: Rule, pack: Pack) -> tuple[str, ...]:
    asked = ["yes" if rule.code in each.required else "" for each in policies_of_law(pack.name)]
    return (
        f"[{rule.code}](#{_anchor(rule)})",
        rule.title,
        rule.article,
        str(rule.text_source),
        *asked,
    )


def _policy(each: Policy) -> tuple[str, ...]:
    doubt = "counts as legal" if each.allows_undecided else "gives `Success_U`"
    cut = "left out as *censored*" if each.censors_open else "counts as not completed"
    lost = "`Unsuccess_dep`" if each.names_departures else "counts as not completed"
    least = f"{each.min_severity.name.lower().replace('_', ' ')} breaches"
    return f"`{each.name}`", doubt, cut, lost, least


def _anchor(rule: Rule) -> str:
    """What Markdown viewers make of the heading."""
    kept = "".join(c for c in f"{rule.code} {rule.title}".lower() if c.isalnum() or c in " -")
    return kept.replace(" ", "-")


def _rule(rule: Rule) -> str:
    rows = [
        ("id", f"`{rule.id}`"),
        ("law", f"{rule.article} ({source_link(rule.source)})"),
        ("text", f"`{rule.text_source}`: {rule.consulted_source}"),
        ("what it asks", rule.gloss),
        ("what is checked", rule.predicate),
        ("unit of the margin", rule.unit),
        ("standard error", rule.criterion.ERROR_FORMULA),
        ("a breach is", rule.grade.value),
        ("it costs", rule.fine),
        ("undecidable without", _list(rule.required_inputs)),
        ("at times undecidable without", _list(rule.conditional_inputs)),
        (
            "without an attempt",
            "judged all the same" if rule.criterion.applies_without_attempt else "not applicable",
        ),
        ("roads", "with oncoming traffic" if rule.only_two_way_roads else ""),
        ("whose duty", "the ego's" if rule.is_duty_of_ego else "another's; no policy asks for it"),
    ]
    body = table(("", ""), [row for row in rows if row[1]])
    return f"### {rule.code} {rule.title}\n\n{body}\n"


def _list(names: frozenset[str]) -> str:
    return ", ".join(f"`{name}`" for name in sorted(names))
