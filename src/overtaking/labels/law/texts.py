"""Texts of the rules of a pack, from `law_rules.toml`."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from overtaking.knowledge.toml_reader import load_toml, read_record
from overtaking.labels.law.numbers import fill_placeholders
from overtaking.labels.law.rule import Rule, TextSource

_FILE = "law_rules.toml"


@dataclass(frozen=True, slots=True, kw_only=True)
class Words:
    """The entry of a rule.

    Attributes:
        text: How its wording is known.
        where: Where it was read.
        border: As in `Rule`, with placeholders such as `{law.side.motor}` for numbers.
        policies: Names of the policies that require it, separated by blanks.
    """

    text: TextSource
    where: str
    border: str
    policies: str


def edition(pack: str) -> str:
    """The edition of the law that a pack was held against."""
    return str(load_toml(_FILE)[pack]["edition"])


def texts_by_code(pack: str) -> Mapping[str, Words]:
    """The entries of a pack by code, in the order of the file; none for another pack."""
    return {
        code: read_record(Words, _FILE, f"{pack}.{code}")
        for code in load_toml(_FILE).get(pack, {})
        if code != "edition"
    }


def with_texts(pack: str, rules: Iterable[Rule]) -> tuple[Rule, ...]:
    """Rules of a pack, each with how its wording is known and what its border is called.

    Args:
        pack: Name of the pack.
        rules: Its rules.

    Raises:
        KeyError: A rule has no entry.
    """
    entries = texts_by_code(pack)
    return tuple(
        replace(
            rule,
            text_source=entry.text,
            consulted_source=entry.where,
            limit_phrase=fill_placeholders(entry.border),
        )
        for rule in rules
        for entry in (entries[rule.code],)
    )
