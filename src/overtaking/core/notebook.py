"""Output of IPython: links, and progress of long work below the running cell of a notebook."""

import importlib
import inspect
import sys
import time
from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from overtaking.core.progress import ProgressCallback

P = ParamSpec("P")
T = TypeVar("T")

PROGRESS = "progress"
"""Keyword of a function that reports its progress."""

DELAY_S = 2.0
"""Duration of the work before its progress appears [s]."""

_INTERVAL_S = 0.25  # A reader cannot follow faster updates, and each one is stored in the notebook.


def show_progress(function: Callable[P, T]) -> Callable[P, T]:
    """The function; in a notebook, a call without `progress` shows it below the cell."""
    signature = inspect.signature(function)

    @wraps(function)
    def call_with_progress(*args: P.args, **kwargs: P.kwargs) -> T:
        call = signature.bind_partial(*args, **kwargs)  # `progress` may be positional.
        if call.arguments.get(PROGRESS) is None:
            call.arguments[PROGRESS] = notebook_progress(function.__name__)
        return function(*call.args, **call.kwargs)

    return call_with_progress


def notebook_progress(title: str) -> ProgressCallback | None:
    """A function that shows progress below the running cell.

    Args:
        title: Text before the numbers.

    Returns:
        The function; None if no IPython kernel runs this code.
    """
    if "ipykernel" not in sys.modules:
        return None
    shell: Any = importlib.import_module("IPython").get_ipython()
    return _CellProgress(title) if getattr(shell, "kernel", None) is not None else None


def display(*, html: str, text: str) -> bool:
    """Show something where IPython runs this code.

    Args:
        html: For notebooks.
        text: The same for terminals.

    Returns:
        Whether IPython runs this code; if not, nothing is shown.
    """
    if "IPython" not in sys.modules or importlib.import_module("IPython").get_ipython() is None:
        return False
    show: Any = importlib.import_module("IPython.display").display
    show({"text/html": html, "text/plain": text}, raw=True)
    return True


class _CellProgress:
    """One line of text below a cell, which each call replaces."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._next_update = time.monotonic() + DELAY_S
        self._handle: Any = None

    def __call__(self, done: int, total: int) -> None:
        """Show the number of steps that are done, and of all."""
        now = time.monotonic()
        is_complete = self._handle is not None and done >= total
        if now < self._next_update and not is_complete:
            return
        self._next_update = now + _INTERVAL_S
        text = {"text/plain": f"{self._title}: {done} of {total}"}
        if self._handle is None:
            show: Any = importlib.import_module("IPython.display").display
            self._handle = show(text, raw=True, display_id=True)
        else:
            self._handle.update(text, raw=True)
