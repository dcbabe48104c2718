"""`overtaking roads`: what an OpenDRIVE file has, and which of its roads can be simulated."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from overtaking.cli import options
from overtaking.cli.output import Output

if TYPE_CHECKING:
    from rich.console import Group

    from overtaking.recordings.opendrive_map import MappedRoad

MapFile = Annotated[Path, typer.Argument(metavar="FILE", help="OpenDRIVE file, not compressed.")]
WithJunctions = Annotated[
    bool, options.option("--junctions", "List the ways across junctions too.")
]


def roads(
    output: Output, file: MapFile, plot: options.Plot = None, with_junctions: WithJunctions = False
) -> None:
    """List the roads of an OpenDRIVE file.

    Says which can be simulated, and why the others cannot.
    """
    from overtaking import api
    from overtaking.cli import arguments

    figure = arguments.figure_file(plot)
    found = api.map_roads(file)
    if figure is not None:
        api.plot_map(found, figure)
    values = values_of(file, found, with_junctions=with_junctions)
    output.result(values, lambda _: render(values))


def values_of(file: Path, found: list["MappedRoad"], *, with_junctions: bool) -> dict[str, Any]:
    """What is printed of the roads of a file, the longest first."""
    listed = [road for road in found if with_junctions or not road.in_junction]
    return {
        "file": file.name,
        "junctions_left_out": len(found) - len(listed),
        "roads": [
            {
                "id": road.road_id,
                "name": road.name,
                "length_m": round(road.length, 3),
                "lanes_right": road.right,
                "lanes_left": road.left,
                "sharpest_radius_m": None if road.radius is None else round(road.radius, 1),
                "steepest_slope": None if road.steepest is None else round(road.steepest, 4),
                "in_junction": road.in_junction,
                "can_be_simulated": road.road is not None,
                "refusal": road.refusal,
            }
            for road in sorted(listed, key=lambda each: (each.road is None, -each.length))
        ],
    }


def render(values: dict[str, Any]) -> "Group":
    """The roads as a table."""
    from rich.console import Group
    from rich.text import Text

    from overtaking.cli.tables import open_table

    table = open_table("road", "length>", "lanes>", "sharpest bend>", "slope>", "simulated")
    for road in values["roads"]:
        radius, slope = road["sharpest_radius_m"], road["steepest_slope"]
        table.add_row(
            road["id"],
            f"{road['length_m']:,.0f} m",
            f"{road['lanes_right']} + {road['lanes_left']}",
            "straight" if radius is None else f"R {radius:,.0f} m",
            "" if slope is None else f"{100.0 * slope:.1f} %",
            f"--road {road['id']}" if road["can_be_simulated"] else Text(_short(road["refusal"])),
        )
    parts = [table, Text("Lanes are driving lanes right and left of the file's reference line.")]
    if values["junctions_left_out"]:
        number = values["junctions_left_out"]
        ways = "way across a junction" if number == 1 else "ways across junctions"
        parts.append(Text(f"{number} {ways} left out; --junctions lists them."))
    return Group(*parts)


def _short(refusal: str) -> str:
    """The reason of a refusal, without file and line, which stand above, and the advice."""
    return f"no: {refusal.split(': ', 3)[-1].rsplit('; ', 1)[0]}"
