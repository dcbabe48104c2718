"""Motion of vehicles under external control of pedals and wheels, without drivers of the model.

The vehicles head anywhere, so the wind has a different direction in the axes of each. A tick is
the time between two decisions. Arrays of the state have shape (vehicle, simulation); there is one
simulation.
"""

import dataclasses

import numpy as np

from overtaking.core.arrays import F32
from overtaking.core.float32_math import HALF, ZERO, clamp, maximum, minimum, sincos
from overtaking.model.pedal_controls import WHEEL_RATE, PedalControls
from overtaking.sim.reference import road_conditions, vehicle_dynamics
from overtaking.sim.reference.state import State
from overtaking.world.step_parameters import StepParameters
from overtaking.world.weather_parameters import SimulationParameters


def update_weather(state: State, params: StepParameters, decision_index: int) -> None:
    """Compute gusts, friction and wind at each vehicle for the next tick."""
    # `local_simulations` replaces the weather, whose wind is the same for all vehicles.
    params = dataclasses.replace(params, local_simulations=_wind_in_vehicle_axes(state, params))
    road_conditions.update_random_processes(state, params, decision_index)
    road_conditions.update_friction(state, params)
    road_conditions.update_wind(state, params)


def drive(state: State, params: StepParameters, controls: PedalControls, steps: int) -> None:
    """Move every vehicle by some steps, without detection of contacts."""
    step_length = params.constants.step
    throttle, brake, wheel_angle = (
        values[:, None] for values in (controls.throttle, controls.brake, controls.wheel_angle)
    )
    for _ in range(steps):
        # Speed in the middle of the step.
        speed = maximum(state.motion.vx + HALF * step_length * state.motion.accel_lon, ZERO)
        _apply_throttle_and_brake(state, params, throttle, brake, speed)
        mid_angle = _turn_wheels(state, params, wheel_angle, speed)
        vehicle_dynamics.advance_motion(state, params, mid_angle, step_length)


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
    """Set the acceleration that the pedals request of `vehicle_dynamics` at a speed.

    The dynamics add the resistance to the requested force and apply the limits of engine, brakes
    and friction. The resistance is subtracted here, so that a vehicle without a foot on a pedal
    coasts.
    """
    vehicles, constants = params.vehicles, params.constants
    air_speed = speed - state.friction_and_wind.tail_wind
    resistance = vehicles.drag * air_speed * np.abs(air_speed) + vehicles.rolling
    # `slip_speed` is the least divisor wherever a formula divides by speed [m/s].
    engine_force = minimum(
        vehicles.launch_force, vehicles.power / maximum(speed, constants.slip_speed)
    )
    force = throttle * engine_force - brake * vehicles.max_brake_force - resistance
    state.controls.requested_accel = force * vehicles.inverse_mass


def _turn_wheels(state: State, params: StepParameters, requested_angle: F32, speed: F32) -> F32:
    """Turn the front wheels towards an angle; a two-wheeler leans into the curve of that angle.

    `Controls.wheel_angle` of a two-wheeler is the lateral acceleration that its lean balances
    [m/s^2]. Its lean follows with a lag, so `WHEEL_RATE` does not limit it.

    Returns:
        Wheel angle [rad], or the lateral acceleration of a two-wheeler [m/s^2], in the middle of
        the step.
    """
    vehicles, constants, controls = params.vehicles, params.constants, state.controls
    friction = state.friction_and_wind
    max_turn = WHEEL_RATE * constants.step
    turn = clamp(requested_angle - controls.wheel_angle, -max_turn, max_turn)
    # v^2 tan(angle) / wheelbase, the lateral acceleration on that curve.
    sine, cosine = sincos(requested_angle)
    accel_lat = speed * speed * sine / (cosine * vehicles.wheelbase)
    max_accel = constants.gravity * HALF * (friction.mu_left + friction.mu_right)
    lean_error = clamp(accel_lat, -max_accel, max_accel) - controls.wheel_angle
    # Share of the error that a first-order lag removes in a step, by the trapezoidal rule.
    lag_share = constants.step / (constants.two_wheeler_lag + HALF * constants.step)
    change = np.where(vehicles.two_wheeler > 0, lean_error * lag_share, turn)
    start_angle = controls.wheel_angle
    controls.wheel_angle = start_angle + change
    return start_angle + HALF * change
