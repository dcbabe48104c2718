"""Sprites taken from a painted sheet at any place and angle.

A sheet is painted once, with several texels to the pixel, each texel holding what a pixel centred
there would show. A sprite is then a sample of every n-th texel, at sub-pixel places without any
filter: that is what makes a frame cheap.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from overtaking.video.canvas import Sprite

if TYPE_CHECKING:
    from overtaking.video.canvas import U16

_STRAIGHT = 0.35
"""A sheet whose ends are moved by less by a turn is drawn straight [px]."""

_SMALL = 0.12
"""Angle up to which what lies beyond an edge of a sheet stays within its transparent rim [rad]."""

_TURN = 0.0025
"""Step of small angles: the ends of a long truck move by a sixth of a pixel [rad]."""

_MAX_KEPT = 64  # Sprites of a texture, a few megabytes at most.
_MIDDLES = np.arange(2048) + 0.5


@dataclass(frozen=True, slots=True)
class Texture:
    """A painted sheet.

    Attributes:
        luma: As `Sprite.luma`, with `fine` texels to the pixel.
        chroma: As `Sprite.chroma`, with `fine` texels to the pixel of its plane.
        origin: Where the sheet's origin is, from its left upper corner [px].
        fine: Texels to a pixel.
        kept: Sprites that were taken, by angle and place within two pixels; nothing but speed
            depends on them.
    """

    luma: U16
    chroma: U16
    origin: tuple[float, float]
    fine: int
    kept: dict[tuple[int, int, int], tuple[Sprite, int, int]] = field(
        default_factory=dict[tuple[int, int, int], tuple[Sprite, int, int]], repr=False
    )

    def at(self, x: float, y: float, angle: float) -> tuple[Sprite, int, int]:
        """The sheet turned about its origin, which lies at a place on the canvas.

        Args:
            x: Column of the origin, fractions allowed [px].
            y: Row of the origin [px].
            angle: Anticlockwise [rad].

        Returns:
            The sprite, and where its left upper corner belongs: both numbers even.
        """
        turn = round(angle / _TURN)
        if abs(turn) * _TURN >= _SMALL:
            return self._turned(x, y, angle)
        if abs(angle) * self.luma.shape[2] < 2.0 * self.fine * _STRAIGHT:
            turn = 0
        # Sprites recur: there are as many places within two pixels as there are texels.
        period = 2 * self.fine
        (columns, right), (rows, down) = (divmod(round(at * self.fine), period) for at in (x, y))
        key = (turn, right, down)
        if key not in self.kept:
            if len(self.kept) >= _MAX_KEPT:
                self.kept.clear()
            self.kept[key] = self._small(right / self.fine, down / self.fine, turn * _TURN)
        sprite, left, top = self.kept[key]
        return sprite, left + 2 * columns, top + 2 * rows

    def _small(self, x: float, y: float, angle: float) -> tuple[Sprite, int, int]:
        """The sprite for a small angle."""
        sprite, left, top = self._tilted(x, y, angle) if angle else self._straight(x, y)
        kept = (np.ascontiguousarray(one) for one in (sprite.luma, sprite.chroma))
        return Sprite(*kept), left, top

    def _straight(self, x: float, y: float) -> tuple[Sprite, int, int]:
        left = 2 * math.ceil(0.5 * (x - self.origin[0]))
        top = 2 * math.ceil(0.5 * (y - self.origin[1]))
        ahead = (left - x + self.origin[0], top - y + self.origin[1])
        luma = self._every(self.luma, ahead, 2)
        chroma = self._every(self.chroma, (0.5 * ahead[0], 0.5 * ahead[1]), 1)
        return Sprite(luma, chroma), left, top

    def _every(self, texels: U16, ahead: tuple[float, float], pixels: int) -> U16:
        """Every n-th texel from a place on; `pixels` is what two columns of luma are in a plane."""
        fine = self.fine
        first = [round((offset + 0.5) * fine - 0.5) for offset in ahead]
        count = [texels.shape[2 - i] // (fine * pixels) - 1 for i in (0, 1)]
        stop = [first[i] + (count[i] * pixels - 1) * fine + 1 for i in (0, 1)]
        return texels[:, first[1] : stop[1] : fine, first[0] : stop[0] : fine]

    def _tilted(self, x: float, y: float, angle: float) -> tuple[Sprite, int, int]:
        """As `_turned` for small angles, where row and column of a texel are sums of two parts.

        One part depends on the pixel's row and one on its column, so the numbers of all texels are
        one outer sum. Those that fall beyond an edge land on the opposite one or are clipped to a
        corner: all of them are transparent.
        """
        columns, rows = self.luma.shape[2] // self.fine, self.luma.shape[1] // self.fine
        more = 2 * math.ceil(0.25 * columns * abs(math.sin(angle)))
        left = 2 * math.ceil(0.5 * (x - self.origin[0]))
        top = 2 * math.ceil(0.5 * (y - self.origin[1])) - more
        place = (left - x, top - y, math.cos(angle), math.sin(angle))
        size = (columns // 2 - 1, rows // 2 - 1 + more)
        luma = self._summed(self.luma, place, (2 * size[0], 2 * size[1]), 1.0)
        return Sprite(luma, self._summed(self.chroma, place, size, 2.0)), left, top

    def _summed(
        self,
        texels: U16,
        place: tuple[float, float, float, float],
        size: tuple[int, int],
        pixel: float,
    ) -> U16:
        left, top, cosine, sine = place
        width, per_pixel = texels.shape[2], self.fine / pixel
        right = (left + _MIDDLES[: size[0]] * pixel) * per_pixel
        down = (top + _MIDDLES[: size[1]] * pixel) * per_pixel
        column = (right * cosine + self.origin[0] * per_pixel).astype(np.intp)
        column += np.rint(right * sine).astype(np.intp) * width
        row = (down * cosine + self.origin[1] * per_pixel).astype(np.intp) * width
        row -= np.rint(down * sine).astype(np.intp)
        flat = texels.reshape(len(texels), -1)
        return flat.take(row[:, None] + column, axis=1, mode="clip")

    def _turned(self, x: float, y: float, angle: float) -> tuple[Sprite, int, int]:
        cosine, sine = math.cos(angle), math.sin(angle)
        rows, columns = self.luma.shape[1] / self.fine, self.luma.shape[2] / self.fine
        offset = (0.5 * columns - self.origin[0], 0.5 * rows - self.origin[1])
        centre = (
            x + offset[0] * cosine + offset[1] * sine,
            y - offset[0] * sine + offset[1] * cosine,
        )
        reach = (
            0.5 * (columns * abs(cosine) + rows * abs(sine)),
            0.5 * (columns * abs(sine) + rows * abs(cosine)),
        )
        left, top = (2 * math.floor(0.5 * (centre[i] - reach[i])) for i in (0, 1))
        half = [math.ceil(reach[i]) + 1 for i in (0, 1)]
        place = (left - x, top - y, cosine, sine)
        luma = self._gathered(self.luma, place, (2 * half[0], 2 * half[1]), 1.0)
        chroma = self._gathered(self.chroma, place, (half[0], half[1]), 2.0)
        return Sprite(luma, chroma), left, top

    def _gathered(
        self,
        texels: U16,
        place: tuple[float, float, float, float],
        size: tuple[int, int],
        pixel: float,
    ) -> U16:
        """The texel below each pixel; beyond the edges, which are transparent, that of the edge."""
        left, top, cosine, sine = place
        right = left + (np.arange(size[0], dtype=np.float32) + np.float32(0.5)) * pixel
        down = top + (np.arange(size[1], dtype=np.float32)[:, None] + np.float32(0.5)) * pixel
        per_pixel = self.fine / pixel
        column = (right * cosine - down * sine + self.origin[0]) * per_pixel
        row = (right * sine + down * cosine + self.origin[1]) * per_pixel
        height, width = texels.shape[1:]
        np.minimum(np.maximum(row, 0.0, out=row), height - 1, out=row)
        np.minimum(np.maximum(column, 0.0, out=column), width - 1, out=column)
        index = row.astype(np.intp) * width
        index += column.astype(np.intp)
        return texels.reshape(len(texels), -1).take(index, axis=1)
