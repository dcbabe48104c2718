"""Tables as text, CSV and LaTeX."""

import json
import math
from collections.abc import Iterable
from html import escape

import pandas as pd

from overtaking.analysis.stats.columns import BY_NAME
from overtaking.analysis.stats.results import Statistics
from overtaking.analysis.stats.survival import Survival
from overtaking.analysis.stats.table import Style, Table, write
from overtaking.knowledge.glossary import terms

FORMATS = ("text", "csv", "json", "latex")
"""The formats of statistics."""

_TIDY = ["table", "feature", "unit", "statistic", "class", "value"]
_LATEX = str.maketrans(
    {letter: f"\\{letter}" for letter in "&%$#_{}"}
    | {
        "\\": r"\textbackslash{}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "<": r"$<$",
        ">": r"$>$",
        "–": "--",
        "−": "$-$",
        "σ": r"$\sigma$",
        "ρ": r"$\rho$",
        "η": r"$\eta$",
        "ε": r"$\varepsilon$",
        "χ": r"$\chi$",
        "²": r"$^2$",
    }
)


def page_parts(statistics: Statistics) -> list[str | Table | dict[str, str]]:
    """The parts of the printed text in order: tables, meanings of words, waiting time, notes."""
    parts: list[str | Table | dict[str, str]] = [
        statistics.classes,
        _legend("classes", statistics.sample.classes),
        statistics.static,
        statistics.dynamic,
        _legend("features", BY_NAME),
    ]
    return parts + _remarks(statistics)


def _remarks(statistics: Statistics) -> list[str]:
    """The waiting time, notes and warnings."""
    waiting = [] if statistics.waiting is None else [_waiting_to_text(statistics.waiting)]
    notes = [f"note: {note}" for note in statistics.notes]
    return [*waiting, *notes, *(f"warning: {leak.sentence}" for leak in statistics.leaks)]


def to_text(statistics: Statistics) -> str:
    """All tables and remarks as plain text."""
    tables = [table_to_text(table) for table in statistics.tables]
    return "\n\n".join(tables + _remarks(statistics))


def to_html(statistics: Statistics) -> str:
    """All tables and remarks as HTML without styles, for notebooks."""
    remarks = [f"<p>{escape(text)}</p>" for text in _remarks(statistics)]
    return "".join([*map(_table_to_html, statistics.tables), *remarks])


def _table_to_html(table: Table) -> str:
    header = "".join(f'<th scope="col">{escape(name)}</th>' for name in table.header)
    rows = "".join(
        f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>"
        for row in _without_repeats(table)
    )
    return (
        f"<table><caption>{escape(table.title)}</caption><thead><tr>{header}</tr></thead>"
        f"<tbody>{rows}</tbody></table><p>{escape(table.note)}</p>"
    )


def _legend(group: str, names: Iterable[str]) -> dict[str, str]:
    """The meaning of each name in a group of terms."""
    meanings = terms(group)
    return {name: meanings[name].meaning for name in names}


def table_to_text(table: Table) -> str:
    """A table in columns; repeated words at the start of a row are left out."""
    rows = [list(table.header), *_without_repeats(table)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = [
        "  ".join(
            cell.ljust(width) if column < table.num_texts else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
    rule = "-" * max(map(len, lines))
    return "\n".join([table.title, rule, lines[0], rule, *lines[1:], rule, table.note])


def _without_repeats(table: Table) -> list[list[str]]:
    """The cells, with the first two texts, such as feature and unit, only where they change."""
    rows: list[list[str]] = []
    before: list[str] = []
    for cells in table.cells():
        same = table.num_texts > 1 and before[:1] == cells[:1]
        unit = "" if before[1:2] == cells[1:2] else cells[1]
        rows.append(["", unit, *cells[2:]] if same else cells)
        before = cells
    return rows


def _waiting_to_text(waiting: Survival) -> str:
    """The waiting time in three lines."""
    spans = ", ".join(
        f"{share:.0%} after {write(waiting.quantile(share), Style.NUMBER)} s"
        for share in (0.25, 0.5, 0.75)
        if not math.isnan(waiting.quantile(share))
    )
    return (
        f"Waiting time (Kaplan-Meier)\n{waiting.num_events:,} drivers began, "
        f"{waiting.num_censored:,} had not begun when the recording ended (censored).\n"
        f"Of all drivers have begun: {spans or 'fewer than 25%'}."
    )


def to_csv(statistics: Statistics) -> str:
    """All tables in one: a row per table, feature, statistic and class, with the exact value."""
    rows = pd.concat([_tidy(table) for table in statistics.tables])
    if statistics.waiting is not None:
        rows = pd.concat([rows, _tidy_waiting(statistics.waiting)])
    return str(rows.to_csv(index=False, lineterminator="\n"))


def table_to_csv(table: Table) -> str:
    """A table as it is, with exact values."""
    return str(table.rows.to_csv(index=False, lineterminator="\n"))


def _tidy(table: Table) -> pd.DataFrame:
    """A table with one value per row."""
    if table.by_column:
        long = table.rows.melt(id_vars="class", var_name="statistic").assign(feature="CLASS")
    else:
        texts = list(table.header[: table.num_texts])
        long = table.rows.melt(id_vars=texts, var_name="class")
    return long.assign(table=table.name).reindex(columns=_TIDY)


def _tidy_waiting(waiting: Survival) -> pd.DataFrame:
    """The curve of waiting times with one value per row."""
    long = waiting.rows().melt(id_vars="time_s", var_name="statistic")
    names = [f"t = {time:g}" for time in long["time_s"]]
    return long.assign(table="waiting-time", feature="WT", unit="s", **{"class": names})[_TIDY]


def to_latex(statistics: Statistics) -> str:
    """All tables as LaTeX; they need the package booktabs."""
    return "\n".join(table_to_latex(table) for table in statistics.tables)


def table_to_latex(table: Table) -> str:
    """A table as LaTeX, with rules between features; it needs the package booktabs."""
    columns = "l" * table.num_texts + "r" * (len(table.header) - table.num_texts)
    lines = [
        r"\begin{table}[htbp]",
        r"  \centering",
        rf"  \caption{{{latex(table.title)}. {latex(table.note)}}}",
        rf"  \label{{tab:{table.name}}}",
        rf"  \begin{{tabular}}{{@{{}}{columns}@{{}}}}",
        r"    \toprule",
        f"    {_latex_row(table.header)}",
        r"    \midrule",
    ]
    for number, row in enumerate(_without_repeats(table)):
        if number and table.num_texts > 1 and row[0]:
            lines.append(r"    \addlinespace")
        lines.append(f"    {_latex_row(row)}")
    lines += [r"    \bottomrule", r"  \end{tabular}", r"\end{table}"]
    return "\n".join(lines) + "\n"


def _latex_row(cells: Iterable[str]) -> str:
    return " & ".join(latex(cell) for cell in cells) + r" \\"


def latex(text: str) -> str:
    """Text with LaTeX's special characters escaped."""
    return text.translate(_LATEX)


def written(statistics: Statistics, name: str) -> str:
    """All statistics in one of the `FORMATS` other than text."""
    if name == "json":
        return json.dumps(statistics.values(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    return {"csv": to_csv, "latex": to_latex}[name](statistics)
