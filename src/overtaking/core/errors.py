"""Error classes with one message format, checks of arguments, and the packages of extras.

All errors that this package raises on purpose derive from `OvertakingError`. Their messages have
one line: `where: what: expected ..., got ...; next_step`. The `check_...` functions raise such an
error if an argument is invalid.

An extra is a named set of optional packages, such as `sql` for DuckDB. `pyproject.toml` declares
the extras, and groups of several extras, such as `all`; this module reads both from the metadata of
the installed package.
"""

from __future__ import annotations

import operator
import re
import shlex
import sys
from dataclasses import dataclass
from difflib import SequenceMatcher
from functools import cache
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from overtaking.core.representation import as_utf8

if TYPE_CHECKING:
    from collections.abc import Iterable
    from typing import Self


MAX_MESSAGE_PART = 160
"""Largest number of characters of one part of a message. Chosen: two lines of a terminal."""


def printable(part: object, length: int = MAX_MESSAGE_PART) -> str:
    """Write a part of a message on one line that UTF-8 can hold.

    The character � replaces each unprintable character, because terminals obey control characters.

    Args:
        part: A text; the message shows any other value by its `repr`.
        length: Largest number of characters; "..." replaces the end of a longer text.
    """
    text = as_utf8(part) if isinstance(part, str) else repr(part)
    # Cut before the loop over characters, because a part may be an array or a whole file. The
    # character beyond `length` shows that the text was longer.
    text = " ".join(text.split())[: length + 1]
    text = "".join(character if character.isprintable() else "�" for character in text)
    return text if len(text) <= length else text[: length - 3] + "..."


def _format_message(
    *, what: object, where: object, expected: object, got: object, next_step: object = "correct it"
) -> str:
    head = f"{printable(where)}: {printable(what)}"
    body = f"expected {printable(expected)}, got {printable(got)}"
    return f"{head}: {body}; {printable(next_step)}"


class OvertakingError(Exception):
    """Base class of all errors that this package raises on purpose.

    The constructor takes either a message or its five parts.

    Args:
        message: A complete message. `pickle` passes it when it restores an error of another
            process.
        what: The invalid thing, such as a column, a key or an option.
        where: The file, section or call that contains it.
        expected: Description of a valid value.
        got: The invalid value, or a description of it.
        next_step: Advice for the user, as an imperative.
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
    def unknown_choice(cls, *, what: str, where: str, choices: Iterable[str], got: object) -> Self:
        """The error for a name that is not one of the valid names.

        Args:
            what: The kind of name, such as `colour`.
            where: The call or option that received the name.
            choices: The valid names.
            got: The invalid name.
        """
        step = "choose one of them"
        return cls(what=what, where=where, expected=" or ".join(choices), got=got, next_step=step)

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
        """The error for a number outside its range.

        Args:
            what: Name of the number.
            where: The call or option that received it.
            low: Smallest valid number.
            high: Largest valid number; None for a range without an upper limit.
            got: The invalid number.
            next_step: Advice for the user; if empty, to choose a number in that range.
        """
        expected = f"{low} or more" if high is None else f"{low} to {high}"
        step = next_step or "choose a number in that range"
        return cls(what=what, where=where, expected=expected, got=got, next_step=step)


class ConfigError(OvertakingError, ValueError):
    """An invalid option, argument or specification (a description of the traffic to simulate)."""


class NoSuchSimulationError(ConfigError, IndexError):
    """A simulation number outside the data set.

    A loop `for simulation in dataset` reads the simulations 0, 1, 2, ... and stops at an
    `IndexError`, so this class derives from it.
    """


class SchemaError(OvertakingError, ValueError):
    """A table or an array with invalid columns, types or units, or of an unknown version."""

    @classmethod
    def newer_version(cls, *, what: str, where: str, newest: int, got: int) -> Self:
        """The error for a file that a later version of this package has written.

        Args:
            what: The format with a version, such as `version of the manifest`.
            where: The file.
            newest: Newest version that this package reads.
            got: Version of the file.
        """
        step = "use the version of overtaking that wrote it, or a newer one"
        return cls(what=what, where=where, expected=f"at most {newest}", got=got, next_step=step)


class DriverError(OvertakingError, RuntimeError):
    """A user's function that drives the ego vehicle raises an exception or returns no action."""


class ImportFormatError(OvertakingError, ValueError):
    """A file of another program, such as a map or a recording, that violates its format."""


class RecordingWarning(UserWarning):
    """A recording of real traffic has implausible or missing values, but is imported.

    The property `import_report` of the imported data lists these values, and their treatment.
    """


class DatasetError(OvertakingError, RuntimeError):
    """A data set folder that is incomplete, damaged or in another state than required."""


class LockedError(DatasetError):
    """A data set folder into which another process writes."""


class SystemLimitError(OvertakingError, RuntimeError):
    """The operating system does not grant more memory, threads, processes or open files."""


