"""Integers of several libraries and types, for tests of what takes a whole number."""

from __future__ import annotations

import numpy as np


class OwnInteger:
    """A type that is no number of Python, but an index."""

    def __init__(self, number: int) -> None:
        self._number = number

    def __index__(self) -> int:
        return self._number


INTEGER_TYPES = {
    "int8": np.int8,
    "uint8": np.uint8,
    "int32": np.int32,
    "uint32": np.uint32,
    "int64": np.int64,
    "uint64": np.uint64,
    "array without axes": lambda number: np.array(number, np.uint8),
    "own type": OwnInteger,
}
"""Functions that turn an integer of Python into another one, by name."""

NO_INTEGERS = [True, np.bool_(True), np.array(True), 7.0, np.float64(7), "7", [7], np.array([7])]
"""Values that no function takes for the integer 7."""
