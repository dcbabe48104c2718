"""What the readers of all formats say when they refuse a file."""

from overtaking.core.errors import ImportFormatError
from overtaking.core.representation import as_utf8


def refused(where: str, what: str, expected: str, got: str, next_step: str) -> ImportFormatError:
    """The error for a file that cannot be used.

    Args:
        where: The file, and the line in it.
        what: The part that is wrong.
        expected: What would have been right.
        got: The value found.
        next_step: What the reader can do now, as an imperative.
    """
    return ImportFormatError(
        where=where, what=what, expected=expected, got=got, next_step=next_step
    )


def shown(text: str, *, length: int = 40) -> str:
    """A text of unknown origin for a message: printable, on one line and short."""
    clean = "".join(char if char.isprintable() else "?" for char in as_utf8(text))
    return clean if len(clean) <= length else clean[: length - 3] + "..."
