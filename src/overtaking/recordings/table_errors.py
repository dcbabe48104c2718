"""Errors of tables of recordings, which name the file and the place in it."""

from pathlib import Path

from overtaking.core.errors import ImportFormatError, OvertakingError
from overtaking.core.files import unreadable_error
from overtaking.recordings import messages
from overtaking.recordings.messages import shown

_NEXT_STEP = "use the files as their owners distribute them, or correct the map of columns"


def refused(
    where: Path | str, what: str, expected: str, got: str, next_step: str = _NEXT_STEP
) -> ImportFormatError:
    """The error for a file or a part of it that cannot be used.

    Args:
        where: The file, or the name of the table.
        what: The part that is wrong.
        expected: A description of the right content.
        got: The content found.
        next_step: Advice for the user.
    """
    place = shown(where.name if isinstance(where, Path) else where, length=80)
    return messages.refused(place, what, expected, shown(got, length=150), next_step)


def unreadable(path: Path, expected: str, error: Exception) -> OvertakingError:
    """The error for a file that could not be read.

    Args:
        path: The file.
        expected: A description of the right content.
        error: What reading it raised.
    """
    refusal = unreadable_error(error, shown(str(path), length=120), ImportFormatError)
    if refusal is not None:
        return refusal
    reason = getattr(error, "strerror", None) or str(error)
    return refused(path, "file", expected, reason)


def refused_cell(
    where: Path | str, row: int | str, name: str, expected: str, got: str
) -> ImportFormatError:
    """The error for one cell.

    Args:
        where: The file.
        row: Place of the row as `RowPlaces.name` gives it, or the index of a row in a text file
            whose first line holds the names.
        name: Name of the column.
        expected: A description of the right value.
        got: The value found.
    """
    place = f"line {row + 2}" if isinstance(row, int) else row
    return refused(where, f"{place}, column {shown(name)}", expected, got)
