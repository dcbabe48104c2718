"""A table: exact values, and the format of each."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Self

import pandas as pd

from overtaking.core.equality import ContentEquality
from overtaking.core.representation import json_values

NO_VALUE = "–"


class Style(Enum):
    """How a value is written."""

    TEXT = "text"
    COUNT = "count"
    NUMBER = "number"
    COEFFICIENT = "coefficient"
    SHARE = "share"
    P_VALUE = "p-value"


@dataclass(frozen=True, slots=True, kw_only=True)
class Table(ContentEquality):
    """A table.

    Attributes:
        name: Short name, for files.
        title: One line.
        note: How to read it.
        rows: The exact values; columns of text come first.
        styles: How the values of each row are written, or, if `by_column`, of each column.
        num_texts: How many of the first columns are text.
        by_column: Whether `styles` goes by columns.
    """

    name: str
    title: str
    note: str
    rows: pd.DataFrame
    styles: tuple[Style, ...]
    num_texts: int
    by_column: bool = False

    @classmethod
    def of(
        cls,
        *,
        name: str,
        title: str,
        note: str,
        columns: Mapping[str, Style],
        rows: Iterable[Sequence[object]],
    ) -> Self:
        """A table whose columns each have a style; those of text come first.

        Args:
            name: As in `Table`.
            title: As in `Table`.
            note: As in `Table`.
            columns: The style of each column by its name.
            rows: The values of each row.
        """
        return cls(
            name=name,
            title=title,
            note=note,
            rows=pd.DataFrame(list(rows), columns=list(columns)),
            styles=tuple(columns.values()),
            num_texts=list(columns.values()).count(Style.TEXT),
            by_column=True,
        )

    @property
    def header(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(str(name) for name in self.rows.columns)

    def cells(self) -> list[list[str]]:
        """Every row as a person reads it."""
        written: list[list[str]] = []
        for number, row in enumerate(self.rows.itertuples(index=False, name=None)):
            styles = self.styles if self.by_column else (self.styles[number],) * len(row)
            texts, values = row[: self.num_texts], row[self.num_texts :]
            cells = [str(text) for text in texts]
            cells += [
                write(value, style)
                for value, style in zip(values, styles[self.num_texts :], strict=True)
            ]
            written.append(cells)
        return written

    def records(self) -> list[dict[str, Any]]:
        """Every row as plain values for JSON; null where there is none."""
        return json_values(self.rows.to_dict(orient="records"))


def write(value: Any, style: Style) -> str:
    """A value as a person reads it."""
    if isinstance(value, str):
        return value
    if value is None or math.isnan(value):
        return NO_VALUE
    if style is Style.SHARE:
        return f"{100.0 * value:.1f} %"
    if style is Style.P_VALUE:
        return "< 0.001" if value < 1e-3 else f"{value:.3f}"
    if style is Style.COUNT:
        return f"{value:,.0f}" if float(value).is_integer() else f"{value:,.1f}"
    text = f"{value:,.3f}" if style is Style.COEFFICIENT else f"{value:,.2f}"
    return text.lstrip("-") if not text.strip("-0.") else text.replace("-", "−")
