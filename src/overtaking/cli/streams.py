"""The standard streams, which may be closed, full, or unable to encode all characters."""

from __future__ import annotations

import codecs
import contextlib
import io
import os
import sys
import unicodedata
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from overtaking.core.representation import as_utf8

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

_ERROR_HANDLER = "overtaking.plain"
_DEFAULT_WIDTH = 80
_SURROGATES = range(0xDC80, 0xDD00)  # Bytes of a file name that are not UTF-8 (PEP 383).

_EQUIVALENTS: Mapping[str, str] = (
    dict.fromkeys("‐‑–—−─━", "-")
    | dict.fromkeys("│┃", "|")
    | dict.fromkeys("‘’′", "'")
    | dict.fromkeys("“”„«»″", '"')
    | dict.fromkeys("✓✔", "+")
    | dict.fromkeys("×✗✘", "x")
    | dict.fromkeys("µ\N{GREEK SMALL LETTER MU}", "u")
    | dict(zip("▁▂▃▄▅▆▇█", "_.-=+*%#", strict=True))
    | dict(zip("·•÷⁄≈↑↓øØłŁıđð", ".*//~^voOlLidd", strict=True))
    | {"→": "->", "←": "<-", "↔": "<->", "⇒": "=>", "≥": ">=", "≤": "<=", "≠": "!=", "±": "+/-"}
    | {"…": "...", "∞": "inf", "√": "sqrt", "°": "deg", "§": "sect.", "€": "EUR"}
    | {"ß": "ss", "æ": "ae", "Æ": "AE", "œ": "oe", "þ": "th"}
)


def prepare_streams() -> None:
    """Open closed standard streams, and let all streams replace characters that they cannot encode.

    Python sets a stream to None if the shell has closed it. The next file that is opened then gets
    the free file descriptor, so the output of a library would be written into that file.
    """
    for descriptor in range(3):
        with contextlib.suppress(OSError):
            os.fstat(descriptor)
            continue
        os.open(os.devnull, os.O_RDWR)  # Takes the lowest free number.
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            mode = "r" if name == "stdin" else "w"
            setattr(sys, name, Path(os.devnull).open(mode, encoding="utf-8"))  # noqa: SIM115
    codecs.register_error(_ERROR_HANDLER, _replace_unencodable)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=_ERROR_HANDLER)


def print_error_line(text: str) -> None:
    """Print a line on standard error, unless that is closed or full."""
    try:
        print(text, file=sys.stderr, flush=True)
    except OSError:
        discard(sys.stderr)


def discard(stream: TextIO) -> None:
    """Discard the further output of a stream, and the output in its buffer.

    Without this, Python tries to write the buffer again when it exits, and prints a second error.
    """
    with contextlib.suppress(OSError, ValueError):  # A stream that is closed, or not a file.
        sink = os.open(os.devnull, os.O_WRONLY)
        os.dup2(sink, stream.fileno())
        os.close(sink)


def terminal_width() -> int | None:
    """Columns that lines of standard output may fill.

    Returns:
        `COLUMNS` of the environment if it is set; else the width of the terminal; None if standard
        output is not a terminal, so that lines may have any length.
    """
    columns = os.environ.get("COLUMNS", "")
    if columns.isdecimal() and int(columns) > 0:
        return int(columns)
    if not sys.stdout.isatty():
        return None
    try:
        width = os.get_terminal_size(sys.stdout.fileno()).columns
    except (OSError, ValueError):
        return _DEFAULT_WIDTH
    return width or _DEFAULT_WIDTH  # Terminals of unknown size report 0.


def fold_command(words: Sequence[str], width: int, label: str = "") -> list[str]:
    """Fold a command into lines of a width; a backslash ends all lines but the last.

    Args:
        words: The words of the command, quoted where a shell needs it; no word is broken.
        width: Columns of a line.
        label: Text before the command.
    """
    single_line = f"{label}{' '.join(words)}"
    if len(single_line) <= width:
        return [single_line]
    lines, line = [], label + words[0]
    for word in words[1:]:
        if len(f"{line} {word} \\") > width and line.strip():
            lines.append(f"{line} \\")
            line = f"  {word}"
        else:
            line = f"{line} {word}"
    return [*lines, line]


def can_encode(text: str, stream: TextIO) -> bool:
    """Whether the encoding of a stream has every character of a text."""
    try:
        text.encode(stream.encoding or "utf-8")
    except UnicodeEncodeError:
        return False
    return True


def plain_equivalent(character: str) -> str:
    """Replace a character by similar ASCII text, such as `->` for an arrow, or by `?`."""
    if character in _EQUIVALENTS:
        return _EQUIVALENTS[character]
    name = unicodedata.name(character, "")
    if name.startswith("GREEK"):
        letter = name.rpartition("LETTER ")[2].partition(" ")[0].lower()
        return letter.capitalize() if "CAPITAL" in name else letter
    if name.startswith("BOX DRAWINGS"):
        return "+"
    parts = unicodedata.normalize("NFKD", character)
    if parts == character:
        return "?"
    base = "".join(part for part in parts if not unicodedata.combining(part))
    return "".join(part if part.isascii() else plain_equivalent(part) for part in base)


def _replace_unencodable(error: UnicodeError) -> tuple[str | bytes, int]:
    """The error handler of the streams (`codecs.register_error`)."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    character = error.object[error.start]
    if ord(character) in _SURROGATES:
        return as_utf8(character), error.start + 1
    return plain_equivalent(character), error.start + 1
