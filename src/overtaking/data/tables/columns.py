"""Columns of tables: those that the fields of a batch declare, and those that encoders compute.

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
from overtaking.model.batch import Batch, BatchField, FieldSpec, batch_fields

TEXT = pa.string()

Names = tuple[str, ...]
"""The names that an enumeration column can hold, in the order of their codes in memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of a table, and where its values are.

    Attributes:
        name: Name with the suffix of its unit.
        dtype: Type of the values; Arrow's for texts and fixed bytes. Of an enumeration it is the
            type of the codes.
        spec: Declaration of the field. Its `null_unless` begins at the batch of the table, and its
            `needs` include what the whole table or part of a table needs.
        path: Attribute of the batch, dotted; an encoder computes a column that has no attribute.
        index: Index on the last axis; None if the table has a row for every element.
        null_value: Value of the attribute `spec.null_unless` where the column is null.
        is_nullable: Whether it may hold nulls.
    """

    name: str
    dtype: np.dtype[Any] | pa.DataType
    spec: FieldSpec
    path: str
    index: int | None = None
    null_value: int = 0
    is_nullable: bool = False

    @property
    def arrow_field(self) -> pa.Field:
        """The column in an Arrow schema, with unit, meaning and names as metadata."""
        spec, dtype = self.spec, self.dtype
        metadata = {"unit": spec.unit, "description": spec.meaning}
        kind = dtype if isinstance(dtype, pa.DataType) else pa.from_numpy_dtype(dtype)
        if spec.names:
            # Parquet gives dictionaries back with this type of index.
            kind = pa.dictionary(pa.int32(), pa.string())
            metadata["names"] = json.dumps(list(spec.names))
        if spec.flags:
            metadata["flags"] = json.dumps(list(spec.flags))
        return pa.field(self.name, kind, nullable=self.is_nullable, metadata=metadata)

    def is_silent(self, unknown: Collection[str]) -> bool:
        """Whether it is null throughout where some properties are unknown."""
        return any(name in unknown for name in self.spec.needs)


def computed_column(
    name: str,
    dtype: type[np.generic] | pa.DataType,
    spec: FieldSpec,
    *,
    path: str = "",
    is_nullable: bool = False,
) -> Column:
    """A column that no field of a batch declares: an encoder computes it.

    Args:
        name: Its name, to which the suffix of the unit is added.
        dtype: As in `Column`.
        spec: Its declaration.
        path: As in `Column`; the name if left out.
        is_nullable: As in `Column`.
    """
    return Column(
        name=name + NAME_SUFFIXES[spec.unit],
        dtype=dtype if isinstance(dtype, pa.DataType) else np.dtype(dtype),
        spec=spec,
        path=path or name,
        is_nullable=is_nullable,
    )


def columns_of(
    cls: type[Batch],
    path: str = "",
    *,
    only: Collection[str] = (),
    without: Collection[str] = (),
    prefix: str = "",
    about: str = "",
    index: int | None = None,
    needs: Sequence[str] = (),
    nullable: bool | Collection[str] = (),
    dtypes: Mapping[str, type[np.generic]] = MappingProxyType({}),
    units: Mapping[str, str] = MappingProxyType({}),
) -> list[Column]:
    """Columns of the fields that a batch declares, in their order.

    Args:
        cls: The class of the batch; see `model.batch.FieldSpec`.
        path: Where the batch of the table holds it, dotted; empty if it is the same.
        only: Names of the fields that are wanted; all of them if empty.
        without: Names of fields that are left out.
        prefix: What the names of the columns begin with.
        about: What is added to each meaning, such as "the vehicle ahead".
        index: Index on the last axis of each array.
        needs: What all of these columns need, besides the `needs` of their fields.
        nullable: Whether all of these columns may hold nulls. Names of fields allow nulls in their
            columns, and in columns that need something. A column without a value everywhere always
            may.
        dtypes: Types of columns that are not those of their fields.
        units: The same for units.
    """
    columns: list[Column] = []
    for name, field in batch_fields(cls).items():
        if field.column is None or name in without or (only and name not in only):
            continue
        spec, where = field.spec, f"{path}.{name}".lstrip(".")
        if field.dtype is None:  # A batch in the batch.
            columns += columns_of(
                field.type, where, prefix=f"{prefix}{field.column}_", about=spec.meaning
            )
            continue
        null_unless, null_value = _null_rule(cls, path, field)
        is_nullable = bool(null_unless)
        if isinstance(nullable, bool):
            is_nullable |= nullable
        else:
            is_nullable |= name in nullable or bool(spec.needs)
        spec = dataclasses.replace(
            spec,
            meaning=f"{spec.meaning}; {about}" if about else spec.meaning,
            unit=units.get(name, spec.unit),
            null_unless=null_unless,
            needs=(*needs, *spec.needs),
        )
        columns.append(
            Column(
                name=prefix + field.column + NAME_SUFFIXES[spec.unit],
                dtype=np.dtype(dtypes.get(name, field.dtype)),
                spec=spec,
                path=where,
                index=index,
                null_value=null_value,
                is_nullable=is_nullable,
            )
        )
    return columns


def _null_rule(cls: type[Batch], path: str, field: BatchField) -> tuple[str, int]:
    """The attribute that tells where a column is null, and its value there.

    Args:
        cls: Class of the batch that declares the field.
        path: Where the batch of the table holds that batch.
        field: The field.
    """
    relative = field.spec.null_unless
    if not relative and field.spec.missing is not None:
        relative = f".{field.name}"
    if not relative.startswith("."):
        return relative, 0
    flag = batch_fields(cls).get(relative[1:])
    null_value = 0 if flag is None or flag.spec.missing is None else flag.spec.missing
    return f"{path}{relative}".lstrip("."), null_value


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
