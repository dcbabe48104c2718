"""Errors of tables of recordings, which name the file and the place in it."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from overtaking.core.errors import ImportFormatError
from overtaking.recordings import messages
from overtaking.recordings.messages import shown

_NEXT_STEP = "use the files as their owners distribute them, or correct the map of columns"


def refused(where: Path | str, what: str, expected: str, got: str) -> ImportFormatError:
    """The error for a file or a part of it that cannot be used.

    Args:
        where: The file, or the name of the table.
        what: The part that is wrong.
        expected: A description of the right content.
        got: The content found.
    """
    place = shown(where.name if isinstance(where, Path) else where, length=80)
    return messages.refused(place, what, expected, shown(got, length=150), _NEXT_STEP)


def refused_cell(
    where: Path | str, row: int, name: str, expected: str, got: str
) -> ImportFormatError:
    """The error for one cell.

    Args:
        where: The file.
        row: Row of the table, from 0; the message counts lines from 1, the first for the names.
        name: Name of the column.
        expected: A description of the right value.
        got: The value found.
    """
    return refused(where, f"line {row + 2}, column {name}", expected, got)


def named(names: Sequence[str], wanted: Iterable[str], where: str) -> dict[str, str]:
    """The name in a table of each wanted column, by the wanted name.

    Args:
        names: The columns of the table.
        wanted: The columns to find. A column whose name differs only in capital letters and blanks
            around it stands for a wanted one if no column has the exact name.
        where: Name of the table in messages.

    Raises:
        ImportFormatError: A column is missing, or there are several of that name.
    """
    name_in_table: dict[str, str] = {}
    for name in wanted:
        exact = [column for column in names if column == name]
        matches = exact or [
            column for column in names if column.strip().casefold() == name.casefold()
        ]
        if len(matches) != 1:
            got = f"{len(matches)} of them" if matches else "none"
            raise refused(where, "line 1", f"a column {name}", got)
        name_in_table[name] = matches[0]
    return name_in_table
