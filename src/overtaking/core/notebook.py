"""Output in IPython: HTML messages, and the progress of long calls below the cell of a notebook.

Outside IPython (a script, a plain Python shell) nothing is shown. `model.checks` decorates each
public function that has an argument `progress` with `show_progress`.
"""

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
"""Name of the argument that takes a function's progress callback."""

DELAY_S = 2.0
"""Time from the call to the first display of its progress [s]. Shorter calls show no progress.
Chosen."""

_INTERVAL_S = 0.25
"""Shortest time between two updates [s]. Chosen: users cannot follow faster updates, and the
notebook file stores each of them."""


def show_progress(function: Callable[P, T]) -> Callable[P, T]:
    """Decorate a function so that a call without `progress` shows its progress in notebooks.

    Args:
        function: A function with an argument `progress`: a `ProgressCallback`, which the function
            calls with the numbers of completed and of all steps, or None for no callback.

    Returns:
        The function. If a notebook runs the call and the caller passes no callback, it gets one
        that displays the numbers below the running cell.
    """
    signature = inspect.signature(function)

    @wraps(function)
    def call_with_progress(*args: P.args, **kwargs: P.kwargs) -> T:
        # `bind_partial` finds `progress` also as a positional argument, and leaves errors about
        # missing arguments to the call itself.
        call = signature.bind_partial(*args, **kwargs)
        if call.arguments.get(PROGRESS) is None:
            call.arguments[PROGRESS] = notebook_progress(function.__name__)
        return function(*call.args, **call.kwargs)

    return call_with_progress


def notebook_progress(title: str) -> ProgressCallback | None:
    """Make a callback that shows progress below the running cell.

    Args:
        title: Text before the numbers: "title: 3 of 10".

    Returns:
        The callback; None if no notebook runs this code.
    """
    if "ipykernel" not in sys.modules:  # The package that connects IPython with a notebook.
        return None
    # A script can load ipykernel as well, but it has no IPython shell, or one without a kernel.
    shell = _import_loaded("IPython").get_ipython()
    return _CellProgress(title) if getattr(shell, "kernel", None) is not None else None


def display(*, html: str, text: str) -> bool:
    """Show a message if IPython runs this code.

    Args:
        html: The message in HTML, which notebooks show.
        text: The same message as plain text, which IPython shows in a terminal.

    Returns:
        Whether IPython runs this code and shows the message.
    """
    if "IPython" not in sys.modules or _import_loaded("IPython").get_ipython() is None:
        return False
    _import_loaded("IPython.display").display({"text/html": html, "text/plain": text}, raw=True)
    return True


def _import_loaded(name: str) -> Any:
    """A module of IPython in a process that has loaded IPython already.

    Not an `import` statement: this package does not require IPython, and type checkers, which run
    without it, would report the statement. So the type of the module is `Any`.
    """
    return importlib.import_module(name)


class _CellProgress:
    """A progress callback that displays one line of text below the cell and then updates it."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._next_update = time.monotonic() + DELAY_S
        self._displayed_line: Any = None  # IPython's handle of the line; None before its display.

    def __call__(self, num_completed: int, num_steps: int) -> None:
        """Update the line at most once in `_INTERVAL_S`; the last step always updates a shown line.

        Args:
            num_completed: Number of completed steps.
            num_steps: Number of all steps.
        """
        now = time.monotonic()
        is_last_update = self._displayed_line is not None and num_completed >= num_steps
        if now < self._next_update and not is_last_update:
            return
        self._next_update = now + _INTERVAL_S
        text = {"text/plain": f"{self._title}: {num_completed} of {num_steps}"}
        if self._displayed_line is None:
            display_text = _import_loaded("IPython.display").display
            self._displayed_line = display_text(text, raw=True, display_id=True)
        else:
            self._displayed_line.update(text, raw=True)
