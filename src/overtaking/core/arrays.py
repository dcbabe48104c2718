"""Array types with their dtypes, and a pool that reuses the memory of large arrays.

All packages annotate their arrays with the types, such as `F32`. `model.batch` checks the arrays in
a dataclass: it reads the expected dtype of a field from the annotation.

The pool is for arrays that the engine fills; the engine is the compiled simulator in
`crates/overtaking-core`. It computes many simulations at a time, a batch, whose arrays take 80 to
160 MB. The system clears new memory before it hands it out, which took a seventh of the engine's
time. Memory from the pool is not cleared.
"""

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
"""A float32 array. Type checkers see an array of floats of any width: by the annotations of NumPy,
many operations on float32 arrays return an unknown width, and checkers would reject correct code.
"""
F64 = Annotated[NDArray[np.float64], np.dtype(np.float64)]
I16 = Annotated[NDArray[np.int16], np.dtype(np.int16)]
I32 = Annotated[NDArray[np.int32], np.dtype(np.int32)]
I64 = Annotated[NDArray[np.int64], np.dtype(np.int64)]
U8 = Annotated[NDArray[np.uint8], np.dtype(np.uint8)]
U32 = Annotated[NDArray[np.uint32], np.dtype(np.uint32)]
U64 = Annotated[NDArray[np.uint64], np.dtype(np.uint64)]
Mask = Annotated[NDArray[np.bool_], np.dtype(np.bool_)]
IndexArray = Annotated[NDArray[np.intp], np.dtype(np.intp)]  # Positions in an axis of an array.

F32Like = F32 | np.floating[Any]
"""A float32 array or number."""

MIN_POOLED_BYTES = 1 << 20
"""Smaller arrays are ordinary NumPy arrays: NumPy and the C library reuse small blocks. The number
is a choice."""

MAX_POOLED_BYTES = 256 << 20
"""Largest amount of unused memory that the pool keeps. Chosen: one large batch and its results."""

# Linux maps memory in pages of 4 KiB or, on request, in huge pages of this size (x86 and ARM). The
# CPU stores the addresses of a limited number of pages, and has to look up the others. The arrays
# of a batch have more small pages than that, but few huge ones.
_HUGE_PAGE_BYTES = 2 << 20

_CACHE_LINE_BYTES = 64  # As many bytes as the widest vectors of a CPU (AVX-512).


class ArrayLayout(NamedTuple):
    """Name, shape and dtype of one array in a group of arrays with a common block of memory."""

    name: str
    shape: tuple[int, ...]
    dtype: type[np.generic] | np.dtype[Any]


class _PoolKey(NamedTuple):
    """An array takes memory from the pool only if the key of the memory equals its own key."""

    purpose: Hashable  # As in `reused_bytes`; None if the initial values do not matter.
    num_bytes: int  # Whole huge pages.


_pool: dict[_PoolKey, list[mmap.mmap]] = {}
"""Unused blocks of memory. Python can call `_return_to_pool` at any moment, also while this thread
takes memory from the pool. A lock would then wait for itself. Instead, lists change only by
`append` and `pop`, which are atomic."""


