"""Anti-aliased shapes on a sheet: painted once, looked at often."""

from __future__ import annotations

import copy
import math
from typing import TYPE_CHECKING

import numpy as np

from overtaking.video.canvas import OPAQUE, Sprite
from overtaking.video.palette import yuv
from overtaking.video.texture import Texture

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.video.canvas import U16
    from overtaking.video.text import Lettering

    F32 = NDArray[np.float32]

FINE = 4
"""Texels to a pixel of sheets that sprites are taken from."""

_STEPS_PER_UNIT = 3.0  # Of what is swept; the steps of a slanting edge are then not seen.


class _Grid:
    """One resolution of a sheet.

    Args:
        box: Left, right, upper and lower end in units.
        pixels: Pixels of this plane to a unit.
        fine: Texels to a pixel.
        size: Texels in x and in y.
        components: Colour components, the share that shines through not counted.
    """

    def __init__(
        self,
        box: tuple[float, float, float, float],
        pixels: float,
        fine: int,
        size: tuple[int, int],
        components: int,
    ) -> None:
        self.pixels = pixels
        self.step = 1.0 / (pixels * fine)
        self.x = (box[0] + (np.arange(size[0]) + 0.5) * self.step).astype(np.float32)
        self.y = (box[2] + (np.arange(size[1]) + 0.5) * self.step).astype(np.float32)
        self.texels = np.zeros((components + 1, size[1], size[0]), dtype=np.float32)
        self.texels[-1] = 1.0

    def copy(self) -> _Grid:
        """The same texels, to be painted on apart."""
        other = copy.copy(self)
        other.texels = self.texels.copy()
        return other

    def near(self, axis: F32, low: float, high: float) -> slice:
        """Indices of the texels that something between two places can touch."""
        first = math.floor((low - float(axis[0])) / self.step - 0.5 / (self.pixels * self.step))
        last = math.ceil((high - float(axis[0])) / self.step + 0.5 / (self.pixels * self.step))
        return slice(max(first, 0), max(min(last + 1, len(axis)), 0))

    def cover(self, rows: slice, columns: slice, share: F32, colour: F32) -> None:
        """Lay a colour over some texels; of the last component nothing is added."""
        part = self.texels[:, rows, columns]
        part += share * (colour - part)


