"""The actions of a driver, and how an answer becomes the action that is recorded."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F64, Mask
from overtaking.model.driver_interface import ACTION_KINDS, MAX_ACTION_PARTS, ActionPart
from overtaking.sim.ego_observation import EgoObservation

Track = Callable[[EgoObservation], F64]
"""From what is observed to an action, while an answer holds."""


_SPEED_TIME_CONSTANT = 1.0  # In which a difference of speed is made up for; a choice [s].


_POINT_TIMES = (0.5, 1.0, 1.5, 2.0)  # When the points of a trajectory are reached [s].


_MIN_TRACKING_SPEED = 1.0  # Keeps curvatures finite [m/s].


_, _LANE = ACTION_KINDS["accel_lane"]


@dataclass(frozen=True, slots=True)
class ActionSpace:
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


def _track_speed(answer: F64, _: EgoObservation) -> Track:
    """Accelerate as comfortably as the scenario's driver towards a speed."""

    def track(observation: EgoObservation) -> F64:
        wanted = (answer[:, 0] - observation.ego.speed) / _SPEED_TIME_CONSTANT
        accel = np.clip(wanted, -observation.vehicle.decel, observation.vehicle.accel)
        return np.stack([accel, answer[:, 1]], axis=1)

    return track


def _track_points(answer: F64, begin: EgoObservation) -> Track:
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
        accel = _least_squares_accel(places - ego.s[:, None], along, times)
        aside = _least_squares_accel(sides - ego.lateral_position[:, None], across, times)
        v = np.maximum(speed, _MIN_TRACKING_SPEED)
        angle = aside * (vehicle.wheelbase / (v * v) + vehicle.understeer)
        return np.stack([accel, angle], axis=1)

    return track


def _least_squares_accel(way: F64, speed: F64, times: F64) -> F64:
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


_POINT_PARTS = tuple(
    part
    for k in range(1, len(_POINT_TIMES) + 1)
    for part in (
        ActionPart(f"ahead_{k}", "m", 1e-3, 0.0, 200.0),
        ActionPart(f"aside_{k}", "m towards the overtaking side", 1e-3, -20.0, 20.0),
    )
)


ACTION_SPACES: Final = {
    "accel_lane": ActionSpace(ACTION_KINDS["accel_lane"], "accel_lane"),
    "speed_lane": ActionSpace(
        (ActionPart("speed", "m/s", 1e-3, 0.0, 100.0), _LANE), "accel_lane", _track_speed
    ),
    "accel_steer": ActionSpace(ACTION_KINDS["accel_steer"], "accel_steer"),
    "trajectory": ActionSpace(_POINT_PARTS, "accel_steer", _track_points),
    "decision": ActionSpace(ACTION_KINDS["decision"], "decision"),
    "accel_move": ActionSpace(ACTION_KINDS["accel_move"], "accel_move"),
    "accel_steer_signal": ActionSpace(ACTION_KINDS["accel_steer_signal"], "accel_steer_signal"),
}
"""The actions that a driver may answer, by name; the first one is the default."""


def clip_to_limits(values: F64, parts: tuple[ActionPart, ...]) -> tuple[F64, Mask]:
    """Answers within the limits of their parts, and which were beyond by more than rounding.

    Args:
        values: Answers, shape (simulation, part).
        parts: What they are.
    """
    step, least, most = np.array([(one.resolution, one.low, one.high) for one in parts]).T
    within = np.clip(values, least, most)
    return within, (np.abs(values - within) > 0.5 * step).any(axis=1)


def to_action_integers(
    values: F64, active: Mask, parts: tuple[ActionPart, ...]
) -> NDArray[np.int32]:
    """Rounded actions; zero where nothing runs, shape (simulation, `MAX_ACTION_PARTS`)."""
    steps = np.zeros((len(values), MAX_ACTION_PARTS), np.int32)
    for k, part in enumerate(parts):
        clipped = np.clip(values[:, k], part.low, part.high)
        steps[:, k] = np.where(active, np.rint(clipped / part.resolution), 0.0)
    return steps
