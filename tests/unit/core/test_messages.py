"""Messages between a process and its child arrive whole or not at all."""

from __future__ import annotations

import io

import pytest

from overtaking.core.messages import receive, send

MESSAGES = [{"a": (1, 2.5)}, None, b"\0" * 70_000, OSError(28, "No space left", "file")]


def test_messages_arrive_one_by_one_until_there_are_no_more():
    stream = io.BytesIO()
    for message in MESSAGES:
        send(stream, message)
    stream.seek(0)
    *plain, error = [receive(stream) for _ in MESSAGES]
    assert plain == MESSAGES[:-1]
    assert (error.errno, error.filename) == (28, "file")
    with pytest.raises(EOFError):
        receive(stream)


@pytest.mark.parametrize("length", [1, 3, 4, 5, 20])
def test_what_was_cut_off_is_the_end(length):
    stream = io.BytesIO()
    send(stream, "a word that somebody did not finish")
    with pytest.raises(EOFError):
        receive(io.BytesIO(stream.getvalue()[:length]))
