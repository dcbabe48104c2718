"""`overtaking roads`: what an OpenDRIVE file has, and which of its roads can be simulated."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from overtaking.cli import options
from overtaking.cli.output import Output
from overtaking.core.units import kmh_from_mps

if TYPE_CHECKING:
    from rich.console import Group

    from overtaking.model.road import Road
    from overtaking.recordings.opendrive_lanes import Side
    from overtaking.recordings.opendrive_map import MappedRoad

MapFile = Annotated[Path, typer.Argument(metavar="FILE", help="OpenDRIVE file, not compressed.")]
WithJunctions = Annotated[
    bool, options.option("--junctions", "List the ways across junctions too.")
]


def roads(
    output: Output,
    file: MapFile,
    plot: options.Plot = None,
    with_junctions: WithJunctions = False,
    speed_limit: options.SpeedLimit = None,
    driving_side: options.DrivingSide = None,
) -> None:
    """List the roads of an OpenDRIVE file.

    Says which can be simulated, and why the others cannot.
    """
    from overtaking.api import reports
    from overtaking.cli import arguments
    from overtaking.recordings.opendrive_map import list_opendrive_roads

    figure = arguments.figure_file(plot)
    limit = arguments.speed_limit(speed_limit)
    mapped_roads = list_opendrive_roads(
        file, speed_limit=limit, driving_side=cast("Side | None", driving_side)
    )
    if figure is not None:
        reports.plot(mapped_roads, out=figure)
    values = values_of(file, mapped_roads, with_junctions=with_junctions)
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
                "leads_to": road.leads_to,
                "can_be_simulated": road.road is not None,
                "simulated_from_m": None if road.part is None else round(road.part.start, 3),
                "simulated_to_m": None if road.part is None else round(road.part.end, 3),
                "is_whole": None if road.part is None else road.part.is_whole,
                "is_two_way": None if road.road is None else road.road.is_two_way,
                "limits_kmh": None if road.road is None else _limits(road.road),
                "refusal": road.refusal,
            }
            for road in sorted(listed, key=lambda each: (-_simulated(each), -each.length))
        ],
    }


def _simulated(road: "MappedRoad") -> float:
    """How much of a road can be simulated [m]."""
    return 0.0 if road.road is None else road.road.length


def _limits(road: "Road") -> list[float]:
    """The limits of a road, the lowest first, each once [km/h]."""
    stretches = road.course.speed_limit_spans if road.course else ()
    limits = {road.speed_limit, *(one.speed for one in stretches)}
    return [round(kmh_from_mps(limit), 1) for limit in sorted(limits)]


def render(values: dict[str, Any]) -> "Group":
    """The roads as a table."""
    from rich.console import Group
    from rich.text import Text

    from overtaking.cli.tables import open_table

    names = ("road", "length>", "lanes>", "sharpest bend>", "slope>", "km/h>", "leads to>")
    table = open_table(*names, "simulated")
    for road in values["roads"]:
        radius, slope = road["sharpest_radius_m"], road["steepest_slope"]
        table.add_row(
            road["id"],
            f"{road['length_m']:,.0f} m",
            f"{road['lanes_right']} + {road['lanes_left']}",
            "straight" if radius is None else f"R {radius:,.0f} m",
            "" if slope is None else f"{100.0 * slope:.1f} %",
            " to ".join(map(_limit_text, _ends(road["limits_kmh"] or []))),
            road["leads_to"] or "",
            _how(road) if road["can_be_simulated"] else Text(_short(road["refusal"])),
        )
    notes = (
        "Lanes are driving lanes right and left of the file's reference line. Of a road whose lanes"
        " change, the longest stretch is simulated on which they do not; limits may change. Where a"
        " road leads to another without a junction, both can be one: --road A,B."
    )
    parts = [table, Text(notes)]
    if values["junctions_left_out"]:
        number = values["junctions_left_out"]
        ways = "way across a junction" if number == 1 else "ways across junctions"
        parts.append(Text(f"{number} {ways} left out; --junctions lists them."))
    return Group(*parts)


def _limit_text(limit_kmh: float) -> str:
    """A speed limit in words; the highest limit of the model means that there is no limit."""
    from overtaking.model.road_course import MAX_SPEED_LIMIT

    return "none" if limit_kmh >= kmh_from_mps(MAX_SPEED_LIMIT) else f"{limit_kmh:.0f}"


def _ends(values: list[float]) -> list[float]:
    """The first and the last of some values, one alone if there are no two."""
    return [values[0], values[-1]] if len(values) > 1 else values


def _how(road: dict[str, Any]) -> str:
    """How a road is simulated, and which part of it."""
    part = f", {road['simulated_from_m']:.0f} to {road['simulated_to_m']:.0f} m"
    directions = ", two-way" if road["is_two_way"] else ""
    return f"--road {shlex.quote(road['id'])}{'' if road['is_whole'] else part}{directions}"


def _short(refusal: str) -> str:
    """The reason of a refusal, without file and line, which stand above, and the advice."""
    return f"no: {refusal.split(': ', 3)[-1].rsplit('; ', 1)[0]}"
