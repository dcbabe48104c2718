"""Reports of progress."""

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Called with the number of simulations that are done, and of all."""


class Counter:
    """Adds up simulations, and reports their number.

    Args:
        total: How many there will be.
        report: Called with the number that are done, and of all; None to report to nobody.
    """

    def __init__(self, total: int, report: Progress | None) -> None:
        """Start at zero."""
        self._done, self._total, self._report = 0, total, report

    def add(self, simulations: int) -> None:
        """Count simulations that have just been done; 0 reports the total."""
        self._done += simulations
        if self._report is not None:
            self._report(self._done, self._total)
