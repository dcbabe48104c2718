"""The actions that an external driver may answer, and their conversion to recorded actions.

Both simulators carry out only the kinds of action in `model.driver_interface.ACTION_KINDS`. A
driver may also answer a speed or a trajectory. Those answers are turned into an acceleration and a
lane, or an acceleration and a wheel angle, anew at each decision.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F64, Mask
from overtaking.model.driver_interface import ACTION_KINDS, MAX_ACTION_PARTS, ActionPart
from overtaking.sim.ego_observation import EgoObservation

TrackAnswer = Callable[[F64, EgoObservation, EgoObservation], F64]
"""A function that returns the present action, shape (simulation, part).

Its arguments are an answer, shape (simulation, part), the observation that the driver answered, and
the present observation.
"""


_SPEED_TIME_CONSTANT = 1.0
"""In the action space `speed_lane`, the acceleration is the answered minus the present speed over
this time [s].

Within the comfort limits the difference decreases to 37 % in this time. Chosen: with a longer time
the ego would reach the answered speed later.
"""


_POINT_TIMES = (0.5, 1.0, 1.5, 2.0)
"""Times after an answer at which the ego is to reach the points of a trajectory [s].

Chosen. They are part of the action space: other times give another meaning to the same answer.
"""


_MIN_TRACKING_SPEED = 1.0
"""Smallest speed in the formula of the wheel angle, which divides by its square [m/s].

Chosen: at lower speeds the wheels turn less than the points require, instead of up to the limit.
"""


_, _LANE_PART = ACTION_KINDS["accel_lane"]  # Change of lane: 1 to the overtaking side, 0, -1.


@dataclass(frozen=True, slots=True)
class ActionSpace:
    """The numbers that a driver answers, and the kind of action that they become.

    Attributes:
        parts: The numbers of an answer.
        kind: Kind of the recorded action, a name in `model.driver_interface.ACTION_KINDS`.
        track: Computes the action of each decision for which an answer holds; None where the answer
            itself is the action.
    """

    parts: tuple[ActionPart, ...]
    kind: str
    track: TrackAnswer | None = None


def _track_speed(answer: F64, start: EgoObservation, now: EgoObservation) -> F64:
    """Acceleration towards the answered speed, within the comfort limits of the model driver.

    Args:
        answer: Speed [m/s] and change of lane (1 to the overtaking side, -1 to the kerb side),
            shape (simulation, part).
        start: Observation that the answer was given to; not used.
        now: Observation at this decision.
    """
    del start  # Only `_track_points` uses it; both functions are a `TrackAnswer`.
    unlimited_accel = (answer[:, 0] - now.ego.speed) / _SPEED_TIME_CONSTANT
    accel = np.clip(unlimited_accel, -now.vehicle.decel, now.vehicle.accel)
    return np.stack([accel, answer[:, 1]], axis=1)


def _track_points(answer: F64, start: EgoObservation, now: EgoObservation) -> F64:
    """Acceleration and wheel angle that lead the ego through the answered points.

    The points ahead are fitted with one constant acceleration along the road and one across it, by
    least squares. The fit is repeated at every decision from the observed position and speed, so
    tracking errors do not add up. The wheel angle contains no part for the bend of the road: in a
    bend the wheels turn only once heading and lateral position have changed against the road.
    There are no comfort limits as in `_track_speed`, because the points determine the motion.

    Args:
        answer: For each point the distance along the road and the distance to the overtaking side
            from the position at `start`, shape (simulation, 2 * point) [m].
        start: Observation that the answer was given to.
        now: Observation at this decision.
    """
    points = answer.reshape(len(answer), len(_POINT_TIMES), 2)
    point_s = points[:, :, 0] + start.ego.s[:, None]
    point_lateral_position = points[:, :, 1] + start.ego.lateral_position[:, None]
    distances_along = point_s - now.ego.s[:, None]
    distances_across = point_lateral_position - now.ego.lateral_position[:, None]
    # A point whose time is over gets the time 0 and so no weight in the fit.
    times = np.maximum(np.array(_POINT_TIMES) - (now.time - start.time), 0.0)

    # The heading is the angle to the road, positive towards the overtaking side.
    speed, heading = now.ego.speed.astype(np.float64), now.ego.heading.astype(np.float64)
    accel = _least_squares_accel(distances_along, speed * np.cos(heading), times)
    lateral_accel = _least_squares_accel(distances_across, speed * np.sin(heading), times)

    # Steady cornering of the single-track model: the Ackermann angle, wheelbase times curvature
    # a / v^2, plus understeer times lateral acceleration a.
    v = np.maximum(speed, _MIN_TRACKING_SPEED)
    wheel_angle = lateral_accel * (now.vehicle.wheelbase / (v * v) + now.vehicle.understeer)
    return np.stack([accel, wheel_angle], axis=1)


def _least_squares_accel(distances: F64, speed: F64, times: F64) -> F64:
    """The constant acceleration with the smallest sum of squared distances from the points.

    At time t the vehicle has moved v t + a t^2 / 2, which is linear in a. With h = t^2 / 2 the
    least-squares solution is a = sum(h (distance - v t)) / sum(h^2).

    Args:
        distances: Distance from the vehicle to each point, shape (simulation, point) [m].
        speed: Present speed in the direction of the distances, shape (simulation,) [m/s].
        times: Time until each point is to be reached, shape (point,) [s].

    Returns:
        Accelerations, shape (simulation,) [m/s^2]; zero if the times of all points are over.
    """
    half_squares = 0.5 * times * times
    denominator = float((half_squares * half_squares).sum())
    numerator = (half_squares * (distances - speed[:, None] * times)).sum(axis=1)
    return numerator / denominator if denominator > 0.0 else np.zeros_like(numerator)


# The limits are chosen wide enough for any vehicle: a vehicle at the largest speed of `speed_lane`,
# 100 m/s, moves by 200 m within the 2 s of a trajectory. 20 m aside are more than five lanes of
# 3.5 m. Recorded positions have the same resolution, 1 mm.
_POINT_PARTS = tuple(
    part
    for k in range(1, len(_POINT_TIMES) + 1)
    for part in (
        ActionPart(f"ahead_{k}", "m", resolution=1e-3, low=0.0, high=200.0),
        ActionPart(
            f"aside_{k}",
            "m towards the overtaking side",
            resolution=1e-3,
            low=-20.0,
            high=20.0,
        ),
    )
)


ACTION_SPACES: Final = {
    "accel_lane": ActionSpace(ACTION_KINDS["accel_lane"], "accel_lane"),
    "speed_lane": ActionSpace(
        (ActionPart("speed", "m/s", resolution=1e-3, low=0.0, high=100.0), _LANE_PART),
        "accel_lane",
        _track_speed,
    ),
    "accel_steer": ActionSpace(ACTION_KINDS["accel_steer"], "accel_steer"),
    "trajectory": ActionSpace(_POINT_PARTS, "accel_steer", _track_points),
    "decision": ActionSpace(ACTION_KINDS["decision"], "decision"),
    "accel_move": ActionSpace(ACTION_KINDS["accel_move"], "accel_move"),
    "accel_steer_signal": ActionSpace(ACTION_KINDS["accel_steer_signal"], "accel_steer_signal"),
}
"""The action spaces by the names that a `Driver` states; the first is the default.

