"""Tables of states as recordings: any columns, units and rate that a map names."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.core.errors import ConfigError
from overtaking.core.representation import as_utf8
from overtaking.model.road import DrivingSide
from overtaking.recordings.column_map import ColumnMap, column_map
from overtaking.recordings.examination import examine
from overtaking.recordings.findings import Check
from overtaking.recordings.reading_progress import report_stage
from overtaking.recordings.recording import (
    NEVER_RECORDED,
    Recording,
    Tracks,
    bending,
    by_ways,
    kept,
    lane_codes,
    on_road,
    slope,
)
from overtaking.recordings.recording_checks import check_lanes, check_rows
from overtaking.recordings.table_axes import check_directions, check_sides
from overtaking.recordings.table_errors import refused
from overtaking.recordings.table_road import LANES_FITTED, MOST_BEND, check_straight, located
from overtaking.recordings.table_streams import uncompressed_name
from overtaking.recordings.track_table import read_track_rows

if TYPE_CHECKING:
    from collections.abc import Mapping

    from overtaking.core.arrays import F64
    from overtaking.model.road import Road
    from overtaking.recordings.rows import Rows


_MOVES = 0.5  # Below this speed a movement has no reliable direction [m/s].
_MOST_BEND_ON_GIVEN_ROAD = 4.0  # A lane: short tracks may show overtakes and nothing else [m].
_WIDEST = 1.0e6  # Farther from each other than any two vehicles of a recording are [m].


def read_table(
    path: Path | str,
    columns: str | Path | Mapping[str, Any] | ColumnMap,
    *,
    road: Road | None = None,
    only: Mapping[str, str] | None = None,
    driving_side: str | None = None,
) -> Recording:
    """The traffic in a table, or in the three of highD's family.

    Args:
        path: The file; CSV, Parquet or Arrow.
        columns: The column of each quantity; see `column_map`.
        road: The road, in the axes of the table; by default what the map says of it, and else
            lanes are inferred from the traffic.
        only: Values that columns must have.
        driving_side: Side that traffic keeps to, "right" or "left", in place of that of the map of
            columns.

    Raises:
        ImportFormatError: A file is missing or damaged, or no straight road can be inferred; the
            message names line and column.
        ConfigError: The map is wrong.
    """
    chosen = with_driving_side(column_map(columns), driving_side, road)
    rows = read_track_rows(Path(path), chosen, only)
    report_stage("rows")
    name = as_utf8(Path(uncompressed_name(Path(path))).stem)
    return recording_of(rows, chosen, name, road=road)


def with_driving_side(columns: ColumnMap, side: str | None, road: Road | None) -> ColumnMap:
    """A map of columns with the side of traffic that the user states.

    Args:
        columns: The map.
        side: "right" or "left", None for the side of the map.
        road: The road of the traffic, None if it is inferred. Its side must be the same.

    Raises:
        ConfigError: The side is unknown, or differs from that of the road.
    """
    if side is None:
        return columns
    sides = [driving_side.value for driving_side in DrivingSide]
    if side not in sides:
        raise ConfigError.unknown_choice(
            what="driving side", where="import", choices=sides, got=side
        )
    if road is not None and road.driving_side.value != side:
        raise ConfigError(
            what="driving side",
            where=f"road {road.name}",
            expected=road.driving_side.value,
            got=side,
            next_step="leave the side out, or correct the rule of the road in its map",
        )
    return replace(columns, road={**columns.road, "driving_side": side})


def recording_of(
    rows: Rows, columns: ColumnMap, name: str, *, road: Road | None = None
) -> Recording:
    """The traffic in rows.

    Args:
        rows: The rows.
        columns: The map that they were read with.
        name: What the recording is called.
        road: As in `read_table`.

    Raises:
        ImportFormatError: No straight road can be inferred, or nobody drives along it.
        ConfigError: The map is wrong.
    """
    findings = check_rows(rows)
    check_directions(rows.where, findings)
    place = located(rows, columns, road)
    if not np.ptp(place.s) < _WIDEST:
        raise refused(rows.where, "positions", f"less than {_WIDEST:g} m", f"{np.ptp(place.s):g} m")
    bend = check_straight(
        rows, place.s, place.d, MOST_BEND if road is None else _MOST_BEND_ON_GIVEN_ROAD
    )
    check_sides(rows, columns, place.road, place.s, place.d)
    driven = tracks_of(rows, place.road, place.s, place.d)
    report_stage("tracks")
    if columns.point == "front":
        driven = _centred(driven, place.road)
    there = on_road(place.road, driven.s, driven.d)
    if place.notes["lanes_from"] == LANES_FITTED:
        findings += check_lanes(
            place.road, kept(driven, there, rows.frame_interval_ms), rows.frame_interval_ms
        )
    ways = by_ways(kept(driven, there, rows.frame_interval_ms), place.road)
    if not ways.along:
        oncoming = ways.oncoming + ways.left_out
        got = f"{oncoming} oncoming ones" if oncoming else "none"
        # Headings that are turned by more than 90 degrees make all vehicles oncoming ones.
        got += "".join(f"; {one.detail}" for one in findings if one.check is Check.HEADINGS)
        raise refused(rows.where, "vehicles", "some that drive along the road", got)
    unknown = NEVER_RECORDED | {"weather"} | place.unknown
    unknown |= {"kinds"} if "type" not in columns.columns else frozenset()
    unknown |= {"yaw_rate"} if "yaw_rate" not in columns.columns else frozenset()
    recording = Recording(
        name=f"{columns.name} {name}",
        file_format="table",
        road=place.road,
        frame_interval_ms=rows.frame_interval_ms,
        tracks=ways.tracks,
        unknown=unknown,
        notes={
            **place.notes,
            **rows.notes,
            **ways.notes,
            "straightening_m": bend,
            "states": ways.tracks.num_rows,
            "states_off_the_road": driven.num_rows - int(there.sum()),
            "world_shift_m": [place.road.origin_x, place.road.origin_y],
            "derived": derived(columns),
            "columns": {"source": columns.source, "tested": columns.is_tested},
        },
        findings=tuple(findings),
        time_origin_s=rows.time_origin_s,
    )
    examined = examine(recording)
    report_stage("examination")
    return examined


def derived(columns: ColumnMap) -> list[str]:
    """What is worked out from positions, because no column holds it."""
    there = columns.columns.keys()
    ways = {
        "speed": ({"speed"}, {"vx", "vy"}),
        "heading": ({"heading"}, {"vx", "vy"}),
        "accel_lon": ({"accel_lon"}, {"ax", "ay"}),
        "accel_lat": ({"accel_lat"}, {"ax", "ay"}),
    }
    return [name for name, sets in ways.items() if not any(one <= there for one in sets)]


def tracks_of(rows: Rows, road: Road, s: F64, d: F64) -> Tracks:
    """The vehicles in road coordinates; what no column holds is worked out from positions.

    Args:
        rows: The rows.
        road: The road.
        s: Along it, shape (row,) [m].
        d: To its left, same shape [m].
    """
    given, nothing = rows.values, np.zeros(len(s))
    turn = road.heading_at(s)
    cosine, sine = np.cos(turn), np.sin(turn)
    stretch, turning = bending(road, s, d)

    def turned(name: str) -> tuple[F64, F64] | None:
        if f"{name}x" not in given or f"{name}y" not in given:
            return None
        east, north = given[f"{name}x"], given[f"{name}y"]
        return east * cosine + north * sine, north * cosine - east * sine

    def rate(values: F64) -> F64:
        return slope(values, rows.start, rows.frame_interval_ms)

    along, left = turned("v") or (rate(s) * stretch, rate(d))
    speed = np.abs(given["speed"]) if "speed" in given else np.hypot(along, left)
    heading = np.where(np.hypot(along, left) > _MOVES, np.arctan2(left, along), 0.0)
    if "heading" in given:
        heading = given["heading"] - turn
        heading = heading - np.round(heading / (2.0 * np.pi)) * (2.0 * np.pi)
    # The axes that these are told in turn with the road.
    turn_rate = turning * along
    push, pull = turned("a") or (rate(along) - turn_rate * left, rate(left) + turn_rate * along)
    cosine, sine = np.cos(heading), np.sin(heading)
    lon = push * cosine + pull * sine if turned("a") else rate(speed)
    x, y = road.to_world(s, d)
    return Tracks(
        names=rows.names,
        kind=rows.kind.astype(np.uint8),
        is_kind_known=rows.is_kind_known,
        length=rows.length,
        width=rows.width,
        carriageway=np.zeros(len(rows.names), np.int64),
        file_row=rows.file_row,
        first=rows.frame[rows.start[:-1]],
        start=rows.start,
        x=x,
        y=y,
        s=s,
        d=d,
        speed=speed,
        heading=turn + heading,
        accel_lon=given.get("accel_lon", lon),
        accel_lat=given.get("accel_lat", pull * cosine - push * sine),
        yaw_rate=given.get("yaw_rate", nothing),
        wheel_angle=nothing,
        lane=lane_codes(road, d),
    )


def _centred(tracks: Tracks, road: Road) -> Tracks:
    """The tracks of centres, from those of the middles of the fronts."""
    half = tracks.length[tracks.vehicle] * 0.5
    x, y = tracks.x - half * np.cos(tracks.heading), tracks.y - half * np.sin(tracks.heading)
    s, d = road.to_road(x, y)
    return replace(tracks, s=s, d=d, x=x, y=y, lane=lane_codes(road, d))
