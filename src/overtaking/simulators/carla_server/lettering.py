"""A few letters of five by seven dots, for the note in each picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.simulators.carla_server.camera import Drawing

_ROWS = 7
_COLUMNS = 5
# Each row of a letter as five bits, from the top.
_LETTERS = {
    "A": (14, 17, 17, 31, 17, 17, 17),
    "D": (30, 17, 17, 17, 17, 17, 30),
    "E": (31, 16, 16, 30, 16, 16, 31),
    "G": (14, 17, 16, 23, 17, 17, 14),
    "I": (14, 4, 4, 4, 4, 4, 14),
    "K": (17, 18, 20, 24, 20, 18, 17),
    "L": (16, 16, 16, 16, 16, 16, 31),
    "N": (17, 25, 21, 19, 17, 17, 17),
    "O": (14, 17, 17, 17, 17, 17, 14),
    "R": (30, 17, 17, 30, 20, 18, 17),
    "T": (31, 4, 4, 4, 4, 4, 4),
    "U": (17, 17, 17, 17, 17, 17, 14),
    "V": (17, 17, 17, 17, 17, 10, 4),
    "W": (17, 17, 17, 21, 21, 27, 17),
    ",": (0, 0, 0, 0, 4, 4, 8),
    ":": (0, 4, 0, 0, 0, 4, 0),
    " ": (0, 0, 0, 0, 0, 0, 0),
}
_MARGIN = 2


def dots(text: str) -> NDArray[np.bool_]:
    """A text as dots, shape (7, 6 per letter); KeyError for other letters."""
    columns = [
        [bool(row >> (_COLUMNS - 1 - k) & 1) for row in _LETTERS[letter]]
        if k < _COLUMNS
        else [False] * _ROWS
        for letter in text
        for k in range(_COLUMNS + 1)
    ]
    return np.array(columns).T


def stamp(drawing: Drawing, size: tuple[int, int], text: str) -> None:
    """Write a text on a dark strip at the bottom left, twice as large on a large picture.

    Args:
        drawing: Gets the shapes.
        size: Width and height of the picture [pixels]; what does not fit is cut off.
        text: Of the letters in this module.
    """
    width, height = size
    scale = max(1, min(width // 360, height // 180))
    pattern = np.kron(np.pad(dots(text), _MARGIN), np.ones((scale, scale), np.bool_))
    top, columns = max(height - len(pattern), 0), min(pattern.shape[1], width)
    drawing.rect((0.0, columns), (top, height), "#000000", opacity=0.67)
    covered = np.where(pattern[: height - top, :columns], np.uint8(255), np.uint8(0))
    drawing.mask(np.ascontiguousarray(covered), (0, top), "#ffffff")