class Sheet:
    """Something to paint on, in units of its own; y grows downwards.

    Args:
        box: Left, right, upper and lower end in units.
        scale: Pixels to a unit.
        fine: Texels to a pixel.
    """

    def __init__(self, box: tuple[float, float, float, float], scale: float, fine: int = 1) -> None:
        """A transparent sheet."""
        self.box, self.scale, self.fine = box, scale, fine
        half = [math.ceil((high - low) * scale / 2.0) for low, high in (box[:2], box[2:])]
        size = (half[0] * fine, half[1] * fine)
        self._luma = _Grid(box, scale, fine, (2 * size[0], 2 * size[1]), 1)
        self._chroma = _Grid(box, scale / 2.0, fine, size, 2)

    def fill(self, colour: str) -> None:
        """One colour everywhere."""
        for grid, components in self._planes(colour):
            grid.texels[...] = components

    def copy(self) -> Sheet:
        """A sheet with the same on it."""
        other = Sheet.__new__(Sheet)
        other.box, other.scale, other.fine = self.box, self.scale, self.fine
        other._luma, other._chroma = self._luma.copy(), self._chroma.copy()
        return other

    def rect(
        self,
        x: tuple[float, float],
        y: tuple[float, float],
        colour: str,
        *,
        opacity: float = 1.0,
        radius: float = 0.0,
    ) -> None:
        """A rectangle, with round corners if it has a radius."""
        for grid, components in self._planes(colour):
            columns, rows = grid.near(grid.x, *x), grid.near(grid.y, *y)
            across, down = grid.x[columns], grid.y[rows, None]
            if radius > 0.0:
                share = _rounded(across, down, x, y, radius, grid.pixels)
            else:
                share = _between(across, x, grid.pixels) * _between(down, y, grid.pixels)
            grid.cover(rows, columns, np.float32(opacity) * share, components)

    def frame(
        self,
        x: tuple[float, float],
        y: tuple[float, float],
        colour: str,
        *,
        line: float,
        radius: float,
    ) -> None:
        """The outline of a rectangle with round corners, `line` wide, inside its edges."""
        inner_x, inner_y = (x[0] + line, x[1] - line), (y[0] + line, y[1] - line)
        for grid, components in self._planes(colour):
            columns, rows = grid.near(grid.x, *x), grid.near(grid.y, *y)
            across, down = grid.x[columns], grid.y[rows, None]
            share = _rounded(across, down, x, y, radius, grid.pixels)
            share -= _rounded(across, down, inner_x, inner_y, max(radius - line, 0.0), grid.pixels)
            grid.cover(rows, columns, share, components)

    def glow(self, x: float, y: float, reach: float, colour: str, strength: float) -> None:
        """Light around a point that fades towards `reach`."""
        for grid, components in self._planes(colour):
            columns = grid.near(grid.x, x - reach, x + reach)
            rows = grid.near(grid.y, y - reach, y + reach)
            across, down = (grid.x[columns] - x) / reach, (grid.y[rows, None] - y) / reach
            share = np.maximum(1.0 - across * across - down * down, 0.0)
            faded: F32 = (strength * share * share).astype(np.float32)
            grid.cover(rows, columns, faded, components)

    def swept(
        self,
        x: tuple[float, float],
        y: tuple[float, float],
        reach: tuple[float, float],
        colour: str,
        *,
        opacity: float,
    ) -> None:
        """All that a rectangle passes over when it is moved by `reach`."""
        steps = 1 + math.ceil(max(abs(reach[0]), abs(reach[1])) * _STEPS_PER_UNIT)
        moves = [(reach[0] * step / steps, reach[1] * step / steps) for step in range(steps + 1)]
        for grid, components in self._planes(colour):
            share = np.zeros(grid.texels.shape[1:], dtype=np.float32)
            for right, down in moves:
                across = _between(grid.x, (x[0] + right, x[1] + right), grid.pixels)
                along = _between(grid.y[:, None], (y[0] + down, y[1] + down), grid.pixels)
                np.maximum(share, across * along, out=share)
            share *= np.float32(opacity)
            grid.cover(slice(None), slice(None), share, components)

    def curve(self, x: F32, y: F32, colour: str, *, line: float, opacity: float = 1.0) -> None:
        """A line through points with growing x, `line` wide."""
        for grid, components in self._planes(colour):
            columns = grid.near(grid.x, float(x[0]), float(x[-1]))
            rows = grid.near(grid.y, float(y.min()) - line, float(y.max()) + line)
            across = grid.x[columns]
            inside = _between(across, (float(x[0]), float(x[-1])), grid.pixels)
            height = np.interp(across, x, y).astype(np.float32)
            slope = np.gradient(height, grid.step) if len(height) > 1 else np.zeros_like(height)
            away = np.abs(grid.y[rows, None] - height) / np.sqrt(1.0 + slope * slope)
            share = np.clip((0.5 * line - away) * grid.pixels + 0.5, 0.0, 1.0)
            seen: F32 = (opacity * inside * share).astype(np.float32)
            grid.cover(rows, columns, seen, components)

    def write(self, lettering: Lettering, x: int, y: int, colour: str) -> None:
        """Put a text on a sheet of one texel to the pixel, its left upper corner at x and y."""
        for (grid, components), share in zip(
            self._planes(colour), lettering.shares(x % 2, y % 2), strict=True
        ):
            factor = 1 if grid is self._luma else 2
            row, column = (y - y % 2) // factor, (x - x % 2) // factor
            rows = slice(row, min(row + share.shape[0], len(grid.y)))
            columns = slice(column, min(column + share.shape[1], len(grid.x)))
            part = share[: rows.stop - row, : columns.stop - column]
            grid.cover(rows, columns, part, components)

    def sprite(self) -> Sprite:
        """The sheet of one texel to the pixel, as a sprite."""
        return Sprite(_fixed(self._luma.texels), _fixed(self._chroma.texels))

    def texture(self) -> Texture:
        """The sheet, ready to take sprites from; its origin is what they are placed by."""
        origin = (-self.box[0] * self.scale, -self.box[2] * self.scale)
        return Texture(_fixed(self._luma.texels), _fixed(self._chroma.texels), origin, self.fine)

    def _planes(self, colour: str) -> tuple[tuple[_Grid, F32], tuple[_Grid, F32]]:
        """The two resolutions with the components of a colour in each, and 0 for what is hidden."""
        y, u, v = yuv(colour)
        luma = np.array([y, 0.0], dtype=np.float32)[:, None, None]
        chroma = np.array([u, v, 0.0], dtype=np.float32)[:, None, None]
        return (self._luma, luma), (self._chroma, chroma)


def _between(axis: F32, ends: tuple[float, float], pixels: float) -> F32:
    """Share of a pixel around each place that lies between two ends."""
    scale = np.float32(pixels)
    half = np.float32(0.5)
    begin: F32 = np.clip((axis - np.float32(ends[0])) * scale + half, 0.0, 1.0)
    end: F32 = np.clip((axis - np.float32(ends[1])) * scale + half, 0.0, 1.0)
    return begin - end


def _rounded(
    x: F32,
    y: F32,
    x_ends: tuple[float, float],
    y_ends: tuple[float, float],
    radius: float,
    pixels: float,
) -> F32:
    """Share of each pixel inside a rectangle with round corners, by distance from its edge."""
    across = np.abs(x - np.float32(0.5 * (x_ends[0] + x_ends[1])))
    down = np.abs(y - np.float32(0.5 * (y_ends[0] + y_ends[1])))
    across -= np.float32(0.5 * (x_ends[1] - x_ends[0]) - radius)
    down -= np.float32(0.5 * (y_ends[1] - y_ends[0]) - radius)
    beyond_x, beyond_y = np.maximum(across, 0.0), np.maximum(down, 0.0)
    distance = np.sqrt(beyond_x * beyond_x + beyond_y * beyond_y)
    distance += np.minimum(np.maximum(across, down), 0.0)
    inside: F32 = np.clip((radius - distance) * pixels + 0.5, 0.0, 1.0).astype(np.float32)
    return inside


def _fixed(texels: F32) -> U16:
    """Texels in fixed point, the last component on the scale of opacity."""
    result = (texels + np.float32(0.5)).astype(np.uint16)
    result[-1] = texels[-1] * np.float32(OPAQUE) + np.float32(0.5)
    return result
