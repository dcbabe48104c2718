"""Memory that returns: never while somebody looks, always afterwards, and not without bound."""

from __future__ import annotations

import gc
import threading

import numpy as np
import pyarrow as pa
import pytest

from overtaking.core import memory

LARGE = memory.LARGE_BYTES


@pytest.fixture(autouse=True)
def _nothing_kept(monkeypatch):
    monkeypatch.setattr(memory, "_free", {})


def address(array):
    return array.ctypes.data


def kept():
    return sum(size * len(free) for (_, size), free in memory._free.items())


@pytest.mark.parametrize("dtype", [np.int32, np.int16, np.uint8, np.float32, bool])
def test_an_array_has_the_size_and_type_that_were_asked_for_and_can_be_written(dtype):
    for size in (0, 1, 1000, LARGE // np.dtype(dtype).itemsize + 3):
        array = memory.empty(size, dtype)
        assert array.shape == (size,)
        assert array.dtype == dtype
        array[:] = 1
        assert array.sum() == size


def test_memory_is_used_again_once_the_array_is_gone():
    first = memory.empty(LARGE, np.uint8)
    place = address(first)
    del first
    assert address(memory.empty(LARGE, np.uint8)) == place


@pytest.mark.ci
@pytest.mark.parametrize(
    "look",
    [
        lambda array: array[5:6],
        lambda array: array.reshape(4, -1)[1:, ::2],
        lambda array: array.view(np.int32)[-1:],
        memoryview,
        lambda array: array.reshape(2, -1).T.view(bool),
    ],
    ids=["slice", "reshape", "view", "memoryview", "transpose"],
)
def test_memory_is_not_used_again_while_somebody_looks_at_a_part_of_it(look):
    array = memory.empty(LARGE, np.uint8)
    place = address(array)
    seen = look(array)
    del array
    gc.collect()
    other = memory.empty(LARGE, np.uint8)
    assert address(other) != place
    del seen, other
    both = [memory.empty(LARGE, np.uint8) for _ in range(2)]
    assert place in map(address, both)


def test_an_arrow_table_keeps_the_memory_that_it_shows():
    array = memory.empty(LARGE, np.uint8)
    array[:] = 7
    column = pa.array(array)
    del array
    memory.empty(LARGE, np.uint8)[:] = 9
    assert (column.to_numpy() == 7).all()


@pytest.mark.parametrize("size", [10, LARGE + 7])
def test_what_was_left_is_zero_at_first(size):
    memory.empty(size, np.uint8)[:] = 9
    array = memory.as_left("a use", size)
    assert array.shape == (size,)
    assert not array.any()


def test_what_was_left_is_found_by_the_same_use_alone():
    array = memory.as_left(("a use", 1), LARGE)
    array[::100] = 7
    place = address(array)
    del array
    others = [memory.as_left(("a use", 2), LARGE), memory.empty(LARGE, np.uint8)]
    assert place not in map(address, others)
    again = memory.as_left(("a use", 1), LARGE)
    assert address(again) == place
    assert (again[::100] == 7).all()
    assert np.count_nonzero(again) == len(again[::100])


def test_two_arrays_that_live_at_the_same_time_do_not_overlap():
    arrays = [memory.empty(LARGE + 1000 * k, np.uint8) for k in range(8)]
    for k, array in enumerate(arrays):
        array[:] = k
    assert [list(np.unique(array)) for array in arrays] == [[k] for k in range(8)]


def test_no_more_is_kept_than_the_bound(monkeypatch):
    monkeypatch.setattr(memory, "KEPT_BYTES", 6 * LARGE)
    arrays = [memory.empty(LARGE, np.uint8) for _ in range(10)]
    del arrays
    assert 0 < kept() <= 6 * LARGE


def test_threads_never_share_memory():
    wrong = []

    def work(number):
        for _ in range(200):
            array = memory.empty(LARGE, np.uint8)
            array[::4096] = number
            if (array[::4096] != number).any():
                wrong.append(number)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
