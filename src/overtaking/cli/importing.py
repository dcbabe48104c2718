"""`overtaking import`: recordings of others."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from overtaking.cli import options
from overtaking.cli.output import Output

if TYPE_CHECKING:
    from rich.console import RenderableType

    from overtaking.data.load import Dataset

RecordingFormat = Annotated[
    str,
    typer.Argument(
        metavar="FORMAT", help="Format of the recording: commonroad, highd or pinto2023."
    ),
]
RecordingFile = Annotated[
    Path, typer.Argument(metavar="FILE", help="Recording; of highD the file NN_tracks.csv.")
]
AttemptsOnly = Annotated[
    bool | None,
    typer.Option(
        "--attempts-only", help="Leave out vehicles that follow another and never overtake."
    ),
]
Vehicles = Annotated[
    int | None,
    typer.Option("--vehicles", metavar="N", help="Vehicles per simulation at most.  [default: 16]"),
]
Lanelet = Annotated[
    int | None,
    typer.Option("--lanelet", metavar="ID", help="With commonroad: a lanelet of the road to use."),
]
Direction = Annotated[
    int | None,
    typer.Option(
        "--direction", metavar="1|2", help="With highd: only the upper or the lower lanes."
    ),
]
_WORDS = {
    "vehicles": "vehicles",
    "lane_changes_left": "lane changes to the left",
    "lane_changes_right": "lane changes to the right",
    "passes": "passes",
    "candidate_overtakes": "candidate overtakes",
    "candidates_that_return": "of them back in their lane",
    "followers_without_attempt": "followers without an attempt",
    "oncoming_left_out": "oncoming vehicles left out",
    "other_roads": "other roads, for --lanelet",
    "neighbours_with_a_slot": "share of neighbours kept",
    "simulations": "simulations",
    "frames": "frames",
    "straightening_m": "road straightened by up to [m]",
    "widening": "lanes differ from their mean by",
    "longest_way": "way along outer lanes differs by",
    "speed_ratio_median": "measured over recorded speed",
    "time_scaling": "time scaled to",
    "road": "road",
}


def import_recording(
    output: Output,
    file_format: RecordingFormat,
    file: RecordingFile,
    out: options.OutFolder,
    attempts_only: AttemptsOnly = None,
    vehicles: Vehicles = None,
    lanelet: Lanelet = None,
    direction: Direction = None,
    map_file: options.Map = None,
    road: options.Road = None,
) -> None:
    """Convert recordings of real traffic into a labelled data set.

    Each overtake, and each vehicle that follows another, becomes a simulation. --map and --road
    name the road of a pinto2023 table.
    """
    from overtaking import api
    from overtaking.cli import arguments

    given = arguments.given(
        attempts_only=attempts_only or None,
        vehicles=vehicles,
        lanelet=lanelet,
        direction=direction,
        road=arguments.road(map_file, road),
    )
    begin = time.monotonic()
    with output.progress("simulations") as meter:
        data = api.import_recording(file_format, file, out, progress=meter, **given)
    values = of_import(data, time.monotonic() - begin)
    output.wrote(values, lambda _: render(values))


# On the command line it is called what Python does not let a function be called.
import_recording.__name__ = "import"


def of_import(data: "Dataset", seconds: float) -> dict[str, Any]:
    """What was found in a recording, and where it is now."""
    identity = data.manifest.identity
    source = identity.source
    assert source is not None
    return {
        "data": str(data.path),
        "format": source.format,
        "recording": source.recording,
        "files": source.files,
        "simulations": len(data),
        "unknown": list(identity.unknown),
        "counts": source.counts,
        "notes": source.notes,
        "content_hash": data.content_hash,
        "duration_s": round(seconds, 3),
    }


def render(values: dict[str, Any]) -> "RenderableType":
    """What was found, as a page."""
    from rich.table import Table
    from rich.text import Text

    grid = Table.grid(padding=(0, 2))
    grid.add_column(style="bold")
    grid.add_column(overflow="fold")
    grid.add_row("recording", Text(f"{values['recording']} ({values['format']})"))
    for name, value in (values["counts"] | values["notes"]).items():
        if name in _WORDS and value is not None:
            grid.add_row(_WORDS[name], Text(f"{value:,}" if isinstance(value, int) else f"{value}"))
    grid.add_row("not known", Text(", ".join(values["unknown"])))
    if values["notes"].get("time_scaling"):
        warning = "positions move at {} of the recorded speeds: the clock was scaled"
        grid.add_row("beware", Text(warning.format(values["notes"]["time_scaling"])))
    grid.add_row("data set", Text(f"{values['data']}: {values['simulations']:,} simulations"))
    grid.add_row("next", Text(f"overtaking show {values['data']} 0"))
    return grid


COMMANDS: dict[options.Body, str] = {
    import_recording: "overtaking import commonroad scene.xml --out data/scene",
}
