"""The commands that begin with `overtaking sumo`."""

from overtaking.cli import options
from overtaking.cli.output import Output


def run(
    output: Output,
    out: options.OutFolder,
    made: options.Making,
    road: options.RoadChoice,
    profile: options.ProfileWord = None,
) -> None:
    """Simulate scenarios on SUMO and write a labelled data set."""
    from overtaking.cli import making

    making.make(output, out, making.recipe(made, profile, road), made, simulator="sumo")
