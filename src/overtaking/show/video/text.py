"""A cache of drawn texts."""

from __future__ import annotations

import unicodedata
from functools import cache, lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from overtaking.show.video.canvas import Drawing

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from PIL.ImageFont import FreeTypeFont

    from overtaking.show.video.canvas import Canvas

_MAX_KEPT = 4096  # Speeds from 0 to 300 km/h with every label, and room to spare.
_FINE = 4  # Letters are drawn so many times as large, as their places are whole pixels.
_INSTEAD = str.maketrans({"–": "-", "—": "-", "’": "'", "“": '"', "”": '"', "≤": "<=", "≥": ">="})


class Picture(NamedTuple):
    """A drawing whose left upper corner is its origin.

    Attributes:
        drawing: The drawing.
        width: [px].
        height: [px].
    """

    drawing: Drawing
    width: int
    height: int


@lru_cache(maxsize=_MAX_KEPT)
def line(text: str, size: int, colour: str, *, bold: bool = False) -> Picture:
    """A line of text.

    Args:
        text: What the font lacks is written in similar letters.
        size: Height of the font [px].
        colour: `#rrggbb`.
        bold: Whether the strokes are thicker.
    """
    covered = lettering(text, size, bold=bold)
    drawing = Drawing()
    drawing.mask(covered, (0, 0), colour)
    return Picture(drawing, covered.shape[1], covered.shape[0])


def write_number(canvas: Canvas, text: str, place: tuple[int, int], size: int, colour: str) -> int:
    """Write a text that changes all the time, and give the column after it.

    All digits are equally wide, so that text behind them does not move.
    """
    x, y = place
    for letter in text:
        one = line(letter, size, colour)
        canvas.draw(one.drawing, x, y)
        x += (line("0", size, colour) if letter.isdigit() else one).width
    return x


@lru_cache(maxsize=_MAX_KEPT)
def lettering(text: str, size: int, *, bold: bool = False) -> NDArray[np.uint8]:
    """How much of each pixel a line of text covers, 0 to 255; shape (height, width)."""
    from PIL import Image, ImageDraw

    text, font = _writable(text), _font(_FINE * size)
    stroke = 0.35 * _FINE if bold else 0.0
    width = round(font.getlength(text) + 2.0 * stroke) // _FINE + 1
    height = sum(font.getmetrics()) // _FINE + 1
    image = Image.new("L", (_FINE * width, _FINE * height))
    ImageDraw.Draw(image).text((stroke, 0), text, fill=255, font=font, stroke_width=stroke)
    return np.asarray(image.reduce(_FINE))


@cache
def _font(size: int) -> FreeTypeFont:
    """The font that comes with Pillow, so its version is the same on every machine."""
    from PIL import ImageFont

    font = ImageFont.load_default(size)
    assert isinstance(font, ImageFont.FreeTypeFont), "Pillow was built without FreeType"
    return font


def _writable(text: str) -> str:
    """The text in letters that the font has."""
    plain = unicodedata.normalize("NFKD", text.translate(_INSTEAD))
    return "".join(letter for letter in plain if letter.isascii() or letter in "·°")
