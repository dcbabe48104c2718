"""Rows as tables for a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from rich.table import Table


def open_table(*columns: str, **settings: Any) -> Table:
    """An empty table without lines.

    Args:
        columns: Their heads; a column whose head ends in ">" is aligned to the right.
        settings: Further settings of `rich.table.Table`.
    """
    from rich.table import Table
    from rich.text import Text

    plain: dict[str, Any] = {"box": None, "pad_edge": False, "padding": (0, 2, 0, 0)}
    table = Table(**plain | settings)
    for head in columns:
        side = "right" if head.endswith(">") else "left"
        table.add_column(Text(head.removesuffix(">")), justify=side, overflow="fold")
    return table


def drawn_rows(
    header: Iterable[str],
    rows: Iterable[Sequence[str]],
    *,
    is_first_whole: bool = False,
    **settings: Any,
) -> Table:
    """A table of texts, with a line below its header; long cells are folded.

    Args:
        header: Names of the columns, as in `open_table`.
        rows: The cells of each row.
        is_first_whole: Whether the cells of the first column stay on one line.
        settings: Further settings of `rich.table.Table`.
    """
    from rich import box
    from rich.text import Text

    table = open_table(*header, box=box.SIMPLE_HEAD, padding=(0, 1), **settings)
    table.columns[0].no_wrap = is_first_whole
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    return table


def facts(rows: Iterable[tuple[str, object]]) -> Table:
    """Names in bold, each with its values."""
    from rich.table import Table
    from rich.text import Text

    grid = Table.grid(padding=(0, 2))
    grid.add_column(style="bold")
    grid.add_column(overflow="fold")
    for name, value in rows:
        grid.add_row(name, Text(str(value)))
    return grid
