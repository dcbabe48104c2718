"""Colours against FFmpeg's conversion, and sprites against their own definition."""

from __future__ import annotations

import av
import numpy as np
import pytest
from tests.support.drawing import drawn

from overtaking.video import palette
from overtaking.video.canvas import HEIGHT, OPAQUE, WIDTH, Canvas, blank, rgb
from overtaking.video.palette import yuv
from overtaking.video.pictures import Sprite, Tile

COLOURS = [palette.EGO, palette.TARGET, palette.WARNING, *palette.PAINT.values(), "#000000"]


def plain(colour: str):
    frame = blank()
    canvas = Canvas(frame)
    y, u, v = yuv(colour)
    canvas.luma[...] = round(y)
    canvas.chroma[...] = np.array([round(u), round(v)])[:, None, None]
    return frame


@pytest.mark.parametrize("colour", COLOURS)
def test_ffmpeg_shows_a_colour_as_it_was_meant(colour):
    frame = av.VideoFrame.from_ndarray(plain(colour), format="yuv420p")
    shown = frame.reformat(format="rgb24", src_colorspace="smpte170m").to_ndarray()
    meant = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    assert np.abs(shown.astype(int) - meant).max() <= 3  # Eight bits, rounded twice.


@pytest.mark.parametrize("colour", COLOURS)
def test_our_pictures_have_the_colours_of_ffmpeg(colour):
    shown = rgb(plain(colour))
    meant = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    assert shown.shape == (HEIGHT, WIDTH, 3)
    assert np.abs(shown.astype(int) - meant).max() <= 3


def sprite(width: int, height: int, opacity: int) -> Sprite:
    def plane(value: int, shape: tuple[int, int]):
        numbers = np.arange(shape[0] * shape[1]).reshape(shape) % 40 + value
        return (numbers * opacity // OPAQUE).astype(np.uint16)

    full, half = (height, width), (height // 2, width // 2)
    keep = OPAQUE - opacity
    return Sprite(
        np.stack([plane(100, full), np.full(full, keep, np.uint16)]),
        np.stack([plane(90, half), plane(150, half), np.full(half, keep, np.uint16)]),
    )


@pytest.mark.parametrize(
    "place", [(-4, -2), (WIDTH - 6, HEIGHT - 4), (-4, HEIGHT - 4), (WIDTH - 6, -2), (20, 30)]
)
def test_what_lies_outside_is_cut_off_and_nothing_else(place):
    one = sprite(12, 8, 100)
    canvas = drawn(lambda part: part.sprite(one, *place))
    luma, _ = one.planes()
    expected = np.full((HEIGHT, WIDTH), 16)
    for row in range(8):
        for column in range(12):
            y, x = place[1] + row, place[0] + column
            if 0 <= y < HEIGHT and 0 <= x < WIDTH:
                expected[y, x] = luma[0, row, column] + 16 * (OPAQUE - 100) // OPAQUE
    assert np.array_equal(canvas.luma, expected)
    inside = [max(place[i], 0) // 2 for i in (0, 1)]
    changed = np.argwhere(canvas.chroma[1] != 128)
    assert changed.min(axis=0).tolist() == inside[::-1]


@pytest.mark.parametrize("place", [(-12, 0), (WIDTH, 0), (0, -8), (0, HEIGHT), (9_000, 9_000)])
def test_a_sprite_beyond_the_edges_changes_nothing(place):
    canvas = drawn(lambda part: part.sprite(sprite(12, 8, OPAQUE), *place))
    assert np.array_equal(canvas.luma, Canvas(blank()).luma)


def test_an_opaque_sprite_and_a_tile_of_it_are_the_same():
    one = sprite(12, 8, OPAQUE)
    luma, chroma = (plane.astype(np.uint8) for plane in one.planes())
    tile = Tile(luma[0], chroma[:2])
    blended = drawn(lambda part: part.sprite(one, 40, 60))
    pasted = drawn(lambda part: part.tile(tile, 40, 60))
    assert np.array_equal(blended.luma, pasted.luma)
    assert np.array_equal(blended.chroma, pasted.chroma)
