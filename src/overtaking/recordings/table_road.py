"""The road of a table: one that is given, that its map states, or that the traffic shows.

A road is inferred as a straight one in the direction in which most vehicles move, or, where their
ways bend, along the line that they have in common. Lanes are where the traffic drives: around the
medians of the named lanes where a column names them; else in the comb of equally wide lanes that
best fits the positions across the road.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.core.errors import ConfigError, ImportFormatError
from overtaking.model.reference_line import CurveSegment, ReferenceLine
from overtaking.model.road import (
    MAX_LANES,
    MAX_ORIGIN,
    MIN_LANE_WIDTH,
    DrivingSide,
    Lane,
    Road,
    RoadMark,
)
from overtaking.model.road_course import RoadCourse
from overtaking.recordings.fitting import is_straight
from overtaking.recordings.limits import NO_LIMIT
from overtaking.recordings.origins import origin_near
from overtaking.recordings.table_errors import refused
from overtaking.recordings.table_line import line_of_traffic

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from overtaking.core.arrays import F64
    from overtaking.recordings.column_map import ColumnMap
    from overtaking.recordings.rows import Rows


LANES_FITTED = "traffic, equally wide"
"""Note `lanes_from` of a road whose lanes are inferred from traffic, all of one width."""

WIDTHS = np.arange(2.75, 4.26, 0.01)
"""Widths of lanes that are looked for [m]."""

LEAST_COMB = 0.4
"""How far traffic has to keep to a comb of lanes: 1 if all drive along the middles of lanes, 0 if
they drive anywhere."""

LEAST_SHARE = 0.003
"""Share of all states that makes a lane of what is beside other lanes."""

MOST_BEND = 0.5
"""Largest middle ordinate of the vehicles' ways, in the median, on a road that counts as straight:
half of the room that a car has beside it in a lane [m]."""

_LEAST_WAY = 20.0  # Shorter ways have no direction that is worth counting [m].
_BEYOND = 25.0  # Road before the first and after the last position: the longest body fits [m].
_SAMPLE = 20_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Located:
    """A road and where the rows are on it.

    Attributes:
        road: The road.
        s: Along it, shape (row,) [m].
        d: To the left of it, same shape [m].
        unknown: What is not known of the road, names of `UNKNOWNS`.
        notes: Where it comes from.
    """

    road: Road
    s: F64
    d: F64
    unknown: frozenset[str]
    notes: dict[str, Any]


def located(rows: Rows, columns: ColumnMap, road: Road | None) -> Located:
    """Where the rows are on a road.

    Args:
        rows: The rows.
        columns: The map, which may state the road or parts of it.
        road: The road, if it is known.

    Raises:
        ImportFormatError: No road can be inferred.
        ConfigError: What the map says is not what a road is.
    """
    x, y = rows.values["x"], rows.values["y"]
    if road is not None:
        s, d = road.to_road(*road.from_source(x, y))
        notes = {"lanes_from": f"road {road.name}"}
        return Located(road=road, s=s, d=d, unknown=frozenset(), notes=notes)
    origin = origin_near(x, y)
    x, y = x - origin[0], y - origin[1]
    stated = columns.road
    given = stated.get("heading_deg")
    heading = _direction(rows, x, y) if given is None else _stated_heading(columns, given)
    cosine, sine = np.cos(heading), np.sin(heading)
    along, across = x * cosine + y * sine, y * cosine - x * sine
    notes: dict[str, Any] = {}
    line = None
    if "borders_m" not in stated and bend_of(rows, along, across) > MOST_BEND:
        line = line_of_traffic(rows, x, y, None if given is None else heading)
        along, across = ReferenceLine.from_segments(line.pieces).to_road(x, y)
        notes["line_pieces"], notes["line_off_m"] = len(line.pieces), round(line.miss, 3)
    if "borders_m" in stated:
        # Stated borders count from the origin of the table, `across` from the one near the traffic.
        origin_across = origin[1] * cosine - origin[0] * sine
        borders = _stated_borders(stated["borders_m"]) - origin_across
        notes["lanes_from"] = "map of columns"
    elif rows.lane is not None and "lanes" in stated:
        borders = _named_borders(rows, across, [f"{one}" for one in stated["lanes"]])
        notes["lanes_from"] = "traffic, by the named lanes"
    else:
        is_forward = _forward(rows, along)
        if not is_forward.any():
            expected = "some that drive in the direction of heading_deg"
            raise refused(rows.where, "vehicles", expected, "none")
        borders, fit = _comb(rows.where, across[is_forward])
        notes |= {"lanes_from": LANES_FITTED, "lane_fit": round(fit, 3)}
    if line is None:
        first, middle = float(along.min()) - _BEYOND, float(borders[0] + borders[-1]) * 0.5
        length = float(along.max()) + _BEYOND - first
        begin = first * cosine - middle * sine, first * sine + middle * cosine
        pieces = (CurveSegment(*begin, heading, max(length, 1.0)),)
    else:
        first, middle, pieces = 0.0, 0.0, line.pieces
    limit = _limit(rows.about, columns)
    made = _road(rows.where, columns, borders - middle, pieces, limit=limit, origin=origin)
    notes |= {"lane_widths_m": np.round(np.diff(borders), 2).tolist()}
    return Located(
        road=made,
        s=along - first,
        d=across - middle,
        unknown=_unknown(rows, columns),
        notes=notes,
    )


def _stated_heading(columns: ColumnMap, heading_deg: float) -> float:
    """The direction of travel, in axes of which y is to the left of x [rad].

    The map states it from the table's x axis towards its y axis.
    """
    return float(np.deg2rad(heading_deg if columns.y_is_left else -heading_deg))


def bend_of(rows: Rows, s: F64, d: F64) -> float:
    """Median middle ordinate of the vehicles' ways: how far they are from the road's [m]."""
    first, last = rows.start[:-1], rows.start[1:] - 1
    middle = (first + last) // 2
    way = s[last] - s[first]
    long = np.abs(way) > _LEAST_WAY
    if not long.any():
        return 0.0
    part = (s[middle] - s[first])[long] / way[long]
    chord = d[first][long] + part * (d[last] - d[first])[long]
    return float(np.median(np.abs(d[middle][long] - chord)))


def check_straight(rows: Rows, s: F64, d: F64, max_bend: float = MOST_BEND) -> float:
    """The bend of the ways against the road, refused where it is no bend of the road."""
    bend = bend_of(rows, s, d)
    if bend > max_bend:
        raise refused(
            rows.where,
            "ways of the vehicles",
            f"a road that they drive along: at most {max_bend:g} m from the chord in their middle",
            f"{bend:.2f} m",
        )
    return round(bend, 3)


def _direction(rows: Rows, x: F64, y: F64) -> float:
    """The direction of travel: the median of the ways' angles, weighted by length [rad]."""
    first, last = rows.start[:-1], rows.start[1:] - 1
    east, north = x[last] - x[first], y[last] - y[first]
    way, angle = np.hypot(east, north), np.arctan2(north, east)
    if not way.max() > _LEAST_WAY:
        expected = f"one that moves by {_LEAST_WAY:g} m"
        raise refused(rows.where, "vehicles", expected, f"at most {way.max():.1f} m")
    # Both directions of an axis are one: angles are doubled, and most of the traffic chooses.
    double = np.angle(np.sum(way * np.exp(2j * angle))) / 2.0
    ahead = np.cos(angle - double)
    if np.sum(way * np.sign(ahead)) < 0.0:
        double, ahead = double + np.pi, -ahead
    off = np.angle(np.exp(1j * (angle - double)))[ahead > 0.0]
    weight = way[ahead > 0.0]
    order = np.argsort(off, kind="stable")
    half = np.searchsorted(np.cumsum(weight[order]), weight.sum() * 0.5)
    heading = double + off[order][half]
    return float(np.angle(np.exp(1j * heading)))


