"""Statistics of a data set, and the report on it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from overtaking.cli import options
from overtaking.cli.output import Output
from overtaking.core.errors import check_choice
from overtaking.core.representation import format_count

if TYPE_CHECKING:
    from rich.text import Text

    from overtaking.show.report.write import Report

Weighted = Annotated[
    bool, options.option("--weighted", "Weight each simulation by its importance weight.")
]
Reading = Annotated[
    str | None,
    options.option(
        "--reading NAME", "Definition of the features: paper or matched.  [default: the policy's]"
    ),
]
Learn = Annotated[bool, options.option("--learn", "Add learned rules and factors; takes minutes.")]
Written = Annotated[
    str, options.option("--format NAME", f"{options.FORMAT} text, csv, json or latex.")
]
Folder = Annotated[
    Path | None, options.option("--out FOLDER", f"{options.OUT} A folder.  [default: DATA/report]")
]


def stats(
    output: Output,
    data: options.Data,
    weighted: Weighted = False,
    policy: options.Policy = None,
    reading: Reading = None,
    written: Written = "text",
) -> None:
    """Print class frequencies, feature statistics and waiting times."""
    from overtaking.analysis.stats import formats
    from overtaking.api import studies

    check_choice(written, formats.FORMATS, what="--format", where="stats")
    found = studies.dataset_statistics(data, policy=policy, reading=reading, weighted=weighted)
    if written == "text":
        output.page(found.values(), formats.page_parts(found))
    else:
        output.text(found.values(), formats.written(found, written))


def report(
    output: Output,
    data: options.Data,
    out: Folder = None,
    weighted: Weighted = False,
    policy: options.Policy = None,
    reading: Reading = None,
    learn: Learn = False,
) -> None:
    """Write an HTML report: figures, tables and associations."""
    from overtaking.api import reports

    with output.progress("parts") as meter:
        made = reports.write_report(
            data,
            out,
            policy=policy,
            reading=reading,
            weighted=weighted,
            learn=learn,
            progress=meter,
        )
    values = values_of(made) | output.duration
    output.wrote(values, lambda _: render(values))


def values_of(made: "Report") -> dict[str, Any]:
    """The written files."""
    return {
        "page": str(made.path),
        "simulations": len(made.statistics.sample),
        "figures": list(made.figures),
        "tables": list(made.tables),
        "warnings": [leak.sentence for leak in made.statistics.leaks],
        "missing": list(made.remarks),
    }


def render(values: dict[str, Any]) -> "Text":
    """Where the page is, and what it lacks."""
    from rich.text import Text

    warnings = len(values["warnings"])
    lines = [
        f"{values['page']}: {format_count(len(values['figures']), 'figure')} and "
        f"{format_count(len(values['tables']), 'table')} of "
        f"{format_count(values['simulations'], 'simulation')}, {values['duration_s']:.1f} s",
        *(
            [f"{format_count(warnings, 'warning')} about its classes, see the page"]
            if warnings
            else []
        ),
        *values["missing"],
    ]
    return Text("\n".join(lines))
