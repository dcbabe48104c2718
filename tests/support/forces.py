"""Accelerations that tyres, engine, brakes and air can give each vehicle."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from overtaking.world import road_surface
from overtaking.world.step_parameters import VehicleParameters

if TYPE_CHECKING:
    from overtaking.model.trajectories import Trajectories
    from overtaking.world.step_parameters import StepParameters

SIGMAS = 6.0
"""Turbulence beyond so many standard deviations does not occur: 2e-9 of a normal distribution."""

SPEED_ERROR = 0.15
"""Speed changes by less between the step that an acceleration belongs to and its frame [m/s]."""


class Bounds(NamedTuple):
    """Least and largest acceleration along and across, (simulation, vehicle, time) [m/s^2]."""

    backward: np.ndarray
    forward: np.ndarray
    sideward: np.ndarray


def bounds(ran: Trajectories, given: StepParameters, driven: np.ndarray) -> Bounds:
    """The bounds of a run, by Newton's second law for each vehicle.

    Along: tyre force - drag at the air speed - rolling resistance. The tyre force is at most the
    friction of a dry road, and that of the brakes or the engine with the side force of the front
    wheels at their angle; a wreck slides on friction alone. Across: friction, and on four wheels
    the side wind.

    Args:
        ran: The run.
        given: What it was run with.
        driven: Where no vehicle is a wreck, (simulation, vehicle, time).
    """
    p = VehicleParameters._make(given.vehicle_table.transpose(0, 2, 1)[..., None])
    q = given.simulations
    c = given.constants
    speed = ran.states.speed / 1000.0
    grip = c.gravity * road_surface.peak_friction(
        c, np.float32(0.0), np.float32(0.0), p.tyre_wear, p.has_truck_tyres
    )
    aside = grip * np.sin(np.abs(ran.states.wheel_angle) / 1e4)
    strength = 1.0 + SIGMAS * c.turbulence_intensity + q.gust_gain
    tail = np.array([np.zeros_like(strength), q.wind_along * strength])
    slow, fast = (speed - one[:, None, None] for one in (tail.max(axis=0), tail.min(axis=0)))
    slow, fast = slow - SPEED_ERROR, fast + SPEED_ERROR
    most = (p.drag * fast * np.abs(fast) + p.rolling) * p.inverse_mass
    least = (p.drag * slow * np.abs(slow) + p.rolling) * p.inverse_mass
    engine = np.minimum(p.launch_force, p.power / np.maximum(speed - SPEED_ERROR, c.slip_speed))
    pushed = np.minimum(grip, engine * p.inverse_mass + aside)
    braked = np.minimum(grip, p.max_brake_force * p.inverse_mass + aside)
    across = np.abs(q.wind_across) * strength
    air = np.maximum(np.abs(slow), np.abs(fast)) ** 2 + across[:, None, None] ** 2
    wind = np.where(p.two_wheeler > 0, 0.0, p.side_wind * air * p.inverse_mass)
    return Bounds(
        backward=-np.where(driven, braked, grip) - most,
        forward=np.where(driven, pushed, grip) - least,
        sideward=grip + wind,
    )
