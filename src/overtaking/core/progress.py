"""Progress of work that has several parts."""

from collections.abc import Callable

ProgressCallback = Callable[[int, int], None]
"""A function that receives the number of completed steps and of all steps."""


class ProgressCounter:
    """Counts completed steps and reports them.

    Args:
        total: Number of all steps.
        progress: The function to call after each step; None for no report.
    """

    def __init__(self, total: int, progress: ProgressCallback | None) -> None:
        """Start at zero."""
        self._completed, self._total, self._progress = 0, total, progress

    def __call__(self, number: int = 1) -> None:
        """Add completed steps."""
        self._completed += number
        if self._progress is not None:
            self._progress(self._completed, self._total)
