"""Refuse a name or a number that cannot be used."""

from collections.abc import Iterable
from difflib import SequenceMatcher
from math import inf

from overtaking.core.errors import ConfigError


def check_name(got: str, known: Iterable[str], *, what: str, where: str) -> None:
    """Refuse a name that is not one of those that are known.

    Args:
        got: The name.
        known: All names that can be used.
        what: The option or argument.
        where: The command or function.

    Raises:
        ConfigError: It is none of them.
    """
    names = list(known)
    if got not in names:
        raise ConfigError.not_among(what, where, names, got)


def nearest_first(name: str, names: Iterable[str]) -> list[str]:
    """Names in order of their similarity to a name, the most similar one first."""

    def similarity(other: str) -> float:
        return SequenceMatcher(a=name.lower(), b=other.lower()).ratio()

    return sorted(names, key=similarity, reverse=True)


def check_least(
    got: float, least: float, most: float = inf, *, what: str, where: str, unit: str = ""
) -> None:
    """Refuse a number that is too small, or too large.

    Args:
        got: The number.
        least: The smallest that can be used.
        most: The largest.
        what: The option or argument.
        where: The command or function.
        unit: What it counts, for the message.

    Raises:
        ConfigError: It is smaller or larger, or NaN.
    """
    if not least <= got <= most:
        bounds = f"{least:g} {unit}".strip() + " or more"
        raise ConfigError.of(
            what=what,
            where=where,
            expected=bounds if most == inf else f"{least:,} to {most:,} {unit}".strip(),
            got=got,
            next_step="choose a number in that range",
        )
