"""The folder of a report, and its files: each appears whole or not at all."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from overtaking.analysis.stats.formats import table_to_csv, table_to_latex
from overtaking.analysis.stats.table import Table
from overtaking.core.equality import ContentEquality
from overtaking.core.errors import ConfigError
from overtaking.core.files import write_atomically
from overtaking.show.palette import CLASS_COLOURS
from overtaking.show.report.page import figure_block, missing, table_block, view_block

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURES, TABLES, PAGE, VIEW = "figures", "tables", "index.html", "view.html"


@dataclass(frozen=True, slots=True, kw_only=True)
class Written(ContentEquality):
    """What was written.

    Attributes:
        path: The page.
        figures: Names of the figures, each as SVG, PDF and PNG in `figures`.
        tables: Names of the tables, each as LaTeX and CSV in `tables`.
        remarks: What the page could not show, and why.
    """

    path: Path
    figures: tuple[str, ...]
    tables: tuple[str, ...]
    remarks: tuple[str, ...]


class ReportFolder:
    """A report while it is written: each method writes files and returns their HTML.

    Attributes:
        out: The folder, made if missing.
        figures: Names of the figures so far.
        tables: Names of the tables so far.
        remarks: What could not be shown so far, and why.
    """

    def __init__(self, out: Path) -> None:
        """Begin with nothing written."""
        for name in (FIGURES, TABLES):
            (out / name).mkdir(parents=True, exist_ok=True)
        self.out = out
        self.figures: list[str] = []
        self.tables: list[str] = []
        self.remarks: list[str] = []
        self._has_view = False

    def figure(self, name: str, caption: str, draw: Callable[[], "Figure"]) -> str:
        """Draw a figure and write it as SVG, PDF and PNG.

        Args:
            name: Name of its files.
            caption: The words below it.
            draw: Draws it; called a second time for narrow screens.
        """
        from overtaking.show.plots.style import FORMATS, drawn_for, to_svg

        drawn = draw()
        for ending, to_bytes in FORMATS.items():
            write_atomically(self.out / FIGURES / f"{name}{ending}", to_bytes(drawn))
        self.figures.append(name)
        svg = to_svg(drawn)
        with drawn_for("column"):
            return figure_block(name, svg, caption, to_svg(draw()))

    def table(self, table: Table) -> str:
        """Write a table as LaTeX and as CSV."""
        write_atomically(self.out / TABLES / f"{table.name}.tex", table_to_latex(table).encode())
        write_atomically(self.out / TABLES / f"{table.name}.csv", table_to_csv(table).encode())
        self.tables.append(table.name)
        return table_block(table, CLASS_COLOURS)

    def view(self, content: bytes, caption: str) -> str:
        """Write the page in which simulations run, and embed it."""
        write_atomically(self.out / VIEW, content)
        self._has_view = True
        return view_block(VIEW, caption)

    def lacking(self, why: str) -> str:
        """Note what cannot be shown."""
        if why not in self.remarks:
            self.remarks.append(why)
        return missing(why)

    def finish(self, text: str) -> dict[str, Any]:
        """Write the page, and remove files of an earlier report that this report does not have.

        Returns:
            The fields of `Written`.
        """
        write_atomically(self.out / PAGE, text.encode())
        current = {
            FIGURES: (self.figures, {".svg", ".pdf", ".png"}),
            TABLES: (self.tables, {".tex", ".csv"}),
        }
        for name, (names, endings) in current.items():
            for path in (self.out / name).iterdir():
                if path.suffix in endings and path.stem not in names:
                    path.unlink()
        if not self._has_view:
            (self.out / VIEW).unlink(missing_ok=True)
        lists = {"figures": self.figures, "tables": self.tables, "remarks": self.remarks}
        return {"path": self.out / PAGE, **{name: tuple(one) for name, one in lists.items()}}


def put_figure(path: Path, drawing: "Figure") -> None:
    """Write a figure as a whole, in the format that the name of the file ends in.

    Args:
        path: The file; its folder exists.
        drawing: A figure in the design of `show.plots`.

    Raises:
        ConfigError: The name ends in something else than .svg, .pdf or .png.
        OSError: The file cannot be written.
    """
    from overtaking.show.plots.style import FORMATS

    check_figure_file(path)
    write_atomically(path, FORMATS[path.suffix](drawing))


def check_figure_file(path: Path) -> None:
    """Refuse a file name whose ending is not a format of figures.

    Raises:
        ConfigError: The name ends in something else than .svg, .pdf or .png.
    """
    from overtaking.show.plots.style import FORMATS

    if path.suffix not in FORMATS:
        raise ConfigError(
            what="file",
            where=path.name,
            expected=f"a name that ends in {' or '.join(FORMATS)}",
            got=f"the ending {path.suffix or '(none)'}",
            next_step="rename the file",
        )
