"""A list of what is on frames: its order, its parts, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest

from overtaking import _core
from overtaking.video.canvas import HEIGHT, WIDTH, Canvas, blank
from overtaking.video.display import Display
from overtaking.video.pictures import Sprite


def square(luma: int, size: int = 8) -> Sprite:
    half = size // 2
    shown, hidden = np.full((1, size, size), luma), np.zeros((1, size, size))
    chroma = np.concatenate([np.full((2, half, half), 128), np.zeros((1, half, half))])
    return Sprite(np.concatenate([shown, hidden]).astype(np.uint16), chroma.astype(np.uint16))


def frames_of(display: Display) -> list[Canvas]:
    frames = [blank() for _ in range(display.num_frames)]
    for number, frame in enumerate(frames):
        display.draw(number, frame)
    return [Canvas(frame) for frame in frames]


def test_what_is_added_later_lies_above_on_every_frame():
    display = Display(3)
    part = display.part()
    part.sprite(square(100), 20, 20)
    part.sprite(square(200), 24, 24, frames=[1])
    part.sprite(square(50), 26, 26)
    shown = [frame.luma[[21, 25, 27], [21, 25, 27]].tolist() for frame in frames_of(display)]
    assert shown == [[100, 100, 50], [100, 200, 50], [100, 100, 50]]


def test_places_may_differ_from_frame_to_frame():
    display = Display(4)
    display.part().sprite(square(100), 2 * np.arange(4), 10)
    first = [int(np.argmax(frame.luma[12] == 100)) for frame in frames_of(display)]
    assert first == [0, 2, 4, 6]


def test_rows_of_a_part_are_counted_from_its_first_and_nothing_is_drawn_beyond_it():
    display = Display(1)
    display.part(40, 60).sprite(square(100), 10, 16)
    luma = frames_of(display)[0].luma
    assert np.flatnonzero(luma[:, 12] == 100).tolist() == [56, 57, 58, 59]


def test_more_may_be_said_of_one_frame_than_of_another():
    display = Display(2)
    which, columns = np.array([1, 0, 2]), np.array([10, 10, 30])
    squares = [square(80), square(90), square(70)]
    display.part().sprites(squares, which, columns, 10, frames=[1, 0, 1])
    one, two = (frame.luma[12, [12, 32]].tolist() for frame in frames_of(display))
    assert (one, two) == ([80, 16], [90, 70])


def test_a_display_may_be_looked_at_in_any_order_and_again():
    display = Display(2)
    display.part().sprite(square(100), np.array([0, 40]), 0)
    frame = blank()
    for number in (1, 0, 1):
        frame[...] = blank()
        display.draw(number, frame)
        assert frame[2, 42 * number] == 100


def items(*numbers: int) -> np.ndarray:
    return np.array([numbers], np.int32)


def test_a_list_that_names_no_picture_is_refused():
    frames = _core.Frames(WIDTH, HEIGHT, 92)
    sprite = _core.item_kinds().index("sprite")
    with pytest.raises(ValueError, match="expected something to draw"):
        frames.play(items(sprite, 0, 0, 0, 0, 0, 0, HEIGHT), np.array([1]))


def test_a_frame_that_is_not_there_and_an_array_that_is_none_are_refused():
    display = Display(1)
    display.part().sprite(square(100), 0, 0)
    with pytest.raises(ValueError, match="there is no 1"):
        display.draw(1, blank())
    with pytest.raises(ValueError, match="a frame: expected 768000"):
        display.draw(0, blank()[:HEIGHT])


def test_a_picture_of_another_shape_is_refused():
    luma, chroma = square(100).planes()
    with pytest.raises(ValueError, match="two components of half its size"):
        Sprite(luma, chroma[:2])
    with pytest.raises(ValueError, match="opacity to 256"):
        Sprite(luma + np.uint16(300), chroma)
