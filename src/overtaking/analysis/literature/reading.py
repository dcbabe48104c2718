"""Reads the tables of the literature from their files."""

from __future__ import annotations

import json
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from overtaking.analysis.literature import records
from overtaking.core.errors import KnowledgeError
from overtaking.knowledge.toml_reader import load_toml

if TYPE_CHECKING:
    from collections.abc import Mapping

Record = TypeVar("Record")

UNKNOWN = "unknown"
"""Value of a correction without a right value: TOML has no null."""


@cache
def references() -> Mapping[str, records.Reference]:
    """The references by id."""
    return _table(records.Reference, "sources")


@cache
def systems(*, is_corrected: bool = True) -> Mapping[str, records.System]:
    """The driving systems by id, in the paper's order.

    Args:
        is_corrected: Whether to apply corrections; if not, values are as printed.
    """
    return _table(records.System, "systems", is_corrected=is_corrected)


@cache
def datasets(*, is_corrected: bool = True) -> Mapping[str, records.DrivingDataset]:
    """The driving data sets by id, in the paper's order; argument as in `systems`."""
    return _table(records.DrivingDataset, "datasets", is_corrected=is_corrected)


@cache
def factors() -> Mapping[str, records.Factor]:
    """The factors of driveability by id, explicit ones first."""
    return _table(records.Factor, "factors")


@cache
def studies() -> Mapping[str, records.Study]:
    """The studies of overtaking by id, in the paper's order."""
    return _table(records.Study, "studies")


def _table(cls: type[Record], name: str, *, is_corrected: bool = True) -> Mapping[str, Record]:
    """All records of a file.

    Raises:
        KnowledgeError: An entry of the file is wrong.
    """
    file = f"literature/{name}.toml"
    printed: dict[str, Any] = {}
    corrected: dict[str, Any] = {}
    for key, row in load_toml(file).items():
        printed[key] = {"id": key} | {name: row[name] for name in row if name != "corrections"}
        corrected[key] = _corrected(printed[key], row.get("corrections", {}))
    found = _checked(cls, file, printed)  # Also if it is corrected: both must be valid.
    return MappingProxyType(_checked(cls, file, corrected) if is_corrected else found)


def _corrected(row: dict[str, Any], corrections: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """A row with its corrections applied and kept."""
    if not corrections:
        return row
    kept: list[dict[str, Any]] = [
        {"column": column, "printed": row.get(column), **one}
        | ({"value": None} if one.get("value") == UNKNOWN else {})
        for column, one in corrections.items()
    ]
    return row | {one["column"]: one.get("value") for one in kept} | {"corrections": kept}


def _checked(cls: type[Record], file: str, rows: dict[str, Any]) -> dict[str, Record]:
    """Rows as records. JSON, because pydantic is strict there and yet takes lists as tuples."""
    try:
        return TypeAdapter(dict[str, cls]).validate_json(json.dumps(rows))  # pyright: ignore[reportInvalidTypeForm]
    except ValidationError as error:
        first = error.errors()[0]
        raise KnowledgeError(
            what="entry",
            where=f"{file} {'.'.join(map(str, first['loc']))}",
            expected=first["msg"].removeprefix("Value error, ").removeprefix("Input should be "),
            got=first["input"],
            next_step="correct the file",
        ) from None
