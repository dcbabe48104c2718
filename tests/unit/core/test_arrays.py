"""Memory that returns: never while somebody looks, always afterwards, and not without bound."""

from __future__ import annotations

import gc
import threading

import numpy as np
import pyarrow as pa
import pytest

from overtaking.core import arrays

LARGE = arrays.MIN_POOLED_BYTES


@pytest.fixture(autouse=True)
def _nothing_kept(monkeypatch):
    monkeypatch.setattr(arrays, "_pool", {})


def address(array):
    return array.ctypes.data


def kept():
    return sum(size * len(free) for (_, size), free in arrays._pool.items())


@pytest.mark.parametrize("dtype", [np.int32, np.int16, np.uint8, np.float32, bool])
def test_an_array_has_the_size_and_type_that_were_asked_for_and_can_be_written(dtype):
    for size in (0, 1, 1000, LARGE // np.dtype(dtype).itemsize + 3):
        array = arrays.empty_array(size, dtype)
        assert array.shape == (size,)
        assert array.dtype == dtype
        array[:] = 1
        assert array.sum() == size


def test_memory_is_used_again_once_the_array_is_gone():
    first = arrays.empty_array(LARGE, np.uint8)
    place = address(first)
    del first
    assert address(arrays.empty_array(LARGE, np.uint8)) == place


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
    array = arrays.empty_array(LARGE, np.uint8)
    place = address(array)
    seen = look(array)
    del array
    gc.collect()
    other = arrays.empty_array(LARGE, np.uint8)
    assert address(other) != place
    del seen, other
    both = [arrays.empty_array(LARGE, np.uint8) for _ in range(2)]
    assert place in map(address, both)


def test_an_arrow_table_keeps_the_memory_that_it_shows():
    array = arrays.empty_array(LARGE, np.uint8)
    array[:] = 7
    column = pa.array(array)
    del array
    arrays.empty_array(LARGE, np.uint8)[:] = 9
    assert (column.to_numpy() == 7).all()


@pytest.mark.parametrize("size", [10, LARGE + 7])
def test_what_was_left_is_zero_at_first(size):
    arrays.empty_array(size, np.uint8)[:] = 9
    array = arrays.reused_bytes("a use", size)
    assert array.shape == (size,)
    assert not array.any()


def test_what_was_left_is_found_by_the_same_use_alone():
    array = arrays.reused_bytes(("a use", 1), LARGE)
    array[::100] = 7
    place = address(array)
    del array
    others = [arrays.reused_bytes(("a use", 2), LARGE), arrays.empty_array(LARGE, np.uint8)]
    assert place not in map(address, others)
    again = arrays.reused_bytes(("a use", 1), LARGE)
    assert address(again) == place
    assert (again[::100] == 7).all()
    assert np.count_nonzero(again) == len(again[::100])


def test_two_arrays_that_live_at_the_same_time_do_not_overlap():
    blocks = [arrays.empty_array(LARGE + 1000 * k, np.uint8) for k in range(8)]
    for k, array in enumerate(blocks):
        array[:] = k
    assert [list(np.unique(array)) for array in blocks] == [[k] for k in range(8)]


def test_no_more_is_kept_than_the_bound(monkeypatch):
    monkeypatch.setattr(arrays, "MAX_POOLED_BYTES", 6 * LARGE)
    blocks = [arrays.empty_array(LARGE, np.uint8) for _ in range(10)]
    del blocks
    assert 0 < kept() <= 6 * LARGE


def test_threads_never_share_memory():
    wrong = []

    def work(number):
        for _ in range(200):
            array = arrays.empty_array(LARGE, np.uint8)
            array[::4096] = number
            if (array[::4096] != number).any():
                wrong.append(number)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
