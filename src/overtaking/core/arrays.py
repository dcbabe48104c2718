"""Array types with their dtypes; memory of large arrays is reused."""

import contextlib
import math
import mmap
import weakref
from collections.abc import Hashable
from itertools import accumulate
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

F32 = Annotated[NDArray[np.floating[Any]], np.dtype(np.float32)]
"""A float32 array. Type checkers see an array of any float: in NumPy's own types the width is lost
after one operation, so that they would report errors in correct code."""
F64 = Annotated[NDArray[np.float64], np.dtype(np.float64)]
I16 = Annotated[NDArray[np.int16], np.dtype(np.int16)]
I32 = Annotated[NDArray[np.int32], np.dtype(np.int32)]
I64 = Annotated[NDArray[np.int64], np.dtype(np.int64)]
U8 = Annotated[NDArray[np.uint8], np.dtype(np.uint8)]
U32 = Annotated[NDArray[np.uint32], np.dtype(np.uint32)]
U64 = Annotated[NDArray[np.uint64], np.dtype(np.uint64)]
Mask = Annotated[NDArray[np.bool_], np.dtype(np.bool_)]
IndexArray = Annotated[NDArray[np.intp], np.dtype(np.intp)]

F32Like = F32 | np.floating[Any]
"""A float32 array or number."""

MIN_POOLED_BYTES = 1 << 20
"""Arrays below this are NumPy's own."""

MAX_POOLED_BYTES = 256 << 20
"""Most unused memory that is kept: that of a large batch and of its results."""
_PAGE_BYTES = 2 << 20  # What Linux calls a huge page, on x86 and on ARM.

_LINE_BYTES = 64
"""Arrays begin where a line of the CPU's cache does."""

ArrayLayout = tuple[tuple[str, tuple[int, ...], type[np.generic] | np.dtype[Any]], ...]
"""Names, shapes and types of some arrays."""

_PoolKey = tuple[Hashable, int]
"""The use that memory is reserved for (None for any), and its size."""

_pool: dict[_PoolKey, list[mmap.mmap]] = {}
"""Unused memory. Only `append` and `pop` touch the lists, so that neither threads nor a
finaliser in the midst of either need a lock."""


def empty_array(size: int, dtype: Any) -> NDArray[Any]:
    """An array with arbitrary content, as from `numpy.empty`.

    Its memory returns when the array and all views of it are gone, and not before.

    Args:
        size: Number of elements.
        dtype: Their type.
    """
    kind = np.dtype(dtype)
    length = size * kind.itemsize
    if length < MIN_POOLED_BYTES:
        return np.empty(size, kind)
    return _pooled_bytes(length, None).view(kind)


def reused_bytes(purpose: Hashable, size: int) -> NDArray[np.uint8]:
    """Bytes that are zero, or what the last array for the same use and size left in them.

    A caller that keeps in them how far they were filled need not clear the rest.

    Args:
        purpose: Name of a purpose; memory is reused only for the same purpose.
        size: Their number.
    """
    return np.zeros(size, np.uint8) if size < MIN_POOLED_BYTES else _pooled_bytes(size, purpose)


def _pooled_bytes(length: int, purpose: Hashable) -> NDArray[np.uint8]:
    """Memory of a huge page or more, which is given back with the last reference to it."""
    room = -(-length // _PAGE_BYTES) * _PAGE_BYTES
    memory = _take_from_pool((purpose, room))
    whole = np.frombuffer(memory, np.uint8)
    begin = -whole.ctypes.data % _PAGE_BYTES
    weakref.finalize(whole, _return_to_pool, memory, (purpose, room)).atexit = False
    return whole[begin : begin + length]


def _take_from_pool(purpose: _PoolKey) -> mmap.mmap:
    """Memory in which as many bytes begin at a huge page."""
    with contextlib.suppress(KeyError, IndexError):
        return _pool[purpose].pop()
    flags = {} if not hasattr(mmap, "MAP_PRIVATE") else {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANON}
    memory = mmap.mmap(-1, purpose[1] + _PAGE_BYTES, **flags)
    if hasattr(mmap, "MADV_HUGEPAGE"):
        with contextlib.suppress(OSError):  # A kernel without them serves small ones.
            memory.madvise(mmap.MADV_HUGEPAGE)
    return memory


def _return_to_pool(memory: mmap.mmap, purpose: _PoolKey) -> None:
    """Keep memory for the next one, unless there is plenty."""
    kept = sum(room * len(free) for (_, room), free in tuple(_pool.items()))
    if kept + purpose[1] <= MAX_POOLED_BYTES:
        _pool.setdefault(purpose, []).append(memory)


class Buffers:
    """Output arrays that are used again as long as they are large enough.

    Without one, memory is reused too, but only when no reference to the last batch is left.
    """

    def __init__(self) -> None:
        """Start without memory."""
        self._memory: dict[str, NDArray[Any]] = {}
        self._layouts: dict[str, ArrayLayout] = {}

    def array(self, name: str, shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
        """An array of this shape with arbitrary content; valid until the next call for it."""
        size = int(np.prod(shape, dtype=np.int64))
        memory = self._memory.get(name)
        if memory is None or memory.size < size:
            memory = self._memory[name] = empty_array(size, dtype)
        return memory[:size].reshape(shape)

    def arrays(self, name: str, layout: ArrayLayout) -> dict[str, NDArray[Any]]:
        """Arrays of zeros, or with the values of an earlier array of this layout; valid as above.

        Args:
            name: Of all of them together.
            layout: Name, shape and type of each.
        """
        sizes = [math.prod(shape) * np.dtype(kind).itemsize for _, shape, kind in layout]
        ends = list(accumulate(-(-size // _LINE_BYTES) * _LINE_BYTES for size in sizes))
        if self._layouts.get(name) != layout:
            self._layouts[name], self._memory[name] = layout, reused_bytes(layout, ends[-1])
        memory, begins = self._memory[name], [0, *ends]
        return {
            # Empty slices can share an address with another array, and the engine refuses to write
            # to two arrays at one address.
            field: memory[begin : begin + size].view(kind).reshape(shape)
            if size
            else np.empty(shape, kind)
            for (field, shape, kind), begin, size in zip(layout, begins, sizes, strict=False)
        }
