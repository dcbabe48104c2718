"""Refuse a name or a number that cannot be used."""

import operator
from collections.abc import Iterable
from difflib import SequenceMatcher
from math import inf
from typing import Any

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

    def similarity(candidate: str) -> float:
        return SequenceMatcher(a=name.lower(), b=candidate.lower()).ratio()

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


def whole_number(value: Any) -> int | None:
    """The integer that a value stands for, as for `operator.index`; None for any other value.

    Integers of NumPy overflow where Python's do not, and JSON cannot write them.

    Args:
        value: An integer of Python, NumPy or another library; flags are no integers.
    """
    is_flag = isinstance(value, bool) or str(getattr(value, "dtype", "")).endswith("bool")
    try:
        return None if is_flag else operator.index(value)
    except TypeError:
        return None


def check_whole_number(value: Any, low: int, high: int, *, what: str, where: str) -> int:
    """Refuse a value that is no integer of a range.

    Args:
        value: The value.
        low: The smallest integer.
        high: The largest one.
        what: The option or argument.
        where: The command or function.

    Returns:
        The integer.

    Raises:
        ConfigError: The value is something else.
    """
    number = whole_number(value)
    if number is None or not low <= number <= high:
        raise ConfigError.out_of_range(what, where, low, high, value)
    return number


def convert_integers(record: Any, *names: str) -> None:
    """Replace integers of other libraries in a frozen dataclass by Python's.

    Args:
        record: The dataclass, in its `__post_init__`.
        names: The fields; those that hold something else stay as they are.
    """
    for name in names:
        if (number := whole_number(getattr(record, name))) is not None:
            object.__setattr__(record, name, number)
