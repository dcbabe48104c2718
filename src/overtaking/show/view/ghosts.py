"""Where the ego believes its neighbours to be: at recorded decisions, or at all of them.

Each belief has the slot of its vehicle, because a role does not identify a vehicle: from the
decision to change lanes on, the driver's leader is the vehicle ahead in the new lane.
"""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.model.driver_interface import NEIGHBOUR_ROLES, EgoColumns, NeighbourColumns
from overtaking.model.trajectories import (
    NO_VEHICLE,
    POSITION_RESOLUTION,
    SPEED_RESOLUTION,
    ManoeuvreKind,
    PerceivedVehicle,
)
from overtaking.model.vehicles import EGO_SLOT
from overtaking.world.constants import DECISIONS_PER_SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from overtaking.model.trajectories import Trajectories
    from overtaking.sim.stepping import BeliefTrace

_IMAGINED_SIZE_M = (4.5, 1.8)
"""Length and width of a drawn vehicle that exists only in the driver's belief."""

_ALWAYS_WATCHED = ("leader", "oncoming", "second_oncoming")


class Awareness(IntEnum):
    """How the driver knows a neighbour at a decision."""

    UNNOTICED = 0  # The driver does not know the vehicle: it is drawn at its true position.
    SEEN = 1
    REMEMBERED = 2  # Seen at an earlier glance; the belief is extrapolated since then.


def recorded_beliefs(trajectories: Trajectories) -> list[dict[str, Any]]:
    """The neighbours that the ego considered at its recorded decisions, where it believed them.

    Args:
        trajectories: A batch of one simulation.

    Returns:
        A record for each decision and each neighbour that existed or was believed in: time [s],
        station and lateral position [m], speed [m/s], size [m], and both gaps [m], None for
        an unknown gap.
    """
    if "percepts" in trajectories.unknown:
        return []
    return list(_recorded_beliefs(trajectories))


def beliefs_at_every_decision(trajectories: Trajectories, trace: BeliefTrace) -> dict[str, Any]:
    """Where the ego believes its neighbours to be, at every decision.

    Args:
        trajectories: A batch of one simulation.
        trace: The beliefs of its ego, and the true values.

    Returns:
        The time between decisions [ms]. For each role that a neighbour ever has, columns over the
        decisions: slot of the neighbour (None without one), `Awareness`, station and lateral
        position, believed and true gap, length and width [mm]. A vehicle that the driver does not
        notice stands at its true position.
    """
    interval_ms = 1000.0 / float(DECISIONS_PER_SECOND)
    decisions = np.arange(len(trace.ego))
    frames = (decisions * interval_ms / trajectories.scenario.frame_interval_ms).astype(int)
    frames = np.minimum(frames, int(trajectories.num_frames[0]) - 1)
    roles = (_neighbour_columns(trajectories, trace, role, frames) for role in NEIGHBOUR_ROLES)
    return {"interval_ms": interval_ms, "roles": [role for role in roles if role is not None]}


