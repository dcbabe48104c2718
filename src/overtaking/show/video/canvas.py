"""Pictures and the shapes on them, drawn by compiled code."""

from overtaking._core import Canvas, Drawing

__all__ = ["HEIGHT", "WIDTH", "Canvas", "Drawing"]

WIDTH, HEIGHT = 1280, 400
"""Size of a frame [px]."""
