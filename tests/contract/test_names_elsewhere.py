"""The page of names in other tools names columns, traits and neighbours that exist."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

from overtaking.data.tables.schemas import COLUMNS
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.trajectories import States
from overtaking.model.vehicles import DriverTraits

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "names-elsewhere.md"


def test_every_name_of_ours_exists():
    rows = re.findall(r"^\| (`[^|]+`) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    names = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    columns = {column.name for table in COLUMNS.values() for column in table}
    fields = {field.name for cls in (DriverTraits, States) for field in dataclasses.fields(cls)}
    assert len(names) > 20
    assert names - columns - fields - set(NeighbourRole.__members__) == set()
