"""Large arrays whose memory is used again as soon as nobody looks at them.

A batch of simulations fills some eighty megabytes. Memory that is fresh from the operating system
costs a fault and a clearing for each page, which took a seventh of the engine's time; and on pages
of 4 KiB, each row of a simulation lies on a page of its own, more of them than the CPU remembers.
"""

import contextlib
import mmap
import weakref
from typing import Any

import numpy as np
from numpy.typing import NDArray

LARGE_BYTES = 1 << 20
"""Arrays below this are NumPy's own."""

KEPT_BYTES = 256 << 20
"""At most so much is kept while nobody uses it: three batches."""

_PAGE_BYTES = 2 << 20  # What Linux calls a huge page, on x86 and on ARM.

_free: dict[int, list[mmap.mmap]] = {}
"""Memory that nobody uses, by its size. Only `append` and `pop` touch the lists, so that neither
threads nor a finaliser in the midst of either need a lock."""


def empty(size: int, dtype: Any) -> NDArray[Any]:
    """An array whose content means nothing, as `numpy.empty` gives it.

    Its memory returns when the array and all views of it are gone, and not before.

    Args:
        size: Number of elements.
        dtype: Their type.
    """
    kind = np.dtype(dtype)
    length = size * kind.itemsize
    if length < LARGE_BYTES:
        return np.empty(size, kind)
    room = -(-length // _PAGE_BYTES) * _PAGE_BYTES
    memory = _taken(room)
    whole = np.frombuffer(memory, np.uint8)
    begin = -whole.ctypes.data % _PAGE_BYTES
    weakref.finalize(whole, _give_back, memory, room).atexit = False
    return whole[begin : begin + length].view(kind)


def _taken(room: int) -> mmap.mmap:
    """Memory in which `room` bytes begin at a huge page."""
    with contextlib.suppress(KeyError, IndexError):
        return _free[room].pop()
    flags = {} if not hasattr(mmap, "MAP_PRIVATE") else {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANON}
    memory = mmap.mmap(-1, room + _PAGE_BYTES, **flags)
    if hasattr(mmap, "MADV_HUGEPAGE"):
        with contextlib.suppress(OSError):  # A kernel without them serves small ones.
            memory.madvise(mmap.MADV_HUGEPAGE)
    return memory


def _give_back(memory: mmap.mmap, room: int) -> None:
    """Keep memory for the next one, unless there is plenty."""
    kept = sum(size * len(free) for size, free in tuple(_free.items()))
    if kept + room <= KEPT_BYTES:
        _free.setdefault(room, []).append(memory)
