"""Painted sheets that are put on frames at any place and angle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from overtaking.video.canvas import U16


@dataclass(frozen=True, slots=True)
class Texture:
    """A painted sheet.

    It is painted once, with several texels to the pixel, each texel holding what a pixel centred
    there would show. What is drawn is the texel below the middle of each pixel: places within a
    pixel cost no filter, and that is what makes a frame cheap.

    Attributes:
        luma: As `Sprite.luma`, with `fine` texels to the pixel.
        chroma: As `Sprite.chroma`, with `fine` texels to the pixel of its plane.
        origin: Where the sheet's origin is, from its left upper corner [px].
        fine: Texels to a pixel.
    """

    luma: U16
    chroma: U16
    origin: tuple[float, float]
    fine: int
