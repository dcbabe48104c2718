"""Arrow arrays from NumPy arrays and back, without a copy where that is possible.

Pyarrow's own conversions load pandas to ask whether that is what they were given. That takes longer
than simulating the scenarios of a paper, and writing a data set does not need it.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from overtaking.core.arrays import Mask

Array = NDArray[Any]


class Masked(NamedTuple):
    """Values of a column and where they are null."""

    values: Array
    missing: Mask


def to_arrow(values: Array, missing: Mask | None = None) -> pa.Array:
    """An array of numbers, or of yes and no, of the same type.

    Args:
        values: Shape (row,).
        missing: Where it is null, shape (row,).
    """
    kind = pa.from_numpy_dtype(values.dtype)
    bits = pa.types.is_boolean(kind)
    data = pa.py_buffer(_packed(values) if bits else np.ascontiguousarray(values))
    return pa.Array.from_buffers(kind, len(values), [_validity(missing), data])


def to_texts(texts: Sequence[str | None]) -> pa.Array:
    """An array of texts, null where there is none."""
    encoded = [text.encode() if text else b"" for text in texts]
    ends = np.cumsum([0, *map(len, encoded)], dtype=np.int32)
    missing = np.array([text is None for text in texts], dtype=np.bool_)
    buffers = [_validity(missing), pa.py_buffer(ends), pa.py_buffer(b"".join(encoded))]
    return pa.Array.from_buffers(pa.string(), len(texts), buffers)


def to_names(codes: Array, names: Sequence[str], missing: Mask | None = None) -> pa.Array:
    """An array of names, of which there are a few.

    Args:
        codes: Index of each name among `names`, shape (row,).
        names: The names.
        missing: Where it is null, shape (row,).
    """
    indices = to_arrow(codes.astype(np.int32, copy=False), missing)
    return pa.DictionaryArray.from_arrays(indices, listed(tuple(names)))


@lru_cache(maxsize=256)
def listed(names: tuple[str, ...]) -> pa.Array:
    """`to_texts` of a few names, the same array each time."""
    return to_texts(names)


def to_numpy(chunk: pa.Array) -> Array:
    """The values of an array of numbers or of yes and no; what stands for a null means nothing."""
    data = chunk.buffers()[1]
    if pa.types.is_boolean(chunk.type):
        return _unpacked(data, chunk.offset, len(chunk))
    kind = np.dtype(chunk.type.to_pandas_dtype())
    if not len(chunk):
        return np.empty(0, dtype=kind)
    return np.frombuffer(data, dtype=kind, count=len(chunk), offset=chunk.offset * kind.itemsize)


def column_to_numpy(column: pa.ChunkedArray, missing: Any = 0) -> Array:
    """The values of a column of numbers or of yes and no, with a value for its nulls."""
    kind = np.dtype(column.type.to_pandas_dtype())
    parts = [np.empty(0, dtype=kind)]
    for chunk in column.chunks:
        values = to_numpy(chunk)
        parts.append(
            np.where(missing_in(chunk), kind.type(missing), values) if chunk.null_count else values
        )
    return np.concatenate(parts)


def longest_text(texts: pa.Array) -> int:
    """Length of the longest of some texts [bytes]; 0 if there are none."""
    if not len(texts):
        return 0
    ends = np.frombuffer(texts.buffers()[1], np.int32, len(texts) + 1, 4 * texts.offset)
    return int(np.diff(ends).max())


def missing_in(chunk: pa.Array) -> Mask:
    """Mask of the nulls of an array."""
    validity = chunk.buffers()[0]
    if validity is None:
        return np.zeros(len(chunk), dtype=np.bool_)
    return ~_unpacked(validity, chunk.offset, len(chunk))


def _validity(missing: Mask | None) -> pa.Buffer | None:
    """Arrow's validity bits, or None if all values are there."""
    return pa.py_buffer(_packed(~missing)) if missing is not None and missing.any() else None


def _packed(bits: Mask) -> NDArray[np.uint8]:
    return np.packbits(bits, bitorder="little")


def _unpacked(data: pa.Buffer, offset: int, count: int) -> Mask:
    """Bits `offset` to `offset + count` of a buffer."""
    if not count:
        return np.zeros(0, dtype=np.bool_)
    first, skipped = divmod(offset, 8)
    octets = np.frombuffer(data, dtype=np.uint8, offset=first)
    bits = np.unpackbits(octets, count=skipped + count, bitorder="little")
    return bits[skipped:].view(np.bool_)
