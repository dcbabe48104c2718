"""A hash over what a table says, whatever the file or the batches it comes in."""

import hashlib
from collections.abc import Iterable

import numpy as np
import pyarrow as pa

from overtaking import _core
from overtaking.tables.arrow import Array, Mask, missing_in, to_numpy
from overtaking.tables.columns import codes, names_of


class ContentDigest:
    """A hash over the values of a table that arrives in pieces.

    Each column has a BLAKE3 hash of its own, so that pieces of any length give the same result;
    nulls are hashed as a column of their own, and what stands behind them does not count.
    """

    def __init__(self, schema: pa.Schema) -> None:
        """Start with no rows of a table of one of the `SCHEMAS`."""
        self._schema = schema
        self._values = [_core.Hash() for _ in schema]
        self._nulls = [_core.Hash() for _ in schema]
        self.num_rows = 0

    def update(self, table: pa.Table) -> None:
        """Add rows."""
        self.num_rows += table.num_rows
        for place, field in enumerate(self._schema):
            for chunk in table.column(place).chunks:
                missing = missing_in(chunk) if field.nullable else None
                if missing is not None:
                    self._nulls[place].update(_little_endian(missing))
                self._values[place].update(_little_endian(_values(chunk, field, missing)))

    def hexdigest(self) -> str:
        """The hash over all rows so far, 64 hexadecimal digits."""
        pairs = zip(self._values, self._nulls, strict=True)
        return total_of(
            self._schema, ((values.hexdigest(), nulls.hexdigest()) for values, nulls in pairs)
        )


def total_of(schema: pa.Schema, digests: Iterable[tuple[str, str]]) -> str:
    """The hash of a table from the hashes over the values and over the nulls of its columns."""
    total = hashlib.sha256()
    for field, (values, nulls) in zip(schema, digests, strict=True):
        total.update(f"{field.name}\0{field.type}\0{values}\0{nulls}\0".encode())
    return total.hexdigest()


def content_of(table: pa.Table) -> str:
    """The content hash of a whole table."""
    digest = ContentDigest(table.schema)
    digest.update(table)
    return digest.hexdigest()


def _values(chunk: pa.Array, field: pa.Field, missing: Mask | None) -> Array:
    """The values of a chunk as an array whose bytes say all of them, with zero for null."""
    if names := names_of(field):
        return codes(chunk, names).astype(np.int8)
    if pa.types.is_string(field.type) or pa.types.is_fixed_size_binary(field.type):
        texts = b"".join(_bytes(value) for value in chunk.to_pylist())
        return np.frombuffer(texts, dtype=np.uint8)
    values = to_numpy(chunk)
    if missing is None or not missing.any():
        return values
    return np.where(missing, np.zeros(1, dtype=values.dtype), values)


def _bytes(value: str | bytes | None) -> bytes:
    """A text after its length, so that no two columns of texts look alike."""
    text = value.encode() if isinstance(value, str) else value or b""
    return len(text).to_bytes(8, "little") + text


def _little_endian(values: Array) -> bytes | memoryview:
    """The bytes of an array, the same on every machine."""
    ordered = values.astype(values.dtype.newbyteorder("<"), copy=False)
    return np.ascontiguousarray(ordered).data.cast("B") if len(ordered) else b""
