"""The command that compares our simulations with every number of a paper."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from overtaking.cli import options
from overtaking.cli.output import Output

if TYPE_CHECKING:
    from overtaking.analysis.reproduction.run import Reproduction
    from overtaking.analysis.stats.table import Table

NUM_REPLICATES, SEED = 1000, 2023

Study = Annotated[str, typer.Argument(metavar="STUDY", help="Study to reproduce: pinto2023.")]
NumReplicates = Annotated[
    int, options.option("--num-replicates N", "Number of sets of 276 simulations.")
]
Seed = Annotated[
    int,
    options.option(
        "--seed N", f"{options.SEED} Those that the drivers were fitted with are refused."
    ),
]
Page = Annotated[
    Path | None,
    options.option(
        "--out FOLDER", f"{options.OUT} A folder for an HTML page with figures.  [default: none]"
    ),
]


def reproduce(
    output: Output,
    study: Study,
    num_replicates: NumReplicates = NUM_REPLICATES,
    seed: Seed = SEED,
    out: Page = None,
    threads: options.Threads = None,
    changes: options.Changes = None,
) -> None:
    """Compare each number of the study with replicates of its data."""
    from overtaking.api import reports, studies
    from overtaking.cli import arguments

    arguments.limit_threads(threads)
    with output.progress("simulations") as meter:
        found = studies.reproduce_study(
            study,
            num_replicates=num_replicates,
            seed=seed,
            overrides=arguments.overrides(changes or [], None),
            progress=meter,
        )
    values = found.values()
    if out is not None:
        made = reports.write_report(found, out)
        values |= {"page": str(made.path), "missing": list(made.remarks)}
        for text in (f"{made.path}: {len(made.figures)} figures", *made.remarks):
            output.say(text)
    output.page(values | output.duration, page_parts(found))


def page_parts(found: "Reproduction") -> "list[str | Table | dict[str, str]]":
    """Paragraphs and tables of the result, from top to bottom."""
    from overtaking.analysis.reproduction import tables, words

    score, numbers, design, collided, pushes, lawful, starts = tables.tables(found)
    return [
        words.lead(found),
        *(f"note: {text}" for text in words.notes(found)),
        *(f"warning: {text}" for text in words.warnings(found)),
        score,
        "\n".join(f"missed: {name}: {text}" for name, text in words.causes(found)),
        numbers,
        dict(words.standings()),
        collided,
        pushes,
        design,
        "\n".join(f"{name}: {text}" for name, text in words.remarks_on_numbers(found)),
        "What the label hides",
        *words.hidden(found),
        lawful,
        words.about_starts(found),
        starts,
    ]