`model.driver_interface.ACTION_KINDS` explains the kinds of action.
"""

MAX_ANSWER_PARTS: Final = max(len(space.parts) for space in ACTION_SPACES.values())
"""Largest number of parts of an answer. An answer may have more parts than its recorded action."""


class ClippedAnswers(NamedTuple):
    """Answers within their limits.

    Attributes:
        values: The answers, shape (simulation, part).
        was_clipped: Whether any part of an answer was outside its limits, shape (simulation,). An
            excess of up to half a resolution does not count, because the later rounding to whole
            steps removes it anyway.
    """

    values: F64
    was_clipped: Mask


def clip_to_limits(values: F64, parts: tuple[ActionPart, ...]) -> ClippedAnswers:
    """Clip answers to the limits of their parts.

    Args:
        values: Answers, shape (simulation, part).
        parts: The parts, which state limits and resolution.
    """
    limits = np.array([(part.resolution, part.low, part.high) for part in parts])
    resolution, low, high = limits.T
    clipped = np.clip(values, low, high)
    was_clipped = (np.abs(values - clipped) > 0.5 * resolution).any(axis=1)
    return ClippedAnswers(clipped, was_clipped)


def to_action_integers(
    values: F64, is_running: Mask, parts: tuple[ActionPart, ...]
) -> NDArray[np.int32]:
    """Convert actions to the integers that are recorded and that both simulators carry out.

    Args:
        values: Actions, shape (simulation, part).
        is_running: Whether each simulation runs, shape (simulation,).
        parts: The parts of the kind of action.

    Returns:
        Each part as a number of steps of its resolution, shape (simulation, `MAX_ACTION_PARTS`).
        Zero for simulations that have ended and for parts that the kind of action does not have.
    """
    steps = np.zeros((len(values), MAX_ACTION_PARTS), np.int32)
    for k, part in enumerate(parts):
        # Answers are within their limits, but a tracked answer may lead to an action outside them.
        clipped = np.clip(values[:, k], part.low, part.high)
        steps[:, k] = np.where(is_running, np.rint(clipped / part.resolution), 0.0)
    return steps
