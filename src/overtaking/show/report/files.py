"""Files of a report: each appears whole or not at all."""

import os
from pathlib import Path

from overtaking.analysis.stats.formats import table_to_csv, table_to_latex
from overtaking.analysis.stats.table import Table

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


def put_table(folder: Path, table: Table) -> None:
    """Put a table as LaTeX and as CSV into a report.

    Raises:
        OSError: They cannot be written.
    """
    put(folder / TABLES / f"{table.name}.tex", table_to_latex(table).encode())
    put(folder / TABLES / f"{table.name}.csv", table_to_csv(table).encode())


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
