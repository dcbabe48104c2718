"""Checks that left and right in a map of columns agree with the traffic of a table.

Traffic in one direction looks the same in a mirror. Two things show a mirrored table: the side of
oncoming traffic, and the order of lanes if the map lists them from the slow to the fast side.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from overtaking.model.road import DrivingSide
from overtaking.model.vehicles import VehicleKind
from overtaking.recordings.findings import Check
from overtaking.recordings.table_errors import refused

if TYPE_CHECKING:
    from collections.abc import Iterable

    from overtaking.core.arrays import F64
    from overtaking.core.errors import ImportFormatError
    from overtaking.model.road import Road
    from overtaking.recordings.column_map import ColumnMap
    from overtaking.recordings.findings import Finding
    from overtaking.recordings.rows import Rows

MIN_SIDE_OFFSET = 1.0
"""Least lateral distance between both directions of traffic at which the side is clear [m]."""

MIN_ONCOMING_SHARE = 0.05
"""Least number of oncoming vehicles per forward vehicle. Fewer may be unmarked bicycles or vehicles
that go the wrong way, which show no side."""

_MIN_DISTANCE = 20.0  # Vehicles that move less show no reliable direction [m].
_MIN_COSINE = 0.9  # Vehicles at more than 26° to the road cross it or leave it.
_MAX_SAMPLE = 20_000  # Rows that suffice for median offsets of lanes.


def check_sides(rows: Rows, columns: ColumnMap, road: Road, s: F64, d: F64) -> None:
    """Refuse a table in which traffic contradicts the sides that the map of columns states.

    Args:
        rows: The rows.
        columns: The map, which states the axes and may state the order of lanes.
        road: The road, which has the side that traffic keeps to.
        s: Position along the road, shape (row,) [m].
        d: Position to its left, same shape [m].

    Raises:
        ImportFormatError: Oncoming traffic is on the wrong side, or lanes are in the wrong order.
    """
    _check_oncoming(rows, road, s, d)
    _check_lane_order(rows, columns, road, d)


def check_directions(file_name: str, findings: Iterable[Finding]) -> None:
    """Refuse a table in which velocities or headings have other axes than positions.

    Args:
        file_name: Name of the table in messages.
        findings: Findings of the comparison of columns.

    Raises:
        ImportFormatError: A finding says that axes differ or that headings are flipped.
    """
    for finding in findings:
        is_mirrored = finding.check is Check.HEADINGS and "y is flipped" in finding.detail
        if finding.check is Check.AXES or is_mirrored:
            raise refused(
                file_name,
                "axes",
                "velocities and headings that agree with the movement of positions",
                finding.detail,
                "correct the columns or y_axis in the map of columns; angles turn from the x axis "
                "towards the y axis",
            )


def _check_oncoming(rows: Rows, road: Road, s: F64, d: F64) -> None:
    """Refuse oncoming traffic on the wrong side of the other traffic."""
    first, last = rows.start[:-1], rows.start[1:] - 1
    along, across = s[last] - s[first], d[last] - d[first]
    distance = np.hypot(along, across)
    is_along_road = (distance > _MIN_DISTANCE) & (np.abs(along) > _MIN_COSINE * distance)
    is_along_road &= rows.kind != VehicleKind.BICYCLE
    is_forward, is_oncoming = is_along_road & (along > 0.0), is_along_road & (along < 0.0)
    num_forward, num_oncoming = int(is_forward.sum()), int(is_oncoming.sum())
    if not num_forward or num_oncoming < max(1.0, MIN_ONCOMING_SHARE * num_forward):
        return
    mean_d = np.add.reduceat(d, first) / np.diff(rows.start)
    to_left = float(np.median(mean_d[is_oncoming]) - np.median(mean_d[is_forward]))
    side, oncoming_side = _sides(road)
    if to_left * _sign(road) < -MIN_SIDE_OFFSET:
        raise _side_error(
            rows.where,
            "oncoming traffic",
            f"vehicles to the {oncoming_side} of the others, as traffic keeps to the {side}",
            f"{num_oncoming} vehicles {abs(to_left):.1f} m to the {side}",
        )


def _check_lane_order(rows: Rows, columns: ColumnMap, road: Road, d: F64) -> None:
    """Refuse lanes that the map states in the order from the fast to the slow side."""
    if rows.lane is None or "lanes" not in columns.road:
        return
    step = max(1, len(d) // _MAX_SAMPLE)
    lane, sample = rows.lane[::step], d[::step]
    offsets = [sample[lane == str(name)] for name in columns.road["lanes"]]
    centres = np.array([np.median(offset) for offset in offsets if len(offset)])
    steps = np.diff(centres) * _sign(road)
    if len(steps) and (steps < 0.0).all():
        side, fast_side = _sides(road)
        raise _side_error(
            rows.where,
            "order of lanes",
            f"road.lanes from the {side} to the {fast_side}, as traffic keeps to the {side}",
            f"{', '.join(str(name) for name in columns.road['lanes'])} from the {fast_side}",
        )


def _sign(road: Road) -> float:
    """1.0 where traffic keeps to the right (faster lanes have larger d), else -1.0."""
    return 1.0 if road.driving_side is DrivingSide.RIGHT else -1.0


def _sides(road: Road) -> tuple[str, str]:
    """The side that traffic keeps to, and the other one."""
    return ("right", "left") if road.driving_side is DrivingSide.RIGHT else ("left", "right")


def _side_error(file_name: str, what: str, expected: str, got: str) -> ImportFormatError:
    """The error for traffic that contradicts the sides in the map of columns."""
    return refused(
        file_name,
        what,
        expected,
        got,
        "correct y_axis (in images y grows to the right of x), road.driving_side, road.lanes or "
        "road.heading_deg in the map",
    )
