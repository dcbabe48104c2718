"""Anti-aliased shapes on a sheet: painted once by compiled code, looked at often."""

from __future__ import annotations

from typing import TYPE_CHECKING

from overtaking.video.palette import yuv
from overtaking.video.pictures import Painting

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from overtaking.video.pictures import Sprite, Texture, Tile
    from overtaking.video.text import Lettering

    F32 = NDArray[np.float32]
    Ends = tuple[float, float]
    """Lower and upper end along an axis."""

FINE = 4
"""Texels to a pixel of sheets that are put at any place and angle."""


class Sheet:
    """Something to paint on, in units of its own; y grows downwards.

    Args:
        box: Left, right, upper and lower end in units.
        scale: Pixels to a unit.
        fine: Texels to a pixel: 1, 2, 4 or 8.

    Raises:
        ValueError: It has no size, or is too large.
    """

    __slots__ = ("_painted",)

    def __init__(self, box: tuple[float, float, float, float], scale: float, fine: int = 1) -> None:
        """A transparent sheet."""
        self._painted = Painting(box[:2], box[2:], scale, fine)

    def fill(self, colour: str) -> None:
        """One colour everywhere."""
        self._painted.fill(yuv(colour))

    def rect(
        self, x: Ends, y: Ends, colour: str, *, opacity: float = 1.0, radius: float = 0.0
    ) -> None:
        """A rectangle, with round corners if it has a radius."""
        self._painted.rect(x, y, yuv(colour), opacity, radius)

    def frame(self, x: Ends, y: Ends, colour: str, *, line: float, radius: float) -> None:
        """The outline of a rectangle with round corners, `line` wide, inside its edges."""
        self._painted.frame(x, y, yuv(colour), line, radius)

    def glow(self, x: float, y: float, reach: float, colour: str, strength: float) -> None:
        """Light around a point that fades towards `reach`."""
        self._painted.glow((x, y), reach, yuv(colour), strength)

    def swept(self, x: Ends, y: Ends, reach: Ends, colour: str, *, opacity: float) -> None:
        """All that a rectangle passes over when it is moved by `reach`."""
        self._painted.swept(x, y, reach, yuv(colour), opacity)

    def curve(self, x: F32, y: F32, colour: str, *, line: float, opacity: float = 1.0) -> None:
        """A line through points with growing x, `line` wide."""
        self._painted.curve(x, y, yuv(colour), line, opacity)

    def write(self, lettering: Lettering, x: int, y: int, colour: str) -> None:
        """Put a text on a sheet of one texel to the pixel, its left upper corner at x and y."""
        luma, chroma = lettering.shares(x % 2, y % 2)
        self._painted.stamp(luma, chroma, (x // 2, y // 2), yuv(colour))

    def sprite(self) -> Sprite:
        """The sheet of one texel to the pixel, as a picture with opacity."""
        return self._painted.sprite()

    def tile(self) -> Tile:
        """The sheet of one texel to the pixel, as a picture that nothing shines through."""
        return self._painted.tile()

    def texture(self) -> Texture:
        """The sheet, to be put at any place and angle; its origin is what it is placed by."""
        return self._painted.texture()
