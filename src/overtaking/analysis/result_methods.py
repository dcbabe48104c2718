"""Methods of results that draw figures and write pages.

Drawing stands above this package and loads large libraries, so both methods load it by name when
they are called.
"""

from importlib import import_module
from pathlib import Path
from typing import Any


class Plottable:
    """A result that has figures."""

    __slots__ = ()

    def plot(
        self,
        figure: str | None = None,
        *,
        out: str | Path | None = None,
        ax: Any = None,
        width: str = "page",
        policy: str | None = None,
    ) -> Any:
        """Draw a figure of this result.

        Args:
            figure: Name of the figure, needed if the result has several. The error for an unknown
                name lists all names.
            out: File for the figure: `.svg`, `.pdf` or `.png` by its name.
            ax: Axes of Matplotlib to draw into; only for figures with single axes.
            width: `column` (3.5 inches) or `page` (7.16 inches), as in `overtaking.plot`.
            policy: Policy that decides about the classes of twins; None for the default of the
                profile.

        Returns:
            The Matplotlib figure.

        Raises:
            ConfigError: No figure or width has this name, or the figure has several axes.
            MissingExtraError: The extra `plots` is not installed.
            OSError: The file cannot be written.
        """
        plotting = import_module("overtaking.api.reports")
        return plotting.plot(self, figure, out=out, ax=ax, width=width, policy=policy)


class Reportable:
    """A result that has a page with tables, figures and remarks."""

    __slots__ = ()

    def write_report(self, out: str | Path, **options: Any) -> Any:
        """Write this result as a page that needs no network.

        Args:
            out: Folder for the page; files of an earlier report are replaced.
            options: `films` and `progress`, as in `overtaking.write_report`.

        Returns:
            Path of the page and remarks on missing parts; a list of them for a benchmark.

        Raises:
            ConfigError: An option is not for this result.
            OSError: A file cannot be written.
        """
        reports = import_module("overtaking.api.reports")
        return reports.write_report(self, out, **options)