class MissingExtraError(OvertakingError, ImportError):
    """An optional package is missing or too old."""

    @classmethod
    def for_extra(
        cls, extra: str, *, what: str, where: str, got: str = "none", otherwise: str = ""
    ) -> Self:
        """The error for an extra that is not installed; its next step is the command to run.

        Args:
            extra: Name of the extra, such as `sql`.
            what: The package, and its purpose.
            where: The function or command that needs the package.
            got: Installed version, or the reason why the import failed.
            otherwise: An alternative without the extra, as an imperative; may be empty.
        """
        head = f"{where}: {what}: expected the extra [{extra}], got {printable(got)}"
        alternative = f"; or {otherwise}" if otherwise else ""
        # Not the parts of a message: a part is cut at `MAX_MESSAGE_PART` characters, and a command
        # that is cut does not run.
        return cls(f"{head}; run: {install_command(extra)}{alternative}")


class KnowledgeError(OvertakingError, ValueError):
    """A constant of the model is missing or unknown, or has no unit or no source.

    The constants are in the TOML files of `overtaking/knowledge/data`.
    """


class InfeasibleError(OvertakingError, ValueError):
    """A valid request that cannot be met.

    For example, the vehicles do not fit on the road, or one of them cannot reach its speed.
    """


def check_extra(extra: str, *modules: str, what: str, where: str, otherwise: str = "") -> None:
    """Refuse a call whose extra is not installed; the function does not check versions.

    Args:
        extra: Name of the extra, such as `sql`.
        modules: Modules of the extra that the call imports, such as "PIL" of the package Pillow.
        what: The package, and its purpose.
        where: The function or command that needs the package.
        otherwise: An alternative without the extra, as an imperative; may be empty.

    Raises:
        MissingExtraError: One of the modules is missing.
    """
    from importlib.util import find_spec

    if any(find_spec(module) is None for module in modules):
        raise MissingExtraError.for_extra(extra, what=what, where=where, otherwise=otherwise)


def check_choice(choice: str, choices: Iterable[str], *, what: str, where: str) -> None:
    """Refuse a name that is not one of the valid names.

    Args:
        choice: The name.
        choices: The valid names.
        what: The option or argument.
        where: The command or function.

    Raises:
        ConfigError: The name is not valid.
    """
    names = list(choices)
    if choice not in names:
        raise ConfigError.unknown_choice(what=what, where=where, choices=names, got=choice)


def nearest_first(name: str, names: Iterable[str]) -> list[str]:
    """Sort valid names by their similarity to a name that a user wrote, the most similar first.

    Upper and lower case count as equal.
    """

    def similarity(candidate: str) -> float:
        return SequenceMatcher(a=name.lower(), b=candidate.lower()).ratio()

    return sorted(names, key=similarity, reverse=True)


def check_in_range(
    value: float, low: float, high: float = inf, *, what: str, where: str, unit: str = ""
) -> None:
    """Refuse a number outside its range; see `check_whole_number` for an argument that is a count.

    Args:
        value: The number.
        low: Smallest valid number.
        high: Largest valid number; infinite for a range without an upper limit.
        what: The option or argument.
        where: The command or function.
        unit: Unit of the number, for the message; empty for a number without a unit.

    Raises:
        ConfigError: The number is smaller or larger, or NaN.
    """
    if not low <= value <= high:
        # Not `out_of_range`, whose message has no unit. A lower limit alone is small in all calls:
        # `:g` writes 0.0 as "0". A range can end at a large number: `:,` writes "1,000,000" where
        # `:g` would write "1e+06".
        at_least = f"{low:g} {unit}".strip() + " or more"
        raise ConfigError(
            what=what,
            where=where,
            expected=at_least if high == inf else f"{low:,} to {high:,} {unit}".strip(),
            got=value,
            next_step="choose a number in that range",
        )


def whole_number(value: Any) -> int | None:
    """Convert an integer of any library to Python's type.

    Integers of NumPy overflow in arithmetic, and JSON cannot write them.

    Args:
        value: An integer of Python, NumPy or another library. Booleans do not count as integers.

    Returns:
        The integer; None for any other value, also for a float such as 7.0.
    """
    # The dtype of a boolean is "bool" in NumPy and "torch.bool" in PyTorch.
    is_boolean = isinstance(value, bool) or str(getattr(value, "dtype", "")).endswith("bool")
    try:
        return None if is_boolean else operator.index(value)
    except TypeError:
        return None


def check_whole_number(value: Any, low: int, high: int, *, what: str, where: str) -> int:
    """Refuse a value that is not an integer, or is outside its range.

    Args:
        value: The value.
        low: Smallest valid integer.
        high: Largest valid integer.
        what: The option or argument.
        where: The command or function.

    Returns:
        The integer, of Python's type.

    Raises:
        ConfigError: The value is not an integer from low to high.
    """
    number = whole_number(value)
    if number is None or not low <= number <= high:
        raise ConfigError.out_of_range(what=what, where=where, low=low, high=high, got=value)
    return number


