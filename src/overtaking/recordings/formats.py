"""The formats that recordings can be imported from, and what each of them can be asked."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from overtaking.core.errors import ConfigError, ImportFormatError
from overtaking.core.files import unreadable_error
from overtaking.core.representation import as_utf8
from overtaking.recordings.messages import refused, shown
from overtaking.recordings.reading_progress import count_bytes, open_counted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from overtaking.recordings.pinto2023_import import TableScenes
    from overtaking.recordings.recording import Recording
    from overtaking.recordings.scenes import Scenes

_OF_ALL = frozenset({"attempts_only", "vehicles", "smooth", "speed_limit"})
FORMATS: dict[str, frozenset[str]] = {
    "commonroad": _OF_ALL | {"lanelet", "driving_side"},
    "exid": _OF_ALL | {"road", "only", "driving_side"},
    "highd": _OF_ALL | {"direction"},
    "ngsim": _OF_ALL | {"road", "only", "driving_side"},
    "pinto2023": frozenset({"road", "speed_limit"}),
    "table": _OF_ALL | {"road", "only", "columns", "driving_side"},
}
"""Each format with the options that its reader takes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Imported:
    """A recording that has been read, and where from.

    Attributes:
        scenes: The simulations that wait to be made.
        files: SHA-256 of each file that was read, by its name.
        options: The options of the call.
    """

    scenes: Scenes | TableScenes
    files: dict[str, str]
    options: dict[str, Any]


def read_recording(file_format: str, path: Path | str, options: Mapping[str, Any]) -> Imported:
    """Read a recording of any format, whole, before anything is made of it.

    Args:
        file_format: One of `FORMATS`.
        path: The file; of exiD and highD its `_tracks.csv`.
        options: Options of that format by name: `attempts_only`, `vehicles` (of a simulation),
            `lanelet` (an id), `driving_side` ("right" or "left"), `direction` (1 or 2), `road` (a
            `Road`), `columns` (a map), `only` (values that columns must have), `smooth` (whether
            tracks are smoothed), `speed_limit` (in m/s, in place of that of the file; infinite for
            none).

    Raises:
        ConfigError: There is no such format, an option is not for it, or the file does not have the
            road of an option.
        ImportFormatError: The file cannot be used; the message names line and element or column.
    """
    check_options(file_format, options)
    source = Path(path)
    # Before reading, so that a file that changes meanwhile is not named by what it became.
    paths = _files(file_format, source, options)
    with count_bytes(paths):
        files = {as_utf8(path.name): _sha256(path) for path in paths}
        scenes = _read(file_format, source, options)
    shown_options = {name: _plain(value) for name, value in options.items()}
    return Imported(scenes=scenes, files=files, options=shown_options)


def check_options(file_format: str, options: Mapping[str, Any]) -> None:
    """Refuse options that are wrong for every recording, before any is read.

    Args:
        file_format: One of `FORMATS`.
        options: As in `read_recording`.

    Raises:
        ConfigError: There is no such format, or an option is not for it or out of its range.
    """
    if file_format not in FORMATS:
        raise ConfigError.unknown_choice(
            what="format", where="import", choices=FORMATS, got=file_format
        )
    for name in options:
        if name not in FORMATS[file_format]:
            allowed = sorted(FORMATS[file_format])
            raise ConfigError.unknown_choice(
                what=f"option for {file_format}", where="import", choices=allowed, got=name
            )
    if file_format == "table" and "columns" not in options:
        raise ConfigError(
            what="columns",
            where="import table",
            expected="a map of columns",
            got="none",
            next_step="name it with --columns; --template writes one to fill in",
        )
    _check_values(file_format, options)


