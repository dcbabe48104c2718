"""Error classes, their one message format, checks of names and numbers, extras."""

from __future__ import annotations

import operator
import re
import shlex
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from difflib import SequenceMatcher
from functools import cache
from importlib import metadata
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from overtaking.core.representation import as_utf8

if TYPE_CHECKING:
    from collections.abc import Iterable
    from typing import Self


MAX_MESSAGE_PART = 160


def printable(part: object) -> str:
    """A part of a message on one line, without what a terminal would obey, and not too long."""
    text = as_utf8(part) if isinstance(part, str) else repr(part)
    text = " ".join(text.split())
    text = text[: MAX_MESSAGE_PART + 1]
    text = "".join(one if one.isprintable() else "�" for one in text)
    if len(text) <= MAX_MESSAGE_PART:
        return text
    return text[: MAX_MESSAGE_PART - 3] + "..."


def _format_message(
    *, what: object, where: object, expected: object, got: object, next_step: object = "correct it"
) -> str:
    head = f"{printable(where)}: {printable(what)}"
    body = f"expected {printable(expected)}, got {printable(got)}"
    return f"{head}: {body}; {printable(next_step)}"


class OvertakingError(Exception):
    """Base class of all errors that this package raises on purpose.

    Args:
        message: A complete message, in place of the five parts. Pickling restores an error so.
        what: The invalid thing, such as a column, a key or an option.
        where: The file, section or call in which it was found.
        expected: Description of a valid value.
        got: The value found.
        next_step: Advice for the user, as an imperative.

    The parts make the one-line message `where: what: expected ..., got ...; next_step`.
    """

    @overload
    def __init__(self, message: str) -> None: ...

    @overload
    def __init__(
        self,
        *,
        what: object,
        where: object,
        expected: object,
        got: object,
        next_step: object = "correct it",
    ) -> None: ...

    def __init__(self, message: str | None = None, **parts: object) -> None:
        """Take a message, or format its parts."""
        super().__init__(_format_message(**parts) if message is None else message)

    @classmethod
    def unknown_choice(cls, what: str, where: str, known: Iterable[str], got: object) -> Self:
        """An error for a name that is none of those that are known.

        Args:
            what: What is named, such as `policy`.
            where: The call or option that was given the name.
            known: The names to choose from.
            got: The name that was given.
        """
        step = "choose one of them"
        return cls(what=what, where=where, expected=" or ".join(known), got=got, next_step=step)

    @classmethod
    def out_of_range(
        cls,
        *,
        what: str,
        where: str,
        low: object,
        high: object = None,
        got: object,
        next_step: str = "",
    ) -> Self:
        """An error for a number that is not in a range.

        Args:
            what: What the number is of.
            where: The call or option that was given the number.
            low: Smallest number.
            high: Largest number; None if there is none.
            got: The number that was given.
            next_step: What the reader can do; to choose a number in that range if left out.
        """
        expected = f"{low} or more" if high is None else f"{low} to {high}"
        step = next_step or "choose a number in that range"
        return cls(what=what, where=where, expected=expected, got=got, next_step=step)


class ConfigError(OvertakingError, ValueError):
    """A profile, specification, option or argument that cannot be used."""


class NoSuchSimulationError(ConfigError, IndexError):
    """The number of a simulation that a data set does not have; ends a loop over its numbers."""


class SchemaError(OvertakingError, ValueError):
    """A table or array whose columns, types, units or version are not those agreed on."""

    @classmethod
    def newer_version(cls, what: str, where: str, known: int, got: int) -> Self:
        """The error for a version that is newer than this package knows.

        Args:
            what: The version of what.
            where: The file.
            known: The newest that is known.
            got: The value found.
        """
        step = "use the version of overtaking that wrote it, or a newer one"
        return cls(what=what, where=where, expected=f"at most {known}", got=got, next_step=step)


class DriverError(OvertakingError, RuntimeError):
    """A policy that raises, or answers what is no action."""


class ImportFormatError(OvertakingError, ValueError):
    """A file of another program that does not say what its format requires."""


class RecordingWarning(UserWarning):
    """A recording that was read, and in whose examination something was found.

    `import_report` has each finding, and what the reader did about it.
    """


class DatasetError(OvertakingError, RuntimeError):
    """A data set folder that is incomplete, damaged or in the wrong state."""


class LockedError(DatasetError):
    """A data set folder that another process is writing."""


class SystemLimitError(OvertakingError, RuntimeError):
    """Memory, threads, processes or open files that the operating system does not grant."""


class MissingExtraError(OvertakingError, ImportError):
    """An optional dependency that a command needs and that is not installed."""

    @classmethod
    def for_extra(
        cls, extra: str, *, what: str, where: str, got: str = "none", otherwise: str = ""
    ) -> Self:
        """The error for an extra that is not installed; its last part is the command to run.

        Args:
            extra: Its name.
            what: The package, and what it does.
            where: What needs it.
            got: The value found.
            otherwise: What else the reader can do, as an imperative.
        """
        head = f"{where}: {what}: expected the extra [{extra}], got {printable(got)}"
        instead = f"; or {otherwise}" if otherwise else ""
        return cls(f"{head}; run: {install_command(extra)}{instead}")


