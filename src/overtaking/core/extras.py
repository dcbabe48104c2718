"""The packages that this one needs, always or for an extra, and how they are installed."""

from __future__ import annotations

import re
import shlex
import sys
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path

PACKAGE = "overtaking"


@dataclass(frozen=True, slots=True)
class Requirement:
    """A package that this one needs.

    Attributes:
        package: Its name.
        specifier: Its name and the versions that fit, such as `duckdb>=1.1`.
        extra: The extra that needs it; empty if nothing works without it.
    """

    package: str
    specifier: str
    extra: str

    def is_newer_than(self, version: str) -> bool:
        """Whether a version is below the lowest one that fits."""
        bound = re.search(r"[>=]=\s*([\w.]+)", self.specifier)
        return bound is not None and _release(version) < _release(bound[1])


def _release(version: str) -> tuple[int, ...]:
    """The numbers of a release to compare, without zeros at the end: 3.10 is 3.10.0."""
    numbers = re.match(r"[\d.]*", version)
    parts = [int(part) for part in (numbers[0] if numbers else "").split(".") if part]
    while parts and parts[-1] == 0:
        parts.pop()
    return tuple(parts)


@cache
def requirements() -> tuple[Requirement, ...]:
    """What the installed package states that it needs."""
    stated: list[Requirement] = []
    for line in metadata.requires(PACKAGE) or []:
        specifier, _, marker = line.partition(";")
        extra = re.search(r"\bextra\s*==\s*['\"]([\w-]+)['\"]", marker)
        package = re.split(r"[^\w.-]", specifier.strip(), maxsplit=1)[0]
        if package != PACKAGE:  # Groups such as `all` are made of the others.
            stated.append(Requirement(package, specifier.strip(), extra[1] if extra else ""))
    return tuple(stated)


@cache
def extras() -> dict[str, tuple[str, ...]]:
    """The requirements of each extra, such as `duckdb>=1.1` of `sql`."""
    by_extra: dict[str, tuple[str, ...]] = {}
    for one in requirements():
        if one.extra:
            by_extra[one.extra] = (*by_extra.get(one.extra, ()), one.specifier)
    return by_extra


@cache
def extra_groups() -> dict[str, tuple[str, ...]]:
    """The extras that each group such as `all` or `common` is made of."""
    groups: dict[str, tuple[str, ...]] = {}
    for line in metadata.requires(PACKAGE) or []:
        match = re.match(rf"{PACKAGE}\[([\w,\s-]+)\].*\bextra\s*==\s*['\"]([\w-]+)['\"]", line)
        if match is not None:
            groups[match[2]] = tuple(sorted(name.strip() for name in match[1].split(",")))
    return groups


def install_command(extra: str) -> str:
    """The command that installs an extra, or a group of extras, for the interpreter that runs.

    It names the packages of the extra and not this one, which may be a clone.
    """
    names = extra_groups().get(extra, (extra,))
    return pip_command(*(specifier for name in names for specifier in extras()[name]))


def pip_command(*specifiers: str) -> str:
    """The command that installs packages for the interpreter that runs."""
    here, running = Path.cwd(), Path(sys.executable)
    is_below = here in running.parent.parents  # A shell looks for a bare name elsewhere.
    interpreter = running.relative_to(here) if is_below else running
    return shlex.join([str(interpreter), "-m", "pip", "install", *specifiers])
