"""The optional packages: what each extra consists of, and how it is installed."""

from __future__ import annotations

import re
import shlex
import sys
from functools import cache
from importlib import metadata
from pathlib import Path

PACKAGE = "overtaking"
_ALL = "all"


@cache
def extras() -> dict[str, tuple[str, ...]]:
    """The requirements of each extra, such as `duckdb>=1.1` of `sql`."""
    found: dict[str, tuple[str, ...]] = {}
    for line in metadata.requires(PACKAGE) or []:
        requirement, _, marker = line.partition(";")
        extra = re.search(r"\bextra\s*==\s*['\"]([\w-]+)['\"]", marker)
        if extra and extra[1] != _ALL:
            found[extra[1]] = (*found.get(extra[1], ()), requirement.strip())
    return found


def install_command(extra: str) -> str:
    """The command that installs an extra for the interpreter that runs.

    It names the packages of the extra and not this one, which may be a clone.
    """
    here, running = Path.cwd(), Path(sys.executable)
    is_below = here in running.parent.parents  # A shell looks for a bare name elsewhere.
    interpreter = running.relative_to(here) if is_below else running
    return shlex.join([str(interpreter), "-m", "pip", "install", *extras()[extra]])
