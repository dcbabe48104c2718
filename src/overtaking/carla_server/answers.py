"""The shapes of answers: most results are wrapped, so that a client can tell them from errors."""

from __future__ import annotations

from typing import Any


class Refused(Exception):
    """Something that a client asked for and cannot have; the client is told."""


NOTHING: list[Any] = [[False]]
"""The answer of a call that only does something."""

Answer = list[Any]


def value(result: Any) -> Answer:
    """A result."""
    return [[1, result]]


def refusal(message: str) -> Answer:
    """An error in the place of a result."""
    return [[0, [message]]]


def void_refusal(message: str) -> Answer:
    """An error of a call that only does something."""
    return [[True, [message]]]
