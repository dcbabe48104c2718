"""Where the ego believed others to be, at the decisions at which that was recorded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.model.trajectory import (
    METRES_PER_SECOND_PER_STEP,
    METRES_PER_STEP,
    NO_VEHICLE,
    DecisionKind,
)
from overtaking.model.vehicles import Role

if TYPE_CHECKING:
    from collections.abc import Iterator

    from overtaking.model.trajectory import Trajectories

_BODY = (4.5, 1.8)
"""Length and width of a vehicle that is believed in and does not exist [m]."""

_LEADER, _FRONT, _REAR = range(3)


def ghosts(run: Trajectories) -> list[dict[str, Any]]:
    """The neighbours that the ego considered, where it believed them to be.

    Args:
        run: A batch of one simulation.

    Returns:
        One per neighbour and decision that was not noticed or was believed in: time [s], place
        along and across the road [m], speed [m/s], size [m], and both gaps [m], None where there
        is none.
    """
    return [] if "percepts" in run.unknown else list(_ghosts(run))


def _ghosts(run: Trajectories) -> Iterator[dict[str, Any]]:
    percepts = run.percepts
    for row in np.flatnonzero(percepts.valid[0]).tolist():
        for place in (_LEADER, _FRONT, _REAR):
            exists = percepts.vehicle[0, row, place] != NO_VEHICLE
            if exists or percepts.detected[0, row, place]:
                yield _ghost(run, row, place)


def _ghost(run: Trajectories, row: int, place: int) -> dict[str, Any]:
    percepts, states = run.percepts, run.states
    slot, is_seen = int(percepts.vehicle[0, row, place]), bool(percepts.detected[0, row, place])
    time_ms, last = int(percepts.time[0, row]), int(run.num_frames[0]) - 1
    frame = min(time_ms // run.scenario.frame_interval_ms, last)
    is_real = slot != NO_VEHICLE
    length, width = _size(run, slot) if is_real else _BODY
    truth = percepts.true_gap, percepts.true_closing_speed
    source = (percepts.gap, percepts.closing_speed) if is_seen else truth
    gap, closing = (int(of[0, row, place]) * METRES_PER_STEP for of in source)
    way = -1 if place == _REAR else 1
    reach = gap + 0.5 * (length + _size(run, Role.EGO)[0])
    ego = states.s[0, Role.EGO, frame] * METRES_PER_STEP
    speed = states.speed[0, Role.EGO, frame] * METRES_PER_SECOND_PER_STEP
    true_gap = int(percepts.true_gap[0, row, place]) * METRES_PER_STEP
    nowhere = _lane(run, row, place, frame)
    lateral = states.d[0, slot, frame] * METRES_PER_STEP if is_real else nowhere
    return {
        "time_s": time_ms / 1000.0,
        "decision": DecisionKind(int(percepts.kind[0, row])).name,
        "vehicle": slot if is_real else None,
        "seen": is_seen,
        "s_m": round(float(ego) + way * reach, 3),
        "d_m": round(float(lateral), 3),
        "speed_mps": round(float(speed) - way * closing, 3),
        "length_m": round(length, 3),
        "width_m": round(width, 3),
        "gap_m": round(gap, 3) if is_seen else None,
        "true_gap_m": round(true_gap, 3) if is_real else None,
    }


def _size(run: Trajectories, slot: int) -> tuple[float, float]:
    """Length and width [m]."""
    bodies = run.scenario.vehicles
    return float(bodies.length[0, slot]), float(bodies.width[0, slot])


def _lane(run: Trajectories, row: int, place: int, frame: int) -> float:
    """Middle of the empty lane in which the driver believed a vehicle [m]."""
    lane = int(run.states.lane[0, Role.EGO, frame])
    if place != _LEADER:
        lane += 1 if run.percepts.kind[0, row] == DecisionKind.PULL_OUT else -1
    return float(run.road.centres[min(max(lane, 0), run.road.num_lanes - 1)])
