"""The command that holds a profile against real traffic."""

from pathlib import Path
from typing import Annotated

import typer

from overtaking.cli import options
from overtaking.cli.output import Output

SIMULATIONS = 1000

Profile = Annotated[
    str, typer.Argument(metavar="PROFILE", help="Profile of the package, or a TOML file.")
]
Simulations = Annotated[
    int, typer.Option("--simulations", "-n", metavar="N", help="How many to simulate.")
]
Plot = Annotated[
    Path | None,
    typer.Option("--plot", metavar="FILE", help="Draw the figures, too; .png or .svg."),
]


def validate(
    output: Output,
    profile: Profile,
    simulations: Simulations = SIMULATIONS,
    seed: options.Seed = None,
    plot: Plot = None,
    map_file: options.Map = None,
    road: options.Road = None,
    threads: options.Threads = None,
    changes: options.Changes = None,
) -> int:
    """Hold the traffic of a profile against measured traffic; 1 if a target is missed."""
    from overtaking import api
    from overtaking.cli import arguments, validation_page

    arguments.limit_threads(threads)
    figure = arguments.figure_file(plot)
    with output.progress("simulations") as meter:
        found = api.validate(
            profile,
            simulations,
            1 if seed is None else seed,
            overrides=arguments.overrides(changes or [], None),
            road=arguments.road(map_file, road),
            progress=meter,
        )
    if figure is not None:
        api.plot_validation(found, figure)
    values = found.values()
    output.result(values, lambda _: validation_page.render(values))
    return 0 if found.is_met else 1


COMMANDS: dict[options.Body, str] = {
    validate: "overtaking validate motorway -n 1000 --seed 1 --plot motorway.png",
}
