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


def batch_refusal(message: str) -> Answer:
    """An error of a batch as a whole."""
    return [refusal(message)]


def errors(answer: Answer) -> list[str]:
    """The error in an answer, or all those in the answer to a batch."""
    match answer:
        case [[0 | True, [str(message)]]]:
            return [message]
        case [[int(), *_]]:
            return []
        case _:
            return [message for one in answer for message in errors(one)]
