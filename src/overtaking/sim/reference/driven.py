"""A tick of vehicles with somebody else at pedals and wheel; nobody of ours decides anything.

Vehicles head anywhere, so the wind has other axes for each.
"""

from dataclasses import dataclass

import numpy as np

from overtaking.core.elementary import F32, clamp, maximum, minimum, sincos
from overtaking.sim.reference import dynamics, environment
from overtaking.sim.reference.state import Fields, State
from overtaking.world.constants import Constants
from overtaking.world.parameters import Parameters, SimulationParameters

WHEEL_RATE = np.float32(6.0)
"""How fast the front wheels turn [rad/s]; CARLA's follow the control almost at once."""

MOVING = (
    "s", "d", "psi", "vx", "vy", "r", "wheel", "accel", "a_lon", "a_lat", "gust",
    "distance_error", "speed_error", "wander", "mu_fast", "mu_slow", "wind_force", "wind_moment",
    "tail_wind",
)  # fmt: skip
"""Fields of the state that change meanwhile, in the order in which the engine has them."""


@dataclass(frozen=True, slots=True)
class Controls:
    """What drivers do; every array has shape (vehicle, 1).

    Attributes:
        throttle: Part of the force that the engine has at this speed, 0 to 1.
        brake: Part of the braking force, 0 to 1.
        angle: Wanted angle of the front wheels, anticlockwise [rad].
    """

    throttle: F32
    brake: F32
    angle: F32


def weather(
    state: State, given: Parameters, p: Fields, q: SimulationParameters, decision: int
) -> None:
    """Gusts, friction under the wheels and wind on the side, as they are for the next tick."""
    turned = _turned(state, q)
    environment.move_random_processes(state, given, turned, decision)
    environment.grip(state, given, p, turned)
    environment.wind(state, given, p, turned)


def drive(state: State, c: Constants, p: Fields, controls: Controls, steps: int) -> None:
    """Move every vehicle by some steps; contacts are not looked for."""
    for _ in range(steps):
        _press(state, c, p, controls)
        _turn(state, c, p, controls.angle)
        dynamics.move(state, c, p)


def _turned(state: State, q: SimulationParameters) -> SimulationParameters:
    """The weather with the wind in the axes of each vehicle."""
    sine, cosine = sincos(state.psi)
    return q._replace(
        wind_along=q.wind_along * cosine + q.wind_across * sine,
        wind_across=q.wind_across * cosine - q.wind_along * sine,
    )


def _press(state: State, c: Constants, p: Fields, controls: Controls) -> None:
    """From pedals to the acceleration that the dynamics are asked for.

    They add what drag and rolling take and cut at engine, brakes and grip, so a foot off both
    pedals lets the vehicle coast.
    """
    air = state.vx - state.tail_wind
    resistance = p.drag * air * np.abs(air) + p.rolling
    engine = minimum(p.launch_force, p.power / maximum(state.vx, c.slip_speed))
    force = controls.throttle * engine - controls.brake * p.brake_force - resistance
    state.accel = force * p.inverse_mass


def _turn(state: State, c: Constants, p: Fields, angle: F32) -> None:
    """Turn front wheels towards the wanted angle, or lean into the curve it stands for."""
    most = WHEEL_RATE * c.step
    turned = state.wheel + clamp(angle - state.wheel, -most, most)
    sine, cosine = sincos(angle)
    curve = state.vx * state.vx * sine / (cosine * p.wheelbase)
    grip = c.gravity * np.float32(0.5) * (state.mu_fast + state.mu_slow)
    lean = clamp(curve, -grip, grip)
    leaned = state.wheel + (lean - state.wheel) * (c.step / c.two_wheeler_lag)
    state.wheel = np.where(p.two_wheeler > 0, leaned, turned)
