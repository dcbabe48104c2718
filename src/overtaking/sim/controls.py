"""The actions of a driver, and how an answer becomes the action that is recorded."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from overtaking.core.arrays import F64
from overtaking.model.driver_interface import ACTION_KINDS, ActionPart
from overtaking.sim.observation import EgoObservation

Track = Callable[[EgoObservation], F64]
"""From what is observed to an action, while an answer holds."""

_SPEED_TIME = 1.0  # In which a difference of speed is made up for; a choice [s].
_POINT_TIMES = (0.5, 1.0, 1.5, 2.0)  # When the points of a trajectory are reached [s].
_SLOWEST = 1.0  # Keeps curvatures finite [m/s].

_, _LANE = ACTION_KINDS["accel_lane"]


@dataclass(frozen=True, slots=True)
class Control:
    """A way in which a driver drives.

    Attributes:
        parts: The numbers of an answer.
        kind: The kind of action that it becomes, a name in `model.driver_interface.ACTION_KINDS`.
        plan: From an answer and what was observed then to what follows it; None where the answer is
            the action.
    """

    parts: tuple[ActionPart, ...]
    kind: str
    plan: Callable[[F64, EgoObservation], Track] | None = None


def _towards_speed(answer: F64, _: EgoObservation) -> Track:
    """Accelerate as comfortably as the scenario's driver towards a speed."""

    def track(observation: EgoObservation) -> F64:
        wanted = (answer[:, 0] - observation.ego.speed) / _SPEED_TIME
        accel = np.clip(wanted, -observation.vehicle.decel, observation.vehicle.accel)
        return np.stack([accel, answer[:, 1]], axis=1)

    return track


def _along_points(answer: F64, begin: EgoObservation) -> Track:
    """Drive through points with the constant accelerations that miss them least.

    Along and across the road these are the least squares over the points that are left; anew at
    every decision, so errors fade.
    """
    points = answer.reshape(len(answer), len(_POINT_TIMES), 2)
    places = points[:, :, 0] + begin.ego.s[:, None]
    sides = points[:, :, 1] + begin.ego.lateral_position[:, None]

    def track(observation: EgoObservation) -> F64:
        times = np.maximum(np.array(_POINT_TIMES) - (observation.time - begin.time), 0.0)
        ego, vehicle = observation.ego, observation.vehicle
        speed, heading = ego.speed.astype(np.float64), ego.heading.astype(np.float64)
        along, across = speed * np.cos(heading), speed * np.sin(heading)
        accel = _missing_least(places - ego.s[:, None], along, times)
        aside = _missing_least(sides - ego.lateral_position[:, None], across, times)
        v = np.maximum(speed, _SLOWEST)
        angle = aside * (vehicle.wheelbase / (v * v) + vehicle.understeer)
        return np.stack([accel, angle], axis=1)

    return track


def _missing_least(way: F64, speed: F64, times: F64) -> F64:
    """The constant acceleration that misses points least, shape (simulation,) [m/s^2].

    Args:
        way: How far each point is, shape (simulation, point) [m].
        speed: The speed now, shape (simulation,) [m/s].
        times: In how long each point is to be reached, shape (point,) [s].
    """
    half_squares = 0.5 * times * times
    total = float((half_squares * half_squares).sum())
    rest = (half_squares * (way - speed[:, None] * times)).sum(axis=1)
    return rest / total if total > 0.0 else np.zeros_like(rest)


_POINTS = tuple(
    part
    for k in range(1, len(_POINT_TIMES) + 1)
    for part in (
        ActionPart(f"ahead_{k}", "m", 1e-3, 0.0, 200.0),
        ActionPart(f"aside_{k}", "m towards the overtaking side", 1e-3, -20.0, 20.0),
    )
)

CONTROLS: Final = {
    "accel_lane": Control(ACTION_KINDS["accel_lane"], "accel_lane"),
    "speed_lane": Control(
        (ActionPart("speed", "m/s", 1e-3, 0.0, 100.0), _LANE), "accel_lane", _towards_speed
    ),
    "accel_steer": Control(ACTION_KINDS["accel_steer"], "accel_steer"),
    "trajectory": Control(_POINTS, "accel_steer", _along_points),
    "decision": Control(ACTION_KINDS["decision"], "decision"),
    "accel_move": Control(ACTION_KINDS["accel_move"], "accel_move"),
    "accel_steer_signal": Control(ACTION_KINDS["accel_steer_signal"], "accel_steer_signal"),
}
"""The actions that a driver may answer, by name; the first one is the default."""
