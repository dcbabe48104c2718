"""Maps of columns: which column of a recording holds what, and in which unit.

A map is a TOML file. Those of known data sets lie in `columns/`; `template` writes one to fill in.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from overtaking.core.errors import ConfigError
from overtaking.core.files import read_toml
from overtaking.core.representation import as_utf8
from overtaking.model.vehicles import VehicleKind
from overtaking.recordings.messages import shown
from overtaking.recordings.table_streams import COMPRESSED_SUFFIXES, uncompressed_name
from overtaking.scenarios.specification_values import suggestion

MAPS = Path(__file__).with_name("columns")
"""The folder of the maps that are part of the package."""

TRACKS, VEHICLES, RECORDING = "tracks", "vehicles", "recording"
TABLES = (TRACKS, VEHICLES, RECORDING)
"""A recording is one table of states, or that and one of vehicles and one of a single row."""

UNITS: dict[str, tuple[str, float]] = {
    **{name: ("length", size) for name, size in
       (("m", 1.0), ("km", 1e3), ("cm", 1e-2), ("mm", 1e-3), ("ft", 0.3048))},
    **{name: ("time", size) for name, size in
       (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9), ("min", 60.0), ("h", 3600.0))},
    **{name: ("speed", size) for name, size in
       (("m/s", 1.0), ("km/h", 1.0 / 3.6), ("ft/s", 0.3048), ("mph", 0.44704))},
    **{name: ("acceleration", size) for name, size in (("m/s^2", 1.0), ("ft/s^2", 0.3048))},
    **{name: ("angle", size) for name, size in (("rad", 1.0), ("deg", 0.017453292519943295))},
    **{name: ("turning", size) for name, size in
       (("rad/s", 1.0), ("deg/s", 0.017453292519943295))},
    "1/s": ("rate", 1.0),
}  # fmt: skip
"""What a unit measures, and its size in SI units."""

QUANTITIES: dict[str, tuple[str, str]] = {
    "vehicle": ("", "number or name of the vehicle"),
    "frame": ("", "number of the frame; needs frames_per_second, or a column frame_rate"),
    "time": ("time", "in place of frame; no unit for dates, durations and ISO 8601"),
    "frame_rate": ("rate", "frames a second; of the table recording"),
    "x": ("length", "position, or four columns: the corners of the box"),
    "y": ("length", "position, or four columns: the corners in the same order"),
    "length": ("length", "of the vehicle"),
    "width": ("length", "of the vehicle"),
    "type": ("", "a word or number that [types] explains; without it kinds are not known"),
    "lane": ("", "number or name of the lane"),
    "direction": ("", "number of the carriageway; of highD"),
    "upper_lines": ("", "lane markings between semicolons; of highD"),
    "lower_lines": ("", "lane markings between semicolons; of highD"),
    "speed_limit": ("speed", "one for the whole recording, negative for none"),
    "speed": ("speed", "without it: from vx and vy, else from positions"),
    "vx": ("speed", "along x"),
    "vy": ("speed", "along y"),
    "heading": ("angle", "from the x axis towards the y axis; without it: from the movement"),
    "accel_lon": (
        "acceleration",
        "along the vehicle; without it: from ax and ay, else from speeds",
    ),
    "accel_lat": ("acceleration", "to its left; without it: from ax and ay, else from positions"),
    "ax": ("acceleration", "along x"),
    "ay": ("acceleration", "along y"),
    "yaw_rate": (
        "turning",
        "from the x axis towards the y axis; without it yaw rates are not known",
    ),
}
"""What a column may hold: what it measures, and what it means."""

POINTS = ("centre", "front", "corner", "corners")
"""Where x and y are: the centre of the box, the middle of its front, the corner with the smallest x
and y of a box along the axes, or all four corners."""

ROAD_KEYS = {
    "kind": str, "driving_side": str, "speed_limit_kmh": float, "heading_deg": float,
    "borders_m": list, "lanes": list,
}  # fmt: skip
"""What a map may say of the road, with types."""

_RECORDING_KEYS = {
    "name": str, "source": str, "tested": bool, "frames_per_second": float, "length_m": float,
    "width_m": float, "point": str, "y_axis": str, "is_exact": bool, "names": list,
    "thousands": str,
}  # fmt: skip
_SECTIONS = ("recording", "files", "columns", "types", "only", "road")
BY_LENGTH, LEFT_OUT, NOT_KNOWN = -1, -2, -3
"""Codes of types beside `VehicleKind`: a car whose length decides about its kind; a vehicle that is
not read; a vehicle of unknown kind."""

_KINDS = {
    "car": BY_LENGTH,
    "van": VehicleKind.VAN,
    "truck": VehicleKind.TRUCK,
    "motorcycle": VehicleKind.MOTORCYCLE,
    "bicycle": VehicleKind.BICYCLE,
    "left_out": LEFT_OUT,
    "not_known": NOT_KNOWN,
}

THOUSANDS = (".", ",", "none")
"""Separators of thousands in numbers that are text."""

_MOST_BYTES = 1 << 20
_CELL = re.compile(r"^(.*?)\s*\[([^\[\]]*)\]$")


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """Where a quantity is found.

    Attributes:
        table: One of `TABLES`.
        names: Names of the columns: one, or the four of corners.
        factor: Size of its unit in SI units.
        unit: Its unit, one of `UNITS`; empty without one.
    """

    table: str
    names: tuple[str, ...]
    factor: float
    unit: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnMap:
    """A map of columns, checked.

    Attributes:
        name: What it is called.
        source: Where the columns are documented.
        is_tested: Whether a reader was tested with files in these columns.
        columns: Where each of `QUANTITIES` is that the recording has.
        files: Ending of the file of each of `TABLES`; empty where there is one table.
        kinds: `VehicleKind`, `BY_LENGTH`, `LEFT_OUT` or `NOT_KNOWN` of each type of the source.
        only: Values that a column must have.
        road: What is said of the road, `ROAD_KEYS`.
        frames_per_second: Where no column has it, else None [1/s].
        length: Of vehicles, where no column has it, else None [m].
        width: The same [m].
        point: One of `POINTS`.
        y_is_left: Whether y grows to the left of x.
        is_exact: Whether it is damage if a vehicle is missing in a frame, or if frames are no whole
            milliseconds apart.
        header: Names of the columns of a file without any.
        thousands: One of `THOUSANDS`; None where the map does not say.
    """

    name: str
    source: str
    is_tested: bool
    columns: dict[str, Column]
    files: dict[str, str] = field(default_factory=dict[str, str])
    kinds: dict[str, int] = field(default_factory=dict[str, int])
    only: dict[str, str] = field(default_factory=dict[str, str])
    road: dict[str, Any] = field(default_factory=dict[str, Any])
    frames_per_second: float | None = None
    length: float | None = None
    width: float | None = None
    point: str = POINTS[0]
    y_is_left: bool = True
    is_exact: bool = False
    header: tuple[str, ...] = ()
    thousands: str | None = None

    def names(self, table: str) -> tuple[str, ...]:
        """The columns that are read of a table."""
        found = [name for one in self.columns.values() if one.table == table for name in one.names]
        return tuple(dict.fromkeys([*found, *(self.only if table == TRACKS else ())]))


@cache
def map_names() -> tuple[str, ...]:
    """The maps that are part of the package."""
    return tuple(sorted(path.stem for path in MAPS.glob("*.toml")))


def column_map(given: str | Path | Mapping[str, Any] | ColumnMap) -> ColumnMap:
    """A map of columns.

    Args:
        given: The name of one that is part of the package, the path of a TOML file, its content as
            a mapping, or only its section `columns`.

    Raises:
        ConfigError: There is none, or it is wrong; the message names section and key.
    """
    if isinstance(given, ColumnMap):
        return given
    if isinstance(given, Mapping):
        content = given if "columns" in given else {"columns": given}
        return _Reading("columns", content).map()
    path = MAPS / f"{given}.toml" if given in map_names() else Path(given)
    return _Reading(path.name, _content(path)).map()


def _content(path: Path) -> Mapping[str, Any]:
    """A map as it is written."""
    try:
        return read_toml(path, _MOST_BYTES)
    except OSError as error:
        got, step = error.strerror or "no path", f"choose a file, or {' or '.join(map_names())}"
    except (ValueError, RecursionError) as error:
        got, step = shown(f"{error}", length=150), "correct the file"
    raise ConfigError(
        what="map of columns",
        where=shown(str(path), length=120),
        expected="a TOML file",
        got=got,
        next_step=step,
    )


@dataclass(frozen=True, slots=True)
class _Reading:
    """A map that is being checked."""

    where: str
    content: Mapping[str, Any]

    def map(self) -> ColumnMap:
        """The checked map."""
        for name, section in self.content.items():
            if name not in _SECTIONS:
                raise self.unknown_key(name, name, _SECTIONS)
            if not isinstance(section, Mapping):
                raise self.refused(name, f"sections {', '.join(_SECTIONS)}", section)
        about = self.section("recording", _RECORDING_KEYS)
        files = self.section("files", dict.fromkeys(TABLES, str))
        columns = {
            name: self.column(name, cell, files)
            for name, cell in self.content.get("columns", {}).items()
        }
        road, kinds = self.section("road", ROAD_KEYS), self.kinds()
        # After all sections: an unknown key is often a missing one with a typing error.
        self.check_complete(columns, about, files)
        point, side = about.get("point", POINTS[0]), about.get("y_axis", "left")
        has_corners = "x" in columns and len(columns["x"].names) == len(columns["y"].names) == 4
        for key, value, known in (
            ("point", point, ("corners",) if has_corners else POINTS[:3]),
            ("y_axis", side, ("left", "right")),
            ("thousands", about.get("thousands", THOUSANDS[-1]), THOUSANDS),
        ):
            if value not in known:
                raise self.refused(f"recording.{key}", " or ".join(known), value)
        return ColumnMap(
            name=about.get("name", as_utf8(Path(self.where).stem)),
            source=about.get("source", ""),
            is_tested=about.get("tested", False),
            columns=columns,
            files=files,
            kinds=kinds,
            only={key: f"{value}" for key, value in self.content.get("only", {}).items()},
            road=road,
            frames_per_second=about.get("frames_per_second"),
            length=about.get("length_m"),
            width=about.get("width_m"),
            point=point,
            y_is_left=side == "left",
            is_exact=about.get("is_exact", False),
            header=tuple(about.get("names", ())),
            thousands=about.get("thousands"),
        )

    def section(self, name: str, known: Mapping[str, type]) -> dict[str, Any]:
        """A section with keys of known types."""
        values = dict(self.content.get(name, {}))
        for key, value in values.items():
            kind = known.get(key)
            if kind is None:
                raise self.unknown_key(f"{name}.{key}", key, known)
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            if not (is_number and abs(value) < 1e6 if kind is float else isinstance(value, kind)):
                raise self.refused(f"{name}.{key}", f"a value of type {kind.__name__}", value)
        return values

    def column(self, name: str, cell: object, files: Mapping[str, str]) -> Column:
        """A column from `name [unit]`, with the table before it where there are several."""
        if name not in QUANTITIES:
            raise self.unknown_key(f"columns.{name}", name, QUANTITIES)
        cells = cell if isinstance(cell, list) and name in ("x", "y") and len(cell) == 4 else [cell]
        parts = [self.part(name, one, files) for one in cells]
        tables, names, units = zip(*parts, strict=True)
        if len({*tables}) > 1 or len({*units}) > 1:
            raise self.refused(f"columns.{name}", "one table and one unit", cell)
        factor = UNITS[units[0]][1] if units[0] else 1.0
        return Column(table=tables[0], names=names, factor=factor, unit=units[0])

    def part(self, name: str, cell: object, files: Mapping[str, str]) -> tuple[str, str, str]:
        """Table, name and unit of one column."""
        if not isinstance(cell, str) or not cell.strip():
            raise self.refused(f"columns.{name}", "the name of a column", cell)
        measure = QUANTITIES[name][0]
        found = _CELL.match(cell.strip()) if measure else None
        unit = found.group(2).strip() if found else ""
        # Dates, durations and texts of ISO 8601 have no unit; the reader asks for that of numbers.
        is_wrong = UNITS.get(unit, ("", 0.0))[0] != measure
        if measure and is_wrong and not (name == "time" and found is None):
            known = ", ".join(one for one, (of, _) in UNITS.items() if of == measure)
            expected = f"a unit in brackets behind the name ({known})"
            raise self.refused(f"columns.{name}", expected, cell)
        text = found.group(1) if found else cell.strip()
        table, dot, rest = text.partition(".")
        if not (dot and table in files):
            table, rest = TRACKS, text
        return table, rest, unit

    def kinds(self) -> dict[str, int]:
        """The kind of each type."""
        kinds: dict[str, int] = {}
        for name, types in self.section("types", dict.fromkeys(_KINDS, list)).items():
            kinds |= dict.fromkeys((f"{one}" for one in types), int(_KINDS[name]))
        return kinds

    def check_complete(
        self, columns: Mapping[str, Column], about: Mapping[str, Any], files: Mapping[str, str]
    ) -> None:
        """Refuse a map that lacks what no verdict can be without."""
        has_rate = "frame_rate" in columns or about.get("frames_per_second", 0) > 0
        for what, is_there in (
            *((name, name in columns) for name in ("vehicle", "x", "y")),
            (
                "time, or frame with frames_per_second",
                "time" in columns or ("frame" in columns and has_rate),
            ),
            ("length, or recording.length_m", "length" in columns or "length_m" in about),
            ("width, or recording.width_m", "width" in columns or "width_m" in about),
        ):
            if not is_there:
                raise self.refused("columns", f"{what}", "none")
        if files and {*files} != {*TABLES}:
            raise self.refused("files", ", ".join(TABLES), ", ".join(files))

    def unknown_key(self, what: str, key: str, known: Iterable[str]) -> ConfigError:
        """The error for a key that maps do not have; it proposes the nearest known key."""
        return ConfigError(
            what=shown(what),
            where=self.where,
            expected="a known key",
            got=shown(repr(key)),
            next_step=suggestion(key, known),
        )

    def refused(self, what: str, expected: str, got: object) -> ConfigError:
        """The error for a part of the map."""
        return ConfigError(
            what=shown(what),
            where=self.where,
            expected=expected,
            got=shown(f"{got}"),
            next_step="correct the map; overtaking import table FILE --template writes one",
        )


def files_of(path: Path, columns: ColumnMap) -> dict[str, Path]:
    """The files of a recording by the names of `TABLES`.

    Args:
        path: The table of states.
        columns: The map, which has the endings of the names of the files.

    Returns:
        The files. Each may be compressed or not. Where a file exists in several forms, the
        compression of `path` comes first, then the uncompressed file.

    Raises:
        ConfigError: The path is not that of the table of states.
    """
    if not columns.files:
        return {TRACKS: path}
    ending, name = columns.files[TRACKS], uncompressed_name(path)
    if not name.lower().endswith(ending.lower()):
        raise ConfigError(
            what=f"{columns.name} recording",
            where="import",
            expected=f"a file whose name ends in {ending}",
            got=repr(path.name),
            next_step="name that file; the two others are found beside it",
        )
    stem, compression = name[: -len(ending)], path.name.removeprefix(name)
    return {
        table: _existing(path.with_name(f"{stem}{columns.files[table]}"), compression)
        for table in TABLES
    }


def _existing(path: Path, compression: str) -> Path:
    """The file of a name in the form that exists; the uncompressed name if none does.

    Args:
        path: The file without the ending of a compression.
        compression: The ending to try first, such as ".gz"; empty for none.
    """
    endings = dict.fromkeys((compression, "", *COMPRESSED_SUFFIXES))
    candidates = [path.with_name(path.name + ending) for ending in endings]
    existing = next((candidate for candidate in candidates if candidate.exists()), None)
    if existing is not None or not path.parent.is_dir():
        return existing or path
    # Files that were copied by other systems may have names in capital letters.
    lower = {candidate.name.lower(): rank for rank, candidate in enumerate(candidates)}
    others = [file for file in path.parent.iterdir() if file.name.lower() in lower]
    return min(others, key=lambda file: (lower[file.name.lower()], file.name), default=path)


def template(names: tuple[str, ...] = ()) -> str:
    """A map to fill in.

    Args:
        names: Columns of the table that it is for, listed in a comment.
    """
    lines = [
        "# A map of columns. Write the name of the column, and its unit in brackets, behind the",
        "# quantities that the table has, and remove the `#` before them.",
        f"# Columns of the table: {', '.join(shown(one) for one in names) or 'not known'}",
        "",
        "[recording]",
        'name = "my recording"',
        'source = ""               # where the columns are documented',
        "# frames_per_second = 25  # with a column of frames",
        f'point = "centre"          # where x and y are: {", ".join(POINTS)}',
        'y_axis = "left"           # y grows to the left of x, or to the right (as in images)',
        '# thousands = "."         # separator of thousands: ".", "," or "none"',
        "# length_m = 4.5          # of vehicles, where no column has it",
        "# width_m = 1.8",
        "",
        "[columns]",
    ]
    for name, (measure, about) in QUANTITIES.items():
        units = ", ".join(one for one, (of, _) in UNITS.items() if of == measure)
        unit = f" [{units.split(', ')[0]}]" if units else ""
        lines.append(f'# {name} = "...{unit}"  # {about}' + (f" ({units})" if units else ""))
    lines += [
        "",
        "[types]  # what a type is; an unlisted one is refused",
        *(f"# {name} = []" for name in _KINDS),
        "",
        "[only]   # rows to read, by the value of a column",
        "",
        "[road]   # what is left out is inferred from the traffic, or not known",
        '# kind = "motorway"',
        '# driving_side = "right"',
        "# speed_limit_kmh = 120",
        "# heading_deg = 0         # direction of travel, from the x axis towards the y axis",
        "# borders_m = [0, 3.5, 7] # lane borders; they grow to the left of travel",
        "# lanes = [1, 2]          # values of the column lane, from the slow to the fast side",
    ]
    return "\n".join(lines) + "\n"
