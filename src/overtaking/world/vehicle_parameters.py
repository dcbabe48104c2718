"""From a vehicle's body to the parameters of the step: forces per unit, levers, lamps."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32
from overtaking.core.float32_math import log, maximum
from overtaking.knowledge.toml_reader import constant
from overtaking.model.road import MAX_LANES
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Lights
from overtaking.model.vehicles import VehicleKind, VehicleSpecs
from overtaking.world import visibility
from overtaking.world.constants import EnabledEffects, ModelConstants
from overtaking.world.road_parameters import road_parameters
from overtaking.world.weather_parameters import SceneConditions, with_effective_weather

FieldArrays = dict[str, NDArray[Any]]
"""Fields of `parameters.VehicleParameters`, each of shape (simulation, vehicle)."""
_ONE = np.float32(1.0)
_HALF = np.float32(0.5)

_LAMP_OFF = np.float32(1e9)
"""One over the intensity of a lamp that is off [1/cd]."""


def vehicle_parameters(
    scenario: Scenario, c: ModelConstants, world: SceneConditions, effects: EnabledEffects
) -> FieldArrays:
    """The parameters of the step that bodies decide, but for fields of bodies as they are.

    Args:
        scenario: A batch of scenarios.
        c: Constants.
        world: Its weather and light.
        effects: Ablations.
    """
    v = scenario.vehicles
    return (
        _shape(v, effects)
        | _inertia(v)
        | _drive(scenario, c)
        | _tyres(v, c)
        | _wind_surface(v, c)
        | _lamps(scenario, world)
        | _start(scenario)
    )


def _shape(v: VehicleSpecs, effects: EnabledEffects) -> FieldArrays:
    high = (v.kind == VehicleKind.T) | (v.kind == VehicleKind.V)
    return {
        "half_length": _HALF * v.length,
        "half_width": _HALF * v.width,
        "half_track": _HALF * v.track_width,
        "tall": high & effects.occlusion,
        "shelters": high,
        "spray": v.spray_factor,
    }


def _cg_to_rear(v: VehicleSpecs) -> F32:
    return v.wheelbase - v.cg_to_front


def _inertia(v: VehicleSpecs) -> FieldArrays:
    return {
        "inverse_mass": _ONE / v.mass,
        "inverse_inertia": _ONE / v.yaw_inertia,
        "cg_front": v.cg_to_front,
        "cg_rear": _cg_to_rear(v),
        "inverse_wheelbase": _ONE / v.wheelbase,
    }


def _drive(scenario: Scenario, c: ModelConstants) -> FieldArrays:
    v = scenario.vehicles
    # The study's bicycles drive at 50 km/h and more: let them hold the speed that they start with.
    lifted = maximum(v.max_speed, scenario.start_speed)
    return {
        "launch_force": v.mass * v.launch_accel,
        "power": constant("model.dynamics.power_share") * v.power,
        "drag": c.half_air_density * v.drag_area,
        "rolling": v.rolling_resistance * v.mass * c.gravity,
        "max_speed": np.where(v.unlawful_presence, lifted, v.max_speed),
        "brake_force": v.mass * v.peak_decel,
        "front_drive": v.front_drive_share,
    }


def _tyres(v: VehicleSpecs, c: ModelConstants) -> FieldArrays:
    return {
        "understeer": understeer_gradient(v, c),
        "moment_angle": moment_angle(v, c),
        "side_lag": side_lag(v, c),
        "wear": v.tyre_wear,
        "truck": (v.kind == VehicleKind.T).astype(np.float32),
    }


def understeer_gradient(v: VehicleSpecs, c: ModelConstants) -> F32:
    """Wheel angle per lateral acceleration beyond that of the curve itself [rad s^2/m].

    K = (1 / C_f - 1 / C_r) / g, with the cornering stiffness per axle load.

    Source:
        Gillespie, Fundamentals of Vehicle Dynamics (1992), chapter 6.
    """
    return (_ONE / v.front_stiffness - _ONE / v.rear_stiffness) / c.gravity


def moment_angle(v: VehicleSpecs, c: ModelConstants) -> F32:
    """Wheel angle that balances a yaw moment on a straight course [rad/(N m)].

    (1 / C_f + 1 / C_r) / l with the axles' cornering stiffness in N/rad, from the steady
    single-track equations without yaw rate.
    """
    front = v.front_stiffness * v.mass * c.gravity * _cg_to_rear(v) / v.wheelbase
    rear = v.rear_stiffness * v.mass * c.gravity * v.cg_to_front / v.wheelbase
    return (_ONE / front + _ONE / rear) / v.wheelbase


def side_lag(v: VehicleSpecs, c: ModelConstants) -> F32:
    """Time in which the tyres build up a side force, per speed: m / (C_f + C_r) [s^2/m].

    Source:
        The side-slip time constant of the single-track model (Gillespie 1992, chapter 6).
    """
    share = _cg_to_rear(v) / v.wheelbase
    return _ONE / (c.gravity * (v.front_stiffness * share + v.rear_stiffness * (_ONE - share)))


def _wind_surface(v: VehicleSpecs, c: ModelConstants) -> FieldArrays:
    return {
        "side_wind": c.half_air_density * v.side_area * v.wind_side_coefficient,
        "wind_centre": v.wind_centre_ratio * v.wheelbase,
        "wind_arm": _HALF * (v.cg_to_front - _cg_to_rear(v)),
    }


def _lamps(scenario: Scenario, world: SceneConditions) -> FieldArrays:
    """Lamps and looks: low beam at night, in rain and in thick fog, fog lamps in that alone."""
    v = scenario.vehicles
    has_lamps = v.kind != VehicleKind.B
    night, dark = (
        one.weather.night[:, None] for one in (scenario, with_effective_weather(scenario))
    )
    thick = world.step.fog_extinction > visibility.extinction_of_range(
        constant("model.lights.fog_lamp_range")
    )
    foggy = has_lamps & thick[:, None]
    lit = has_lamps & (night | (world.rain_rate > 0)[:, None] | thick[:, None])
    tail = np.where(
        foggy, constant("weather.lamps.rear_fog"), constant("weather.lamps.rear_position")
    )
    return {
        "lights": _bit(lit, Lights.LOW_BEAM) + _bit(foggy, Lights.REAR_FOG),
        "inverse_tail_lamp": np.where(lit, _ONE / tail, _LAMP_OFF),
        "inverse_head_lamp": np.where(lit, _ONE / constant("model.lights.headlamp"), _LAMP_OFF),
        "loom_width": np.where(dark, v.lamp_separation, v.width),
        "contrast": log(v.contrast),
    }


def _bit(on: NDArray[np.bool_], light: Lights) -> F32:
    return np.where(on, np.float32(light.value), np.float32(0.0))


def _start(scenario: Scenario) -> FieldArrays:
    road = road_parameters(scenario.road)
    borders = road.boundaries
    # An empty slot may name any lane.
    lane = np.minimum(scenario.start_lane, MAX_LANES - 1).astype(np.int64)
    opposed = road.two_way & (lane == road.own_lanes)
    # In its own frame an oncoming vehicle starts in the slowest lane.
    lane = np.where(opposed, 0, lane)
    return {
        "start_s": np.where(opposed, road.far_end - scenario.start_s, scenario.start_s),
        "start_d": _HALF * (borders[lane] + borders[lane + 1]),
        "start_speed": scenario.start_speed,
        "start_lane": lane,
        "direction": np.where(opposed, -_ONE, _ONE),
    }
