"""Texts, drawn once and kept."""

from __future__ import annotations

import math
import unicodedata
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from overtaking.video.canvas import OPAQUE
from overtaking.video.palette import yuv
from overtaking.video.pictures import Sprite

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from PIL.ImageFont import FreeTypeFont

_MAX_KEPT = 4096  # Speeds from 0 to 300 km/h with every label, and room to spare.
_INSTEAD = str.maketrans({"–": "-", "—": "-", "’": "'", "“": '"', "”": '"', "≤": "<=", "≥": ">="})


class Lettering:
    """A text as the share of each pixel that it covers.

    Args:
        share: Shape (height, width), 0 to 1.
    """

    __slots__ = ("_share",)

    def __init__(self, share: NDArray[np.float32]) -> None:
        """Keep it."""
        self._share = share

    @property
    def width(self) -> int:
        """Width [px]."""
        return self._share.shape[1]

    @property
    def height(self) -> int:
        """Height [px]."""
        return self._share.shape[0]

    def shares(
        self, right: int = 0, down: int = 0
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The shares moved by one pixel or none, and the same at half the resolution.

        Width and height of the first are even, as chroma has a pixel for two times two of luma.
        """
        height, width = self._share.shape
        size = (height + down + (height + down) % 2, width + right + (width + right) % 2)
        share = np.zeros(size, dtype=np.float32)
        share[down : down + height, right : right + width] = self._share
        rows = share[0::2] + share[1::2]
        return share, np.asarray((rows[:, 0::2] + rows[:, 1::2]) * 0.25, dtype=np.float32)


@lru_cache(maxsize=_MAX_KEPT)
def lettering(text: str, size: int, *, bold: bool = False) -> Lettering:
    """A line of text.

    Args:
        text: What the font lacks is written in similar letters.
        size: Height of the font [px].
        bold: Whether the strokes are thicker.
    """
    font = _font(size)
    text = _writable(text)
    ascent, descent = font.getmetrics()
    stroke = 0.35 if bold else 0.0
    width = round(font.getlength(text)) + (2 if bold else 1)
    from PIL import Image, ImageDraw

    image = Image.new("L", (max(width, 1), ascent + descent))
    ImageDraw.Draw(image).text((0, 0), text, fill=255, font=font, stroke_width=stroke)
    return Lettering(np.asarray(image, dtype=np.float32) / np.float32(255.0))


@cache
def _font(size: int) -> FreeTypeFont:
    """The font that comes with Pillow, which everybody therefore has in the same version."""
    from PIL import ImageFont

    font = ImageFont.load_default(size)
    assert isinstance(font, ImageFont.FreeTypeFont), "Pillow was built without FreeType"
    return font


def _writable(text: str) -> str:
    """The text in letters that the font has."""
    plain = unicodedata.normalize("NFKD", text.translate(_INSTEAD))
    return "".join(letter for letter in plain if letter.isascii() or letter in "·°")


def line(text: str, size: int, colour: str, *, bold: bool = False) -> Sprite:
    """A line of text as a sprite, for texts that come again."""
    return _line(text, size, colour, bold)


def spelled(text: str, size: int, colour: str, *, bold: bool = False) -> list[Sprite]:
    """The letters of a text, to be put beside each other, for numbers that change all the time.

    All digits are equally wide, so that what stands behind them does not tremble.
    """
    return [_letter(letter, size, colour, bold) for letter in text]


@lru_cache(maxsize=_MAX_KEPT)
def _line(text: str, size: int, colour: str, bold: bool) -> Sprite:
    return _coloured(lettering(text, size, bold=bold).shares(), colour)


@lru_cache(maxsize=_MAX_KEPT)
def _letter(letter: str, size: int, colour: str, bold: bool) -> Sprite:
    """A letter in a cell of even width."""
    drawn = lettering(letter, size, bold=bold)
    cell = lettering("0", size, bold=bold).width if letter.isdigit() else drawn.width
    spare = 2 * math.ceil(0.5 * (cell - 1)) - drawn.width
    luma, chroma = drawn.shares(right=max(spare // 2, 0) % 2)
    width = 2 * math.ceil(0.5 * (cell - 1))
    return _coloured((_widened(luma, width), _widened(chroma, width // 2)), colour)


def _widened(share: NDArray[np.float32], width: int) -> NDArray[np.float32]:
    """The same in a cell of another width."""
    cell = np.zeros((share.shape[0], width), dtype=np.float32)
    kept = min(width, share.shape[1])
    cell[:, :kept] = share[:, :kept]
    return cell


def _coloured(shares: tuple[NDArray[np.float32], NDArray[np.float32]], colour: str) -> Sprite:
    """Shares as a sprite of one colour."""
    y, u, v = yuv(colour)
    luma, chroma = shares
    return Sprite(
        np.rint(np.stack([luma * y, (1.0 - luma) * OPAQUE])).astype(np.uint16),
        np.rint(np.stack([chroma * u, chroma * v, (1.0 - chroma) * OPAQUE])).astype(np.uint16),
    )
