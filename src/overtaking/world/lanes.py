"""The road for the step: lateral axis towards the fast side, padded to a fixed size."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from overtaking.core.elementary import F32, as_f32, sincos
from overtaking.model.road import MAX_LANES, DrivingSide, Road
from overtaking.world import film
from overtaking.world.constants import known


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadParameters:
    """The road as the step sees it, lateral axis towards the fast side.

    Attributes:
        num_lanes: Driving lanes.
        boundaries: Lane borders from slow to fast, padded with the last, shape (MAX_LANES + 1,)
            [m].
        film_path: `film.film_per_path` of each lane, padded, shape (MAX_LANES,).
        side: +1 in right-hand traffic, -1 in left-hand traffic.
        x0: World x of the road's origin [m].
        y0: World y [m].
        heading: Direction of travel [rad].
        cosine: Of the heading.
        sine: Of the heading.
    """

    num_lanes: int
    boundaries: F32
    film_path: F32
    side: np.float32
    x0: np.float32
    y0: np.float32
    heading: np.float32
    cosine: np.float32
    sine: np.float32


@lru_cache(maxsize=16)
def road_parameters(road: Road) -> RoadParameters:
    """The road as the step sees it; all callers share its arrays, which must not be changed."""
    side = np.float32(1.0 if road.driving_side is DrivingSide.RIGHT else -1.0)
    borders = _padded(side * as_f32(road.boundaries))
    heading = np.float32(road.heading)
    sine, cosine = sincos(heading)
    return RoadParameters(
        num_lanes=road.num_lanes,
        boundaries=borders,
        film_path=film.film_per_path(_drainage_path(borders)),
        side=side,
        x0=np.float32(road.x0),
        y0=np.float32(road.y0),
        heading=heading,
        cosine=np.float32(cosine),
        sine=np.float32(sine),
    )


def _padded(borders: F32) -> F32:
    """Borders with the last one repeated, so that lanes which do not exist have no width."""
    return np.concatenate([borders, np.full(MAX_LANES + 1 - len(borders), borders[-1], np.float32)])


def _drainage_path(borders: F32) -> F32:
    """How far water has run from the fast edge, the crown, to the middle of each lane [m]."""
    middle = (borders[1:] + borders[:-1]) * np.float32(0.5)
    return np.maximum(borders[-1] - middle, known("model.water.shortest_path"))