def _forward(rows: Rows, along: F64) -> NDArray[np.bool_]:
    """The rows of vehicles that drive in the direction of the road."""
    return (along[rows.start[1:] - 1] > along[rows.start[:-1]])[rows.vehicle]


def _comb(where: str, across: F64) -> tuple[F64, float]:
    """Borders of the equally wide lanes that fit best, and how well they do."""
    if not len(across):
        raise refused(where, "vehicles", "some that drive along the road", "none")
    across = across[:: max(1, len(across) // _SAMPLE)]
    turns = np.exp(2j * np.pi * across / WIDTHS[:, None]).mean(axis=1)
    best = int(np.argmax(np.abs(turns)))
    width, fit = float(WIDTHS[best]), float(np.abs(turns[best]))
    centre = float(np.angle(turns[best])) / (2.0 * np.pi) * width
    lane = np.rint((across - centre) / width).astype(np.int64)
    numbers, count = np.unique(lane, return_counts=True)
    used = numbers[count >= LEAST_SHARE * len(across)]
    lanes = int(np.ptp(used)) + 1 if len(used) else 0
    if fit < LEAST_COMB or not 2 <= lanes <= MAX_LANES:
        got = f"{lanes} lanes of {width:.2f} m, fit {fit:.2f}"
        expected = f"traffic in 2 to {MAX_LANES} lanes, fit at least {LEAST_COMB:g}"
        raise refused(where, "lanes from the traffic", expected, got)
    return centre + (np.arange(used.min(), used.max() + 2) - 0.5) * width, fit


def _named_borders(rows: Rows, across: F64, names: list[str]) -> F64:
    """Borders half-way between the medians of named lanes, from the slow to the fast side."""
    assert rows.lane is not None
    found = [across[rows.lane == name] for name in names]
    centres = np.array([np.median(each) for each in found if len(each)])
    apart = np.diff(centres)
    if len(centres) < 2 or (np.abs(apart) < MIN_LANE_WIDTH).any() or np.ptp(np.sign(apart)):
        got = ", ".join(f"{one:.1f} m" for one in centres) or "none"
        expected = "medians of two lanes or more, in the order of road.lanes"
        raise refused(rows.where, "lanes from the traffic", expected, got)
    between = (centres[1:] + centres[:-1]) * 0.5
    ends = centres[0] - apart[0] * 0.5, centres[-1] + apart[-1] * 0.5
    return np.concatenate([[ends[0]], between, [ends[1]]])


def _stated_borders(given: list[Any]) -> F64:
    """Borders that a map states."""
    try:
        borders = np.array(given, np.float64)
        is_right = borders.ndim == 1 and len(borders) > 1 and (np.diff(borders) > 0.0).all()
    except (ValueError, TypeError):
        borders, is_right = np.zeros(0), False
    if is_right and np.abs(borders).max() < MAX_ORIGIN:
        return borders
    raise ConfigError(
        what="road.borders_m",
        where="map of columns",
        expected="two growing numbers or more, from the right to the left",
        got=f"{given}"[:80],
        next_step="correct the map",
    )


def check_stated_road(columns: ColumnMap) -> None:
    """Refuse a map of columns whose road is impossible, before a recording is read.

    Args:
        columns: The map.

    Raises:
        ConfigError: No road can have its borders, side, direction or speed limit.
    """
    borders = _stated_borders(columns.road.get("borders_m", [0.0, 3.5]))
    heading = float(np.deg2rad(columns.road.get("heading_deg", 0.0)))
    pieces = (CurveSegment(0.0, 0.0, heading, 1.0),)
    limit = _limit({}, columns)
    try:
        # Borders may count from a distant origin; the width of the lanes is checked.
        _road("map of columns", columns, borders - borders[0], pieces, limit=limit)
    except ImportFormatError as error:
        raise ConfigError(str(error)) from None


def _road(
    where: str,
    columns: ColumnMap,
    borders: F64,
    pieces: tuple[CurveSegment, ...],
    *,
    limit: float | None,
    origin: tuple[float, float] = (0.0, 0.0),
) -> Road:
    """The road between some borders.

    Args:
        where: The recording, for a message.
        columns: The map, which may state parts of the road.
        borders: Offsets of the borders of the lanes from the line, shape (border,) [m].
        pieces: The line, in coordinates that count from the origin.
        limit: As `_limit` returns it [m/s].
        origin: Position in the table of the point that coordinates count from [m].
    """
    side = columns.road.get("driving_side", "right")
    if side not in ("right", "left"):
        raise ConfigError.unknown_choice(
            what="road.driving_side", where="map of columns", choices=("right", "left"), got=side
        )
    widths = np.abs(np.diff(borders))
    is_right = side == "right"
    if (borders[-1] > borders[0]) != is_right:
        borders, widths = borders[::-1], widths[::-1]
    try:
        return Road(
            name=columns.name,
            kind=columns.road.get("kind", "motorway"),
            driving_side=DrivingSide(side),
            lanes=tuple(
                Lane(
                    lane_id=(k - len(widths)) if is_right else len(widths) - k,
                    width=float(width),
                    right_mark=RoadMark.NONE,
                    left_mark=RoadMark.NONE,
                )
                for k, width in enumerate(widths)
            ),
            kerb_edge_d=float(borders[0]),
            length=sum(piece.length for piece in pieces),
            x0=pieces[0].x,
            y0=pieces[0].y,
            heading=pieces[0].heading,
            origin_x=origin[0],
            origin_y=origin[1],
            speed_limit=NO_LIMIT if limit is None or limit < 0.0 else limit,
            course=None if is_straight(pieces) else RoadCourse(segments=pieces),
        )
    except ConfigError as error:
        raise refused(where, "road", "one that the model is made for", f"{error}") from None


def _limit(about: Mapping[str, Any], columns: ColumnMap) -> float | None:
    """The speed limit that is known, negative for none; None where it is not known [m/s]."""
    stated = columns.road.get("speed_limit_kmh")
    return about.get("speed_limit") if stated is None else float(stated) / 3.6


def _unknown(rows: Rows, columns: ColumnMap) -> frozenset[str]:
    """What neither the table nor its map tells of the road."""
    unknown = {"marks"}
    if _limit(rows.about, columns) is None:
        unknown.add("speed_limit")
    if "kind" not in columns.road:
        unknown.add("road_kind")
    return frozenset(unknown)
