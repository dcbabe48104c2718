"""The tables of the literature from their files, checked, as frozen records."""

from __future__ import annotations

import dataclasses
import types
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from overtaking.analysis.literature.records import (
    FACTOR_KINDS,
    MARKS,
    MEMBERS,
    SAE_LEVELS,
    Correction,
    DrivingDataset,
    Factor,
    Study,
    StudyFactor,
    System,
    Value,
)
from overtaking.core.errors import KnowledgeError
from overtaking.knowledge.quantity import SOURCE_KINDS, Source
from overtaking.knowledge.reader import load

if TYPE_CHECKING:
    from collections.abc import Mapping

Record = TypeVar("Record")

UNKNOWN = "unknown"
"""The value of a correction that says that there is no right one: TOML has no null."""

_ALLOWED: dict[type, dict[str, Any]] = {
    Source: {"kind": SOURCE_KINDS},
    System: {"sae_level": SAE_LEVELS, "comfort": MARKS, "safety": MARKS},
    DrivingDataset: MEMBERS,
    Factor: {"kind": FACTOR_KINDS},
    StudyFactor: {"category": ("A", "B", "C")},
}
"""What a field may hold, or each of its members."""

_CITING = ("source", "reference")


@cache
def references() -> Mapping[str, Source]:
    """Every reference by its id."""
    return _table(Source, "sources")


@cache
def systems(*, is_corrected: bool = True) -> Mapping[str, System]:
    """The driving systems by id, in the paper's order.

    Args:
        is_corrected: Whether corrections are applied; if not, values are as printed.
    """
    return _table(System, "systems", is_corrected=is_corrected)


@cache
def datasets(*, is_corrected: bool = True) -> Mapping[str, DrivingDataset]:
    """The data sets of driving by id, in the paper's order; argument as in `systems`."""
    return _table(DrivingDataset, "datasets", is_corrected=is_corrected)


@cache
def factors() -> Mapping[str, Factor]:
    """The factors of driveability by id, the explicit ones first."""
    return _table(Factor, "factors")


@cache
def studies() -> Mapping[str, Study]:
    """The studies of overtaking by id, in the paper's order."""
    return _table(Study, "studies")


def _table(cls: type[Record], name: str, *, is_corrected: bool = True) -> Mapping[str, Record]:
    """All records of a file."""
    file = f"literature/{name}.toml"
    rows = {
        key: _record(cls, {"id": key, **row}, f"{file} [{key}]", is_corrected=is_corrected)
        for key, row in load(file).items()
    }
    return MappingProxyType(rows)


def _record(
    cls: type[Record], row: dict[str, Any], where: str, *, is_corrected: bool = True
) -> Record:
    """One record from its table in a file."""
    fields = {field.name: field for field in dataclasses.fields(cast("Any", cls))}
    unknown = sorted(set(row) - set(fields))
    missing = [
        name
        for name, field in fields.items()
        if field.default is dataclasses.MISSING and name not in row
    ]
    if unknown or missing:
        got = f"{'an unknown' if unknown else 'no'} {(unknown or missing)[0]}"
        raise _wrong(where, f"the keys {', '.join(fields)}", got)
    given = dict(row)
    corrections = given.pop("corrections", None)
    values = {name: _value(cls, name, item, where) for name, item in given.items()}
    if corrections is not None:
        found = _corrections(cls, corrections, values, where)
        if is_corrected:
            values |= {one.column: one.value for one in found} | {"corrections": found}
    return cls(**values)


def _corrections(
    cls: type, rows: dict[str, dict[str, Any]], printed: dict[str, Value], where: str
) -> tuple[Correction, ...]:
    """The corrections of a record, each beside what the paper prints."""
    found: list[Correction] = []
    for column, row in rows.items():
        place = f"{where} corrections.{column}"
        if set(row) != {"value", "source", "why"}:
            raise _wrong(place, "value, source and why", ", ".join(sorted(row)))
        is_unknown = row["value"] == UNKNOWN
        value = None if is_unknown else _value(cls, column, row["value"], place)
        source = _value(Correction, "source", row["source"], place)
        if value == printed.get(column):
            raise _wrong(place, "another value than the printed one", value)
        found.append(
            Correction(
                column=column,
                printed=printed.get(column),
                value=value,
                source=source,
                why=row["why"],
            )
        )
    return tuple(found)


def _value(cls: type, name: str, item: Any, where: str) -> Any:
    """One field, as the type that it declares and out of what it may hold."""
    place = f"{where} {name}"
    hint = _hints(cls).get(name)
    if hint == tuple[StudyFactor, ...]:
        return tuple(_record(StudyFactor, one, place) for one in item)
    if hint == tuple[str, ...]:
        if not (isinstance(item, list) and all(isinstance(one, str) for one in item)):
            raise _wrong(place, "a list of names", item)
        members: tuple[Any, ...] = tuple(item)
        value: Any = members
    else:
        members, value = (item,), item
        if type(item) not in _plain(hint):
            raise _wrong(place, " or ".join(kind.__name__ for kind in _plain(hint)), item)
    allowed = _ALLOWED.get(cls, {}).get(name)
    if name in _CITING:
        allowed = tuple(load("literature/sources.toml"))
    for one in members:
        if allowed is not None and one not in allowed:
            raise _wrong(place, f"one of {', '.join(map(str, allowed))}", one)
    return value


@cache
def _hints(cls: type) -> dict[str, Any]:
    return get_type_hints(cls)


def _plain(hint: Any) -> tuple[type, ...]:
    """The types that a declared type stands for, without None."""
    kinds = get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)
    return tuple(kind for kind in kinds if kind not in (type(None), None))


def _wrong(where: str, expected: str, got: object) -> KnowledgeError:
    return KnowledgeError.of(
        what="entry", where=where, expected=expected, got=got, next_step="correct the file"
    )
