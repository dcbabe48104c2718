"""Where the ego believed others to be: at recorded decisions, or at all of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.model.observation import AROUND, OWN, ROLES
from overtaking.model.trajectory import (
    METRES_PER_SECOND_PER_STEP,
    METRES_PER_STEP,
    NO_VEHICLE,
    DecisionKind,
)
from overtaking.model.vehicles import Role
from overtaking.world.clock import DECISIONS_PER_SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from overtaking.core.arrays import F32
    from overtaking.model.trajectory import Trajectories
    from overtaking.sim.beliefs import Beliefs

_BODY = (4.5, 1.8)
"""Length and width of a vehicle that is believed in and does not exist [m]."""

_LEADER, _FRONT, _REAR = range(3)

_WATCHED = ("lead", "oncoming", "behind_oncoming")
"""Where drivers look all the time."""


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


def every_ghost(run: Trajectories, told: Beliefs) -> dict[str, Any]:
    """Where the ego believes its neighbours to be, at every decision.

    Args:
        run: A batch of one simulation.
        told: What its ego believes.

    Returns:
        The time between decisions [ms]. For each kind of neighbour, columns over the decisions:
        slot (None where there is none), whether it is seen (2: at the last look, since when it goes
        on as believed), place along and across the road, believed and true gap, length and width
        [mm]. An unseen one stands at its true place.
    """
    interval = 1000.0 / float(DECISIONS_PER_SECOND)
    frames = np.arange(len(told.own)) * interval / run.scenario.frame_interval_ms
    at = np.minimum(frames.astype(int), int(run.num_frames[0]) - 1)
    roles = (_role(run, told, place, at) for place in range(len(ROLES)))
    return {"interval_ms": interval, "roles": [one for one in roles if one is not None]}


def _role(
    run: Trajectories, told: Beliefs, place: int, at: NDArray[np.int64]
) -> dict[str, Any] | None:
    """The columns of one kind of neighbour; None if there never is one."""
    own = dict(zip(OWN, told.own[:, 0].T, strict=True))
    believed, true = (
        dict(zip(AROUND, of[:, 0, place].T, strict=True)) for of in (told.believed, told.true)
    )
    there, seen = true["detected"] > 0, believed["detected"] > 0
    if not (there | seen).any():
        return None
    way = -1.0 if ROLES[place].endswith("rear") else 1.0
    reach = 0.5 * (true["length"] + _size(run, Role.EGO)[0])
    side = float(run.road.side)
    across = side * (own["lateral"] + true["aside"])
    true_s = own["position"] + way * (true["gap"] + reach)
    slot = _slots(run, at, true_s, across)
    width = run.scenario.vehicles.width[0][slot]
    watches = (own["looks"] > 0) | (ROLES[place] in _WATCHED)
    if way > 0:
        watches |= own["arrived"] == 0
    held, is_held = _held(believed, seen, watches, slot)
    gap = np.where(seen | is_held, held, true["gap"])
    columns = {
        "s": own["position"] + way * (gap + reach),
        "d": across,
        "gap": np.where(seen | is_held, held, np.nan),
        "true_gap": true["gap"],
        "length": true["length"],
        "width": width,
    }
    return {
        "role": ROLES[place],
        "slot": [int(one) if is_there else None for one, is_there in zip(slot, there, strict=True)],
        "seen": np.where(is_held, 2, seen).astype(int).tolist(),
        **{f"{name}_mm": _whole(values, there) for name, values in columns.items()},
    }


def _held(
    believed: dict[str, F32],
    seen: NDArray[np.bool_],
    watches: NDArray[np.bool_],
    slot: NDArray[np.int64],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Believed gaps, and which are from the last look: at other lanes drivers look now and then.

    Args:
        believed: What is believed at each decision.
        seen: Whether the neighbour is seen.
        watches: Whether the driver looks there.
        slot: Which neighbour.
    """
    gap, is_held = believed["gap"].astype(np.float64), np.zeros_like(seen)
    last = -1
    for k in range(len(gap)):
        if seen[k]:
            last = k
        elif watches[k] or last < 0 or slot[k] != slot[last]:
            last = -1
        else:
            elapsed = (k - last) / float(DECISIONS_PER_SECOND)
            gap[k] = gap[last] - float(believed["closing"][last]) * elapsed
            is_held[k] = True
    return gap, is_held


def _whole(values: NDArray[np.floating], there: NDArray[np.bool_]) -> list[int | None]:
    """Millimetres, None where there is nothing."""
    known = there & np.isfinite(values)
    return [
        round(float(one) / METRES_PER_STEP) if is_known else None
        for one, is_known in zip(values, known, strict=True)
    ]


def _slots(
    run: Trajectories, at: NDArray[np.int64], s: NDArray[np.floating], d: NDArray[np.floating]
) -> NDArray[np.int64]:
    """The vehicles that stand nearest to some places, at some frames."""
    states, valid = run.states, run.state_valid[0][:, at].copy()
    valid[Role.EGO] = False
    along = np.abs(states.s[0][:, at] * METRES_PER_STEP - np.nan_to_num(s))
    aside = np.abs(states.d[0][:, at] * METRES_PER_STEP - np.nan_to_num(d))
    return np.where(valid, along + aside, np.inf).argmin(axis=0)


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
