"""From the words on the command line to the arguments of a public function."""

from __future__ import annotations

import math
import os
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, cast

from overtaking.core.errors import ConfigError
from overtaking.core.files import check_output_path
from overtaking.core.process_limits import THREADS_VARIABLE
from overtaking.core.units import kmh_from_mps, mps_from_kmh

if TYPE_CHECKING:
    from pathlib import Path

    from overtaking.cli.options import Chosen, MeasurementErrorOptions, RoadChoice
    from overtaking.labels.law.measurement_errors import MeasurementErrors
    from overtaking.model.road import Road
    from overtaking.recordings.opendrive_lanes import Side

FRAME_INTERVAL_KEY = "profile.frame_interval_ms"
MOST_NUMBERS = 1_000_000

_LIKE = {"--set": "traffic.vehicles=2..6", "--only": "Location=us-101"}

DEFAULTS: dict[str, Any] = {
    "profile": "pinto2023-physical",
    "num_simulations": 276,  # As many as the paper has.
    "seed": 1,
}
"""Defaults of `generate`."""


def limit_threads(threads: int | None) -> None:
    """Set the number of threads of the engine, which reads it at its first call."""
    if threads is not None:
        os.environ[THREADS_VARIABLE] = str(threads)


def given(**arguments: Any) -> dict[str, Any]:
    """The arguments that the user gave, without those that were left out."""
    return {name: value for name, value in arguments.items() if value not in (None, {})}


def measurement_errors(choice: MeasurementErrorOptions) -> MeasurementErrors | None:
    """The errors of measurement that the user gave, None without any.

    Raises:
        ConfigError: A standard deviation is out of its range.
    """
    deviations = given(position_std=choice.position_std, speed_std=choice.speed_std)
    if not deviations:
        return None
    from overtaking.labels.law.measurement_errors import MeasurementErrors

    return MeasurementErrors(**deviations)


def overrides(
    changes: list[str], frame_interval_ms: int | None, *, where: str = "--set"
) -> dict[str, Any]:
    """Changes of the profile, by dotted key.

    Args:
        changes: Texts of the form `key=value`; the last one of a key counts.
        frame_interval_ms: Time between two frames, if it is to be different.
        where: The option.

    Raises:
        ConfigError: A text has another form.
    """
    values: dict[str, Any] = {}
    for change in changes:
        key, equals, value = change.partition("=")
        if not (key.strip() and equals and value.strip()):
            raise ConfigError(
                what=repr(change),
                where=where,
                expected="KEY=VALUE",
                got=repr(change),
                next_step=f"write it like {where} {_LIKE[where]}",
            )
        values[key.strip()] = value.strip()
    if frame_interval_ms is not None:
        values[FRAME_INTERVAL_KEY] = frame_interval_ms
    return values


def choose_carla(server: str) -> None:
    """Say which CARLA server is used; its simulator looks when it is first called.

    Raises:
        ConfigError: The text is no address.
    """
    from overtaking.simulators.carla.library import HEADLESS, SERVER_VARIABLE, parse_address

    if server != HEADLESS:
        parse_address(server)
    os.environ[SERVER_VARIABLE] = server


def picture_size(text: str) -> tuple[int, int]:
    """Width and height from `WIDTHxHEIGHT`.

    Raises:
        ConfigError: The text has another form.
    """
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise ConfigError(
            what="size",
            where="--size",
            expected="WIDTHxHEIGHT",
            got=repr(text),
            next_step="write it like --size 1280x720",
        )
    return int(width), int(height)


def carla_simulator(driver: str) -> str:
    """The simulator of a driver.

    Raises:
        ConfigError: There is no such driver.
    """
    names = {"own": "carla", "traffic-manager": "carla-traffic-manager"}
    if driver not in names:
        raise ConfigError.unknown_choice(what="driver", where="--driver", choices=names, got=driver)
    return names[driver]


def road(choice: RoadChoice) -> Road | None:
    """The road that was asked for, None if it is the profile's.

    Args:
        choice: The options that choose it.

    Raises:
        ConfigError: There is no such road, or an option needs a map and no map is named.
        ImportFormatError: The file or the road cannot be used.
    """
    driving_side = cast("Side | None", choice.driving_side)
    limit = speed_limit(choice.speed_limit)
    name = choice.road if choice.map_file is None else choice.map_file
    if name is None:
        for option, value in (("--speed-limit", limit), ("--driving-side", driving_side)):
            if value is not None:
                raise ConfigError(
                    what=option,
                    where="road",
                    expected="a map, whose road the option changes",
                    got="no --map",
                    next_step="name an OpenDRIVE file with --map, or leave the option out",
                )
        return None
    from overtaking.recordings.roads import load_road

    road_id = None if choice.map_file is None else choice.road
    return load_road(name, road_id, speed_limit=limit, driving_side=driving_side)


