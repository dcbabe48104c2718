"""The paper's table with its 22 columns, from any recorded simulations and back.

`to_table` gives the values with their types, `write_table` the file with the cells as the paper
prints them, `read_table` the values again. What a column means is in `pinto2023_schema`.

Vehicle ids are the vehicle's slot plus one, so the ego is always 1, and 0 stays free for the
paper's "no collision". The y axis and all angles are CARLA's: y to the right of x, clockwise.
"""

# pyarrow ships no types.
# pyright: reportUnknownParameterType=false

from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import ArrayLike, NDArray

from overtaking.core.errors import ConfigError
from overtaking.core.units import deg_from_rad, kmh_from_mps
from overtaking.model.road import DrivingSide, Road
from overtaking.model.trajectories import (
    ACCEL_RESOLUTION,
    ANGLE_RESOLUTION,
    BEYOND_KERB_EDGE,
    NO_VEHICLE,
    POSITION_RESOLUTION,
    SPEED_RESOLUTION,
    Stage,
    Trajectories,
)
from overtaking.model.vehicles import EGO_SLOT
from overtaking.recordings.pinto2023_files import read_table, write_table
from overtaking.recordings.pinto2023_schema import (
    COLUMNS,
    DECIMALS,
    FORMAT,
    SCHEMA,
    VEHICLE_COLUMNS,
)

__all__ = ["COLUMNS", "FORMAT", "SCHEMA", "read_table", "to_table", "write_table"]

_MS_PER_S = 1000
_NEEDED = frozenset({"weather", "speed_limit", "stage"})
"""What no cell can leave open, of `model.trajectories.UNKNOWNS`."""
_STEPS_PER_CENTIMETRE = round(0.01 / POSITION_RESOLUTION)


def to_table(trajectories: Trajectories, numbers: NDArray[np.integer] | None = None) -> pa.Table:
    """The paper's table of a batch of simulations, one row per simulation and recorded frame.

    Args:
        trajectories: Recorded simulations, on a road of any driving side.
        numbers: Number of each simulation in its data set, shape (simulation,); by default the
            index that its scenario was drawn from.

    Returns:
        A table of `SCHEMA`, sorted by simulation and frame, rounded as the paper rounds.

    Raises:
        ConfigError: The recording does not say what the table has to: it is from elsewhere.
    """
    if missing := sorted(_NEEDED & trajectories.unknown):
        raise ConfigError(
            what="the paper's table",
            where="export",
            expected="simulations, of which everything in it is known",
            got=f"a recording that does not tell {', '.join(missing)}",
            next_step="choose --format commonroad or highd",
        )
    simulation, frame = np.nonzero(trajectories.frame_mask)
    numbered = trajectories.scenario.scenario_index if numbers is None else numbers
    columns = {
        "S": numbered[simulation],
        **_frame_columns(trajectories, simulation, frame),
        **_vehicle_columns(trajectories, simulation, frame),
        **_road_columns(trajectories, simulation, frame),
        **_weather_columns(trajectories, simulation),
    }
    arrays = [pa.array(columns[field.name], type=field.type) for field in SCHEMA]
    return pa.Table.from_arrays(arrays, schema=SCHEMA)


def _rounded(values: ArrayLike) -> NDArray[np.float64]:
    """Values with the paper's decimals, as the doubles nearest to those decimal numbers."""
    scale = 10.0**DECIMALS
    return np.rint(np.asarray(values, dtype=np.float64) * scale) / scale


def _metres(steps: NDArray[np.integer]) -> NDArray[np.float64]:
    """Recorded lengths rounded to centimetres, halves exactly to even [m]."""
    return np.rint(steps / _STEPS_PER_CENTIMETRE) / 100.0


def _degrees(steps: NDArray[np.integer]) -> NDArray[np.float64]:
    """Recorded angles, anticlockwise, as clockwise degrees."""
    return _rounded(deg_from_rad(-steps.astype(np.float64) * ANGLE_RESOLUTION)) + 0.0  # No -0.


def _ids(slots: NDArray[np.integer]) -> NDArray[np.int32]:
    """Ids of vehicle slots, shape as given."""
    return slots.astype(np.int32) + 1


def _frame_columns(
    trajectories: Trajectories, simulation: NDArray[np.intp], frame: NDArray[np.intp]
) -> dict[str, ArrayLike | pa.Array]:
    """F, TS, IDego, C and OV of each row."""
    partner = trajectories.collided_with[simulation, frame]
    return {
        "F": frame,
        "TS": trajectories.time_ms[frame] / _MS_PER_S,
        "IDego": np.full(len(frame), EGO_SLOT + 1),
        "C": pa.array(_ids(partner), mask=partner == NO_VEHICLE),
        "OV": (
            _is_first(trajectories.stage, Stage.PULL_OUT)
            | _is_first(trajectories.stage, Stage.RETURN)
        )[simulation, frame].astype(np.int8),
    }


def _is_first(stages: NDArray[np.uint8], stage: Stage) -> NDArray[np.bool_]:
    """Where a stage is seen for the first time, shape (simulation, time)."""
    seen = np.logical_or.accumulate(stages == stage, axis=1)
    before = np.zeros_like(seen)
    before[:, 1:] = seen[:, :-1]
    return seen & ~before


