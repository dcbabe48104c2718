"""CARLA's Ackermann controller: from a wanted speed and wheel angle to pedals and steering."""

from dataclasses import dataclass, field
from typing import NamedTuple

from overtaking.simulators.carla_server.arguments import Control, Gains, Target

_MAX_ACCEL, _MAX_DECEL = 3.0, 8.0
"""Limits where the client states no acceleration [m/s^2]."""

_AT_REST = 0.1
"""Below this speed a vehicle stands [m/s]."""

_NO_LIMIT = 1e-3
"""Below this a steering speed or an acceleration means: as fast as possible."""

_MEMORY = 0.8
"""Weight of the last acceleration in its running mean."""


class Seen(NamedTuple):
    """What the controller knows of its vehicle.

    Attributes:
        speed: Forward, negative backwards [m/s].
        steer: Steering now, -1 to 1.
        lock: Largest wheel angle [rad].
    """

    speed: float
    steer: float
    lock: float


@dataclass(slots=True)
class _Pid:
    """A controller whose integral and output stay within -1 and 1."""

    integral: float = 0.0
    last: float = 0.0

    def run(self, gains: tuple[float, float, float], wanted: float, now: float, dt: float) -> float:
        """The output for an error; the derivative is that of the measurement."""
        error = wanted - now
        self.integral = _clamped(self.integral + gains[1] * error * dt, 1.0)
        derivative = -gains[2] * (now - self.last) / dt
        self.last = now
        return _clamped(gains[0] * error + self.integral + derivative, 1.0)


@dataclass(slots=True)
class Ackermann:
    """The controller of one vehicle: speed to acceleration, acceleration to pedals.

    Attributes:
        target: What the client wants.

    Source:
        CARLA 0.9.16, documentation of `carla.VehicleAckermannControl` and the controller that it
        describes: two cascaded PID controllers with the defaults of `Gains`.
    """

    target: Target
    _speed: _Pid = field(default_factory=_Pid)
    _accel: _Pid = field(default_factory=_Pid)
    _last_speed: float = 0.0
    _mean_accel: float = 0.0
    _wanted_accel: float = 0.0
    _pedal: float = 0.0
    _reverse: bool = False

    def control(self, seen: Seen, gains: Gains, dt: float) -> Control:
        """Pedals and steering for the next tick.

        Args:
            seen: The vehicle now.
            gains: Of both PID controllers.
            dt: Length of the tick [s].
        """
        now = (seen.speed - self._last_speed) / dt
        self._mean_accel = _MEMORY * self._mean_accel + (1.0 - _MEMORY) * now
        self._last_speed = seen.speed
        steer = self._steer(seen, dt)
        if abs(seen.speed) < _AT_REST and abs(self.target.speed) < _AT_REST:
            return Control(steer=steer, brake=1.0, reverse=self._reverse)
        self._press(seen.speed, gains, dt)
        forwards, backwards = max(self._pedal, 0.0), max(-self._pedal, 0.0)
        throttle, brake = (backwards, forwards) if self._reverse else (forwards, backwards)
        return Control(throttle, steer, brake, reverse=self._reverse)

    def _steer(self, seen: Seen, dt: float) -> float:
        """Steering, -1 to 1, no faster than the client wants."""
        wanted, now = _clamped(self.target.steer, seen.lock), seen.steer * seen.lock
        rate = abs(self.target.steer_speed)
        if rate >= _NO_LIMIT:
            wanted = now + _clamped(wanted - now, rate * dt)
        return wanted / seen.lock

    def _wanted_speed(self, speed: float) -> float:
        """The speed to make for; a vehicle changes its direction only from rest."""
        if abs(speed) < _AT_REST:
            self._reverse = self.target.speed < 0.0
        elif speed * self.target.speed < 0.0:
            return 0.0
        return self.target.speed

    def _press(self, speed: float, gains: Gains, dt: float) -> None:
        """Move the pedal, -1 (brake) to 1 (throttle), seen forwards."""
        limit = abs(self.target.acceleration)
        low, high = (limit, limit) if limit >= _NO_LIMIT else (_MAX_DECEL, _MAX_ACCEL)
        change = self._speed.run(gains[:3], self._wanted_speed(speed), speed, dt)
        self._wanted_accel = min(max(self._wanted_accel + change, -low), high)
        change = self._accel.run(gains[3:], self._wanted_accel, self._mean_accel, dt)
        self._pedal = _clamped(self._pedal + change, 1.0)


def _clamped(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)
