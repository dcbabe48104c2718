"""The highest speeds of Article 27."""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32
from overtaking.knowledge import number
from overtaking.model.labels import Case
from overtaking.model.vehicles import Role, VehicleKind

ROAD_KINDS = ("motorway", "other", "town")
CLASSES = ("light", "van", "heavy")

_CLASS_OF = {VehicleKind.V: 1, VehicleKind.T: 2}
"""Index into `CLASSES` of what is neither a light passenger vehicle nor a two-wheeler."""


def speed_limits(case: Case) -> tuple[F32, F32]:
    """The lowest and the highest limit that may hold for each ego, shape (simulation,) [m/s].

    They are equal where kind of road, kind of ego and posted limit are known.
    """
    unknown, road = case.trajectories.unknown, case.trajectories.road
    general = _table()
    if "road_kind" not in unknown:
        row = ROAD_KINDS.index(road.kind if road.kind in ROAD_KINDS else "other")
        general = general[row : row + 1]
    low, high = general.min(axis=0), general.max(axis=0)
    if "kinds" in unknown:
        low, high = (np.full_like(low, low.min()), np.full_like(high, high.max()))
    if "speed_limit" in unknown:
        # Any sign may stand there, but none that allows more than the general limit.
        low = np.zeros_like(low)
    else:
        low, high = (np.minimum(each, np.float32(road.speed_limit)) for each in (low, high))
    column = class_of(case.trajectories.scenario.vehicles.kind[:, Role.EGO])
    return low[column], high[column]


def class_of(kind: NDArray[np.uint8]) -> NDArray[np.intp]:
    """Index into `CLASSES` of vehicle kinds."""
    classes = np.zeros(len(VehicleKind), np.intp)
    for each, index in _CLASS_OF.items():
        classes[each] = index
    return classes[kind]


def _table() -> F32:
    """Limits by kind of road and class, shape (kind of road, class) [m/s]."""
    rows = [[number("law.toml", f"limits.{road}.{of}") for of in CLASSES] for road in ROAD_KINDS]
    return np.array(rows, np.float32)
