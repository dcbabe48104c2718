"""A tick of vehicles under external control, without drivers of the model.

Vehicles head anywhere, so the wind has other axes for each.
"""

import dataclasses

import numpy as np

from overtaking.core.arrays import F32
from overtaking.core.float32_math import clamp, maximum, minimum, sincos
from overtaking.model.pedal_controls import WHEEL_RATE, PedalControls
from overtaking.sim.reference import road_conditions, vehicle_dynamics
from overtaking.sim.reference.state import State
from overtaking.world.step_parameters import StepParameters
from overtaking.world.weather_parameters import SimulationParameters


def update_weather(state: State, params: StepParameters, decision_index: int) -> None:
    """Gusts, friction under the wheels and wind on the side, as they are for the next tick."""
    params = dataclasses.replace(params, local_simulations=_wind_in_vehicle_axes(state, params))
    road_conditions.update_random_processes(state, params, decision_index)
    road_conditions.update_friction(state, params)
    road_conditions.update_wind(state, params)


def drive(state: State, params: StepParameters, controls: PedalControls, steps: int) -> None:
    """Move every vehicle by some steps, without detection of contacts."""
    constants = params.constants
    throttle, brake, wheel_angle = (
        values[:, None] for values in (controls.throttle, controls.brake, controls.wheel_angle)
    )
    for _ in range(steps):
        speed = maximum(
            state.motion.vx + np.float32(0.5) * constants.step * state.motion.accel_lon,
            np.float32(0.0),
        )
        _apply_throttle_and_brake(state, params, throttle, brake, speed)
        angle = _turn_wheels(state, params, wheel_angle, speed)
        vehicle_dynamics.advance_motion(state, params, angle, constants.step)


def _wind_in_vehicle_axes(state: State, params: StepParameters) -> SimulationParameters:
    """The weather with the wind in the axes of each vehicle."""
    simulations = params.simulations
    sine, cosine = sincos(state.motion.heading)
    return simulations._replace(
        wind_along=simulations.wind_along * cosine + simulations.wind_across * sine,
        wind_across=simulations.wind_across * cosine - simulations.wind_along * sine,
    )


def _apply_throttle_and_brake(
    state: State, params: StepParameters, throttle: F32, brake: F32, speed: F32
) -> None:
    """From pedals, at a speed, to the acceleration that the dynamics are asked for.

    They add what drag and rolling take and cut at engine, brakes and grip, so a foot off both
    pedals lets the vehicle coast.
    """
    vehicles, constants = params.vehicles, params.constants
    air = speed - state.friction_and_wind.tail_wind
    resistance = vehicles.drag * air * np.abs(air) + vehicles.rolling
    engine = minimum(vehicles.launch_force, vehicles.power / maximum(speed, constants.slip_speed))
    force = throttle * engine - brake * vehicles.max_brake_force - resistance
    state.controls.requested_accel = force * vehicles.inverse_mass


def _turn_wheels(state: State, params: StepParameters, angle: F32, speed: F32) -> F32:
    """Turn front wheels towards the wanted angle, or lean into the curve it stands for.

    Returns:
        Wheel angle, or lean, in the middle of the step.
    """
    vehicles, constants = params.vehicles, params.constants
    half = np.float32(0.5)
    most = WHEEL_RATE * constants.step
    turn = clamp(angle - state.controls.wheel_angle, -most, most)
    sine, cosine = sincos(angle)
    curve = speed * speed * sine / (cosine * vehicles.wheelbase)
    grip = (
        constants.gravity
        * half
        * (state.friction_and_wind.mu_left + state.friction_and_wind.mu_right)
    )
    lean = clamp(curve, -grip, grip) - state.controls.wheel_angle
    lean = lean * (constants.step / (constants.two_wheeler_lag + half * constants.step))
    moved = np.where(vehicles.two_wheeler > 0, lean, turn)
    before = state.controls.wheel_angle
    state.controls.wheel_angle = before + moved
    return before + half * moved
