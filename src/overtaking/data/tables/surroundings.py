"""What lies around a lane, as the tables say it."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from overtaking.data.tables.arrow import missing_in, to_numpy
from overtaking.data.tables.schemas import MARKS
from overtaking.model.road import DrivingSide, Lane, Road

NUM_LANE_CODES = 256
BEYOND_SLOW_EDGE = 255
"""The value of `States.lane` beyond the slow edge; the number of lanes says beyond the fast one."""

N = TypeVar("N", bound=np.generic)


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """Looks up what belongs to each value of `States.lane`; every array has shape (256,).

    Attributes:
        on_road: Whether that value is a driving lane; elsewhere the others mean nothing.
        lane_id: OpenDRIVE's id.
        width: Of the lane itself [m].
        right_mark: Line on its right, a code of `MARKS`.
        left_mark: Line on its left.
        has_right: Whether there is a lane of any type on its right.
        right_id: OpenDRIVE's id of that lane.
        right_width: Its width [m].
        has_left: Whether there is a lane of any type on its left.
        left_id: OpenDRIVE's id of that lane.
        left_width: Its width [m].
    """

    on_road: NDArray[np.bool_]
    lane_id: NDArray[np.int16]
    width: NDArray[np.float64]
    right_mark: NDArray[np.int32]
    left_mark: NDArray[np.int32]
    has_right: NDArray[np.bool_]
    right_id: NDArray[np.int16]
    right_width: NDArray[np.float64]
    has_left: NDArray[np.bool_]
    left_id: NDArray[np.int16]
    left_width: NDArray[np.float64]

    @classmethod
    def of(cls, road: Road) -> "Surroundings":
        """The surroundings of every lane of a road."""
        slower = (road.slow_side_neighbour, *road.lanes[:-1])
        faster = (*road.lanes[1:], road.fast_side_neighbour)
        right, left = (
            (slower, faster) if road.driving_side is DrivingSide.RIGHT else (faster, slower)
        )
        lanes = road.lanes
        return cls(
            on_road=_table([True for _ in lanes], np.bool_),
            lane_id=_ids(lanes),
            width=_widths(lanes),
            right_mark=_table(
                (MARKS.names.index(lane.right_mark.value) for lane in lanes), np.int32
            ),
            left_mark=_table((MARKS.names.index(lane.left_mark.value) for lane in lanes), np.int32),
            has_right=_table((lane is not None for lane in right), np.bool_),
            right_id=_ids(right),
            right_width=_widths(right),
            has_left=_table((lane is not None for lane in left), np.bool_),
            left_id=_ids(left),
            left_width=_widths(left),
        )


def lane_codes(road: Road, lane_id: pa.Array, d: NDArray[np.integer]) -> NDArray[np.uint8]:
    """The values of `States.lane` that a `lane_id` column was written from.

    Args:
        road: The road.
        lane_id: OpenDRIVE ids, null outside the driving lanes.
        d: Position across the road, which tells the one outside from the other, same length [mm].
    """
    ids = np.array([lane.lane_id for lane in road.lanes])
    order = np.argsort(ids)
    missing = missing_in(lane_id)
    given = np.where(missing, ids[0], to_numpy(lane_id))
    code = order[np.searchsorted(ids, given, sorter=order)].astype(np.uint8)
    middle = (road.boundaries[0] + road.boundaries[-1]) * 0.5
    is_fast = road.side * (np.asarray(d) - middle * 1000.0) > 0
    outside = np.where(is_fast, np.uint8(road.num_lanes), np.uint8(BEYOND_SLOW_EDGE))
    return np.where(missing, outside, code)


def _table(values: Iterable[object], dtype: type[N]) -> NDArray[N]:
    """Values per lane as a look-up table, zero beyond the lanes."""
    given = np.array(list(values), dtype=dtype)
    table = np.zeros(NUM_LANE_CODES, dtype=dtype)
    table[: len(given)] = given
    return table


def _ids(lanes: Iterable[Lane | None]) -> NDArray[np.int16]:
    return _table((lane.lane_id if lane else 0 for lane in lanes), np.int16)


def _widths(lanes: Iterable[Lane | None]) -> NDArray[np.float64]:
    return _table((lane.width if lane else 0.0 for lane in lanes), np.float64)