def empty_array(size: int, dtype: Any) -> NDArray[Any]:
    """Allocate an array with arbitrary values, as `numpy.empty` does.

    Its memory returns to the pool after the last reference to the array and to its views is gone.

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
    """Allocate bytes that are zero, or that hold the values of an earlier array.

    A caller can store in the bytes themselves how far it has filled them. The next caller with the
    same purpose reads this, and clears only the filled part.

    Args:
        purpose: Key of the caller: it receives only values of earlier arrays with the same key.
        size: Number of bytes.

    Returns:
        The bytes, shape (size,).
    """
    return np.zeros(size, np.uint8) if size < MIN_POOLED_BYTES else _pooled_bytes(size, purpose)


def _pooled_bytes(size: int, purpose: Hashable) -> NDArray[np.uint8]:
    """Allocate bytes that begin at a huge page, and that return to the pool after their use."""
    num_pages = -(-size // _HUGE_PAGE_BYTES)  # Rounded up.
    key = _PoolKey(purpose, num_pages * _HUGE_PAGE_BYTES)
    memory = _take_from_pool(key)
    block = np.frombuffer(memory, np.uint8)
    begin = -block.ctypes.data % _HUGE_PAGE_BYTES  # Offset of the first huge page in the block.
    # Every view keeps a reference to `block`, so the finaliser runs after the last view is gone. At
    # the exit of Python it must not run: then arrays can still be in use.
    weakref.finalize(block, _return_to_pool, memory, key).atexit = False
    return block[begin : begin + size]


def _take_from_pool(key: _PoolKey) -> mmap.mmap:
    """Take memory with this key from the pool, or from the system if the pool has no such memory.

    The memory is one huge page larger than the key states, because the system aligns it to small
    pages only.
    """
    with contextlib.suppress(KeyError, IndexError):
        return _pool[key].pop()
    # Python's default is shared memory: by default Linux keeps it on small pages, and a forked
    # child process would write into the arrays of its parent. Windows knows no such flags.
    flags = {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANON} if hasattr(mmap, "MAP_PRIVATE") else {}
    memory = mmap.mmap(-1, key.num_bytes + _HUGE_PAGE_BYTES, **flags)
    if hasattr(mmap, "MADV_HUGEPAGE"):
        with contextlib.suppress(OSError):  # A kernel without huge pages uses small ones.
            memory.madvise(mmap.MADV_HUGEPAGE)
    return memory


def _return_to_pool(memory: mmap.mmap, key: _PoolKey) -> None:
    """Put memory into the pool, or leave it to the system if the pool is full."""
    pooled = tuple(_pool.items())  # A copy: another thread may add a key.
    # The additional huge page of each block is not counted: the part of a block outside its array
    # is never touched, so it takes no memory.
    pooled_bytes = sum(pooled_key.num_bytes * len(blocks) for pooled_key, blocks in pooled)
    if pooled_bytes + key.num_bytes <= MAX_POOLED_BYTES:
        _pool.setdefault(key, []).append(memory)


class Buffers:
    """Arrays that a caller hands to the engine again and again, to fill them with new results.

    Each call overwrites the results of the call before. A caller that still needs those uses a new
    object for each call; the pool then reuses memory once the earlier results are deleted.
    """

    def __init__(self) -> None:
        """Start without arrays; the first call for a name allocates its memory."""
        self._memory: dict[str, NDArray[Any]] = {}
        self._layouts: dict[str, tuple[ArrayLayout, ...]] = {}

    def array(self, name: str, shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
        """An array with arbitrary values, valid until the next call with the same name.

        Args:
            name: Name of the array, which `arrays` must not use. All calls with this name must pass
                the same dtype, because they share the memory of the largest array so far.
            shape: Shape of the array.
            dtype: Type of its elements.
        """
        size = int(np.prod(shape, dtype=np.int64))
        memory = self._memory.get(name)
        if memory is None or memory.size < size:
            memory = self._memory[name] = empty_array(size, dtype)
        return memory[:size].reshape(shape)

    def arrays(self, name: str, layouts: tuple[ArrayLayout, ...]) -> dict[str, NDArray[Any]]:
        """A group of arrays that are zero, or that hold the values of an earlier group.

        The earlier group has equal layouts; it may come from another `Buffers` object that was
        deleted. A caller can store in one of the arrays how far it has filled the others; the next
        caller then clears only that part. The arrays are valid until the next call with the same
        name.

        Args:
            name: Name of the group.
            layouts: The arrays, at least one. They follow each other in one block of memory.

        Returns:
            The arrays by the names in their layouts.
        """
        sizes = [math.prod(layout.shape) * np.dtype(layout.dtype).itemsize for layout in layouts]
        # Each array begins at a cache line of the block, so that each vector of its numbers lies in
        # one line. Blocks below `MIN_POOLED_BYTES` may themselves begin elsewhere: a vector in two
        # lines is slower, not wrong.
        begins = [
            0,
            *accumulate(-(-size // _CACHE_LINE_BYTES) * _CACHE_LINE_BYTES for size in sizes),
        ]
        total_bytes = begins.pop()
        if self._layouts.get(name) != layouts:
            # The key of the memory is the layouts, so earlier values belong to arrays of the same
            # names and shapes. They may belong to a group of another name, so groups with equal
            # layouts must be filled in the same way.
            self._layouts[name], self._memory[name] = layouts, reused_bytes(layouts, total_bytes)
        memory = self._memory[name]
        return {
            # Without elements, an array would begin at the address of the next one, and the engine
            # refuses two output arrays at one address.
            layout.name: memory[begin : begin + size].view(layout.dtype).reshape(layout.shape)
            if size
            else np.empty(layout.shape, layout.dtype)
            for layout, begin, size in zip(layouts, begins, sizes, strict=True)
        }
