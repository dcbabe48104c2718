"""How the wording of each rule of a pack is known: `law_texts.toml`."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from overtaking.knowledge.reader import load, read_section
from overtaking.labels.law.rule import Rule, Text

_FILE = "law_texts.toml"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Words:
    """The entry of a rule."""

    text: Text
    where: str


def edition(pack: str) -> str:
    """The edition of the law that a pack was held against."""
    return str(load(_FILE)[pack]["edition"])


def with_texts(pack: str, rules: Iterable[Rule]) -> tuple[Rule, ...]:
    """Rules of a pack, each with how its wording is known.

    Args:
        pack: Name of the pack.
        rules: Its rules.

    Raises:
        KnowledgeError: A rule has no entry.
    """
    entries = {rule.code: read_section(_Words, _FILE, f"{pack}.{rule.code}") for rule in rules}
    return tuple(
        replace(rule, text=entries[rule.code].text, where=entries[rule.code].where)
        for rule in rules
    )
