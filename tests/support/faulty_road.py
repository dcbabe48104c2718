"""A road that is wrong about distant traffic, which a worker process can find by name."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from overtaking.model.known_roads import known_road
from overtaking.model.road import Road

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from overtaking.core.arrays import F64

FAR = 100_000.0
"""Recordings beyond this x make the road fail [m]."""


class FaultyRoad(Road):
    """Stands for a fault of the package in recordings beyond `FAR`."""

    __slots__ = ()

    def from_source(self, x: ArrayLike, y: ArrayLike) -> tuple[F64, F64]:
        """Positions in the world of the road, as in `Road`."""
        if np.max(x) > FAR:
            raise ZeroDivisionError("the road is wrong about distant traffic")
        return super().from_source(x, y)


def faulty_road(name: str = "motorway") -> FaultyRoad:
    """A road of the package with that fault."""
    road = known_road(name)
    values = {field.name: getattr(road, field.name) for field in dataclasses.fields(road)}
    return FaultyRoad(**values)
