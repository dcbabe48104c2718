"""The single-track model once more, in float64 and from its equations, for SciPy to integrate.

Fiala's tyre, the friction circle, brakes that follow the load of the axles, drag, and a side wind;
see Pacejka, Tyre and Vehicle Dynamics (2012), sections 1.3 and 3.2. Nothing here comes from the
package but the numbers of a vehicle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import solve_ivp

if TYPE_CHECKING:
    from collections.abc import Callable

GRAVITY = 9.81
AIR_DENSITY = 1.2
ANTI_LOCK = 0.95
"""Part of the peak friction that the wheels transmit under braking."""
TRACTION = 0.6
"""The same under the engine's force."""
SLIP_SPEED = 3.0
"""Slip and the engine's force are those of this speed at least [m/s]."""


@dataclass(frozen=True, kw_only=True)
class Drive:
    """What is done to the vehicle.

    Attributes:
        wheel: Front wheel angle at a time [rad].
        accel: Acceleration asked for at a time [m/s^2].
        wind: Speed of the wind from the right [m/s].
        friction: Peak friction.
    """

    wheel: Callable[[float], float] = lambda _: 0.0
    accel: Callable[[float], float] = lambda _: 0.0
    wind: float = 0.0
    friction: float = 0.9


def lateral_force(stiffness: float, slip: float, limit: float) -> float:
    """Fiala's lateral force [N] at a slip angle [rad]."""
    z = stiffness * math.tan(slip) / (3.0 * limit)
    if abs(z) >= 1.0:
        return -math.copysign(limit, z)
    return -limit * (3.0 * z - 3.0 * z * abs(z) + z**3)


def side_wind(body: dict[str, float], speed: float, wind: float) -> tuple[float, float]:
    """Side force [N] and yaw moment [N m] of a wind across the road."""
    angle = math.atan2(wind, speed)
    pressure = 0.5 * AIR_DENSITY * (speed**2 + wind**2)
    force = pressure * body["side_area"] * body["wind_side_coefficient"]
    force *= math.copysign(math.sin(min(1.2 * abs(angle), math.pi / 2.0)), angle)
    behind = body["wheelbase"] - body["cg_to_front"]
    arm = body["wind_centre_ratio"] * body["wheelbase"] * math.cos(angle)
    return force, force * (arm + (body["cg_to_front"] - behind) / 2.0)


def within(value: float, bound: float) -> float:
    """`value` limited to plus or minus `bound`."""
    return max(-bound, min(bound, value))


def engine(body: dict[str, float], speed: float) -> float:
    """Largest drive force [N]; the governor closes the throttle over half a metre a second."""
    force = min(0.9 * body["power"] / max(speed, SLIP_SPEED), body["mass"] * body["launch_accel"])
    return force * max(0.0, min(1.0, (body["max_speed"] + 0.5 - speed) / 0.5))


def accelerations(
    body: dict[str, float], motion: np.ndarray, drive: Drive, time: float, carried: float
) -> tuple[float, float, float]:
    """Accelerations along and across the vehicle and of yaw; `carried` shifts the load [m/s^2]."""
    _, _, _, vx, vy, r = motion
    a, mass = body["cg_to_front"], body["mass"]
    b = body["wheelbase"] - a
    delta, grip = drive.wheel(time), drive.friction
    load_f = mass * (GRAVITY * b - carried * body["cg_height"]) / (a + b)
    load_r = mass * (GRAVITY * a + carried * body["cg_height"]) / (a + b)
    resistance = 0.5 * AIR_DENSITY * body["drag_area"] * vx * abs(vx)
    resistance += body["rolling_resistance"] * mass * GRAVITY
    force = mass * drive.accel(time) + resistance
    force = max(min(force, engine(body, vx)), -mass * body["peak_decel"])
    share = load_f / (load_f + load_r) if force < 0.0 else body["front_drive_share"]
    control = ANTI_LOCK if force < 0.0 else TRACTION
    x_f = within(share * force, control * grip * load_f)
    x_r = within((1.0 - share) * force, control * grip * load_r)
    slip_f = math.atan((vy + a * r) / max(vx, SLIP_SPEED)) - delta
    slip_r = math.atan((vy - b * r) / max(vx, SLIP_SPEED))
    limit_f = math.sqrt((grip * load_f) ** 2 - x_f**2)
    limit_r = math.sqrt((grip * load_r) ** 2 - x_r**2)
    y_f = lateral_force(body["front_stiffness"] * load_f, slip_f, limit_f)
    y_r = lateral_force(body["rear_stiffness"] * load_r, slip_r, limit_r)
    blown, turned = side_wind(body, vx, drive.wind)
    across_f = y_f * math.cos(delta) + x_f * math.sin(delta)
    along = (x_f * math.cos(delta) - y_f * math.sin(delta) + x_r - resistance) / mass
    across = (across_f + y_r + blown) / mass
    return along, across, (a * across_f - b * y_r + turned) / body["yaw_inertia"]


def derivative(body: dict[str, float], motion: np.ndarray, drive: Drive, time: float) -> np.ndarray:
    """Rate of change of (s, d, heading, vx, vy, yaw rate)."""
    _, _, psi, vx, vy, r = motion
    along, across, yaw = accelerations(body, motion, drive, time, 0.0)
    for _ in range(7):  # The load follows the acceleration that it causes.
        along, across, yaw = accelerations(body, motion, drive, time, along)
    return np.array(
        [
            vx * math.cos(psi) - vy * math.sin(psi),
            vx * math.sin(psi) + vy * math.cos(psi),
            r,
            along + vy * r,
            across - vx * r,
            yaw,
        ]
    )


def integrated(
    body: dict[str, float], start: tuple[float, float, float], drive: Drive, times: np.ndarray
) -> dict[str, np.ndarray]:
    """SciPy's solution.

    Args:
        body: Numbers of the vehicle, as `VehicleSpecs` names them.
        start: s, d and speed at the first time.
        drive: What is done to it.
        times: When to report.

    Returns:
        s, d, psi, vx, vy and r, each of the shape of `times`.
    """
    s, d, speed = start
    result = solve_ivp(
        lambda t, y: derivative(body, y, drive, t),
        (0.0, float(times[-1])),
        [s, d, 0.0, speed, 0.0, 0.0],
        t_eval=times,
        method="RK45",
        rtol=1e-7,
        atol=1e-9,
        max_step=0.05,
    )
    assert result.success
    return dict(zip(("s", "d", "heading", "vx", "vy", "yaw_rate"), result.y, strict=True))
