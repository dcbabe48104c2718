"""Roads that bend and rise."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from overtaking.model.reference_line import CurveSegment, ReferenceLine
from overtaking.model.road_course import RoadCourse

if TYPE_CHECKING:
    from overtaking.model.road import Road

BENDS = ((300.0, 0.0, 0.0), (100.0, 0.0, 1 / 400), (400.0, 1 / 400, 1 / 400),
         (200.0, 1 / 400, -1 / 400), (300.0, -1 / 400, -1 / 400),
         (100.0, -1 / 400, 0.0))  # fmt: skip
"""Length and curvature at both ends of the pieces of a winding road."""
HILLS = ((0.0, 0.0), (300.0, 0.03), (700.0, -0.04), (1200.0, 0.0))


def line(*parts: tuple[float, float, float]) -> tuple[CurveSegment, ...]:
    """Pieces, each where the one before it ends."""
    pieces, x, y, heading = [], 0.0, 0.0, 0.0
    for length, begin, end in parts:
        pieces.append(CurveSegment(x, y, heading, length, begin, end))
        there = ReferenceLine.from_segments(pieces[-1:]).pose_at(length)
        x, y, heading = float(there.x), float(there.y), float(there.heading)
    return tuple(pieces)


def on(road: Road, *parts: tuple[float, float, float], grade=()) -> Road:
    """A road laid out along other pieces."""
    course = dataclasses.replace(road.course or RoadCourse(), segments=line(*parts), grade=grade)
    return dataclasses.replace(road, x0=0.0, y0=0.0, heading=0.0, course=course)
