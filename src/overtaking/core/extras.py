"""The packages that `overtaking` requires, always or for an extra, and commands to install them."""

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
    for line in metadata.requires(PACKAGE) or []:
        specifier, _, marker = line.partition(";")
        extra = re.search(r"\bextra\s*==\s*['\"]([\w-]+)['\"]", marker)
        package = re.split(r"[^\w.-]", specifier.strip(), maxsplit=1)[0]
        if package != PACKAGE:  # Groups such as `all` require extras of the package.
            name = extra[1] if extra else ""
            packages.append(Requirement(package, specifier.strip(), name))
    return tuple(packages)


@cache
def extras() -> dict[str, tuple[str, ...]]:
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
    for line in metadata.requires(PACKAGE) or []:
        match = re.match(rf"{PACKAGE}\[([\w,\s-]+)\].*\bextra\s*==\s*['\"]([\w-]+)['\"]", line)
        if match is not None:
            groups[match[2]] = tuple(sorted(name.strip() for name in match[1].split(",")))
    return groups


def install_command(extra: str) -> str:
    """The command that installs an extra, or a group of extras, for the running interpreter.

    It names the packages of the extra, not `overtaking[extra]`: an index does not know a clone.
    """
    names = extra_groups().get(extra, (extra,))
    return pip_command(*(specifier for name in names for specifier in extras()[name]))


def pip_command(*specifiers: str) -> str:
    """The command that installs packages for the running interpreter."""
    here, running = Path.cwd(), Path(sys.executable)
    is_below = here in running.parent.parents  # A shell looks for a bare name elsewhere.
    interpreter = running.relative_to(here) if is_below else running
    return shlex.join([str(interpreter), "-m", "pip", "install", *specifiers])
