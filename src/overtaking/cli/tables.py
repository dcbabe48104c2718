"""Rows as a table for a terminal."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table


def drawn_rows(
    header: Iterable[str], rows: Iterable[Sequence[str]], *, is_first_whole: bool = False
) -> "Table":
    """A table of texts; what is too wide for its column is folded.

    Args:
        header: Names of the columns.
        rows: The cells of each row.
        is_first_whole: Whether the cells of the first column stay on one line.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for number, name in enumerate(header):
        table.add_column(Text(name), overflow="fold", no_wrap=is_first_whole and number == 0)
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    return table
