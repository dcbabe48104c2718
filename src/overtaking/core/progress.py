"""Progress of work that has several parts."""

from collections.abc import Callable

ProgressCallback = Callable[[int, int], None]
"""Called with the number of steps that are done, and of all."""


class ProgressCounter:
    """Counts steps, and reports them.

    Args:
        total: The number of steps.
        progress: Called after each step; None to report nothing.
    """

    def __init__(self, total: int, progress: ProgressCallback | None) -> None:
        """Begin with nothing done."""
        self._done, self._total, self._progress = 0, total, progress

    def __call__(self, number: int = 1) -> None:
        """Add steps that are done."""
        self._done += number
        if self._progress is not None:
            self._progress(self._done, self._total)
