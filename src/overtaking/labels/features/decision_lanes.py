"""The lanes around the ego at one instant: who is in them, what they allow, what one sees."""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask, as_f32
from overtaking.labels.features.encounters import Index, Side
from overtaking.labels.features.engine import encounter
from overtaking.labels.law.l02_line import closed_borders
from overtaking.labels.signals.reference import METRES, OCCUPANCY_REACH_MM, left_lane_at
from overtaking.model.decisions import LeftLane, Surround
from overtaking.model.labels import Case
from overtaking.model.signals import Around
from overtaking.model.vehicles import Role
from overtaking.world.conditions import outlook
from overtaking.world.constants import known
from overtaking.world.visibility import meteorological_range

_PERCENT = np.float32(0.01)
_ZERO = np.float32(0.0)


def lane_around(case: Case, frames: Index) -> Surround:
    """Road, weather and light of each simulation at one frame each."""
    road, weather, seen = case.trajectories.road, case.trajectories.scenario.weather, case.signals
    rows = np.arange(len(frames))
    lane = seen.lane[rows, frames]
    on_road = lane < road.num_lanes
    widths = np.array([one.width for one in road.lanes])
    return Surround(
        on_road=on_road,
        lane=lane,
        lanes_to_left=np.where(on_road, road.num_lanes - 1 - lane.astype(np.int32), 0).astype(
            np.uint8
        ),
        lane_width=widths[np.minimum(lane, road.num_lanes - 1)],
        speed_limit=np.full(len(frames), road.speed_limit),
        night=weather.night,
        low_sun=weather.horizon_line,
        rain=outlook(case.trajectories.scenario).rain_rate,
        optical_range=meteorological_range(weather.fog),
        wind=known("weather.wind.full_speed") * (weather.wind * _PERCENT),
        friction=seen.friction[rows, frames],
        sight_lit=seen.sight_lit[rows, frames],
        sight_unlit=seen.sight_unlit[rows, frames],
    )


def left_lane(case: Case, frames: Index) -> LeftLane:
    """The lane to the left of each ego at one frame each."""
    run, seen = case.trajectories, case.signals
    rows = np.arange(len(frames))
    lane = seen.lane[rows, frames].astype(np.int32)
    inside = _in_lane(case, lane + 1, frames) & _near(case, frames)
    speed = as_f32(run.states.speed[rows, :, frames]) * METRES
    count, total = inside.sum(axis=1), _sum(speed, inside)
    return LeftLane(
        exists=lane + 1 < run.road.num_lanes,
        front=encounter(case, Around.LEFT_LEADER, Side.AHEAD, rows, frames),
        rear=encounter(case, Around.LEFT_FOLLOWER, Side.BEHIND, rows, frames),
        occupancy=left_lane_at(run, seen, frames).occupancy,
        count=count.astype(np.uint8),
        space_mean_speed=total / as_f32(np.maximum(count, 1)),
        # Fast vehicles pass a place more often: Wardrop (1952), sum of squares over sum.
        time_mean_speed=_sum(speed * speed, inside) / np.where(total > 0, total, np.float32(1.0)),
        crossable=_crossable(case)[np.minimum(lane, run.road.num_lanes)],
    )


def next_ahead(case: Case, slot: Index, frames: Index) -> tuple[Mask, F32]:
    """The gap ahead of a vehicle to the next one in the ego's lane.

    Args:
        case: The batch.
        slot: The vehicle, shape (simulation,).
        frames: A frame of each simulation, same shape.

    Returns:
        Whether there is a next one, and the gap between their bumpers, same shape [m].
    """
    run, rows = case.trajectories, np.arange(len(frames))
    s = run.states.s[rows, :, frames]
    way = as_f32(s - s[rows, slot][:, None]) * METRES
    half = np.float32(0.5) * run.scenario.vehicles.length
    gap = way - half - half[rows, slot][:, None]
    lane = case.signals.lane[rows, frames].astype(np.int32)
    there = _in_lane(case, lane, frames) & (way > 0)
    gap = np.where(there, gap, np.float32(np.inf)).min(axis=1)
    has_next = np.asarray(there.any(axis=1))
    return has_next, np.where(has_next, gap, _ZERO)


def _in_lane(case: Case, lane: NDArray[np.int32], frames: Index) -> Mask:
    """Which vehicles are in a lane, shape (simulation, vehicle)."""
    run, rows = case.trajectories, np.arange(len(frames))
    inside = run.states.lane[rows, :, frames] == lane[:, None]
    inside &= run.scenario.vehicles.valid & (lane < run.road.num_lanes)[:, None]
    if run.present is not None:
        inside &= run.present[rows, :, frames]
    return inside


def _near(case: Case, frames: Index) -> Mask:
    """Which centres are within the reach of the occupancy, shape (simulation, vehicle)."""
    s = case.trajectories.states.s[np.arange(len(frames)), :, frames]
    return np.abs(s - s[:, [Role.EGO]]) <= OCCUPANCY_REACH_MM


def _sum(values: F32, counted: Mask) -> F32:
    """Sum over the vehicles that count, one after the other, shape (simulation,)."""
    total = np.zeros(len(values), np.float32)
    for j in range(values.shape[1]):
        total = total + np.where(counted[:, j], values[:, j], _ZERO)
    return total


def _crossable(case: Case) -> Mask:
    """Whether the line to the left may be crossed, for each lane and for beyond the fast edge."""
    road = case.trajectories.road
    closed = closed_borders(road)
    lanes = [not closed.get(lane + 1, (False, False))[0] for lane in range(road.num_lanes)]
    return np.array([*lanes, False], np.bool_)
