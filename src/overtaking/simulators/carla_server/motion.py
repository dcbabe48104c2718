"""Poses, ground and wheel angles of vehicles, as values."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from overtaking.model.road import Road

_QUARTER_TURN = 0.5 * math.pi

LEVELS_APART = 3.0
"""A larger difference in height means another level, such as a bridge [m]."""


@dataclass(frozen=True, slots=True)
class GroundFrame:
    """The ground under vehicles.

    Attributes:
        road: The road whose frame, lanes and limit hold.
        shelters_wind: Whether lorries shelter vehicles beside them; only where traffic runs along
            s.
    """

    road: Road
    shelters_wind: bool


@dataclass(frozen=True, slots=True)
class PlanarMotion:
    """Position and velocity of a vehicle, in the frame of the ground.

    Attributes:
        s, d: Position of its centre [m].
        heading: Heading, anticlockwise [rad].
        v_s, v_d: Velocity in the ground's frame [m/s].
        yaw_rate: Anticlockwise [rad/s].
    """

    s: float
    d: float
    heading: float
    v_s: float
    v_d: float
    yaw_rate: float


class VehicleDynamics(NamedTuple):
    """State of the model for a vehicle, in its axes: forwards and to the left.

    Attributes:
        vx, vy: Velocity [m/s].
        yaw_rate: Anticlockwise [rad/s].
        wheel_angle: Angle of the front wheels, anticlockwise [rad].
        accel_lon, accel_lat: Acceleration by tyres and wind [m/s^2].
        mu_left, mu_right: Friction under the wheels of either side.
    """

    vx: float
    vy: float
    yaw_rate: float
    wheel_angle: float
    accel_lon: float
    accel_lat: float
    mu_left: float
    mu_right: float


@dataclass(frozen=True, slots=True)
class Obstacle:
    """A box that vehicles can hit.

    Attributes:
        length, width: Sides of the box [m].
        low, high: Heights of its lower and upper side in the world [m].
        motion: Where it is and how it moves.
        mass: Mass [kg]; infinite for a fixed obstacle.
    """

    length: float
    width: float
    low: float
    high: float
    motion: PlanarMotion
    mass: float = math.inf

    @property
    def yaw_inertia(self) -> float:
        """Moment of inertia of a uniform box about the vertical [kg m^2]."""
        return self.mass * (self.length**2 + self.width**2) / 12.0


@dataclass(frozen=True, slots=True)
class ContactImpulse:
    """An impulse of another vehicle, or of an obstacle, on a vehicle.

    Attributes:
        own, other: Ids of the two.
        impulse_s, impulse_d: Impulse on `own` in the ground's frame [N s].
    """

    own: int
    other: int
    impulse_s: float
    impulse_d: float


def rotate(x: float, y: float, angle: float) -> tuple[float, float]:
    """A vector after an anticlockwise turn, seen from axes of which y points to the left."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return x * cosine - y * sine, x * sine + y * cosine


def boxes_overlap(
    body: Mapping[str, float],
    motion: PlanarMotion,
    other_body: Mapping[str, float],
    other_motion: PlanarMotion,
) -> bool:
    """Whether two rectangles overlap: their projections do on the axes of both.

    Args:
        body: `length` and `width` of the first [m].
        motion: Pose of the first.
        other_body: `length` and `width` of the second [m].
        other_motion: Pose of the second.

    Source:
        Separating axis test: Ericson, Real-Time Collision Detection (2005), section 4.4.
    """
    offset = (other_motion.s - motion.s, other_motion.d - motion.d)
    lengthwise = (motion.heading, other_motion.heading)
    for axis in (*lengthwise, *(heading + _QUARTER_TURN for heading in lengthwise)):
        distance = abs(offset[0] * math.cos(axis) + offset[1] * math.sin(axis))
        reach = _extent(body, motion.heading - axis) + _extent(
            other_body, other_motion.heading - axis
        )
        if distance > reach:
            return False
    return True


def _extent(body: Mapping[str, float], angle: float) -> float:
    """Half the projection of a rectangle on an axis at an angle to its length [m]."""
    return 0.5 * (body["length"] * abs(math.cos(angle)) + body["width"] * abs(math.sin(angle)))


MAX_WHEEL_ANGLE = math.radians(70.0)
"""Angle of the front wheels at full lock; CARLA's cars have 70 degrees [rad]."""

STEERING_CURVE = ((0.0, 1.0), (20.0, 0.9), (60.0, 0.8), (120.0, 0.7))
"""Part of full lock against speed (km/h), as the vehicles of CARLA report theirs."""


class SteeringLimits(NamedTuple):
    """Limits of the angle of front wheels.

    Attributes:
        lock: Angle at full lock [rad].
        curve: Part of it against speed [km/h], speeds increasing.
    """

    lock: float = MAX_WHEEL_ANGLE
    curve: tuple[tuple[float, float], ...] = STEERING_CURVE

    def is_valid(self) -> bool:
        """Whether there is a curve, with increasing speeds and parts of 0 to 1."""
        speeds = [speed for speed, _ in self.curve]
        parts = [part for _, part in self.curve]
        return (
            bool(speeds)
            and speeds == sorted(set(speeds))
            and 0.0 <= min(parts) <= max(parts) <= 1.0
        )

    def angles(self, speeds: Any) -> Any:
        """Angles at full lock at some speeds [km/h], of the same shape."""
        knots, shares = zip(*self.curve, strict=True)
        return self.lock * np.interp(speeds, knots, shares)
