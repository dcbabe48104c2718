"""The columns about a lane and the lanes beside it, and lane codes from them."""

from collections.abc import Iterable, Sequence

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from overtaking.core.errors import SchemaError
from overtaking.data.tables.arrow import Masked, missing_in, to_numpy
from overtaking.data.tables.names import MARKS
from overtaking.model.road import DrivingSide, Lane, Road
from overtaking.model.trajectories import BEYOND_KERB_EDGE

NUM_LANE_CODES = 256
"""Number of values that `States.lane` can have."""


def lane_columns(road: Road) -> dict[str, Masked]:
    """The columns that follow from the lane of a vehicle, for each value of `States.lane`.

    Returns:
        Columns of the table `frames` by name, each of shape (256,); null where there is no such
        lane. Right and left are those of the direction of travel.
    """
    lanes = road.lanes
    slower = (road.kerb_side_neighbour, *lanes[:-1])
    faster = (*lanes[1:], road.overtaking_side_neighbour)
    keeps_right = road.driving_side is DrivingSide.RIGHT
    right, left = (slower, faster) if keeps_right else (faster, slower)
    return {
        "lane_id": _table([lane.lane_id for lane in lanes], np.int16),
        "right_line": _table([MARKS.index(lane.right_mark.value) for lane in lanes], np.int32),
        "left_line": _table([MARKS.index(lane.left_mark.value) for lane in lanes], np.int32),
        "lane_width_m": _table([lane.width for lane in lanes], np.float64),
        **_beside("right", right),
        **_beside("left", left),
    }


def start_lane_ids(road: Road, start_lane: NDArray[np.integer]) -> NDArray[np.int16]:
    """OpenDRIVE ids of the lanes that vehicles start in, also in the lane of the other direction.

    Returns:
        Ids of the shape of `start_lane`; 0 beyond the lanes.
    """
    table = lane_columns(road)["lane_id"].values.copy()
    if road.is_two_way and road.overtaking_side_neighbour is not None:
        table[road.num_lanes] = road.overtaking_side_neighbour.lane_id
    return table[start_lane]


def start_lane_codes(road: Road, ids: NDArray[np.integer]) -> NDArray[np.uint8]:
    """The lanes that `start_lane_ids` was given; `BEYOND_SLOW_EDGE` for other ids."""
    code = np.full(ids.shape, BEYOND_KERB_EDGE, np.uint8)
    for lane in range(road.num_lanes + road.is_two_way):
        code[ids == start_lane_ids(road, np.array(lane))] = lane
    return code


def lane_codes(road: Road, lane_id: pa.Array, d: NDArray[np.integer]) -> NDArray[np.uint8]:
    """The values of `States.lane` that a `lane_id` column was written from.

    Args:
        road: The road.
        lane_id: OpenDRIVE ids, null outside the driving lanes.
        d: Position across the road, which tells the two sides apart, same length [mm].

    Raises:
        SchemaError: The road has no lane of such an id.
    """
    ids = np.array([lane.lane_id for lane in road.lanes])
    order = np.argsort(ids)
    missing = missing_in(lane_id)
    given = np.where(missing, ids[0], to_numpy(lane_id))
    is_lane = np.isin(given, ids)
    if not is_lane.all():
        raise SchemaError(
            what="column lane_id",
            where="states",
            expected=f"one of {', '.join(map(str, ids))}, or null",
            got=int(given[~is_lane][0]),
            next_step="restore the data set from a copy, or generate it again",
        )
    code = order[np.searchsorted(ids, given, sorter=order)].astype(np.uint8)
    middle = (road.lane_boundaries[0] + road.lane_boundaries[-1]) * 0.5
    is_fast = road.overtaking_sign * (np.asarray(d) - middle * 1000.0) > 0
    outside = np.where(is_fast, np.uint8(road.num_lanes), np.uint8(BEYOND_KERB_EDGE))
    return np.where(missing, outside, code)


def _beside(side: str, lanes: Iterable[Lane | None]) -> dict[str, Masked]:
    """The columns about the lane on one side, of any type."""
    known = list(lanes)
    return {
        f"{side}_lane_id": _table([lane and lane.lane_id for lane in known], np.int16),
        f"{side}_lane_width_m": _table([lane and lane.width for lane in known], np.float64),
    }


def _table(values: Sequence[float | None], kind: type[np.generic]) -> Masked:
    """Values of the lanes as a look-up table; null where there is none, and beyond the lanes."""
    known = np.array([value is not None for value in values])
    table, missing = np.zeros(NUM_LANE_CODES, kind), np.ones(NUM_LANE_CODES, np.bool_)
    table[: len(values)] = [value or 0 for value in values]
    missing[: len(values)] = ~known
    return Masked(table, missing)
