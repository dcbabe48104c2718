"""Large arrays whose memory is reused when no reference to them is left.

A batch of simulations fills some eighty megabytes, or twice that. Memory that is fresh from the
operating system costs a fault and a clearing for each page, which took a seventh of the engine's
time; and on pages of 4 KiB, each row of a simulation lies on a page of its own, more of them than
the CPU remembers.
"""

import contextlib
import math
import mmap
import weakref
from collections.abc import Hashable
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

LARGE_BYTES = 1 << 20
"""Arrays below this are NumPy's own."""

KEPT_BYTES = 256 << 20
"""Most unused memory that is kept: that of a large batch and of its results."""

_PAGE_BYTES = 2 << 20  # What Linux calls a huge page, on x86 and on ARM.

_LINE_BYTES = 64
"""Arrays begin where a line of the CPU's cache does."""

Layout = tuple[tuple[str, tuple[int, ...], type[np.generic] | np.dtype[Any]], ...]
"""Names, shapes and types of some arrays."""

_Use = tuple[Hashable, int]
"""The use that memory is reserved for (None for any), and its size."""

_free: dict[_Use, list[mmap.mmap]] = {}
"""Unused memory. Only `append` and `pop` touch the lists, so that neither threads nor a
finaliser in the midst of either need a lock."""


def empty(size: int, dtype: Any) -> NDArray[Any]:
    """An array with arbitrary content, as from `numpy.empty`.

    Its memory returns when the array and all views of it are gone, and not before.

    Args:
        size: Number of elements.
        dtype: Their type.
    """
    kind = np.dtype(dtype)
    length = size * kind.itemsize
    if length < LARGE_BYTES:
        return np.empty(size, kind)
    return _large(length, None).view(kind)


def as_left(use: Hashable, size: int) -> NDArray[np.uint8]:
    """Bytes that are zero, or what the last array for the same use and size left in them.

    A caller that keeps in them how far they were filled need not clear the rest.

    Args:
        use: Name of a purpose; memory is reused only for the same purpose.
        size: Their number.
    """
    return np.zeros(size, np.uint8) if size < LARGE_BYTES else _large(size, use)


def _large(length: int, use: Hashable) -> NDArray[np.uint8]:
    """Memory of a huge page or more, which is given back with the last reference to it."""
    room = -(-length // _PAGE_BYTES) * _PAGE_BYTES
    memory = _taken((use, room))
    whole = np.frombuffer(memory, np.uint8)
    begin = -whole.ctypes.data % _PAGE_BYTES
    weakref.finalize(whole, _give_back, memory, (use, room)).atexit = False
    return whole[begin : begin + length]


def _taken(use: _Use) -> mmap.mmap:
    """Memory in which as many bytes begin at a huge page."""
    with contextlib.suppress(KeyError, IndexError):
        return _free[use].pop()
    flags = {} if not hasattr(mmap, "MAP_PRIVATE") else {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANON}
    memory = mmap.mmap(-1, use[1] + _PAGE_BYTES, **flags)
    if hasattr(mmap, "MADV_HUGEPAGE"):
        with contextlib.suppress(OSError):  # A kernel without them serves small ones.
            memory.madvise(mmap.MADV_HUGEPAGE)
    return memory


def _give_back(memory: mmap.mmap, use: _Use) -> None:
    """Keep memory for the next one, unless there is plenty."""
    kept = sum(room * len(free) for (_, room), free in tuple(_free.items()))
    if kept + use[1] <= KEPT_BYTES:
        _free.setdefault(use, []).append(memory)


class Buffers:
    """Output arrays that are used again as long as they are large enough.

    Without one, memory is reused too, but only when no reference to the last batch is left.
    """

    def __init__(self) -> None:
        """Start without memory."""
        self._memory: dict[str, NDArray[Any]] = {}
        self._layouts: dict[str, Layout] = {}

    def array(self, name: str, shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
        """An array of this shape with arbitrary content; valid until the next call for it."""
        size = int(np.prod(shape, dtype=np.int64))
        memory = self._memory.get(name)
        if memory is None or memory.size < size:
            memory = self._memory[name] = empty(size, dtype)
        return memory[:size].reshape(shape)

    def together(self, name: str, layout: Layout) -> dict[str, NDArray[Any]]:
        """Arrays of zeros, or with the values of an earlier array of this layout; valid as above.

        Args:
            name: Of all of them together.
            layout: Name, shape and type of each.
        """
        sizes = [math.prod(shape) * np.dtype(kind).itemsize for _, shape, kind in layout]
        ends = list(accumulate(-(-size // _LINE_BYTES) * _LINE_BYTES for size in sizes))
        if self._layouts.get(name) != layout:
            self._layouts[name], self._memory[name] = layout, as_left(layout, ends[-1])
        memory, begins = self._memory[name], [0, *ends]
        return {
            # Empty slices can share an address with another array, and the engine refuses to write
            # to two arrays at one address.
            field: memory[begin : begin + size].view(kind).reshape(shape)
            if size
            else np.empty(shape, kind)
            for (field, shape, kind), begin, size in zip(layout, begins, sizes, strict=False)
        }
