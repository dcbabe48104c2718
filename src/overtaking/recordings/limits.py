"""Speed limits of roads: those of a file, stretch by stretch, or one that the user states."""

import dataclasses
import math
from collections.abc import Sequence
from itertools import pairwise

from overtaking.core.errors import ConfigError
from overtaking.model.road import Road
from overtaking.model.road_course import MAX_SPEED_LIMIT, RoadCourse, SpeedLimitSpan

NO_LIMIT = MAX_SPEED_LIMIT
"""Speed limit of a road without one: the largest that `Road` allows [m/s]."""

Stated = tuple[float, float, float]
"""Where a stretch begins [m], the limit along the road from there on, and against it [m/s]."""


def with_speed_limit(road: Road, speed_limit: float) -> Road:
    """A road with one speed limit along all of it, in place of those of its file.

    Args:
        road: The road.
        speed_limit: The limit; infinite or `NO_LIMIT` for none [m/s].

    Raises:
        ConfigError: The limit is not positive, or too large.
    """
    check_speed_limit(speed_limit, f"road {road.name}")
    course = road.course and dataclasses.replace(road.course, speed_limit_spans=())
    return dataclasses.replace(
        road,
        speed_limit=min(speed_limit, NO_LIMIT),
        course=None if course == RoadCourse() else course,
    )


def check_speed_limit(speed_limit: float, where: str) -> None:
    """Refuse a limit that no road can have.

    Args:
        speed_limit: The limit; infinite or `NO_LIMIT` for none [m/s].
        where: The road or call, for the message.

    Raises:
        ConfigError: The limit is not positive, or too large.
    """
    if not (0.0 < speed_limit <= NO_LIMIT or speed_limit == math.inf):  # Also true for NaN.
        raise ConfigError(
            what="speed_limit",
            where=where,
            expected=f"more than 0 and at most {NO_LIMIT:g} m/s, or infinite",
            got=f"{speed_limit:g} m/s",
            next_step="pass a limit in m/s",
        )


def highest_and_lower(
    stretches: Sequence[Stated], length: float
) -> tuple[float, tuple[SpeedLimitSpan, ...]]:
    """The highest limit [m/s], and where lower ones hold.

    Args:
        stretches: In order, from the beginning of the road on.
        length: Of the road [m].

    Returns:
        `Road.speed_limit` and `RoadCourse.speed_limit_spans`. Equal limits of both directions
        between the same stations are one span.
    """
    highest = max(max(one[1:]) for one in stretches)
    along, against = (
        _below(highest, [(one[0], one[way]) for one in stretches], length) for way in (1, 2)
    )
    found = {0: along & against, 1: along - against, -1: against - along}
    ordered = sorted((*one, way) for way, ones in found.items() for one in ones)
    return highest, tuple(
        SpeedLimitSpan(start=start, stop=stop, speed=speed, direction=way)
        for start, stop, speed, way in ordered
    )


def _below(
    highest: float, limits: Sequence[tuple[float, float]], length: float
) -> set[tuple[float, float, float]]:
    """Where each lower limit begins and ends, and it."""
    changes = [limits[0], *(new for old, new in pairwise(limits) if new[1] != old[1])]
    stops = [*(start for start, _ in changes[1:]), length]
    return {
        (start, stop, limit)
        for (start, limit), stop in zip(changes, stops, strict=True)
        if limit < highest
    }
