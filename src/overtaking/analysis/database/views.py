"""The source paper's entities as views of our tables, which `views.sql` declares.

They have a schema of their own, `paper`, because SQL does not distinguish `Frames` from `frames`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

SCHEMA = "paper"
"""Name of the schema of these views."""


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """One of the paper's entities.

    Attributes:
        name: Its name in the paper.
        tables: The tables that it reads.
        statement: What creates it.
    """

    name: str
    tables: tuple[str, ...]
    statement: str


VIEWS = tuple(
    View(
        name=found[1],
        tables=tuple(re.findall(r"main\.(\w+)", found[0])),
        statement=found[0],
    )
    for found in re.finditer(
        rf"^CREATE VIEW {SCHEMA}\.(\w+) AS\n[^;]*",
        Path(__file__).with_suffix(".sql").read_text(encoding="utf-8"),
        re.MULTILINE,
    )
)
"""The entities of the paper's diagram; those whose tables were not kept are left out."""
