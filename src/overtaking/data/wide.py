"""The source paper's 22 variables of one simulation, in SI and with our names.

The paper's own table, in its units and its frame, is an export; see `recordings.pinto2023`.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from overtaking.model.vehicles import Role

_PER_VEHICLE = {
    "positions_m": ("x_m", "y_m", "lane_id"),
    "speeds_mps": ("speed_mps",),
    "directions_rad": ("wheel_angle_rad", "heading_rad"),
    "accelerations_mps2": ("accel_mps2",),
}
"""Columns with a tuple per frame, and what each vehicle contributes to it."""

_OF_THE_ROAD = (
    "speed_limit_mps",
    "right_line",
    "left_line",
    "lane_width_m",
    "right_lane_width_m",
    "left_lane_width_m",
    "collided_with",
)
_OF_THE_WEATHER = ("rain_percent", "fog_percent", "wind_percent", "night", "horizon_line")


def wide_frames(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """One row per frame of a simulation.

    Args:
        tables: `frames`, `states`, `vehicles` and `weather` of one simulation, decoded.

    Returns:
        The 22 variables in the paper's order. Tuples have an element per vehicle, by slot: a
        number, or a tuple where several belong together. Positions are OpenDRIVE's.
    """
    frames, weather = tables["frames"], tables["weather"].iloc[0]
    columns: dict[str, object] = {name: frames[name] for name in ("simulation", "frame", "time_s")}
    columns["ego"] = int(Role.EGO)
    dimensions = _cells(tables["vehicles"], ("length_m", "width_m", "height_m"))
    columns["dimensions_m"] = [tuple(dimensions)] * len(frames)
    columns |= _per_vehicle(tables["states"], len(dimensions), frames["frame"].tolist())
    columns |= {name: frames[name] for name in _OF_THE_ROAD}
    columns |= {name: weather[name] for name in _OF_THE_WEATHER}
    columns["overtaking"] = frames["overtaking"]
    return pd.DataFrame(columns)


def _per_vehicle(states: pd.DataFrame, num_vehicles: int, numbers: list[int]) -> dict[str, object]:
    """The columns with a tuple per frame; missing where a recording lacks a vehicle."""
    norm = np.hypot(states["accel_lon_mps2"], states["accel_lat_mps2"])
    ordered = states.assign(accel_mps2=norm).sort_values(["frame", "vehicle"])
    if len(ordered) < num_vehicles * len(numbers):
        every = pd.MultiIndex.from_product([numbers, range(num_vehicles)])
        ordered = ordered.set_index(["frame", "vehicle"]).reindex(every)
    columns: dict[str, object] = {}
    for name, parts in _PER_VEHICLE.items():
        cells = _cells(ordered, parts)
        frames = range(0, len(cells), num_vehicles)
        columns[name] = [tuple(cells[first : first + num_vehicles]) for first in frames]
    return columns


def _cells(table: pd.DataFrame, columns: tuple[str, ...]) -> list[object]:
    """For each row its only value, or a tuple of several."""
    if len(columns) == 1:
        return table[columns[0]].tolist()
    return list(zip(*(table[column].tolist() for column in columns), strict=True))
