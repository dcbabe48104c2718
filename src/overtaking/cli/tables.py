"""Tables that fit terminals of any width."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

from rich.cells import cell_len
from rich.console import Group
from rich.table import Table
from rich.text import Text

from overtaking.cli.streams import fold_command

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from rich.console import Console, ConsoleOptions, RenderableType

    from overtaking.analysis.stats.table import Table as ResultTable

UNBOUNDED = 1_000_000  # Columns of output that is not a terminal; wider than any line.

_GAP = 2  # Blanks between two columns.
_READABLE = 16  # Columns that a text needs so that its lines do not break at every word.
_INDENT = 2


@dataclass(slots=True, kw_only=True)
class FittingTable:
    """A table that is laid out for the width of the terminal.

    Words are never broken. If the columns do not fit, a table of numbers is split into blocks of
    columns, one below the other. Any other table becomes a list of records: the labels of a row,
    and below them a line for each other cell.

    Attributes:
        heads: Head of each column; empty for a table without heads.
        is_number: Whether each column is aligned to the right.
        num_labels: Number of first columns that name a row.
        title: A line above it.
        has_rule: Whether there is a rule below the heads.
        rows: Cells of each row.
    """

    heads: tuple[Text, ...]
    is_number: tuple[bool, ...]
    num_labels: int = 1
    title: str = ""
    has_rule: bool = False
    rows: list[tuple[Text, ...]] = field(default_factory=list["tuple[Text, ...]"])

    def add_row(self, *cells: str | Text, style: str = "") -> None:
        """Add a row; cells that are left out are empty.

        Args:
            cells: Its cells.
            style: Style of all of them.
        """
        texts = [Text(cell) if isinstance(cell, str) else cell.copy() for cell in cells]
        texts += [Text()] * (len(self.is_number) - len(texts))
        for text in texts:
            text.stylize_before(style)
        self.rows.append(tuple(texts))

    def __rich_console__(
        self, console: Console, options: ConsoleOptions
    ) -> Iterator[RenderableType]:
        """Lay it out (a protocol of Rich)."""
        if self.title:
            yield Prose(Text(self.title, style="bold"))
        blocks = self._blocks(options.max_width)
        if blocks is None:
            yield from self._records(options.max_width)
            return
        for index, (columns, widths) in enumerate(blocks):
            if index:
                yield Text()
            yield self._grid(columns, widths, options)

    def _blocks(self, width: int) -> list[tuple[list[int], list[int]]] | None:
        """Blocks of columns and their widths, each with the labels; None if blocks do not fit."""
        columns = list(range(len(self.is_number)))
        labels, values = columns[: self.num_labels], columns[self.num_labels :]
        if widths := self._fit(columns, width):
            return [(columns, widths)]
        if not values or not all(self.is_number[column] for column in values):
            return None
        blocks: list[tuple[list[int], list[int]]] = []
        while values:
            counts = range(len(values), 1 if len(values) > 1 else 0, -1)
            fitting = ((count, self._fit(labels + values[:count], width)) for count in counts)
            count, widths = next(((count, fit) for count, fit in fitting if fit), (0, []))
            if not widths:
                return None
            blocks.append((labels + values[:count], widths))
            values = values[count:]
        return blocks

    def _fit(self, columns: Sequence[int], width: int) -> list[int]:
        """Widths of some columns that break no word; empty if the columns do not fit."""
        space = width - _GAP * (len(columns) - 1)
        natural = [max(map(_longest_line, self._column(column))) for column in columns]
        if sum(natural) <= space:
            return natural
        smallest = [
            self._smallest(column, most) for column, most in zip(columns, natural, strict=True)
        ]
        spare = space - sum(smallest)
        if spare < 0:
            return []
        widths = list(smallest)
        # Heads of numbers first: a text of several lines reads better than a head of several.
        for is_number in (True, False):
            wishes = [
                (most - least) * (self.is_number[column] is is_number)
                for column, most, least in zip(columns, natural, smallest, strict=True)
            ]
            shares = [min(wish, wish * spare // max(sum(wishes), 1)) for wish in wishes]
            widths = [width + share for width, share in zip(widths, shares, strict=True)]
            spare -= sum(shares)
        return widths

    def _smallest(self, column: int, natural: int) -> int:
        """Least width of a column."""
        words = max(map(_longest_word, self._column(column)))
        if self.is_number[column]:
            return max(words, *(map(_longest_line, (row[column] for row in self.rows))), 0)
        return max(words, min(natural, _READABLE))

    def _column(self, column: int) -> list[Text]:
        """The head and the cells of a column."""
        return [*self.heads[column : column + 1], *(row[column] for row in self.rows), Text()]

    def _grid(
        self, columns: Sequence[int], widths: Sequence[int], options: ConsoleOptions
    ) -> Table:
        """Some columns as a table of Rich."""
        grid = Table(
            box=None,
            pad_edge=False,
            padding=(0, _GAP, 0, 0),
            show_header=bool(self.heads),
            header_style="bold",
        )
        for column, width in zip(columns, widths, strict=True):
            grid.add_column(
                self.heads[column] if self.heads else "",
                width=width,
                justify="right" if self.is_number[column] else "left",
                overflow="fold",
            )
        if self.has_rule and self.heads and options.max_width < UNBOUNDED:
            line = "-" if options.ascii_only else "─"
            grid.add_row(*(Text(line * width, style="dim") for width in widths))
        for row in self._rows_without_repeats():
            grid.add_row(*(row[column] for column in columns))
        return grid

    def _rows_without_repeats(self) -> Iterator[tuple[Text, ...]]:
        """The rows; labels that repeat those of the row before are left empty."""
        if self.num_labels == 1 or not self.heads:
            yield from self.rows
            return
        yield from self.rows[:1]
        for before, row in pairwise(self.rows):
            num_same = 0
            while num_same < self.num_labels - 1 and row[num_same] == before[num_same]:
                num_same += 1
            yield (*(Text() for _ in range(num_same)), *row[num_same:])

    def _records(self, width: int) -> Iterator[Text]:
        """Each row as its labels, and below them a line for each other cell."""
        if not self.heads:
            yield from self._named_values(width)
            return
        heads = [head.plain for head in self.heads[self.num_labels :]]
        head_width = max(map(cell_len, heads), default=0)
        for index, row in enumerate(self.rows):
            label = self._label(row)
            if index and label.plain:
                yield Text()
            label.stylize_before("bold")
            yield from _hanging(label, width, Text())
            for head, cell in zip(heads, row[self.num_labels :], strict=True):
                name = Text(" " * _INDENT + head)
                yield from _named_value(name, cell, head_width + _INDENT, width)

    def _named_values(self, width: int) -> Iterator[Text]:
        """The rows of a table without heads: the first cells are the names of the others."""
        label_width = max((cell_len(self._label(row).plain) for row in self.rows), default=0)
        for row in self.rows:
            value = Text("  ").join(cell for cell in row[self.num_labels :] if cell.plain)
            label = self._label(row)
            if value.plain:
                yield from _named_value(label, value, label_width, width)
            else:
                yield from _hanging(label, width, Text())

    def _label(self, row: Sequence[Text]) -> Text:
        return Text(" ").join(cell for cell in row[: self.num_labels] if cell.plain)


def _named_value(name: Text, value: Text, name_width: int, width: int) -> Iterator[Text]:
    """A value beside its name, or below the name if there is no room beside it.

    Args:
        name: The name.
        value: The value; if it is empty, the name is left out, too.
        name_width: Columns of the longest name.
        width: Columns of a line.
    """
    if not value.plain:
        return
    prefix = name.copy()
    prefix.pad_right(name_width - cell_len(name.plain) + _GAP)
    has_room = name_width <= width // 2 or cell_len(prefix.plain + value.plain) <= width
    if has_room and name_width + _GAP + _longest_word(value) <= width:
        yield from _hanging(value, width, prefix)
        return
    yield from _hanging(name, width, Text())
    yield from _hanging(value, width, Text(" " * 2 * _INDENT))


def _hanging(text: Text, width: int, prefix: Text) -> Iterator[Text]:
    """A text after a prefix; its further lines are indented by the width of the prefix.

    If a word is too long for the rest of a line, the text has neither prefix nor indentation.
    """
    if not text.plain:
        return
    indent = cell_len(prefix.plain)
    if _longest_word(text) > width - indent:
        prefix, indent = Text(), 0
    for line in wrap_words(text, width - indent):
        yield Text.assemble(prefix, line, no_wrap=True, overflow="ignore")
        prefix = Text(" " * indent)


def wrap_words(text: Text, width: int) -> list[Text]:
    """The lines of a text, broken between words only.

    A word that is longer than a line stays whole on a line of its own, so that readers can copy
    paths. Rich has no such mode: it breaks long words or cuts them off.

    Args:
        text: The text. The further lines of an indented line are indented by two more columns.
        width: Columns of a line.
    """
    lines: list[Text] = []
    for paragraph in text.split("\n", allow_blank=True):
        indent = len(paragraph.plain) - len(paragraph.plain.lstrip())
        indent = indent + _INDENT if 0 < indent < width // 2 else 0
        breaks: list[int] = []
        column = 0
        for word in re.finditer(r"\s*\S+\s*", paragraph.plain):
            if column and column + cell_len(word.group().rstrip()) > width:
                breaks.append(word.start())
                column = indent
            column += cell_len(word.group())
        for index, line in enumerate(paragraph.divide(breaks)):
            line.rstrip()
            lines.append(Text.assemble(" " * indent, line) if index else line)
    return lines


@dataclass(frozen=True, slots=True)
class Prose:
    """A text that is broken between words only."""

    text: Text

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Text]:
        """Lay it out (a protocol of Rich)."""
        for line in wrap_words(self.text, options.max_width):
            line.no_wrap, line.overflow = True, "ignore"
            yield line


def with_whole_words(drawing: RenderableType) -> RenderableType:
    """A drawing whose texts are broken between words only.

    Args:
        drawing: A text, a table, or a group of drawings.
    """
    if isinstance(drawing, Group):
        return Group(*map(with_whole_words, drawing.renderables))
    if isinstance(drawing, str):
        return Prose(Text(drawing))
    return Prose(drawing) if isinstance(drawing, Text) and not drawing.no_wrap else drawing


def _longest_line(text: Text) -> int:
    return max(map(cell_len, text.plain.split("\n")))


def _longest_word(text: Text) -> int:
    return max(map(cell_len, text.plain.split()), default=0)


@dataclass(frozen=True, slots=True)
class CommandLine:
    """A command that readers can copy, folded with backslashes if it does not fit on a line.

    Attributes:
        words: The words of the command, quoted where a shell needs it.
        label: Text before the command.
    """

    words: tuple[str, ...]
    label: str = ""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Text]:
        """Lay it out (a protocol of Rich)."""
        for line in fold_command(self.words, options.max_width, self.label):
            yield Text(line, no_wrap=True, overflow="ignore")


def open_table(
    *heads: str, title: str = "", num_labels: int = 1, has_rule: bool = False
) -> FittingTable:
    """A table without rows.

    Args:
        heads: Heads of the columns; a column whose head ends in ">" is aligned to the right.
        title: A line above it.
        num_labels: Number of first columns that name a row.
        has_rule: Whether there is a rule below the heads.
    """
    names = [head.removesuffix(">") for head in heads]
    return FittingTable(
        heads=tuple(map(Text, names)) if any(names) else (),
        is_number=tuple(head.endswith(">") for head in heads),
        num_labels=num_labels,
        title=title,
        has_rule=has_rule,
    )


def drawn_rows(
    header: Iterable[str], rows: Iterable[Sequence[str]], *, title: str = "", num_labels: int = 1
) -> FittingTable:
    """A table of texts, with a line below its header.

    Args:
        header: Heads of the columns, as in `open_table`.
        rows: The cells of each row.
        title: A line above it.
        num_labels: Number of first columns that name a row.
    """
    table = open_table(*header, title=title, num_labels=num_labels, has_rule=True)
    for row in rows:
        table.add_row(*row)
    return table


def facts(rows: Iterable[tuple[str, object]]) -> FittingTable:
    """Names in bold, each with its values."""
    table = open_table("", "")
    for name, value in rows:
        table.add_row(Text(name, style="bold"), str(value))
    return table


def result_table(table: ResultTable) -> Iterator[RenderableType]:
    """A table of results, with its note."""
    texts, numbers = table.header[: table.num_texts], table.header[table.num_texts :]
    header = (*texts, *(f"{name}>" for name in numbers))
    yield drawn_rows(header, table.cells(), title=table.title, num_labels=max(len(texts), 1))
    if table.note:
        yield Prose(Text(table.note, style="dim"))
