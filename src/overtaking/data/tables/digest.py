"""A hash over the values of a table, independent of its file and batches."""

import hashlib

import numpy as np
import pyarrow as pa

from overtaking import _core
from overtaking.data.tables.arrow import Array, Mask, missing_in, to_numpy
from overtaking.data.tables.columns import names_of, short_codes
from overtaking.data.tables.schemas import SINCE

_ALWAYS_COUNTED = 3
"""The last version of the tables all of whose columns count, with or without a value."""
_LENGTH_BYTES = 8


class ContentDigest:
    """A hash over the values of a table that arrives in pieces.

    Each column has a BLAKE3 hash of its own, so that pieces of any length give the same result;
    nulls are hashed as a column of their own, and the values behind them do not count. A column
    that tables got later counts only if it has a value: an older table without it says the same.
    """

    def __init__(self, schema: pa.Schema) -> None:
        """Start with no rows of a table of one of the `SCHEMAS`."""
        self._schema = schema
        self._values = [_core.Hash() for _ in schema]
        self._nulls = [_core.Hash() for _ in schema]
        self._counts = [SINCE.get(field.name, 0) <= _ALWAYS_COUNTED for field in schema]
        self.num_rows = 0

    def update(self, table: pa.Table) -> None:
        """Add rows."""
        self.num_rows += table.num_rows
        for index, field in enumerate(self._schema):
            for chunk in table.column(index).chunks:
                missing = missing_in(chunk) if field.nullable else None
                self._counts[index] |= chunk.null_count < len(chunk)
                if missing is not None:
                    self._nulls[index].update(_little_endian(missing))
                self._values[index].update(_little_endian(_values(chunk, field, missing)))

    def hexdigest(self) -> str:
        """The hash over all rows so far, 64 hexadecimal digits."""
        total = hashlib.sha256()
        columns = zip(self._schema, self._values, self._nulls, self._counts, strict=True)
        for field, values, nulls, counts in columns:
            if not counts:
                continue
            parts = (field.name, field.type, values.hexdigest(), nulls.hexdigest())
            total.update("".join(f"{part}\0" for part in parts).encode())
        return total.hexdigest()


def content_of(table: pa.Table) -> str:
    """The content hash of a whole table."""
    digest = ContentDigest(table.schema)
    digest.update(table)
    return digest.hexdigest()


def _values(chunk: pa.Array, field: pa.Field, missing: Mask | None) -> Array:
    """The values of a chunk as an array whose bytes say all of them, with zero for null."""
    if names := names_of(field):
        return short_codes(chunk, names)
    if pa.types.is_string(field.type) or pa.types.is_fixed_size_binary(field.type):
        return _texts(chunk)
    values = to_numpy(chunk)
    if missing is None or not missing.any():
        return values
    return np.where(missing, np.zeros(1, dtype=values.dtype), values)


def _texts(chunk: pa.Array) -> Array:
    """Each text after its length, so that no two columns of texts look alike; null is empty."""
    data, lengths = _octets(chunk)
    missing = missing_in(chunk)
    if missing.any():  # What lies behind a null does not count.
        data = data[np.repeat(~missing, lengths)]
        lengths = np.where(missing, 0, lengths)
    row = np.arange(len(chunk), dtype=np.int64)
    begins = np.cumsum(lengths) - lengths + _LENGTH_BYTES * row
    hashed = np.empty(len(data) + _LENGTH_BYTES * len(chunk), dtype=np.uint8)
    prefixes = lengths.astype("<i8").view(np.uint8).reshape(-1, _LENGTH_BYTES)
    hashed[begins[:, None] + np.arange(_LENGTH_BYTES)] = prefixes
    hashed[np.arange(len(data)) + np.repeat(_LENGTH_BYTES * (row + 1), lengths)] = data
    return hashed


def _octets(chunk: pa.Array) -> tuple[Array, Array]:
    """The bytes of all texts one after the other, and the length of each."""
    _, *others = chunk.buffers()
    count, first = len(chunk), chunk.offset
    if pa.types.is_fixed_size_binary(chunk.type):
        width = chunk.type.byte_width
        data = np.frombuffer(others[0], np.uint8)[first * width : (first + count) * width]
        return data, np.full(count, width, dtype=np.int64)
    if not count or others[0] is None:
        return np.empty(0, dtype=np.uint8), np.zeros(count, dtype=np.int64)
    ends = np.frombuffer(others[0], np.int32)[first : first + count + 1].astype(np.int64)
    texts = others[1] if others[1] is not None else b""
    return np.frombuffer(texts, np.uint8)[ends[0] : ends[-1]], np.diff(ends)


def _little_endian(values: Array) -> bytes | memoryview:
    """The bytes of an array, the same on every machine."""
    ordered = values.astype(values.dtype.newbyteorder("<"), copy=False)
    return np.ascontiguousarray(ordered).data.cast("B") if len(ordered) else b""
