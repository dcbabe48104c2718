"""Help pages that fit the width of the terminal."""

from __future__ import annotations

import shlex
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from overtaking.cli.streams import fold_command, terminal_width

EXAMPLE = "Example:\n  "

_DEFAULT_WIDTH = 80
_MAX_WIDTH = 100
_NARROW = 64  # In fewer columns a meaning stands below its option, not beside it.
_MEANING_INDENT = 6

_Formatter: Any = typer.Context.formatter_class


class HelpFormatter(_Formatter):
    """Lays out help pages. Typer's own formatter needs at least 50 columns."""

    def write_dl(self, rows: Any, col_max: int = 30, col_spacing: int = 2) -> None:
        """Write words with their meanings: side by side, or one below the other.

        Args:
            rows: Pairs of a word and its meaning.
            col_max: Greatest width of the column of words.
            col_spacing: Blanks between the columns.
        """
        if self.width >= _NARROW:
            super().write_dl(rows, col_max, col_spacing)
            return
        indent = self.current_indent
        for word, meaning in rows:
            self.write_text(word)
            self.current_indent = _MEANING_INDENT
            self.write_text(meaning)
            self.current_indent = indent


def _help_page(command: Any, context: Any) -> str:
    """The help of a command or group."""
    width = min(terminal_width() or _DEFAULT_WIDTH, _MAX_WIDTH)
    formatter = HelpFormatter(width=width)
    command.format_help(context, formatter)
    return formatter.getvalue().rstrip("\n")


class HelpCommand(TyperCommand):
    """A command whose help fits the terminal."""

    def get_help(self, ctx: Any) -> str:
        """The help page."""
        return _help_page(self, ctx)

    def get_short_help_str(self, limit: int = 45) -> str:
        """The summary for the list of commands, never cut off: the list folds it."""
        del limit
        return super().get_short_help_str(limit=_MAX_WIDTH)

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write the example; where it is folded, it remains a valid shell command."""
        del ctx
        example = (self.epilog or "").partition(EXAMPLE)[2]
        words = shlex.split(example, posix=False)  # Keeps the quotes.
        formatter.write_paragraph()
        formatter.write("  Example:\n")
        for line in fold_command(words, formatter.width - 4):
            formatter.write(f"    {line}\n")


class HelpGroup(TyperGroup):
    """A group of commands whose help fits the terminal."""

    def get_help(self, ctx: Any) -> str:
        """The help page."""
        return _help_page(self, ctx)

    def get_short_help_str(self, limit: int = 45) -> str:
        """The summary for the list of commands, never cut off: the list folds it."""
        del limit
        return super().get_short_help_str(limit=_MAX_WIDTH)
