"""Array types with their dtypes; memory of large arrays is reused."""

import contextlib
import math
import mmap
import weakref
from collections.abc import Hashable
from itertools import accumulate
from typing import Annotated, Any, NamedTuple

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
"""Arrays of fewer bytes come from NumPy, which reuses small blocks itself."""

MAX_POOLED_BYTES = 256 << 20
"""Unused memory in the pool, at most: a large batch and its results."""

_PAGE_BYTES = 2 << 20  # Size of a huge page of Linux, on x86 and on ARM.
_LINE_BYTES = 64  # Size of a cache line; each array of a group begins at one.


class ArrayLayout(NamedTuple):
    """One of several arrays in a common block of memory."""

    name: str
    shape: tuple[int, ...]
    dtype: type[np.generic] | np.dtype[Any]


class _PoolKey(NamedTuple):
    """Memory is reused for the same purpose and size; the purpose None stands for any content."""

    purpose: Hashable
    num_bytes: int


_pool: dict[_PoolKey, list[mmap.mmap]] = {}
"""Unused memory. Only `append` and `pop` change the lists: both are atomic, so that threads and
finalisers need no lock."""


def empty_array(size: int, dtype: Any) -> NDArray[Any]:
    """Allocate an array with arbitrary content, as `numpy.empty` does.

    Its memory returns to the pool with the last reference to the array or to a view of it.

    Args:
        size: Number of elements.
        dtype: Type of the elements.

    Returns:
        The array, shape (size,).
    """
    num_bytes = size * np.dtype(dtype).itemsize
    if num_bytes < MIN_POOLED_BYTES:
        return np.empty(size, dtype)
    return _pooled_bytes(num_bytes, None).view(dtype)


def reused_bytes(purpose: Hashable, size: int) -> NDArray[np.uint8]:
    """Allocate bytes that are zero, or hold the values of an earlier array.

    A caller that stores in the array how much of it is filled need not clear the rest.

    Args:
        purpose: The memory of an earlier array is reused for the same purpose and size only.
        size: Number of bytes.

    Returns:
        The bytes, shape (size,).
    """
    return np.zeros(size, np.uint8) if size < MIN_POOLED_BYTES else _pooled_bytes(size, purpose)


def _pooled_bytes(size: int, purpose: Hashable) -> NDArray[np.uint8]:
    """Bytes at the beginning of a huge page, which return to the pool after the last reference."""
    num_pages = -(-size // _PAGE_BYTES)
    key = _PoolKey(purpose, num_pages * _PAGE_BYTES)
    memory = _take_from_pool(key)
    block = np.frombuffer(memory, np.uint8)
    begin = -block.ctypes.data % _PAGE_BYTES
    weakref.finalize(block, _return_to_pool, memory, key).atexit = False
    return block[begin : begin + size]


def _take_from_pool(key: _PoolKey) -> mmap.mmap:
    """Memory from the pool or from the system, with one page more for the alignment."""
    with contextlib.suppress(KeyError, IndexError):
        return _pool[key].pop()
    flags = {} if not hasattr(mmap, "MAP_PRIVATE") else {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANON}
    memory = mmap.mmap(-1, key.num_bytes + _PAGE_BYTES, **flags)
    if hasattr(mmap, "MADV_HUGEPAGE"):
        with contextlib.suppress(OSError):  # A kernel without huge pages uses small ones.
            memory.madvise(mmap.MADV_HUGEPAGE)
    return memory


def _return_to_pool(memory: mmap.mmap, key: _PoolKey) -> None:
    pooled = tuple(_pool.items())  # A copy: another thread may add a key.
    pooled_bytes = sum(pooled_key.num_bytes * len(blocks) for pooled_key, blocks in pooled)
    if pooled_bytes + key.num_bytes <= MAX_POOLED_BYTES:
        _pool.setdefault(key, []).append(memory)


class Buffers:
    """Output arrays of a caller that no longer needs the results of its last call.

    Functions without a `Buffers` object reuse memory as well, but only after the last reference to
    the earlier arrays.
    """

    def __init__(self) -> None:
        """Start without memory."""
        self._memory: dict[str, NDArray[Any]] = {}
        self._layouts: dict[str, tuple[ArrayLayout, ...]] = {}

    def array(self, name: str, shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
        """An array with arbitrary content, valid until the next call with the same name.

        Args:
            name: Name of the array; all calls with one name need the same dtype.
            shape: Its shape.
            dtype: Type of its elements.
        """
        size = int(np.prod(shape, dtype=np.int64))
        memory = self._memory.get(name)
        if memory is None or memory.size < size:
            memory = self._memory[name] = empty_array(size, dtype)
        return memory[:size].reshape(shape)

    def arrays(self, name: str, layouts: tuple[ArrayLayout, ...]) -> dict[str, NDArray[Any]]:
        """Arrays of zeros or, after a call with equal layouts, with the values from then.

        They are valid until the next call with the same name.

        Args:
            name: Name of the group of arrays.
            layouts: The arrays.

        Returns:
            The arrays by their names.
        """
        sizes = [math.prod(layout.shape) * np.dtype(layout.dtype).itemsize for layout in layouts]
        ends = list(accumulate(-(-size // _LINE_BYTES) * _LINE_BYTES for size in sizes))
        if self._layouts.get(name) != layouts:
            self._layouts[name], self._memory[name] = layouts, reused_bytes(layouts, ends[-1])
        memory, begins = self._memory[name], [0, *ends]
        return {
            # Empty slices can share an address with another array, and the engine refuses to write
            # to two arrays at one address.
            layout.name: memory[begin : begin + size].view(layout.dtype).reshape(layout.shape)
            if size
            else np.empty(layout.shape, layout.dtype)
            for layout, begin, size in zip(layouts, begins, sizes, strict=False)
        }
