"""The folder of a report, and its files: each appears whole or not at all."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from overtaking.analysis.stats.formats import table_to_csv, table_to_latex
from overtaking.analysis.stats.table import Table
from overtaking.core.errors import MissingExtraError
from overtaking.show.report.page import figure_block, missing, table_block

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURES, TABLES, PAGE = "figures", "tables", "index.html"


def put(path: Path, content: bytes) -> None:
    """Put a file into its place, whole or not at all.

    Raises:
        OSError: It cannot be written.
    """
    partial = path.with_name(path.name + ".partial")
    try:
        with partial.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def make_folders(folder: Path) -> None:
    """Make the folders of a report, where they are missing.

    Raises:
        OSError: They cannot be made.
    """
    for name in (FIGURES, TABLES):
        (folder / name).mkdir(parents=True, exist_ok=True)


def remove_stale(folder: Path, figures: set[str], tables: set[str]) -> None:
    """Remove the figures and tables of an earlier report that this one does not have.

    Args:
        folder: The report.
        figures: Names of its figures.
        tables: Names of its tables.
    """
    known = {FIGURES: (figures, {".svg", ".png"}), TABLES: (tables, {".tex", ".csv"})}
    for name, (names, endings) in known.items():
        for path in (folder / name).iterdir():
            if path.suffix in endings and path.stem not in names:
                path.unlink()


class ReportFolder:
    """A report while it is written: each method writes files and returns their HTML.

    Attributes:
        out: The folder, made if missing.
        figures: Names of the figures so far.
        tables: Names of the tables so far.
        remarks: What could not be shown so far, and why.
        colours: Colour of each class; none without the extra that draws.
    """

    def __init__(self, out: Path) -> None:
        """Begin with nothing written."""
        make_folders(out)
        self.out = out
        self.figures: list[str] = []
        self.tables: list[str] = []
        self.remarks: list[str] = []
        self.colours = _class_colours()

    def figure(
        self, name: str, caption: str, draw: Callable[[], "Figure"], *, for_phone: bool = True
    ) -> str:
        """Draw a figure and write it as SVG and PNG.

        Args:
            name: Name of its files.
            caption: The words below it.
            draw: Draws it.
            for_phone: Whether to draw it once more for narrow screens.
        """
        from overtaking.show.plots.style import narrow, to_png, to_svg

        drawn = draw()
        svg = to_svg(drawn)
        put(self.out / FIGURES / f"{name}.svg", svg)
        put(self.out / FIGURES / f"{name}.png", to_png(drawn))
        self.figures.append(name)
        if not for_phone:
            return figure_block(name, svg, caption)
        with narrow():
            return figure_block(name, svg, caption, to_svg(draw()))

    def table(self, table: Table) -> str:
        """Write a table as LaTeX and as CSV."""
        put(self.out / TABLES / f"{table.name}.tex", table_to_latex(table).encode())
        put(self.out / TABLES / f"{table.name}.csv", table_to_csv(table).encode())
        self.tables.append(table.name)
        return table_block(table, self.colours)

    def lacking(self, why: str) -> str:
        """Note what cannot be shown."""
        if why not in self.remarks:
            self.remarks.append(why)
        return missing(why)

    def finish(self, text: str) -> Path:
        """Write the page, and remove the files of an earlier report that this one does not have."""
        put(self.out / PAGE, text.encode())
        remove_stale(self.out, set(self.figures), set(self.tables))
        return self.out / PAGE


def _class_colours() -> dict[str, str]:
    try:
        from overtaking.show.plots.style import CLASS_COLOURS
    except MissingExtraError:
        return {}
    return CLASS_COLOURS