def _neighbour_columns(
    trajectories: Trajectories, trace: BeliefTrace, role: str, frames: NDArray[np.int64]
) -> dict[str, Any] | None:
    """Where the driver believes one neighbour to be, at every decision.

    Args:
        trajectories: A batch of one simulation.
        trace: Beliefs and true values of its ego.
        role: The neighbour, one of `NEIGHBOUR_ROLES`.
        frames: Recorded frame of each decision.

    Returns:
        Columns over the decisions; None if no vehicle ever has this role.
    """
    place = NEIGHBOUR_ROLES.index(role)
    ego = EgoColumns._make(trace.ego[:, 0].T)
    believed = NeighbourColumns._make(trace.believed[:, 0, place].T)
    true = NeighbourColumns._make(trace.true[:, 0, place].T)
    has_neighbour, is_seen = true.is_detected > 0, believed.is_detected > 0
    if not (has_neighbour | is_seen).any():
        return None

    half_lengths = 0.5 * (true.length + _length_and_width(trajectories, EGO_SLOT)[0])
    direction = -1.0 if role.endswith("follower") else 1.0  # Gaps are measured between bumpers.
    # The observation is mirrored where traffic drives on the left.
    d = float(trajectories.road.overtaking_sign) * (ego.lateral_position + true.lateral_distance)
    # The trace names no vehicle, so take the one nearest to the true position.
    true_s = ego.s + direction * (true.gap + half_lengths)
    slot = _nearest_slots(trajectories, frames, true_s, d)
    gap, is_remembered = _remembered_gaps(believed, is_seen, _is_watched(ego, role), slot)

    is_believed = is_seen | is_remembered
    drawn_gap = np.where(is_believed, gap, true.gap)
    metres = {
        "s": ego.s + direction * (drawn_gap + half_lengths),
        "d": d,
        "gap": np.where(is_believed, gap, np.nan),
        "true_gap": true.gap,
        "length": true.length,
        "width": trajectories.scenario.vehicles.width[0][slot],
    }
    levels = [Awareness.REMEMBERED, Awareness.SEEN]
    awareness = np.select([is_remembered, is_seen], levels, Awareness.UNNOTICED)
    return {
        "role": role,
        "slot": [
            int(vehicle) if exists else None
            for vehicle, exists in zip(slot, has_neighbour, strict=True)
        ],
        "seen": awareness.tolist(),
        **{f"{name}_mm": _millimetres(values, has_neighbour) for name, values in metres.items()},
    }


def _is_watched(ego: EgoColumns, role: str) -> NDArray[np.bool_]:
    """Whether the driver looks at the place of a neighbour, at each decision.

    Drivers always watch their leader and oncoming traffic, and during a lane change the vehicles
    ahead on both sides. They glance at the other places about once a second.
    """
    is_watched = (ego.checks_mirrors > 0) | (role in _ALWAYS_WATCHED)
    return (
        is_watched
        if role.endswith("follower")
        else is_watched | (ego.has_finished_lane_change == 0)
    )


