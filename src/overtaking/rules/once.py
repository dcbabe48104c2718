"""What many rules ask about a case is worked out for the first of them."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

from overtaking.model.labels import Case

T = TypeVar("T")


def once(function: Callable[[Case], T]) -> Callable[[Case], T]:
    """A function that remembers what it said of a case as long as the case exists.

    All who ask share the answer; its arrays must not be changed.
    """
    answers: WeakKeyDictionary[Case, T] = WeakKeyDictionary()

    @wraps(function)
    def asked(case: Case) -> T:
        if case not in answers:
            answers[case] = function(case)
        return answers[case]

    return asked
