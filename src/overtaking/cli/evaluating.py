"""The command that compares a driver with others."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from overtaking.cli import driving, options, reproducing
from overtaking.cli.output import Output
from overtaking.core.errors import ConfigError

if TYPE_CHECKING:
    from overtaking.analysis.evaluation.benchmark import BenchmarkResult
    from overtaking.analysis.evaluation.results import Evaluation
    from overtaking.analysis.stats.table import Table

NUM_SIMULATIONS, FILMS = 1000, 10

Profile = Annotated[
    str | None,
    typer.Argument(
        metavar="PROFILE",
        help=f"{options.PROFILE} Of a profile of the package, its -risk one.  [default: motorway]",
    ),
]
DriverName = Annotated[
    str,
    options.option(
        "--driver NAME",
        "Driver of the ego: human, stay or rules; module:name or file.py:name, whose code is "
        "executed; or a file.onnx.",
    ),
]
References = Annotated[
    str,
    options.option("--references NAME[,NAME]", "Drivers to compare the driver with, as --driver."),
]
Observation = Annotated[
    str | None,
    options.option(
        "--observation human|truth|FILE",
        "What it observes: what a human driver believes, the truth, or a sensor in a TOML file.",
    ),
]
NumSimulations = Annotated[
    int | None,
    options.option(
        "--num-simulations -n N", f"{options.NUM_SIMULATIONS}  [default: {NUM_SIMULATIONS}]"
    ),
]
Benchmark = Annotated[
    str | None,
    options.option(
        "--benchmark NAME|FILE", "Scenes of a benchmark, whose numbers are fixed: overtake."
    ),
]
Natural = Annotated[
    bool, options.option("--natural", "Draw scenes of PROFILE itself, not of its -risk profile.")
]
Films = Annotated[
    int, options.option("--films N", "How many of the worst scenes are filmed.", min=0, max=FILMS)
]


def evaluate(
    output: Output,
    driver: DriverName,
    road: options.RoadChoice,
    profile: Profile = None,
    references: References = "human,stay",
    observation: Observation = None,
    action: driving.Action = "accel_lane",
    action_repeat: driving.ActionRepeat = 1,
    num_simulations: NumSimulations = None,
    seed: options.Seed = None,
    natural: Natural = False,
    benchmark: Benchmark = None,
    out: reproducing.Page = None,
    films: Films = FILMS,
    threads: options.Threads = None,
    changes: options.Changes = None,
) -> None:
    """Compare a driver with others in the same scenes.

    Rates per scene, km and attempt with intervals, differences, breaches of the law, conflicts and
    lane changes. No conformity with any regulation is claimed.
    """
    from overtaking.api import evaluation
    from overtaking.cli import arguments

    arguments.limit_threads(threads)
    evaluated, *others = (
        evaluation.resolve_driver(
            name.strip(), observation, action=action, action_repeat=action_repeat, option=option
        )
        for name, option in (
            (driver, "--driver"),
            *((name, "--references") for name in references.split(",")),
        )
    )
    scenes: dict[str, Any] = arguments.given(
        profile=profile,
        num_simulations=num_simulations,
        seed=seed,
        natural=natural or None,
        overrides=arguments.overrides(changes or [], None) or None,
        road=arguments.road(road),
    )
    with output.progress("simulations") as meter:
        if benchmark is not None:
            _refuse(scenes)
            found = evaluation.run_benchmark(
                evaluated, benchmark, references=others, progress=meter
            )
        else:
            scenes = {"profile": "motorway", "num_simulations": NUM_SIMULATIONS} | scenes
            found = evaluation.evaluate(
                evaluated, references=others, progress=meter, say=output.say, **scenes
            )
    values = found.values() | _written(output, found, out, films)
    output.page(values | output.duration, page_parts(found))


def _refuse(scenes: dict[str, Any]) -> None:
    """Refuse scenes of one's own beside a benchmark."""
    if scenes:
        raise ConfigError(
            what="--benchmark",
            where="evaluate",
            expected="no other word about the scenes, as a benchmark fixes them",
            got=", ".join(scenes),
            next_step="leave it out, or leave out --benchmark",
        )


def _written(
    output: Output, found: "Evaluation | BenchmarkResult", out: Path | None, films: int
) -> dict[str, Any]:
    """Write the pages, if they are wanted: where they are, and what they lack."""
    from overtaking.api import reports

    if out is None:
        return {}
    with output.progress("films") as meter:
        made = reports.write_report(found, out, films=films, progress=meter)
    pages = made if isinstance(made, list) else [made]
    for page in pages:
        output.say(f"{page.path}: {len(page.figures)} figures, {len(page.films)} films")
        for text in page.remarks:
            output.say(text)
    return {
        "pages": [str(page.path) for page in pages],
        "missing": [text for page in pages for text in page.remarks],
    }


def page_parts(found: "Evaluation | BenchmarkResult") -> "list[str | Table]":
    """Paragraphs and tables of the result, from top to bottom."""
    from overtaking.analysis.evaluation import tables, words
    from overtaking.analysis.evaluation.benchmark import BenchmarkResult

    if isinstance(found, BenchmarkResult):
        parts = [part for evaluation in found.evaluations for part in page_parts(evaluation)]
        return [found.title, *parts]
    return [
        f"{words.title(found)}\n{words.lead(found)}",
        *(f"note: {text}" for text in words.notes(found)),
        *(f"warning: {text}" for text in words.warnings(found)),
        *tables.every(found),
    ]
