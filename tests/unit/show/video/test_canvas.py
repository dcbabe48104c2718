"""Colours against FFmpeg's conversion, shapes against shapely's areas, and what is refused."""

from __future__ import annotations

import math

import av
import numpy as np
import pytest
from shapely.geometry import LineString, box
from tests.support.drawing import drawn

from overtaking.model.vehicles import Colour, VehicleKind
from overtaking.show.video import palette
from overtaking.show.video.canvas import HEIGHT, WIDTH, Canvas, Drawing
from overtaking.show.video.vehicles import Body, painted

COLOURS = [palette.EGO, palette.TARGET, palette.WARNING, *palette.PAINT.values(), "#000000"]
SCALE, WHITE = 10.0, "#ffffff"


def area(drawing: Drawing) -> float:
    """Opacity of a white drawing added up, in square units."""
    at = WIDTH / 2.0, HEIGHT / 2.0
    shown = drawn(lambda canvas: canvas.draw_placed([(drawing, *at, 0.0)], SCALE))
    return float(shown.sum()) / 255.0 / SCALE**2


@pytest.mark.parametrize("colour", COLOURS)
def test_ffmpeg_shows_a_colour_as_it_was_meant(colour):
    planes = np.empty((HEIGHT * 3 // 2, WIDTH), np.uint8)
    Canvas(WIDTH, HEIGHT, colour).write_yuv(planes)
    frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
    shown = frame.reformat(format="rgb24", src_colorspace="smpte170m").to_ndarray()
    meant = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    assert np.abs(shown.astype(int) - meant).max() <= 3  # Eight bits, rounded twice.


def test_luma_and_chroma_are_those_of_bt_601():
    """The matrix of ITU-R BT.601-7, section 2.5, in double precision; chroma of two times two."""
    canvas, rng = Canvas(64, 32, "#000000"), np.random.default_rng(5)
    for _ in range(200):
        x, y, red, green, blue = rng.integers(0, (64, 32, 256, 256, 256)).tolist()
        square = Drawing()
        square.rect((x, x + 3.0), (y, y + 2.0), f"#{red:02x}{green:02x}{blue:02x}")
        canvas.draw(square)
    planes = np.empty((48, 64), np.uint8)
    canvas.write_yuv(planes)
    weights = np.array([0.299, 0.587, 0.114])
    rgb = canvas.to_rgb() / 255.0
    luma = rgb @ weights
    assert np.abs(planes[:32] - (16.0 + 219.0 * luma)).max() <= 1.0
    coarse = rgb.reshape(16, 2, 32, 2, 3).mean(axis=(1, 3))
    for place, (part, scale) in enumerate(((2, 1.772), (0, 1.402))):
        chroma = 128.0 + 224.0 * (coarse[:, :, part] - coarse @ weights) / scale
        found = planes[32 + 8 * place : 40 + 8 * place].reshape(16, 32)
        assert np.abs(found - chroma).max() <= 1.5


@pytest.mark.parametrize("radius", [0.0, 0.3, 0.7])
def test_a_rectangle_covers_the_area_that_shapely_says(radius):
    drawing = Drawing()
    drawing.rect((-2.3, 2.1), (-0.9, 0.85), WHITE, radius=radius)
    shape = box(-2.3 + radius, -0.9 + radius, 2.1 - radius, 0.85 - radius).buffer(radius)
    assert area(drawing) == pytest.approx(shape.area, rel=0.01)


def test_a_frame_covers_the_area_between_two_rectangles():
    drawing = Drawing()
    drawing.outline((-2.0, 2.0), (-1.0, 1.0), WHITE, line=0.2, radius=0.6)
    outer = box(-1.4, -0.4, 1.4, 0.4).buffer(0.6)
    assert area(drawing) == pytest.approx(outer.area - outer.buffer(-0.2).area, rel=0.02)


def test_lines_are_as_long_and_wide_as_shapely_says():
    x = np.linspace(-30.0, 30.0, 40)
    y = 12.0 * np.sin(x / 14.0)
    drawing = Drawing()
    drawing.lines([list(zip(x.tolist(), y.tolist(), strict=True))], WHITE, width=0.8)
    assert area(drawing) == pytest.approx(
        0.8 * LineString(np.column_stack([x, y])).length, rel=0.02
    )


@pytest.mark.parametrize("shade", [(-2.0, 1.0), (1.0, -1.0), (-1.0, 0.0), (0.0, 0.0)])
def test_a_shadow_is_the_hull_of_the_body_and_of_where_its_roof_falls(shade):
    body = Body(kind=VehicleKind.TRUCK, colour=Colour.GREY, length=4.0, width=2.0, height=1.5)
    plain, shaded = (painted(body, (*shade, dark), 0.0) for dark in (0.0, 1.0))

    def shown(drawing: Drawing):
        return drawn(lambda canvas: canvas.draw_placed([(drawing, 640.0, 200.0, 0.0)], SCALE), 255)

    along, across = (1.5 * one for one in shade)
    ends = box(-2.0, -1.0, 2.0, 1.0).union(box(-2 + along, -1 + across, 2 + along, 1 + across))
    dark = (shown(shaded) < 60) | (shown(plain) < 255)
    assert dark.sum() / SCALE**2 == pytest.approx(ends.convex_hull.area, rel=0.03)


@pytest.mark.parametrize("angle", [0.0, 0.002, 0.03, -0.11, 0.5, -1.2, 3.0])
@pytest.mark.parametrize("place", [(300.0, 100.0), (300.63, 100.27), (301.4, 101.85)])
def test_a_drawing_lies_where_it_belongs_however_it_is_turned(angle, place):
    drawing = Drawing()
    drawing.rect((-1.0, 3.0), (-0.9, 0.3), WHITE)
    placed = [(drawing, place[0], place[1], angle)]
    shown = drawn(lambda canvas: canvas.draw_placed(placed, SCALE)) / 255.0
    assert shown.sum() == pytest.approx(4.8 * SCALE**2, rel=0.02)
    rows, columns = (np.arange(size) + 0.5 for size in shown.shape)
    centre = (shown.sum(axis=0) @ columns / shown.sum(), shown.sum(axis=1) @ rows / shown.sum())
    ahead, right = SCALE * 1.0, SCALE * -0.3  # Middle of the rectangle, before it is turned.
    expected = (
        place[0] + ahead * math.cos(angle) + right * math.sin(angle),
        place[1] - ahead * math.sin(angle) + right * math.cos(angle),
    )
    assert centre == pytest.approx(expected, abs=0.13)  # Edges lie on quarters of a pixel.


def test_a_glow_fades_to_nothing_at_its_reach():
    drawing = Drawing()
    drawing.glow(0.0, 0.0, 5.0, WHITE, 0.8)
    placed = [(drawing, 300.0, 100.0, 0.0)]
    row = drawn(lambda canvas: canvas.draw_placed(placed, SCALE))[100, 300:360]
    assert row[0] == pytest.approx(0.8 * 255.0, abs=4.0)
    assert (np.diff(row) <= 0.0).all()
    assert row[49:].max() <= 2.0


@pytest.mark.parametrize("place", [(-7, -3), (WIDTH - 7, HEIGHT - 3), (30, 12), (5000, 4)])
def test_a_mask_that_reaches_beyond_the_picture_is_cut_off(place):
    drawing = Drawing()
    drawing.mask(np.full((8, 14), 255, np.uint8), (0, 0), WHITE)
    shown = drawn(lambda canvas: canvas.draw(drawing, place[0], place[1]))
    x, y = place
    inside = box(0, 0, WIDTH, HEIGHT).intersection(box(x, y, x + 14, y + 8))
    assert shown.sum() / 255.0 == inside.area


def test_chosen_columns_of_another_picture_are_copied():
    other, canvas = Canvas(20, 4, WHITE), Canvas(30, 10, "#000000")
    canvas.copy_columns(other, 3, 5, (2, 9))
    rows, columns = np.nonzero(canvas.to_rgb()[:, :, 0])
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (5, 8, 3, 9)


def test_a_night_without_lamps_leaves_the_moonlight_and_touches_no_other_row():
    canvas = Canvas(32, 20, "#c8c8c8")
    canvas.darken((4, 13), 64, [])
    rows = canvas.to_rgb()[:, 5, 0]
    assert set(rows[4:13].tolist()) == {50}
    assert set(np.delete(rows, np.arange(4, 13)).tolist()) == {200}


@pytest.mark.parametrize("place", [(-3, -2), (13, 8), (-40, 0), (0, 90), (2**31 - 1, -(2**31))])
def test_a_light_that_reaches_beyond_the_picture_is_cut_off(place):
    canvas = Canvas(32, 20, "#c8c8c8")
    canvas.darken((0, 20), 0, [(np.full((4, 6), 255, np.uint8), *place)])
    left, top = 2 * place[0], 2 * place[1]
    inside = box(0, 0, 32, 20).intersection(box(left, top, left + 12, top + 8))
    assert np.count_nonzero(canvas.to_rgb()[:, :, 0]) == inside.area


SHARES, OTHER = np.zeros(32, np.uint16), Canvas(32, 20, WHITE)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (
            lambda canvas: canvas.copy_columns(OTHER, 1, 0, (0, 32)),
            "columns: expected some of both pictures",
        ),
        (
            lambda canvas: canvas.copy_columns(OTHER, 0, 1, (0, 32)),
            "rows: expected some of the canvas",
        ),
        (
            lambda canvas: canvas.copy_columns(OTHER, 0, 0, (9, 8)),
            "columns: expected some of both pictures",
        ),
        (
            lambda canvas: canvas.blend_colour((0, 21), SHARES, WHITE),
            "rows: expected some of the canvas",
        ),
        (
            lambda canvas: canvas.blend_colour((5, 4), SHARES, WHITE),
            "rows: expected some of the canvas",
        ),
        (
            lambda canvas: canvas.blend_colour((0, 20), SHARES[1:], WHITE),
            "hidden: expected 32 numbers, got 31",
        ),
        (
            lambda canvas: canvas.blend_colour((0, 20), SHARES, "red"),
            "colour: expected #rrggbb, got red",
        ),
        (lambda canvas: canvas.darken((0, 22), 9, []), "rows: expected some of the canvas"),
        (lambda canvas: canvas.darken((0, 2**60), 9, []), "rows: expected some of the canvas"),
        (
            lambda canvas: canvas.darken((2**62, 2**62 + 1), 9, []),
            "rows: expected some of the canvas",
        ),
        (lambda _: Canvas(31, 20, WHITE).darken((0, 20), 9, []), "canvas: expected an even width"),
        (
            lambda _: Canvas(32, 19, WHITE).write_yuv(np.empty(912, np.uint8)),
            "canvas: expected an even width and height",
        ),
        (
            lambda canvas: canvas.write_yuv(np.empty(3, np.uint8)),
            "a frame: expected 960 numbers, got 3",
        ),
        (lambda _: Canvas(0, 4, WHITE), "canvas: expected a width and a height"),
        (lambda _: Drawing().rect((0, 1), (0, 1), "#12345"), "colour: expected #rrggbb"),
        (lambda _: Drawing().mask(np.empty((0, 4), np.uint8), (0, 0), WHITE), "mask: expected"),
    ],
)
def test_what_cannot_be_drawn_is_refused(spoil, message):
    with pytest.raises(ValueError, match=message):
        spoil(Canvas(32, 20, WHITE))
