"""Output in IPython: HTML, and the progress of long work below the running cell of a notebook."""

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
"""Name of the argument through which a function reports its progress."""

DELAY_S = 2.0
"""Duration of the work before its progress appears, so that short work shows none [s]."""

_INTERVAL_S = 0.25
"""Shortest time between two updates [s]. A reader cannot follow faster ones, and the notebook
stores each of them."""


def show_progress(function: Callable[P, T]) -> Callable[P, T]:
    """Decorate a function so that it shows its progress in notebooks.

    In a notebook, a call that passes no `progress` shows the progress below the running cell.

    Args:
        function: A function with an argument `progress`, a `ProgressCallback` or None.
    """
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
        title: Text before the numbers: "title: 3 of 10".

    Returns:
        The function; None if no IPython kernel runs this code.
    """
    if "ipykernel" not in sys.modules:
        return None
    shell = _import("IPython").get_ipython()
    return _CellProgress(title) if getattr(shell, "kernel", None) is not None else None


def display(*, html: str, text: str) -> bool:
    """Show a message where IPython runs this code.

    Args:
        html: The message for notebooks.
        text: The same message for terminals.

    Returns:
        Whether IPython runs this code; if not, nothing is shown.
    """
    if "IPython" not in sys.modules or _import("IPython").get_ipython() is None:
        return False
    _import("IPython.display").display({"text/html": html, "text/plain": text}, raw=True)
    return True


def _import(name: str) -> Any:
    """A module of IPython.

    IPython is no dependency of the package: this module imports it only in a process that has
    loaded it already. The package is type-checked without it, so its modules are `Any`.
    """
    return importlib.import_module(name)


class _CellProgress:
    """A progress callback with one line of text below the cell, which each call replaces."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._next_update = time.monotonic() + DELAY_S
        self._handle: Any = None

    def __call__(self, done: int, total: int) -> None:
        """Show the progress, at most every `_INTERVAL_S` and always at the end.

        Args:
            done: Number of steps that are done.
            total: Number of all steps.
        """
        now = time.monotonic()
        is_complete = self._handle is not None and done >= total
        if now < self._next_update and not is_complete:
            return
        self._next_update = now + _INTERVAL_S
        text = {"text/plain": f"{self._title}: {done} of {total}"}
        if self._handle is None:
            display_text = _import("IPython.display").display
            self._handle = display_text(text, raw=True, display_id=True)
        else:
            self._handle.update(text, raw=True)