class KnowledgeError(OvertakingError, ValueError):
    """A knowledge file with an unknown, missing, unitless or unsourced entry."""


class InfeasibleError(OvertakingError, ValueError):
    """A scenario or request that no vehicle on no road could meet."""


def check_choice(got: str, known: Iterable[str], *, what: str, where: str) -> None:
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
        raise ConfigError.unknown_choice(what, where, names, got)


def nearest_first(name: str, names: Iterable[str]) -> list[str]:
    """Names in order of their similarity to a name, the most similar one first."""

    def similarity(candidate: str) -> float:
        return SequenceMatcher(a=name.lower(), b=candidate.lower()).ratio()

    return sorted(names, key=similarity, reverse=True)


def check_in_range(
    got: float, low: float, high: float = inf, *, what: str, where: str, unit: str = ""
) -> None:
    """Refuse a number that is too small, or too large.

    Args:
        got: The number.
        low: The smallest that can be used.
        high: The largest.
        what: The option or argument.
        where: The command or function.
        unit: What it counts, for the message.

    Raises:
        ConfigError: It is smaller or larger, or NaN.
    """
    if not low <= got <= high:
        bounds = f"{low:g} {unit}".strip() + " or more"
        raise ConfigError(
            what=what,
            where=where,
            expected=bounds if high == inf else f"{low:,} to {high:,} {unit}".strip(),
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
        raise ConfigError.out_of_range(what=what, where=where, low=low, high=high, got=value)
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


DISTRIBUTION = "overtaking"


@dataclass(frozen=True, slots=True)
class Requirement:
    """A package that `overtaking` requires.

    Attributes:
        package: Name of the package.
        specifier: Name and supported versions, such as `duckdb>=1.1`.
        extra: The extra that requires it; empty if it is always required.
    """

    package: str
    specifier: str
    extra: str

    def is_newer_than(self, version: str) -> bool:
        """Whether the lowest supported version is newer than a version, such as the installed."""
        bound = re.search(r"[>=]=\s*([\w.]+)", self.specifier)
        return bound is not None and _release(version) < _release(bound[1])


def _release(version: str) -> tuple[int, ...]:
    """The numbers of a release for comparison, without zeros at the end: 3.10 equals 3.10.0."""
    numbers = re.match(r"[\d.]*", version)
    parts = [int(part) for part in (numbers[0] if numbers else "").split(".") if part]
    while parts and parts[-1] == 0:
        parts.pop()
    return tuple(parts)


@cache
def requirements() -> tuple[Requirement, ...]:
    """The requirements in the metadata of the installed package."""
    packages: list[Requirement] = []
    for line in metadata.requires(DISTRIBUTION) or []:
        specifier, _, marker = line.partition(";")
        extra = re.search(r"\bextra\s*==\s*['\"]([\w-]+)['\"]", marker)
        package = re.split(r"[^\w.-]", specifier.strip(), maxsplit=1)[0]
        if package != DISTRIBUTION:  # Groups such as `all` require extras of the package.
            name = extra[1] if extra else ""
            packages.append(Requirement(package, specifier.strip(), name))
    return tuple(packages)


@cache
def extra_requirements() -> dict[str, tuple[str, ...]]:
    """The requirements of each extra, such as `duckdb>=1.1` of `sql`."""
    by_extra: dict[str, tuple[str, ...]] = {}
    for requirement in requirements():
        if extra := requirement.extra:
            by_extra[extra] = (*by_extra.get(extra, ()), requirement.specifier)
    return by_extra


@cache
def extra_groups() -> dict[str, tuple[str, ...]]:
    """The extras in each group, such as `all` or `common`, in alphabetical order."""
    groups: dict[str, tuple[str, ...]] = {}
    for line in metadata.requires(DISTRIBUTION) or []:
        match = re.match(rf"{DISTRIBUTION}\[([\w,\s-]+)\].*\bextra\s*==\s*['\"]([\w-]+)['\"]", line)
        if match is not None:
            groups[match[2]] = tuple(sorted(name.strip() for name in match[1].split(",")))
    return groups


def install_command(extra: str) -> str:
    """The command that installs an extra, or a group of extras, for the running interpreter.

    It names the packages of the extra, not `overtaking[extra]`: an index does not know a clone.
    """
    names = extra_groups().get(extra, (extra,))
    return pip_command(*(specifier for name in names for specifier in extra_requirements()[name]))


def pip_command(*specifiers: str) -> str:
    """The command that installs packages for the running interpreter."""
    here, running = Path.cwd(), Path(sys.executable)
    is_below = here in running.parent.parents  # A shell looks for a bare name elsewhere.
    interpreter = running.relative_to(here) if is_below else running
    return shlex.join([str(interpreter), "-m", "pip", "install", *specifiers])
