"""A cache of results."""

from __future__ import annotations

import threading
from collections import OrderedDict
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable


class Kept:
    """The latest results of a function of one argument.

    Args:
        most: How many are kept.
        make: The function.
    """

    def __init__(self, most: int, make: Callable[[Any], Any]) -> None:
        """Begin with none."""
        self._most, self._make = most, make
        self._found, self._lock = OrderedDict[Any, Any](), threading.Lock()

    def get(self, key: Any) -> Any:
        """The result for an argument."""
        with self._lock:
            if key in self._found:
                self._found.move_to_end(key)
                return self._found[key]
        made = self._make(key)
        with self._lock:
            self._found[key] = made
            while len(self._found) > self._most:
                self._found.popitem(last=False)
        return made
