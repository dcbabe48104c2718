"""Shapes against shapely's areas; sprites lie where they belong at any place and angle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from shapely.geometry import LineString, box
from tests.support.drawing import drawn

from overtaking.video.canvas import OPAQUE, WIDTH
from overtaking.video.sheet import Sheet
from overtaking.video.text import Lettering

SCALE = 10.0
BLACK = "#000000"


def area(sheet: Sheet, texels: float = 4 * SCALE) -> float:
    """Opacity added up, in square units, of so many texels to the unit."""
    luma, _ = sheet.sprite().planes()
    covered = OPAQUE - luma[-1].astype(float)
    return float(covered.sum()) / OPAQUE / texels**2


@pytest.mark.parametrize("radius", [0.0, 0.3, 0.7])
def test_a_rectangle_covers_the_area_that_shapely_says(radius):
    sheet = Sheet((-4.0, 4.0, -2.0, 2.0), SCALE, 4)
    sheet.rect((-2.3, 2.1), (-0.9, 0.85), BLACK, radius=radius)
    shape = box(-2.3 + radius, -0.9 + radius, 2.1 - radius, 0.85 - radius).buffer(radius)
    assert area(sheet) == pytest.approx(shape.area, rel=0.01)


def test_a_frame_covers_the_area_between_two_rectangles():
    sheet = Sheet((-4.0, 4.0, -2.0, 2.0), SCALE, 4)
    sheet.frame((-2.0, 2.0), (-1.0, 1.0), BLACK, line=0.2, radius=0.6)
    outer = box(-1.4, -0.4, 1.4, 0.4).buffer(0.6)
    assert area(sheet) == pytest.approx(outer.area - outer.buffer(-0.2).area, rel=0.02)


def test_what_is_swept_is_the_hull_of_both_ends():
    sheet = Sheet((-6.0, 6.0, -4.0, 4.0), SCALE, 4)
    sheet.swept((-2.0, 2.0), (-1.0, 1.0), (-3.0, 1.5), BLACK, opacity=1.0)
    hull = box(-2.0, -1.0, 2.0, 1.0).union(box(-5.0, 0.5, -1.0, 2.5)).convex_hull
    assert area(sheet) == pytest.approx(hull.area, rel=0.03)  # Its slanting edges are stairs.


def test_a_curve_is_as_long_and_wide_as_shapely_says():
    x = np.linspace(5.0, 95.0, 40, dtype=np.float32)
    y = (20.0 + 12.0 * np.sin(x / 14.0)).astype(np.float32)
    sheet = Sheet((0.0, 100.0, 0.0, 40.0), 1.0)
    sheet.curve(x, y, BLACK, line=2.0)
    length = LineString(np.column_stack([x, y])).length
    assert area(sheet, 1.0) == pytest.approx(2.0 * length, rel=0.03)


@pytest.mark.parametrize("angle", [0.0, 0.002, 0.03, -0.03, 0.11, -0.11, 0.5, -1.2, 3.0])
@pytest.mark.parametrize("place", [(300.0, 100.0), (300.63, 100.27), (301.4, 101.85)])
def test_a_sprite_lies_where_it_belongs_however_it_is_turned(angle, place):
    sheet = Sheet((-4.0, 4.0, -2.0, 2.0), SCALE, 4)
    sheet.rect((-1.0, 3.0), (-0.9, 0.3), BLACK)
    canvas = drawn(lambda part: part.texture(sheet.texture(), place[0], place[1], angle), luma=216)
    dark = (216.0 - canvas.luma) / 200.0
    assert dark.sum() == pytest.approx(4.8 * SCALE**2, rel=0.04)  # A quarter pixel on each edge.
    rows, columns = (np.arange(size) + 0.5 for size in dark.shape)
    centre = (dark.sum(axis=0) @ columns / dark.sum(), dark.sum(axis=1) @ rows / dark.sum())
    ahead, right = SCALE * 1.0, SCALE * -0.3  # Middle of the rectangle, before it is turned.
    expected = (
        place[0] + ahead * math.cos(angle) + right * math.sin(angle),
        place[1] - ahead * math.sin(angle) + right * math.cos(angle),
    )
    assert centre == pytest.approx(expected, abs=0.3)  # Texels are a quarter of a pixel.


def test_chroma_lies_where_luma_does():
    sheet = Sheet((-4.0, 4.0, -2.0, 2.0), SCALE, 4)
    sheet.rect((-1.5, 1.5), (-0.8, 0.8), "#ff0000")
    for angle in (0.0, 0.05, 0.7):
        canvas = drawn(lambda part, turn=angle: part.texture(sheet.texture(), 420.7, 90.3, turn))
        red = canvas.chroma[1].astype(float) - 128.0
        rows, columns = ((np.arange(size) + 0.5) * 2.0 for size in red.shape)
        centre = (red.sum(axis=0) @ columns / red.sum(), red.sum(axis=1) @ rows / red.sum())
        assert centre == pytest.approx((420.7, 90.3), abs=0.3)


def test_a_sprite_reaches_into_the_picture_from_beyond_its_edge():
    sheet = Sheet((-4.0, 4.0, -2.0, 2.0), SCALE, 4)
    sheet.rect((-3.0, 3.0), (-1.0, 1.0), BLACK)
    canvas = drawn(lambda part: part.texture(sheet.texture(), WIDTH + 10.0, 100.0), luma=216)
    assert (216.0 - canvas.luma).sum() / 200.0 == pytest.approx(20.0 * 20.0, rel=0.05)


@pytest.mark.parametrize("place", [(-7, -3), (30, 12), (-7, 12), (100, 100), (-100, 4)])
def test_a_text_that_reaches_beyond_a_sheet_is_cut_off(place):
    text = Lettering(np.ones((8, 14), dtype=np.float32))
    sheet = Sheet((0.0, 40.0, 0.0, 16.0), 1.0)
    sheet.write(text, place[0], place[1], BLACK)
    inside = box(0, 0, 40, 16).intersection(
        box(place[0], place[1], place[0] + 14.0, place[1] + 8.0)
    )
    assert area(sheet, 1.0) == pytest.approx(inside.area)


def test_a_sheet_without_a_size_or_of_a_size_that_no_film_has_is_refused():
    for ends in ((0.0, 0.0), (0.0, 1e9), (0.0, math.nan)):
        with pytest.raises(ValueError, match="2 to 8192 pixels"):
            Sheet((ends[0], ends[1], 0.0, 4.0), SCALE)
    with pytest.raises(ValueError, match="1, 2, 4 or 8 texels"):
        Sheet((0.0, 4.0, 0.0, 4.0), SCALE, 3)


def test_a_curve_without_points_is_refused():
    sheet = Sheet((0.0, 4.0, 0.0, 4.0), SCALE)
    none, one = np.empty(0, np.float32), np.ones(1, np.float32)
    with pytest.raises(ValueError, match="expected points"):
        sheet.curve(none, none, BLACK, line=1.0)
    with pytest.raises(ValueError, match="expected 1 rows, got 0"):
        sheet.curve(one, none, BLACK, line=1.0)
