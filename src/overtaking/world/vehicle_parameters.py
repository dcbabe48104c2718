"""Vehicle bodies and starts as parameters of the step: forces, levers, lamps.

These numbers stay the same during a simulation, so they are computed once, before its first step.
`ModelConstants` holds the constants that the step itself reads. A number that only serves here
stays in `knowledge/data` and is read with `constant`.
"""

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
"""Arrays of shape (simulation, vehicle) by the name of their field of
`step_parameters.VehicleParameters`."""

_LAMP_OFF = np.float32(1e9)
"""One over the intensity of a lamp that is off [1/cd]. It is finite, because the step multiplies it
by a threshold of illuminance that may be 0, and 0 times infinity is no number."""


def vehicle_parameters(context: StepContext) -> FieldArrays:
    """Fields of `VehicleParameters` that are computed from bodies and starts.

    `step_parameters.parameters` adds the fields that equal fields of `VehicleSpecs` and those that
    drivers decide. Lengths are in m and forces in N; a flag is 0 or 1.

    - Body: `half_length`, `half_width`; `half_track`, half the distance of the left and right
      wheels; `tall`, the flag of a body that hides the road ahead from drivers behind it;
      `shelters`, the flag of a body that shelters vehicles to its lee from side wind; `spray`, the
      spray behind the vehicle relative to the spray of a car [1].
    - Inertia: `inverse_mass` [1/kg], `inverse_inertia` about the vertical axis [1/(kg m^2)];
      `cg_front`, `cg_rear`, the distances of the centre of gravity from the front and the rear
      axle, both positive; `inverse_wheelbase` [1/m].
    - Drive: `launch_force`, the largest drive force at low speed; `power` at the wheels [W];
      `drag`, the drag force per squared air speed [N s^2/m^2]; `rolling`, the rolling resistance;
      `max_speed` [m/s]; `brake_force`, the strongest braking force, positive; `front_drive`, the
      share of the drive force at the front axle [1].
    - Tyres: `understeer`, see `understeer_gradient`; `moment_angle`; `side_lag`; `wear` of the
      tread, 0 new to 1 worn; `truck`, the flag of a truck, whose tyres and driver's eye height
      differ.
    - Wind: `side_wind`, the side force per squared air speed at the wind angle that gives the
      largest force [N s^2/m^2]; `wind_centre`, the distance of the centre of wind pressure ahead of
      the middle between the axles, negative behind it; `wind_arm`, the distance of that middle
      ahead of the centre of gravity, negative behind it.
    - Lamps: `lights`, a sum of bits of `Lights`; `inverse_tail_lamp`, `inverse_head_lamp`, one over
      the luminous intensity to the rear and to the front [1/cd]; `loom_width`, the width that
      drivers behind or ahead see grow as the vehicle approaches; `contrast`, the logarithm of the
      contrast of the body against its background [1].
    - Start: `start_s`, `start_d`, `start_lane` in the frame of the vehicle's own direction;
      `start_speed` [m/s]; `direction`, 1 along the road and -1 against it.

    Args:
        context: The batch, its weather and the constants.
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

    K = (1 / C_f - 1 / C_r) / g [rad s^2/m], with the cornering stiffness per axle load; positive
    for a vehicle that understeers.

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
    # The load of an axle is the weight times the distance of the centre of gravity from the other
    # axle, over the wheelbase. `VehicleSpecs` holds the stiffness per axle load.
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
    front_load = _cg_to_rear(vehicles) / vehicles.wheelbase
    rear_load = ONE - front_load
    # Stiffness per axle load, averaged over the loads, times the weight is C_f + C_r.
    mean_stiffness = vehicles.front_stiffness * front_load + vehicles.rear_stiffness * rear_load
    return ONE / (constants.gravity * mean_stiffness)


def _shape(vehicles: VehicleSpecs, effects: EnabledEffects) -> FieldArrays:
    """Lengths and widths, and the effects of a body on other vehicles."""
    is_tall = (vehicles.kind == VehicleKind.TRUCK) | (vehicles.kind == VehicleKind.VAN)
    return {
        "half_length": HALF * vehicles.length,
        "half_width": HALF * vehicles.width,
        "half_track": HALF * vehicles.track_width,
        # The effect `occlusion` disables hidden views only; shelter from wind is no part of it.
        "blocks_view": is_tall & effects.occlusion,
        "shelters_wind": is_tall,
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
    # Pinto, Dutra and Fonseca (2023) let bicycles drive at 50 to 120 km/h on their motorway. So a
    # vehicle that may not be there, which only bicycles are, can hold the speed at which it starts.
    raised_max_speed = maximum(vehicles.max_speed, scenario.start_speed)
    return {
        "launch_force": vehicles.mass * vehicles.launch_accel,
        # Gear changes interrupt the drive: this share is left of the power on average.
        "power": constant("model.dynamics.power_share") * vehicles.power,
        "drag": constants.half_air_density * vehicles.drag_area,
        "rolling": vehicles.rolling_resistance * vehicles.mass * constants.gravity,
        "max_speed": np.where(vehicles.unlawful_presence, raised_max_speed, vehicles.max_speed),
        "max_brake_force": vehicles.mass * vehicles.peak_decel,
        "front_drive": vehicles.front_drive_share,
    }


def _tyres(vehicles: VehicleSpecs, constants: ModelConstants) -> FieldArrays:
    """Steering response and kind of the tyres."""
    return {
        "understeer": understeer_gradient(vehicles, constants),
        "moment_angle": moment_angle(vehicles, constants),
        "side_lag": side_lag(vehicles, constants),
        "tyre_wear": vehicles.tyre_wear,
        "has_truck_tyres": (vehicles.kind == VehicleKind.TRUCK).astype(np.float32),
    }


def _wind_surface(vehicles: VehicleSpecs, constants: ModelConstants) -> FieldArrays:
    """Force of side wind per squared speed, and its levers.

    The yaw moment about the centre of gravity is the side force times `wind_centre` cos(a) +
    `wind_arm`, with the angle a between air speed and vehicle: the centre of wind pressure moves to
    the middle between the axles as the wind turns to the side.
    """
    return {
        "side_wind": constants.half_air_density
        * vehicles.side_area
        * vehicles.wind_side_coefficient,
        # The ratio counts from the middle between the axles to the front.
        "wind_centre": vehicles.wind_centre_ratio * vehicles.wheelbase,
        # That middle lies wheelbase / 2 behind the front axle, the centre of gravity `cg_to_front`,
        # and `cg_to_front` - wheelbase / 2 = (`cg_to_front` - `cg_to_rear`) / 2.
        "wind_arm": HALF * (vehicles.cg_to_front - _cg_to_rear(vehicles)),
    }


def _lamps(context: StepContext) -> FieldArrays:
    """Lamps and contrast: low beam at night, in rain and in thick fog; fog lamps in thick fog.

    Bicycles have no lamps. Where lateral pushes stand for the weather (`Scenario.pushes`), the
    effective weather is a dry, clear day, see `weather_parameters.with_effective_weather`.
    Vehicles still switch their lamps by the recorded night, but drivers judge an approach by the
    width of the body, as by day. Rain and fog in `conditions` come from the effective weather.
    """
    vehicles, conditions = context.scenario.vehicles, context.conditions
    has_lamps = vehicles.kind != VehicleKind.BICYCLE
    is_recorded_night = context.scenario.weather.night[:, None]
    is_effective_night = context.effective_scenario.weather.night[:, None]
    thick_fog = visibility.extinction_of_range(constant("model.lights.fog_lamp_range"))
    is_foggy = (conditions.fog_extinction > thick_fog)[:, None]
    has_fog_lamp = has_lamps & is_foggy
    has_low_beam = has_lamps & (is_recorded_night | (conditions.rain_rate > 0)[:, None] | is_foggy)
    tail_lamp = np.where(
        has_fog_lamp, constant("weather.lamps.rear_fog"), constant("weather.lamps.rear_position")
    )
    head_lamp = constant("model.lights.headlamp")
    return {
        "initial_lights": _light_bit(has_low_beam, Lights.LOW_BEAM)
        + _light_bit(has_fog_lamp, Lights.REAR_FOG),
        "inverse_tail_lamp": np.where(has_low_beam, ONE / tail_lamp, _LAMP_OFF),
        "inverse_head_lamp": np.where(has_low_beam, ONE / head_lamp, _LAMP_OFF),
        "looming_width": np.where(is_effective_night, vehicles.lamp_separation, vehicles.width),
        # Koschmieder's law: a vehicle is seen up to the optical depth log(contrast / threshold).
        "log_contrast": log(vehicles.contrast),
    }


def _start(scenario: Scenario) -> FieldArrays:
    """States at the start, each vehicle in the frame of its own direction.

    A two-way road has one lane in each direction, both equally wide. The opposing lane has the
    number after the road's own lanes. Oncoming vehicles have the frame of the road turned by half a
    circle about its middle, so each lane takes the place of the other: in this frame an
    oncoming vehicle starts in lane 0, between the same borders as a vehicle along the road.
    """
    road = road_parameters(scenario.road)
    borders = road.boundaries
    # A slot without a vehicle may hold any number as its lane.
    lane = np.minimum(scenario.start_lane, MAX_LANES - 1).astype(np.int64)
    is_oncoming = road.has_oncoming_traffic & (lane == road.num_own_lanes)
    lane = np.where(is_oncoming, 0, lane)
    return {
        "start_s": np.where(is_oncoming, road.length - scenario.start_s, scenario.start_s),
        "start_d": HALF * (borders[lane] + borders[lane + 1]),
        "start_speed": scenario.start_speed,
        "start_lane": lane,
        "travel_sign": np.where(is_oncoming, -ONE, ONE),
    }


def _light_bit(is_on: Mask, light: Lights) -> F32:
    """The bit of a light where it is on, else 0."""
    return np.where(is_on, np.float32(light.value), ZERO)


def _cg_to_rear(vehicles: VehicleSpecs) -> F32:
    """Distance between the centre of gravity and the rear axle [m]."""
    return vehicles.wheelbase - vehicles.cg_to_front