def convert_integers(record: Any, *names: str) -> None:
    """Convert integers of other libraries in fields of a frozen dataclass to Python's type.

    Args:
        record: The object, which calls this function in its `__post_init__`.
        names: Names of the fields. A field with another value, such as None, keeps it.
    """
    for name in names:
        if (number := whole_number(getattr(record, name))) is not None:
            object.__setattr__(record, name, number)  # `setattr` fails on a frozen dataclass.


DISTRIBUTION = "overtaking"
"""Name of this package in the metadata of installed packages."""


@dataclass(frozen=True, slots=True)
class Requirement:
    """A package that `overtaking` or one of its extras requires.

    Attributes:
        package: Name of the package, such as `duckdb`.
        specifier: Name and supported versions, such as `duckdb>=1.1`.
        extra: Name of the extra that requires it; empty if `overtaking` itself does.
    """

    package: str
    specifier: str
    extra: str

    def is_newer_than(self, version: str) -> bool:
        """Whether the lowest supported version is newer than an installed version.

        Args:
            version: The installed version, such as "1.0.3".
        """
        # The version after >= or ==. Without one, every version is new enough.
        lowest = re.search(r"[>=]=\s*([\w.]+)", self.specifier)
        return lowest is not None and _release_numbers(version) < _release_numbers(lowest[1])


def _release_numbers(version: str) -> tuple[int, ...]:
    """The numbers of a version for comparison: (3, 10) for "3.10", "3.10.0" and "3.10.0rc1"."""
    numbers = re.match(r"[\d.]*", version)
    parts = [int(part) for part in (numbers[0] if numbers else "").split(".") if part]
    while parts and parts[-1] == 0:
        parts.pop()
    return tuple(parts)


@cache
def requirements() -> tuple[Requirement, ...]:
    """The requirements in the metadata of the installed package, in their order there."""
    from importlib import metadata

    packages: list[Requirement] = []
    # A line is `numpy>=2.0`, or `duckdb>=1.1; extra == "sql"` for a package of an extra.
    for line in metadata.requires(DISTRIBUTION) or []:
        specifier, _, marker = line.partition(";")
        extra = re.search(r"\bextra\s*==\s*['\"]([\w-]+)['\"]", marker)
        package = re.split(r"[^\w.-]", specifier.strip(), maxsplit=1)[0]
        if package == DISTRIBUTION:  # A group of extras, which lists extras of this package.
            continue
        packages.append(Requirement(package, specifier.strip(), extra[1] if extra else ""))
    return tuple(packages)


@cache
def extra_requirements() -> dict[str, tuple[str, ...]]:
    """The specifiers of each extra, such as `duckdb>=1.1`, by the name of the extra."""
    by_extra: dict[str, tuple[str, ...]] = {}
    for requirement in requirements():
        if extra := requirement.extra:
            by_extra[extra] = (*by_extra.get(extra, ()), requirement.specifier)
    return by_extra


@cache
def extra_groups() -> dict[str, tuple[str, ...]]:
    """The names of the extras in each group, in alphabetical order, by the name of the group."""
    from importlib import metadata

    groups: dict[str, tuple[str, ...]] = {}
    # The line of a group is `overtaking[plots,sql]; extra == "common"`.
    for line in metadata.requires(DISTRIBUTION) or []:
        match = re.match(rf"{DISTRIBUTION}\[([\w,\s-]+)\].*\bextra\s*==\s*['\"]([\w-]+)['\"]", line)
        if match is not None:
            groups[match[2]] = tuple(sorted(name.strip() for name in match[1].split(",")))
    return groups


def install_command(extra: str) -> str:
    """The shell command that installs an extra, or a group of extras.

    It names the packages of the extra. With `overtaking[extra]`, pip would look for `overtaking` in
    a package index, but a user may have installed it from a clone of the repository.

    Args:
        extra: Name of an extra or a group.

    Raises:
        KeyError: The name is neither an extra nor a group.
    """
    names = extra_groups().get(extra, (extra,))
    return pip_command(*(specifier for name in names for specifier in extra_requirements()[name]))


def pip_command(*specifiers: str) -> str:
    """The shell command that installs packages for the Python interpreter that runs this code.

    Args:
        specifiers: Names of the packages with their versions, such as `duckdb>=1.1`.
    """
    working_folder, interpreter = Path.cwd(), Path(sys.executable)
    # Shorten the path if the interpreter is in a subfolder. In the working folder itself, only its
    # bare name would be left, which a shell searches in PATH.
    if working_folder in interpreter.parent.parents:
        interpreter = interpreter.relative_to(working_folder)
    return shlex.join([str(interpreter), "-m", "pip", "install", *specifiers])
