"""Limits that change along a road, as files state them: stretch after stretch."""

from collections.abc import Sequence
from itertools import pairwise

from overtaking.model.course import MAX_SPEED_LIMIT, Limit

NO_LIMIT = MAX_SPEED_LIMIT
"""Stands for a road without a speed limit [m/s]."""

Stated = tuple[float, float, float]
"""Where a stretch begins [m], the limit along the road from there on, and against it [m/s]."""


def highest_and_lower(
    stretches: Sequence[Stated], length: float
) -> tuple[float, tuple[Limit, ...]]:
    """The highest limit [m/s], and where lower ones hold.

    Args:
        stretches: In order, from the beginning of the road on.
        length: Of the road [m].

    Returns:
        `Road.speed_limit` and `Course.limits`. What both directions have from the same station to
        the same is one limit.
    """
    highest = max(max(one[1:]) for one in stretches)
    along, against = (
        _below(highest, [(one[0], one[way]) for one in stretches], length) for way in (1, 2)
    )
    found = {0: along & against, 1: along - against, -1: against - along}
    ordered = sorted((*one, way) for way, ones in found.items() for one in ones)
    return highest, tuple(
        Limit(start=start, stop=stop, speed=speed, direction=way)
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
