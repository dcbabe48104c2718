"""SQL queries of a data set, and the diagram of its tables."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from overtaking.cli import options
from overtaking.cli.output import Output, json_of
from overtaking.core.errors import check_choice
from overtaking.core.representation import format_count

if TYPE_CHECKING:
    from rich.console import Group

FORMATS = ("table", "csv", "json")
MOST_SHOWN = 1000
"""Characters of a cell in a table; CSV and JSON have all of them."""

Question = Annotated[str, typer.Argument(metavar="SQL", help="One SELECT statement, in quotes.")]
Written = Annotated[str, options.option("--format NAME", f"{options.FORMAT} table, csv or json.")]
Rows = Annotated[int, options.option("--rows N", options.ROWS, min=1)]
Seconds = Annotated[float, options.option("--timeout S", options.TIMEOUT)]
Memory = Annotated[int, options.option("--memory MIB", options.MEMORY, min=16)]
Drawn = Annotated[str, options.option("--format NAME", f"{options.FORMAT} svg or mermaid.")]
Target = Annotated[
    Path | None, options.option("--out FILE", f"{options.OUT} A file.  [default: print it]")
]


def sql(
    output: Output,
    data: options.Data,
    question: Question,
    written: Written = "table",
    rows: Rows = 1000,
    timeout_s: Seconds = 60.0,
    memory_mib: Memory = 1024,
) -> None:
    """Query the tables of a data set in SQL."""
    from overtaking.api import datasets

    check_choice(written, FORMATS, what="--format", where="sql")
    answer = datasets.sql(data, question, max_rows=rows, timeout_s=timeout_s, memory_mib=memory_mib)
    values = answer.values()
    if answer.is_cut:
        output.say(f"there are more rows than these {rows}; --rows gives more")
    if written == "csv":
        output.text(values, answer.csv())
    elif written == "json":
        output.text(values, json_of(values))
    else:
        output.result(values, lambda _: render(values))


def er(output: Output, drawn: Drawn = "svg", out: Target = None) -> None:
    """Draw the entity-relationship diagram of the tables."""
    from overtaking.analysis.database.diagram import diagram
    from overtaking.core.files import check_output_path, write_atomically

    picture = diagram(drawn)
    if out is not None:
        check_output_path(out)
        write_atomically(out, picture.encode())
    values = {"format": drawn, "file": None if out is None else str(out)}
    if out is None:
        output.text(values | {"diagram": picture}, picture)
    else:
        output.wrote(values, lambda _: str(out))


def render(values: dict[str, Any]) -> "Group":
    """The rows as a table."""
    from rich.console import Group
    from rich.text import Text

    from overtaking.cli.tables import drawn_rows

    rows = [[shown(cell) for cell in row] for row in values["rows"]]
    table = drawn_rows([shown(name) for name in values["columns"]], rows)
    return Group(table, Text(format_count(len(rows), "row")))


def shown(cell: object) -> str:
    """A cell for people: cut if it is long, and without control characters."""
    if cell is None:
        return "–"
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    text = f"{cell:.6g}" if isinstance(cell, float) else str(cell)
    text = text if len(text) <= MOST_SHOWN else f"{text[:MOST_SHOWN]}…"
    return "".join(one if one.isprintable() else "�" for one in text)
