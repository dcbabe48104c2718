"""Frames arrive whole or not at all."""

from __future__ import annotations

import io

import pytest

from overtaking.core.worker_process import read_frame, write_frame

FRAMES = [b"a word", b"", b"\0" * 70_000]


def test_frames_arrive_one_by_one_until_there_are_no_more():
    stream = io.BytesIO()
    for frame in FRAMES:
        write_frame(stream, frame)
    stream.seek(0)
    assert [read_frame(stream) for _ in FRAMES] == FRAMES
    with pytest.raises(EOFError):
        read_frame(stream)


@pytest.mark.parametrize("length", [1, 7, 8, 9, 20])
def test_a_frame_that_is_cut_off_is_the_end(length):
    stream = io.BytesIO()
    write_frame(stream, b"a sentence without an end")
    with pytest.raises(EOFError):
        read_frame(io.BytesIO(stream.getvalue()[:length]))
