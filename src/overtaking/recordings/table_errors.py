"""Errors of tables of recordings, which name the file and the place in it."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from overtaking.core.errors import ImportFormatError
from overtaking.recordings import messages
from overtaking.recordings.messages import shown

_NEXT_STEP = "use the files as their owners distribute them, or correct the map of columns"


def refused(where: Path | str, what: str, expected: str, got: str) -> ImportFormatError:
    """The error for a file that is not what it should be."""
    place = shown(where.name if isinstance(where, Path) else where, length=80)
    return messages.refused(place, what, expected, shown(got, length=150), _NEXT_STEP)


def refused_cell(
    where: Path | str, row: int, name: str, expected: str, got: str
) -> ImportFormatError:
    """The error for one cell.

    Args:
        where: The file.
        row: Row of the table, from 0.
        name: Name of the column.
        expected: What would have been right.
        got: What was there.
    """
    return refused(where, f"line {row + 2}, column {name}", expected, got)


def named(names: Sequence[str], wanted: Iterable[str], where: str) -> dict[str, str]:
    """Name in the table of each wanted column.

    Args:
        names: The columns of the table.
        wanted: The columns to find. A name in other letters, capital or small, is the same if no
            other column has it.
        where: What the table is called in a message.

    Raises:
        ImportFormatError: A column is missing, or there are several of that name.
    """
    found: dict[str, str] = {}
    for name in wanted:
        exact = [column for column in names if column == name]
        same = exact or [one for one in names if one.strip().casefold() == name.casefold()]
        if len(same) != 1:
            got = f"{len(same)} of them" if same else "none"
            raise refused(where, "line 1", f"a column {name}", got)
        found[name] = same[0]
    return found
