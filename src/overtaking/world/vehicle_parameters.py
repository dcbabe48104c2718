"""Vehicle bodies, as parameters of the step: forces per unit, levers, lamps."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import HALF, ONE, ZERO, log, maximum
from overtaking.knowledge.toml_reader import constant
from overtaking.model.road import MAX_LANES
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Lights
from overtaking.model.vehicles import VehicleKind, VehicleSpecs
from overtaking.world import visibility
from overtaking.world.constants import EnabledEffects, ModelConstants
from overtaking.world.road_parameters import road_parameters
from overtaking.world.weather_parameters import StepContext

FieldArrays = dict[str, NDArray[Any]]
"""Fields of `step_parameters.VehicleParameters`, each of shape (simulation, vehicle)."""

_LAMP_OFF = np.float32(1e9)
"""One over the intensity of a lamp that is off [1/cd]."""


def vehicle_parameters(context: StepContext) -> FieldArrays:
    """Fields of `VehicleParameters` that bodies and starts decide, without unchanged ones.

    Args:
        context: The batch, its weather and the constants.

    Returns:
        Arrays of shape (simulation, vehicle) by field.
    """
    vehicles, constants = context.scenario.vehicles, context.constants
    return (
        _shape(vehicles, context.effects)
        | _inertia(vehicles)
        | _drive(context.scenario, constants)
        | _tyres(vehicles, constants)
        | _wind_surface(vehicles, constants)
        | _lamps(context)
        | _start(context.scenario)
    )


def understeer_gradient(vehicles: VehicleSpecs, constants: ModelConstants) -> F32:
    """Wheel angle per lateral acceleration, beyond the angle that the curve itself needs.

    K = (1 / C_f - 1 / C_r) / g [rad s^2/m], with the cornering stiffness per axle load.

    Args:
        vehicles: Vehicles.
        constants: Constants of the model.

    Source:
        Gillespie, Fundamentals of Vehicle Dynamics (1992), chapter 6.
    """
    return (ONE / vehicles.front_stiffness - ONE / vehicles.rear_stiffness) / constants.gravity


def moment_angle(vehicles: VehicleSpecs, constants: ModelConstants) -> F32:
    """Wheel angle that balances a yaw moment on a straight course [rad/(N m)].

    (1 / C_f + 1 / C_r) / l with the axles' cornering stiffness in N/rad, from the steady
    single-track equations without yaw rate.

    Args:
        vehicles: Vehicles.
        constants: Constants of the model.
    """
    front = (
        vehicles.front_stiffness
        * vehicles.mass
        * constants.gravity
        * _cg_to_rear(vehicles)
        / vehicles.wheelbase
    )
    rear = (
        vehicles.rear_stiffness
        * vehicles.mass
        * constants.gravity
        * vehicles.cg_to_front
        / vehicles.wheelbase
    )
    return (ONE / front + ONE / rear) / vehicles.wheelbase


def side_lag(vehicles: VehicleSpecs, constants: ModelConstants) -> F32:
    """Time in which the tyres build up a side force, per speed: m / (C_f + C_r) [s^2/m].

    Args:
        vehicles: Vehicles.
        constants: Constants of the model.

    Source:
        The side-slip time constant of the single-track model (Gillespie 1992, chapter 6).
    """
    share = _cg_to_rear(vehicles) / vehicles.wheelbase
    return ONE / (
        constants.gravity
        * (vehicles.front_stiffness * share + vehicles.rear_stiffness * (ONE - share))
    )


def _shape(vehicles: VehicleSpecs, effects: EnabledEffects) -> FieldArrays:
    """Lengths and widths, and the effects of a body on traffic behind it."""
    is_tall = (vehicles.kind == VehicleKind.TRUCK) | (vehicles.kind == VehicleKind.VAN)
    return {
        "half_length": HALF * vehicles.length,
        "half_width": HALF * vehicles.width,
        "half_track": HALF * vehicles.track_width,
        "tall": is_tall & effects.occlusion,
        "shelters": is_tall,
        "spray": vehicles.spray_factor,
    }


def _inertia(vehicles: VehicleSpecs) -> FieldArrays:
    """Inertia and levers, as the step multiplies by them."""
    return {
        "inverse_mass": ONE / vehicles.mass,
        "inverse_inertia": ONE / vehicles.yaw_inertia,
        "cg_front": vehicles.cg_to_front,
        "cg_rear": _cg_to_rear(vehicles),
        "inverse_wheelbase": ONE / vehicles.wheelbase,
    }


def _drive(scenario: Scenario, constants: ModelConstants) -> FieldArrays:
    """Forces of the engine, the brakes and the resistances."""
    vehicles = scenario.vehicles
    # Bicycles of the study drive at 50 km/h and more: let them hold the speed that they start with.
    raised_max_speed = maximum(vehicles.max_speed, scenario.start_speed)
    return {
        "launch_force": vehicles.mass * vehicles.launch_accel,
        "power": constant("model.dynamics.power_share") * vehicles.power,
        "drag": constants.half_air_density * vehicles.drag_area,
        "rolling": vehicles.rolling_resistance * vehicles.mass * constants.gravity,
        "max_speed": np.where(vehicles.unlawful_presence, raised_max_speed, vehicles.max_speed),
        "brake_force": vehicles.mass * vehicles.peak_decel,
        "front_drive": vehicles.front_drive_share,
    }


def _tyres(vehicles: VehicleSpecs, constants: ModelConstants) -> FieldArrays:
    """Steering response and kind of the tyres."""
    return {
        "understeer": understeer_gradient(vehicles, constants),
        "moment_angle": moment_angle(vehicles, constants),
        "side_lag": side_lag(vehicles, constants),
        "wear": vehicles.tyre_wear,
        "truck": (vehicles.kind == VehicleKind.TRUCK).astype(np.float32),
    }


def _wind_surface(vehicles: VehicleSpecs, constants: ModelConstants) -> FieldArrays:
    """Force of side wind per squared speed, and its levers."""
    return {
        "side_wind": constants.half_air_density
        * vehicles.side_area
        * vehicles.wind_side_coefficient,
        "wind_centre": vehicles.wind_centre_ratio * vehicles.wheelbase,
        "wind_arm": HALF * (vehicles.cg_to_front - _cg_to_rear(vehicles)),
    }


def _lamps(context: StepContext) -> FieldArrays:
    """Lamps and contrast: low beam at night, in rain and in thick fog; fog lamps in thick fog."""
    vehicles, conditions = context.scenario.vehicles, context.conditions
    has_lamps = vehicles.kind != VehicleKind.BICYCLE
    # Lamps are switched by the recorded night. Drivers see outlines of lamps instead of bodies only
    # where the night acts by physics.
    is_night = context.scenario.weather.night[:, None]
    is_dark = context.effective_scenario.weather.night[:, None]
    thick_fog = visibility.extinction_of_range(constant("model.lights.fog_lamp_range"))
    is_foggy = (conditions.fog_extinction > thick_fog)[:, None]
    has_fog_lamp = has_lamps & is_foggy
    has_low_beam = has_lamps & (is_night | (conditions.rain_rate > 0)[:, None] | is_foggy)
    tail_lamp = np.where(
        has_fog_lamp, constant("weather.lamps.rear_fog"), constant("weather.lamps.rear_position")
    )
    head_lamp = constant("model.lights.headlamp")
    return {
        "lights": _light_bit(has_low_beam, Lights.LOW_BEAM)
        + _light_bit(has_fog_lamp, Lights.REAR_FOG),
        "inverse_tail_lamp": np.where(has_low_beam, ONE / tail_lamp, _LAMP_OFF),
        "inverse_head_lamp": np.where(has_low_beam, ONE / head_lamp, _LAMP_OFF),
        "loom_width": np.where(is_dark, vehicles.lamp_separation, vehicles.width),
        "contrast": log(vehicles.contrast),
    }


def _start(scenario: Scenario) -> FieldArrays:
    """States at the start, each vehicle in the frame of its own direction."""
    road = road_parameters(scenario.road)
    borders = road.boundaries
    # A slot without a vehicle may hold any number as its lane.
    lane = np.minimum(scenario.start_lane, MAX_LANES - 1).astype(np.int64)
    is_oncoming = road.two_way & (lane == road.own_lanes)
    # In its own frame an oncoming vehicle starts in the slowest lane.
    lane = np.where(is_oncoming, 0, lane)
    return {
        "start_s": np.where(is_oncoming, road.far_end - scenario.start_s, scenario.start_s),
        "start_d": HALF * (borders[lane] + borders[lane + 1]),
        "start_speed": scenario.start_speed,
        "start_lane": lane,
        "direction": np.where(is_oncoming, -ONE, ONE),
    }


def _light_bit(is_on: Mask, light: Lights) -> F32:
    """The bit of a light where it is on, else 0."""
    return np.where(is_on, np.float32(light.value), ZERO)


def _cg_to_rear(vehicles: VehicleSpecs) -> F32:
    """Distance between the centre of gravity and the rear axle [m]."""
    return vehicles.wheelbase - vehicles.cg_to_front