def _remembered_gaps(
    believed: NeighbourColumns,
    is_seen: NDArray[np.bool_],
    is_watched: NDArray[np.bool_],
    slot: NDArray[np.int64],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Continue a believed gap from one glance to the next.

    Between two glances the belief is extrapolated at the closing speed that was perceived last. It
    ends when the driver looks and sees no vehicle, or when another vehicle takes the place.

    Args:
        believed: Gap [m] and closing speed [m/s] at each decision.
        is_seen: The driver sees the neighbour.
        is_watched: The driver looks at the place.
        slot: The vehicle at the place.

    Returns:
        Believed gap at each decision [m], and whether it is remembered.
    """
    gap = believed.gap.astype(np.float64)
    is_remembered = np.zeros_like(is_seen)
    last_seen: int | None = None
    for decision in range(len(gap)):
        if is_seen[decision]:
            last_seen = decision
            continue
        if last_seen is None:
            continue
        if is_watched[decision] or slot[decision] != slot[last_seen]:
            last_seen = None
            continue
        elapsed = (decision - last_seen) / float(DECISIONS_PER_SECOND)
        gap[decision] = gap[last_seen] - float(believed.closing_speed[last_seen]) * elapsed
        is_remembered[decision] = True
    return gap, is_remembered


def _millimetres(
    values: NDArray[np.floating], has_neighbour: NDArray[np.bool_]
) -> list[int | None]:
    """Whole millimetres, None at decisions without a value."""
    has_value = has_neighbour & np.isfinite(values)
    return [
        round(float(value) / POSITION_RESOLUTION) if is_finite else None
        for value, is_finite in zip(values, has_value, strict=True)
    ]


def _nearest_slots(
    trajectories: Trajectories,
    frames: NDArray[np.int64],
    s: NDArray[np.floating],
    d: NDArray[np.floating],
) -> NDArray[np.int64]:
    """The vehicle that stands nearest to a position, at each of some frames."""
    states = trajectories.states
    is_recorded = trajectories.state_mask[0][:, frames].copy()
    is_recorded[EGO_SLOT] = False
    along = np.abs(states.s[0][:, frames] * POSITION_RESOLUTION - np.nan_to_num(s))
    across = np.abs(states.d[0][:, frames] * POSITION_RESOLUTION - np.nan_to_num(d))
    return np.where(is_recorded, along + across, np.inf).argmin(axis=0)


def _recorded_beliefs(trajectories: Trajectories) -> Iterator[dict[str, Any]]:
    percepts = trajectories.percepts
    for row in np.flatnonzero(percepts.valid[0]).tolist():
        for vehicle in PerceivedVehicle:
            exists = percepts.slot[0, row, vehicle] != NO_VEHICLE
            if exists or percepts.is_detected[0, row, vehicle]:
                yield _recorded_belief(trajectories, row, vehicle)


def _recorded_belief(
    trajectories: Trajectories, row: int, vehicle: PerceivedVehicle
) -> dict[str, Any]:
    """One vehicle of a percept."""
    percepts, states = trajectories.percepts, trajectories.states
    slot = int(percepts.slot[0, row, vehicle])
    is_seen, exists = bool(percepts.is_detected[0, row, vehicle]), slot != NO_VEHICLE
    time_ms, last_frame = int(percepts.time[0, row]), int(trajectories.num_frames[0]) - 1
    frame = min(time_ms // trajectories.scenario.frame_interval_ms, last_frame)
    length, width = _length_and_width(trajectories, slot) if exists else _IMAGINED_SIZE_M
    columns = (percepts.gap, percepts.closing_speed)
    if not is_seen:
        columns = (percepts.true_gap, percepts.true_closing_speed)
    gap, closing_speed = (int(column[0, row, vehicle]) * POSITION_RESOLUTION for column in columns)
    direction = -1 if vehicle == PerceivedVehicle.NEW_FOLLOWER else 1
    reach = gap + 0.5 * (length + _length_and_width(trajectories, EGO_SLOT)[0])
    ego_s = states.s[0, EGO_SLOT, frame] * POSITION_RESOLUTION
    ego_speed = states.speed[0, EGO_SLOT, frame] * SPEED_RESOLUTION
    true_gap = int(percepts.true_gap[0, row, vehicle]) * POSITION_RESOLUTION
    if exists:
        d = states.d[0, slot, frame] * POSITION_RESOLUTION
    else:
        d = _middle_of_believed_lane(trajectories, row, vehicle, frame)
    return {
        "time_s": time_ms / 1000.0,
        "decision": ManoeuvreKind(int(percepts.kind[0, row])).name,
        "vehicle": slot if exists else None,
        "seen": is_seen,
        "s_m": round(float(ego_s) + direction * reach, 3),
        "d_m": round(float(d), 3),
        "speed_mps": round(float(ego_speed) - direction * closing_speed, 3),
        "length_m": round(length, 3),
        "width_m": round(width, 3),
        "gap_m": round(gap, 3) if is_seen else None,
        "true_gap_m": round(true_gap, 3) if exists else None,
    }


def _length_and_width(trajectories: Trajectories, slot: int) -> tuple[float, float]:
    """Length and width of a vehicle [m]."""
    bodies = trajectories.scenario.vehicles
    return float(bodies.length[0, slot]), float(bodies.width[0, slot])


def _middle_of_believed_lane(
    trajectories: Trajectories, row: int, vehicle: PerceivedVehicle, frame: int
) -> float:
    """Lateral position of the middle of a lane in which the driver believes a vehicle [m]."""
    road = trajectories.road
    lane = int(trajectories.states.lane[0, EGO_SLOT, frame])
    if vehicle != PerceivedVehicle.LEADER:
        is_pull_out = trajectories.percepts.kind[0, row] == ManoeuvreKind.PULL_OUT
        lane += 1 if is_pull_out else -1
    return float(road.lane_centres[min(max(lane, 0), road.num_lanes - 1)])
