"""Declarations of columns: name, type, unit, meaning, and the attribute that has the values.

A name ends in its unit. Integer columns count steps of a unit and carry the step in their name:
`x_mm`, `heading_100urad`. Read through this package they come back as SI numbers under the SI name:
`x_m`, `heading_rad`.
"""

import dataclasses
import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from overtaking.core.units import INTEGER_UNITS, NAME_SUFFIXES
from overtaking.data.tables.arrow import missing_in, to_numpy
from overtaking.model.batch import Batch, BatchField, batch_fields

FLOAT, DOUBLE, BOOL, TEXT = pa.float32(), pa.float64(), pa.bool_(), pa.string()
BYTE, SHORT, INT, LONG, ULONG = pa.uint8(), pa.int16(), pa.int32(), pa.int64(), pa.uint64()

Names = tuple[str, ...]
"""The names that an enumeration column can hold, in the order of their codes in memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of a table, and where the batch that the table is made from has its values.

    Attributes:
        field: Name and type; the metadata has unit and meaning.
        path: Attribute of the batch, dotted. What is no attribute is computed by the encoder.
        index: Index on the last axis of the attribute; None if the table has every axis of it.
        present: Attribute that tells where there is a value, dotted; empty if there always is one.
        nothing: Value of `present` where the column is null.
        needs: Names among `model.trajectories.UNKNOWNS`. The column is null throughout in
            recordings that do not tell one of them.
        is_key: Whether it is one of the columns that identify a row.
    """

    field: pa.Field
    path: str
    index: int | None = None
    present: str = ""
    nothing: int = 0
    needs: tuple[str, ...] = ()
    is_key: bool = False

    @property
    def name(self) -> str:
        """The name, with the ending of the unit."""
        return self.field.name

    def is_silent(self, unknown: Collection[str]) -> bool:
        """Whether it is null throughout where some things are unknown."""
        return any(name in unknown for name in self.needs)


def column(
    name: str,
    kind: pa.DataType | Names,
    meaning: str,
    unit: str = "1",
    *,
    path: str = "",
    nullable: bool = False,
    flags: Names = (),
    needs: Sequence[str] = (),
    present: str = "",
    nothing: int = 0,
    is_key: bool = False,
) -> Column:
    """Declare a column.

    Args:
        name: Its name, to which the ending of the unit is added.
        kind: An Arrow type; or the names of an enumeration, which the metadata then lists.
        meaning: One sentence without a full stop.
        unit: A key of `SUFFIXES`.
        path: As in `Column`; the name if left out.
        nullable: Whether the column may hold nulls.
        flags: Names of the bits of an integer column, from the lowest.
        needs: As in `Column`.
        present: As in `Column`.
        nothing: As in `Column`.
        is_key: As in `Column`.
    """
    metadata = {"unit": unit, "description": meaning}
    if isinstance(kind, tuple):
        # Parquet gives dictionaries back with this type of index.
        kind, metadata["names"] = pa.dictionary(pa.int32(), pa.string()), json.dumps(kind)
    if flags:
        metadata["flags"] = json.dumps(flags)
    return Column(
        field=pa.field(name + NAME_SUFFIXES[unit], kind, nullable=nullable, metadata=metadata),
        path=path or name,
        present=present,
        nothing=nothing,
        needs=tuple(needs),
        is_key=is_key,
    )


def attributes(
    path: str, *columns: Column, prefix: str = "", nullable: bool = False, **shared: Any
) -> list[Column]:
    """Columns that are attributes of one part of a batch.

    Args:
        path: The part, dotted.
        columns: The columns, with names and paths relative to that part.
        prefix: What all names begin with.
        nullable: Whether all of these columns may hold nulls.
        shared: Fields that these columns have in common, unless a column has a value of its own.
    """
    return [
        dataclasses.replace(
            one,
            field=one.field.with_name(prefix + one.name).with_nullable(
                nullable or one.field.nullable
            ),
            path=f"{path}.{one.path}".lstrip("."),
            **{name: getattr(one, name) or value for name, value in shared.items()},
        )
        for one in columns
    ]