def _vehicle_columns(
    trajectories: Trajectories, simulation: NDArray[np.intp], frame: NDArray[np.intp]
) -> dict[str, pa.Array]:
    """Dim, L, V, D and A of each row: one tuple per vehicle, by id."""
    present = trajectories.scenario.vehicles.valid[simulation]
    row, slot = np.nonzero(present)
    ends = np.cumsum(present.sum(axis=1))
    offsets = pa.array(np.concatenate([[0], ends]), type=pa.int32())
    values = _vehicle_values(trajectories, simulation[row], slot, frame[row])
    ids = _ids(slot)
    return {
        column: pa.ListArray.from_arrays(
            offsets,
            pa.StructArray.from_arrays(
                [pa.array(ids), *(pa.array(values[name], type=kind) for name, kind in fields)],
                names=["id", *(name for name, _ in fields)],
            ),
        )
        for column, fields in VEHICLE_COLUMNS.items()
    }


def _vehicle_values(
    trajectories: Trajectories,
    simulation: NDArray[np.intp],
    slot: NDArray[np.intp],
    frame: NDArray[np.intp],
) -> dict[str, NDArray[np.generic]]:
    """Values of the tuples by name, one array element per vehicle and row."""
    bodies, states = trajectories.scenario.vehicles, trajectories.states
    at = (simulation, slot, frame)
    lon, lat = states.accel_lon[at].astype(np.float64), states.accel_lat[at].astype(np.float64)
    speed = states.speed[at] * SPEED_RESOLUTION
    return {
        "length_m": _rounded(bodies.length[simulation, slot]),
        "width_m": _rounded(bodies.width[simulation, slot]),
        "height_m": _rounded(bodies.height[simulation, slot]),
        "x_m": _metres(states.x[at]),
        "y_m": _metres(-states.y[at]),
        "lane_id": _surroundings(trajectories.road)["lane_id"][states.lane[at]],
        "speed_kmh": np.rint(kmh_from_mps(speed)).astype(np.int32),
        "wheel_deg": _degrees(states.wheel_angle[at]),
        "yaw_deg": _degrees(states.heading[at]),
        "accel_mps2": _rounded(np.sqrt(lon * lon + lat * lat) * ACCEL_RESOLUTION),
    }


def _road_columns(
    trajectories: Trajectories, simulation: NDArray[np.intp], frame: NDArray[np.intp]
) -> dict[str, ArrayLike | pa.Array]:
    """MV and the surroundings of the ego's lane, of each row."""
    lane = trajectories.states.lane[simulation, EGO_SLOT, frame]
    s = trajectories.states.s[simulation, EGO_SLOT, frame] * POSITION_RESOLUTION
    limit = trajectories.road.speed_limit_at(s)
    columns: dict[str, ArrayLike | pa.Array] = {"MV": _rounded(kmh_from_mps(limit))}
    by_code = _surroundings(trajectories.road)
    for name in ("RT", "LT"):
        columns[name] = by_code[name][lane]
    for name in ("LW", "LWR", "LWL"):
        widths = by_code[name][lane]
        columns[name] = pa.array(_rounded(widths), mask=np.isnan(widths))
    return columns


def _weather_columns(
    trajectories: Trajectories, simulation: NDArray[np.intp]
) -> dict[str, ArrayLike]:
    """Weather and light of each row."""
    weather = trajectories.scenario.weather
    return {
        "Prec": _rounded(weather.rain)[simulation],
        "Fog": _rounded(weather.fog)[simulation],
        "Wind": _rounded(weather.wind)[simulation],
        "DN": np.where(weather.night, "Night", "Day")[simulation],
        "HL": np.where(weather.low_sun, "Yes", "No")[simulation],
    }


def _surroundings(road: Road) -> dict[str, NDArray[Any]]:
    """The table's values for each value of `States.lane`: lane id, marks and widths.

    Beside the driving lanes a vehicle is on the neighbour on that side, such as the shoulder. Where
    the road knows none, the nearest lane counts, as CARLA projects.

    Returns:
        Arrays of shape (256,) by column; widths are NaN where there is no such lane [m].
    """
    slow, fast = road.kerb_side_neighbour, road.overtaking_side_neighbour
    lanes = [*([slow] if slow else []), *road.lanes, *([fast] if fast else [])]
    place = np.full(256, len(lanes) - 1)
    place[: road.num_lanes] = np.arange(road.num_lanes) + (1 if slow else 0)
    place[BEYOND_KERB_EDGE] = 0
    widths = np.array([np.nan, *(lane.width for lane in lanes), np.nan])
    right, left = widths[:-2], widths[2:]  # Lanes are ordered from the slow to the fast side.
    if road.driving_side is DrivingSide.LEFT:
        right, left = left, right
    columns = {
        "lane_id": np.array([lane.lane_id for lane in lanes], dtype=np.int32),
        "RT": np.array([lane.right_mark.value for lane in lanes]),
        "LT": np.array([lane.left_mark.value for lane in lanes]),
        "LW": widths[1:-1],
        "LWR": right,
        "LWL": left,
    }
    return {name: values[place] for name, values in columns.items()}
