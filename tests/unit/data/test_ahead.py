"""Work done ahead comes in order, is bounded, and stops when nobody wants more."""

from __future__ import annotations

import threading
import time

import pytest

from overtaking.core.process_limits import ordered_map


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_results_come_in_order_whatever_takes_longest(threads):
    def work(number: int) -> int:
        time.sleep(0.01 * (number % 3 == 0))
        return number * number

    assert list(ordered_map(work, range(20), threads)) == [n * n for n in range(20)]


def test_no_more_results_wait_than_there_are_threads():
    begun: list[int] = []
    results = ordered_map(lambda number: begun.append(number), range(100), 3)
    next(results)
    time.sleep(0.05)
    assert len(begun) <= 5
    results.close()
    assert len(begun) <= 8


def test_what_fails_in_a_thread_fails_where_it_is_wanted():
    def work(number: int) -> int:
        if number == 3:
            raise ValueError("three")
        return number

    results = ordered_map(work, range(9), 2)
    assert [next(results) for _ in range(3)] == [0, 1, 2]
    with pytest.raises(ValueError, match="three"):
        next(results)


def test_one_thread_works_where_it_is():
    names = set(ordered_map(lambda _: threading.current_thread().name, range(3), 1))
    assert names == {threading.current_thread().name}
