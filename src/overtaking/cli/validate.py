"""The command that compares a profile with real traffic."""

from pathlib import Path
from typing import Annotated

import typer

from overtaking.cli import options
from overtaking.cli.output import Output

NUM_SIMULATIONS = 1000

Profile = Annotated[str, typer.Argument(metavar="PROFILE", help=options.PROFILE)]
NumSimulations = Annotated[int, options.option("--num-simulations -n N", options.NUM_SIMULATIONS)]
Recordings = Annotated[
    Path | None,
    options.option(
        "--recordings FILE|FOLDER", "Compare with recordings in CommonRoad's format too."
    ),
]


def validate(
    output: Output,
    profile: Profile,
    road: options.RoadChoice,
    num_simulations: NumSimulations = NUM_SIMULATIONS,
    seed: options.Seed = None,
    plot: options.Plot = None,
    recordings: Recordings = None,
    threads: options.Threads = None,
    changes: options.Changes = None,
) -> int:
    """Compare a profile's traffic with published measurements.

    The standing of a figure says whether the drivers of the profile were fitted on it. The exit
    status is 1 if a target is missed.
    """
    from overtaking.api import reports, studies
    from overtaking.cli import arguments, validation_page

    arguments.limit_threads(threads)
    figure = arguments.figure_file(plot)
    with output.progress("simulations") as meter:
        found = studies.validate_profile(
            profile,
            num_simulations=num_simulations,
            seed=1 if seed is None else seed,
            overrides=arguments.overrides(changes or [], None),
            road=arguments.road(road),
            progress=meter,
            recordings=recordings,
        )
    if figure is not None:
        reports.plot(found, out=figure)
    values = found.values()
    output.result(values, lambda _: validation_page.render(values))
    return 0 if found.is_met else 1
