"""How far the front wheels of vehicles turn."""

import math
from typing import Any, NamedTuple

import numpy as np

MAX_WHEEL_ANGLE = math.radians(70.0)
"""Angle of the front wheels at full lock; CARLA's cars have 70 degrees [rad]."""

STEERING_CURVE = ((0.0, 1.0), (20.0, 0.9), (60.0, 0.8), (120.0, 0.7))
"""Part of full lock against speed (km/h), as the vehicles of CARLA report theirs."""


class Steering(NamedTuple):
    """How far front wheels turn.

    Attributes:
        lock: Angle at full lock [rad].
        curve: Part of it against speed [km/h], speeds increasing.
    """

    lock: float = MAX_WHEEL_ANGLE
    curve: tuple[tuple[float, float], ...] = STEERING_CURVE

    def is_sound(self) -> bool:
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
