"""Memoisation of functions of a batch."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

from overtaking.model.batch import IdentityBatch

B = TypeVar("B", bound=IdentityBatch)
T = TypeVar("T")


def once(function: Callable[[B], T]) -> Callable[[B], T]:
    """A function whose result for a batch is kept as long as the batch exists.

    All callers share the result; its arrays must not be changed.
    """
    answers: WeakKeyDictionary[B, T] = WeakKeyDictionary()

    @wraps(function)
    def asked(batch: B) -> T:
        if batch not in answers:
            answers[batch] = function(batch)
        return answers[batch]

    return asked