def declared(
    path: str,
    cls: type[Batch],
    *,
    only: Collection[str] = (),
    without: Collection[str] = (),
    kinds: Mapping[str, pa.DataType] = MappingProxyType({}),
    units: Mapping[str, str] = MappingProxyType({}),
    needs: Sequence[str] = (),
    nullable: bool | Collection[str] = (),
) -> list[Column]:
    """Columns that the fields of a batch declare themselves, in the order of the fields.

    Args:
        path: Where the table's batch has this one, dotted; empty if it is the same.
        cls: Its class; see `model.batch.FieldSpec`.
        only: Names of the fields that are wanted; all of them if empty.
        without: Names of fields that are left out.
        kinds: Types of columns that are not those of their fields.
        units: The same for units.
        needs: What all of these columns need, as in `Column`.
        nullable: Whether columns may hold nulls. Names of fields allow nulls in their columns, in
            those that need something, and in those without a value everywhere.
    """
    found: list[Column] = []
    for name, field in batch_fields(cls).items():
        if field.column is None or name in without or (only and name not in only):
            continue
        spec, where = field.spec, f"{path}.{name}".lstrip(".")
        if field.dtype is None:
            found += _nested(where, field.type, field)
            continue
        present = spec.null_unless
        if present.startswith("."):
            present = f"{path}{present}".lstrip(".")
        if isinstance(nullable, bool):
            is_nullable = nullable or bool(present)
        else:
            is_nullable = name in nullable or bool(present or spec.needs)
        found.append(
            column(
                field.column,
                tuple(spec.names) or kinds.get(name) or pa.from_numpy_dtype(field.dtype),
                spec.meaning,
                units.get(name, spec.unit),
                path=where,
                nullable=is_nullable,
                present=present,
                needs=[*needs, *spec.needs],
            )
        )
    return found


def _nested(path: str, cls: type[Batch], outer: BatchField) -> list[Column]:
    """The columns of a batch in a batch, whose names and meanings extend those of its parts."""
    found: list[Column] = []
    for one in declared(path, cls):
        meaning = f"{one.field.metadata[b'description'].decode()}; {outer.spec.meaning}"
        metadata = one.field.metadata | {b"description": meaning.encode()}
        field = one.field.with_name(f"{outer.column}_{one.name}").with_metadata(metadata)
        found.append(dataclasses.replace(one, field=field))
    return found


def unit_of(field: pa.Field) -> str:
    """The unit of a column."""
    return field.metadata[b"unit"].decode()


def names_of(field: pa.Field) -> Names:
    """The names that an enumeration column can hold, in the order of their codes; else empty."""
    return _listed(field, b"names")


def flags_of(field: pa.Field) -> Names:
    """The names of the bits of a column, from the lowest; empty where it has none."""
    return _listed(field, b"flags")


def si_name(field: pa.Field) -> str:
    """The name under which a column comes back as an SI number."""
    unit = unit_of(field)
    if unit not in INTEGER_UNITS:
        return field.name
    return field.name.removesuffix(NAME_SUFFIXES[unit]) + NAME_SUFFIXES[INTEGER_UNITS[unit][0]]


def codes(values: pa.ChunkedArray | pa.Array, names: Names) -> NDArray[np.int64]:
    """The codes of an enumeration column, -1 where it is null.

    The dictionary of a column may hold its names in any order, as other writers list those that
    occur; codes are those of the schema.
    """
    chunks = values.chunks if isinstance(values, pa.ChunkedArray) else [values]
    known = {name: code for code, name in enumerate(names)}
    parts = [np.empty(0, dtype=np.int64)]
    for chunk in chunks:
        meaning = np.array([known[name] for name in chunk.dictionary.to_pylist()] or [-1])
        missing = missing_in(chunk.indices)
        indices = np.where(missing, 0, to_numpy(chunk.indices))
        parts.append(np.where(missing, -1, meaning[indices]))
    return np.concatenate(parts)


def _listed(field: pa.Field, key: bytes) -> Names:
    text = (field.metadata or {}).get(key)
    return _read_list(text) if text else ()


@cache
def _read_list(text: bytes) -> Names:
    """The names in a text of metadata; the same few are asked for with every column."""
    return tuple(json.loads(text))