def speed_limit(text: str | None) -> float | None:
    """The speed limit of an option [m/s], None without the option.

    Args:
        text: A number of km/h, or "none" where there is no limit.

    Raises:
        ConfigError: The text is neither.
    """
    if text is None:
        return None
    from overtaking.model.road_course import MAX_SPEED_LIMIT

    if text.strip().lower() == "none":
        return MAX_SPEED_LIMIT
    try:
        limit = mps_from_kmh(float(text))
    except ValueError:
        limit = math.nan
    if not 0.0 < limit <= MAX_SPEED_LIMIT:
        highest_kmh = f"{kmh_from_mps(MAX_SPEED_LIMIT):g}"
        raise ConfigError(
            what="--speed-limit",
            where="road",
            expected=f"a number of km/h, more than 0 and at most {highest_kmh}, or the word none",
            got=text,
            next_step="correct the limit",
        )
    return limit


def numbers(text: str | None, where: str) -> list[int] | None:
    """Numbers and ranges with commas between them; None without an argument.

    Args:
        text: Such as `1,7,20-29`.
        where: The command.

    Raises:
        ConfigError: It is something else.
    """
    if text is None:
        return None
    parts = [_numbers(part.strip(), where) for part in text.split(",")]
    if sum(map(len, parts)) > MOST_NUMBERS:
        raise _no_numbers(f"more than {MOST_NUMBERS} numbers", where)
    return [number for part in parts for number in part]


def chosen(asked: Chosen, where: str) -> dict[str, Any]:
    """The simulations and frames that were asked for, as the public functions take them.

    Args:
        asked: The options.
        where: The command.
    """
    return given(**asdict(asked) | {"simulation_ids": numbers(asked.simulation_ids, where)})


def _numbers(part: str, where: str) -> range:
    """A number, or all from one to another."""
    first, dash, last = part.partition("-")
    is_number = first.isdecimal() and (last.isdecimal() if dash else True)
    found = range(int(first), int(last or first) + 1) if is_number else range(0)
    if not found or len(found) > MOST_NUMBERS:
        raise _no_numbers(repr(part), where)
    return found


def _no_numbers(got: str, where: str) -> ConfigError:
    return ConfigError(
        what="--simulations",
        where=where,
        expected="numbers and ranges such as 1,7,20-29",
        got=got,
        next_step="write them with commas and without spaces",
    )


def export_target(out: Path, file_format: str, *, is_csv: bool | None) -> Path:
    """The target of an export: the paper's table is a file, every other format a folder.

    Args:
        out: As asked for.
        file_format: Name of the format.
        is_csv: Whether CSV or Parquet was asked for, None if neither.

    Raises:
        ConfigError: It does not fit the format.
    """
    if file_format == "pinto2023":
        return table_file(out, is_csv=is_csv)
    if is_csv is not None:
        raise ConfigError(
            what="kind of file",
            where=str(out),
            expected=f"none with --format {file_format}",
            got="--csv" if is_csv else "--parquet",
            next_step="leave the option out",
        )
    return out


def figure_file(out: Path | None) -> Path | None:
    """The file of a figure, refused before there is one if it cannot be written.

    Raises:
        ConfigError: Its folder is missing, or its ending is of no figure.
    """
    if out is not None:
        check_output_path(out)
    if out is None or (out.suffix in (".png", ".svg", ".pdf") and out.parent.is_dir()):
        return out
    raise ConfigError(
        what="figure",
        where=str(out),
        expected="a file that ends in .png, .svg or .pdf, in a folder that exists",
        got=f"the ending {out.suffix or '(none)'}" if out.parent.is_dir() else "no such folder",
        next_step="choose another name, or make the folder",
    )


def table_file(out: Path, *, is_csv: bool | None) -> Path:
    """The file of a table, with the ending that says its kind.

    Args:
        out: As asked for, with or without such an ending.
        is_csv: Whether CSV or Parquet was asked for, None if neither.

    Raises:
        ConfigError: It is a folder, or its ending says one thing and the option another.
    """
    if out.is_dir():
        raise ConfigError(
            what="--out",
            where=str(out),
            expected="a file",
            got="a folder",
            next_step=f"name a file in it, such as {out / 'table.csv'}",
        )
    kinds = {".csv": True, ".parquet": False}
    named = kinds.get(out.suffix)
    if named is None:
        return out.with_name(out.name + (".parquet" if is_csv is False else ".csv"))
    if is_csv is not None and is_csv != named:
        raise ConfigError(
            what="kind of file",
            where=str(out),
            expected="--csv for .csv, --parquet for .parquet",
            got="--csv" if is_csv else "--parquet",
            next_step="leave the option out, or choose another name",
        )
    return out
