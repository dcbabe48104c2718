"""`overtaking import`: recordings of others."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from overtaking.cli import options
from overtaking.cli.failures import FAULT
from overtaking.cli.output import Output
from overtaking.core.errors import ConfigError
from overtaking.model.import_report import ImportFinding

if TYPE_CHECKING:
    from rich.console import RenderableType

    from overtaking.data.load import Dataset

RecordingFormat = Annotated[
    str,
    typer.Argument(
        metavar="FORMAT",
        help="Format of the recording: commonroad, exid, highd, ngsim, pinto2023, or table for any "
        "columns.",
    ),
]
RecordingFile = Annotated[
    Path,
    typer.Argument(
        metavar="FILE",
        help="Recording; of exiD and highD the file NN_tracks.csv. A folder: "
        "label all recordings in it.",
    ),
]
AttemptsOnly = Annotated[
    bool | None,
    options.option("--attempts-only", "Leave out vehicles that follow another and never overtake."),
]
Vehicles = Annotated[
    int | None, options.option("--vehicles N", "Vehicles per simulation at most.  [default: 16]")
]
Lanelet = Annotated[
    int | None, options.option("--lanelet ID", "With commonroad: a lanelet of the road to use.")
]
Direction = Annotated[
    int | None, options.option("--direction 1|2", "With highd: only the upper or the lower lanes.")
]
Columns = Annotated[
    str | None,
    options.option(
        "--columns FILE|NAME",
        "With table: map of its columns, a TOML file or one of the package: interaction, sind.",
    ),
]
Only = Annotated[
    list[str] | None,
    options.option(
        "--only COLUMN=VALUE",
        "With table, ngsim, exid: rows to read, such as Location=us-101. Repeatable.",
    ),
]
Smooth = Annotated[
    bool | None,
    options.option(
        "--smooth",
        "Smooth positions, speeds and accelerations by moving averages of 0.5, 1 and 4 s, made for "
        "NGSIM.",
    ),
]
Strict = Annotated[
    bool,
    options.option("--strict", "Refuse recordings with findings (not the policy of that name)."),
]
Template = Annotated[
    bool,
    options.option("--template", "With table: write a map of its columns to fill in, to --out."),
]
_MAX_FAILURES = 10
_FOLDER_COUNTS = ("recordings", "refused", "faults", "simulations")
_WORDS = {
    "vehicles": "vehicles",
    "lane_changes_left": "lane changes to the left",
    "lane_changes_right": "lane changes to the right",
    "passes": "passes",
    "candidate_overtakes": "candidate overtakes",
    "candidates_that_return": "of them back in their lane",
    "followers_without_attempt": "followers without an attempt",
    "oncoming": "oncoming vehicles",
    "oncoming_left_out": "oncoming vehicles left out",
    "other_roads": "other roads, for --lanelet",
    "driving_side": "side of traffic",
    "vehicles_left_out": "vehicles left out",
    "neighbours_with_a_slot": "share of neighbours kept",
    "lanes_from": "lanes from",
    "lane_fit": "fit of the lanes",
    "tracks_torn": "tracks torn",
    "interpolated": "states interpolated",
    "rows_missing": "rows with missing cells",
    "rows_repeated": "repeated rows",
    "simulations": "simulations",
    "frames": "frames",
    "line_off_m": "reference line off the middle by up to [m]",
    "straightening_m": "vehicles off the model's road by up to [m]",
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
    road: options.RoadChoice,
    attempts_only: AttemptsOnly = None,
    vehicles: Vehicles = None,
    lanelet: Lanelet = None,
    direction: Direction = None,
    columns: Columns = None,
    only: Only = None,
    smooth: Smooth = None,
    strict: Strict = False,
    template: Template = False,
    executor: options.Executor = "auto",
    workers: options.Workers = None,
    address: options.Address = None,
    resume: options.Resume = False,
) -> int | None:
    """Convert recordings of real traffic into a labelled data set.

    Each overtake, and each vehicle that follows another, becomes a simulation. --map and --road
    name the road of a table, in the axes of its positions. Of a folder all recordings are labelled,
    each on its own road, without keeping frames: --executor, --workers and --resume are for these.
    A recording that fails is named, and the others go on; the exit status is 70 after a fault of
    overtaking itself.
    """
    from overtaking.api import file_formats
    from overtaking.cli import arguments
    from overtaking.cli.tables import facts

    if template:
        file_formats.write_column_map(file, out)
        output.wrote({"map": str(out)}, lambda _: facts([("map of columns", str(out))]))
        return None
    given = arguments.given(
        columns=columns,
        smooth=smooth or None,
        only=arguments.overrides(only or [], None, where="--only"),
        attempts_only=attempts_only or None,
        vehicles=vehicles,
        lanelet=lanelet,
        direction=direction,
        **_road_options(road),
    )
    how = {"workers": workers, "address": address}
    if file.is_dir():
        with output.progress("recordings") as meter:
            result = file_formats.label_recordings(
                file_format,
                file,
                out,
                executor=executor,
                resume=resume,
                strict=strict,
                progress=meter,
                on_read=meter.show_read_bytes,
                **how,
                **given,
            )
        output.say_findings(ImportFinding(**row) for row in result["import_report"])
        _say_failures(output, list(result["failed"].values()))
        values = {"data": str(out)} | result | output.duration
        output.wrote(values, lambda _: facts(_of_folder(values)))
        return FAULT if result["faults"] else None
    _refuse_of_file(resume=resume, executor=executor != "auto", **how)
    with output.progress("simulations") as meter:
        data = file_formats.import_recording(
            file_format,
            file,
            out,
            strict=strict,
            progress=meter,
            on_read=meter.show_read_bytes,
            **given,
        )
    output.say_findings(data.import_findings)
    values = of_import(data) | output.duration
    output.wrote(values, lambda _: render(values))
    return None


# `import` is a keyword, so the function has another name than the command.
import_recording.__name__ = "import"


def _road_options(choice: options.RoadChoice) -> dict[str, Any]:
    """The chosen road; without one, the options that change the road of the recording."""
    from overtaking.cli import arguments

    if choice.map_file is None and choice.road is None:
        limit = arguments.speed_limit(choice.speed_limit)
        return arguments.given(speed_limit=limit, driving_side=choice.driving_side)
    return {"road": arguments.road(choice)}


def _refuse_of_file(**given: Any) -> None:
    """Refuse options that only folders of recordings have."""
    for name, value in given.items():
        if value not in (None, False):
            raise ConfigError(
                what=f"--{name}",
                where="import",
                expected="a folder of recordings beside it",
                got="one file",
                next_step="leave it out",
            )


def _say_failures(output: Output, reasons: list[str]) -> None:
    """Print why recordings of a folder failed, ten at most."""
    for reason in reasons[:_MAX_FAILURES]:
        output.say(f"failed: {reason}")
    if len(reasons) > _MAX_FAILURES:
        output.say(f"failed: {len(reasons) - _MAX_FAILURES:,} others; recordings.json names them")


def _of_folder(values: dict[str, Any]) -> list[tuple[str, str]]:
    """Counts of a folder of recordings."""
    counts = [(name, f"{values[name]:,}") for name in _FOLDER_COUNTS]
    return [*counts, ("content", values["content_hash"]), ("tables", values["data"])]


def of_import(data: "Dataset") -> dict[str, Any]:
    """Counts of an imported recording, and the folder of the data set."""
    from overtaking.api import law

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
        "undecidable": law.undecidable_rules(identity.unknown),
        "counts": source.counts,
        "notes": source.notes,
        "content_hash": data.content_hash,
        "import_report": [finding.to_dict() for finding in data.import_findings],
    }


def render(values: dict[str, Any]) -> "RenderableType":
    """The counts, as tables."""
    from rich.console import Group

    from overtaking.cli.summary import show_command
    from overtaking.cli.tables import facts

    rows = [("recording", f"{values['recording']} ({values['format']})")]
    for name, value in (values["counts"] | values["notes"]).items():
        if name in _WORDS and value is not None:
            rows.append((_WORDS[name], f"{value:,}" if isinstance(value, int) else f"{value}"))
    rows.append(("not known", ", ".join(values["unknown"])))
    for name, codes in values["undecidable"].items():
        rows.append((f"undecidable {name}", " ".join(codes) or "none"))
    if values["notes"].get("time_scaling"):
        warning = "positions move at {} of the recorded speeds: the clock was scaled"
        rows.append(("beware", warning.format(values["notes"]["time_scaling"])))
    rows.append(("data set", f"{values['data']}: {values['simulations']:,} simulations"))
    return Group(facts(rows), show_command(values["data"], "next: "))
