"""SIGTERM ends the work where it is, and only there."""

from __future__ import annotations

import os
import signal
import threading

import pytest

from overtaking.data.interruption import Terminated, termination_raises


def test_a_request_to_end_raises_where_the_work_is():
    with pytest.raises(Terminated), termination_raises():
        os.kill(os.getpid(), signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_a_listener_that_is_there_stays_the_one_who_hears():
    heard: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda number, _: heard.append(number))
    try:
        with termination_raises():
            os.kill(os.getpid(), signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert heard == [signal.SIGTERM]


def test_another_thread_changes_nothing():
    seen: list[object] = []

    def look() -> None:
        with termination_raises():
            seen.append(signal.getsignal(signal.SIGTERM))

    thread = threading.Thread(target=look)
    thread.start()
    thread.join()
    assert seen == [signal.SIG_DFL]


def test_it_is_no_ordinary_exception_that_someone_might_swallow():
    assert not issubclass(Terminated, Exception)
