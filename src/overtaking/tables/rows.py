"""Rows of a table as NumPy arrays: what encoders make, and what is written without another copy."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pyarrow as pa

from overtaking.tables.arrow import (
    Array,
    Mask,
    Masked,
    missing_in,
    to_arrow,
    to_names,
    to_numpy,
    to_same_text,
    to_texts,
)
from overtaking.tables.columns import names_of, short_codes
from overtaking.tables.schemas import SCHEMAS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence


class Texts(NamedTuple):
    """A column of texts: places in a list, and where they are null."""

    places: Array
    texts: tuple[str, ...]
    missing: Mask | None = None

    @classmethod
    def same(cls, text: str, count: int) -> Texts:
        """One text, `count` times."""
        return cls(np.zeros(count, np.int32), (text,))


Given = Array | Masked | Texts
"""A column as an encoder makes it; of an enumeration its codes, of bytes all of them in a row."""


class Column(NamedTuple):
    """A column as it is written.

    Attributes:
        values: Numbers; codes of int8 for names, places of int32 for texts, all bytes one after the
            other for bytes.
        missing: Where it is null, shape (row,); None if nowhere.
        texts: What places stand for.
    """

    values: Array
    missing: Mask | None = None
    texts: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Rows:
    """Some rows of a table.

    Attributes:
        schema: One of the `SCHEMAS`, or what `schema_of` makes of it.
        columns: In the order of the schema.
        num_rows: How many.
    """

    schema: pa.Schema
    columns: tuple[Column, ...]
    num_rows: int

    @classmethod
    def build(cls, table: str, given: Mapping[str, Given]) -> Rows:
        """The columns of a table in the order of its schema.

        Args:
            table: Name of one of the `SCHEMAS`.
            given: Its columns by name.
        """
        columns = tuple(_column(given[name], name, kind) for name, kind in _kinds(table))
        key = columns[0].values
        return cls(SCHEMAS[table], columns, len(key))

    @classmethod
    def of(cls, table: pa.Table) -> Rows:
        """The rows of an Arrow table, without a copy where that is possible."""
        columns = tuple(
            _from_arrow(table.column(place), field) for place, field in enumerate(table.schema)
        )
        return cls(table.schema, columns, table.num_rows)

    @classmethod
    def joined(cls, parts: Sequence[Rows]) -> Rows:
        """The rows of some pieces of one table, one after the other."""
        if len(parts) == 1:
            return parts[0]
        columns = tuple(map(_joined, zip(*(one.columns for one in parts), strict=True)))
        return cls(parts[0].schema, columns, sum(one.num_rows for one in parts))

    def arrow(self) -> pa.Table:
        """The rows as an Arrow table, without a copy where that is possible."""
        arrays = map(_to_arrow, self.columns, self.schema)
        return pa.Table.from_arrays(list(arrays), schema=self.schema)

    def with_columns(self, schema: pa.Schema, new: Mapping[str, Column]) -> Rows:
        """The same rows with some columns exchanged."""
        pairs = zip(schema.names, self.columns, strict=True)
        columns = tuple(new.get(name, column) for name, column in pairs)
        return Rows(schema, columns, self.num_rows)

    @property
    def nbytes(self) -> int:
        """Bytes of the values."""
        return sum(column.values.nbytes for column in self.columns)


def nothing(field: pa.Field, count: int) -> Column:
    """A column of numbers, names or texts without any."""
    return Column(np.zeros(count, _kind(field)), np.ones(count, np.bool_))


def texts_of(texts: Sequence[str]) -> Column:
    """A column of texts that may all differ."""
    return Column(np.arange(len(texts), dtype=np.int32), None, tuple(texts))


@cache
def _kinds(table: str) -> tuple[tuple[str, np.dtype[Any]], ...]:
    """Name of each column of a table, and the type that its values have in memory."""
    return tuple((field.name, _kind(field)) for field in SCHEMAS[table])


def _kind(field: pa.Field) -> np.dtype[Any]:
    """The type that the values of a column have in memory."""
    if names_of(field):
        return np.dtype(np.int8)
    if pa.types.is_string(field.type):
        return np.dtype(np.int32)
    if pa.types.is_fixed_size_binary(field.type):
        return np.dtype(np.uint8)
    return np.dtype(field.type.to_pandas_dtype())


def _column(given: Given, name: str, kind: np.dtype[Any]) -> Column:
    if isinstance(given, Texts):
        return Column(given.places, given.missing, given.texts)
    values, missing = given if isinstance(given, Masked) else (given, None)
    if values.dtype == kind:
        return Column(values, missing)
    assert kind == np.int8, f"{name}: {values.dtype} instead of {kind}"
    return Column(values.astype(np.int8), missing)


def _joined(parts: tuple[Column, ...]) -> Column:
    values, missing, texts = zip(*parts, strict=True)
    gaps = None
    if any(one is not None for one in missing):
        gaps = np.concatenate(
            [
                np.zeros(len(one), np.bool_) if none is None else none
                for one, none in zip(values, missing, strict=True)
            ]
        )
    if all(one == texts[0] for one in texts):
        return Column(np.concatenate(values), gaps, texts[0])
    return Column(np.concatenate(list(_moved(values, texts))), gaps, sum(texts, ()))


def _moved(places: Iterable[Array], texts: Iterable[tuple[str, ...]]) -> Iterable[Array]:
    """Places in lists of texts as places in the lists one after the other."""
    before = 0
    for some, known in zip(places, texts, strict=True):
        yield some + np.int32(before)
        before += len(known)


def _to_arrow(column: Column, field: pa.Field) -> pa.Array:
    values, missing, texts = column
    if names := names_of(field):
        return to_names(values, names, missing)
    if pa.types.is_string(field.type):
        if missing is None and len(texts) == 1:
            return to_same_text(texts[0], len(values))
        gone = np.zeros(len(values), np.bool_) if missing is None else missing
        pairs = zip(values.tolist(), gone.tolist(), strict=True)
        return to_texts([None if none else texts[place] for place, none in pairs])
    if pa.types.is_fixed_size_binary(field.type):
        count = len(values) // field.type.byte_width
        buffers = [None, pa.py_buffer(np.ascontiguousarray(values))]
        return pa.Array.from_buffers(field.type, count, buffers)
    return to_arrow(values, missing)


def _from_arrow(column: pa.ChunkedArray, field: pa.Field) -> Column:
    chunk = column.chunk(0) if column.num_chunks == 1 else column.combine_chunks()
    if names := names_of(field):
        return Column(short_codes(chunk, names), _gaps(chunk.indices))
    if pa.types.is_string(field.type):
        coded = chunk.dictionary_encode()
        places, missing = to_numpy(coded.indices), _gaps(coded.indices)
        return Column(places, missing, tuple(coded.dictionary.to_pylist()))
    if pa.types.is_fixed_size_binary(field.type):
        width, octets = field.type.byte_width, np.frombuffer(chunk.buffers()[1], np.uint8)
        return Column(octets[chunk.offset * width :][: len(chunk) * width], _gaps(chunk))
    return Column(to_numpy(chunk), _gaps(chunk))


def _gaps(chunk: pa.Array) -> Mask | None:
    return missing_in(chunk) if chunk.null_count else None
