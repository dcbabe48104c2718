"""The pictures that frames show, as compiled code holds them: films share them without a copy."""

from overtaking._core import Light, Painting, Sprite, Streaks, Texture, Tile, Veil

__all__ = ["Light", "Painting", "Sprite", "Streaks", "Texture", "Tile", "Veil"]