def _check_values(file_format: str, options: Mapping[str, Any]) -> None:
    """Refuse options of the format that are out of their range."""
    from overtaking.recordings.column_map import column_map
    from overtaking.recordings.highd import check_direction
    from overtaking.recordings.limits import check_speed_limit
    from overtaking.recordings.scenes import NUM_SLOTS, check_num_slots
    from overtaking.recordings.table_road import check_stated_road
    from overtaking.recordings.tables import with_driving_side

    side = options.get("driving_side")
    if file_format not in ("commonroad", "pinto2023"):
        columns = column_map(options.get("columns", file_format))
        with_driving_side(columns, side, options.get("road"))
        check_stated_road(columns)
    elif side not in (None, "right", "left"):
        raise ConfigError.unknown_choice(
            what="driving side", where="import", choices=("right", "left"), got=side
        )
    check_direction(options.get("direction"))
    check_num_slots(options.get("vehicles", NUM_SLOTS))
    if (limit := options.get("speed_limit")) is not None:
        check_speed_limit(limit, "import")


def _plain(value: Any) -> Any:
    """An option as it is written into the manifest."""
    if value == math.inf:  # JSON has no such number.
        return "none"
    if isinstance(value, str | Path):
        return as_utf8(str(value))
    return getattr(value, "name", value)


def _files(file_format: str, source: Path, options: Mapping[str, Any]) -> Sequence[Path]:
    """All files of a recording, and the map of its columns."""
    if file_format in ("commonroad", "pinto2023"):
        return (source,)
    from overtaking.recordings.column_map import column_map, files_of, map_names

    given = options.get("columns", file_format)
    is_file = isinstance(given, str | Path) and f"{given}" not in map_names()
    return (*files_of(source, column_map(given)).values(), *([Path(given)] if is_file else ()))


def _read(file_format: str, source: Path, options: Mapping[str, Any]) -> Scenes | TableScenes:
    """What the reader of a format finds."""
    if file_format == "pinto2023":
        from overtaking.recordings.pinto2023_import import read_pinto2023

        table = read_pinto2023(source, road=options.get("road"))
        if (limit := options.get("speed_limit")) is None:
            return table
        return replace(table, recording=table.recording.with_speed_limit(limit))
    from overtaking.recordings.scenes import NUM_SLOTS, scenes

    recording = _recording(file_format, source, options)
    if (limit := options.get("speed_limit")) is not None:
        recording = recording.with_speed_limit(limit)
    if options.get("smooth"):
        from overtaking.recordings.smoothing import smoothed

        recording = smoothed(recording)
    return scenes(
        recording,
        attempts_only=options.get("attempts_only", False),
        num_slots=options.get("vehicles", NUM_SLOTS),
    )


def _recording(file_format: str, source: Path, options: Mapping[str, Any]) -> Recording:
    """A recording of a format that has tracks."""
    if file_format == "commonroad":
        from overtaking.recordings.commonroad import read_commonroad

        return read_commonroad(
            source, lanelet_id=options.get("lanelet"), driving_side=options.get("driving_side")
        )
    if file_format == "highd":
        from overtaking.recordings.highd import read_highd

        return read_highd(source, direction=options.get("direction"))
    from overtaking.recordings.tables import read_table

    columns = options.get("columns", file_format)
    names = ("road", "only", "driving_side")
    chosen = {name: options[name] for name in names if name in options}
    return replace(read_table(source, columns, **chosen), file_format=file_format)


def _sha256(path: Path) -> str:
    """Hash over the bytes of a plain file, 64 hexadecimal digits."""
    try:
        if not path.is_file():
            reason = "no plain file" if path.exists() else "no such file"
            raise _unreadable(path, reason)
        with open_counted(path, "hash") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, ValueError) as error:
        if isinstance(error, ImportFormatError):
            raise
        refusal = unreadable_error(error, shown(str(path), length=120), ImportFormatError)
        got = getattr(error, "strerror", None) or "no path"
        raise refusal or _unreadable(path, got) from None


def _unreadable(path: Path, got: str) -> ImportFormatError:
    return refused(shown(str(path), length=120), "file", "a readable file", got, "check the path")
