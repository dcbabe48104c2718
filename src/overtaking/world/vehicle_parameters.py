"""Parameters of vehicles in a simulation step: masses, forces, levers, lamps, starts.

`vehicle_parameters` takes the bodies of the vehicles (`Scenario.vehicles`), their starts and the
weather. It returns fields of `step_parameters.VehicleParameters`, each an array with one number per
vehicle. `step_parameters.step_parameters` collects them once before a simulation, together with the
fields that `driver_parameters` computes. `ModelConstants` holds the numbers of the model that the
step reads; `constant` reads any number of the model from `knowledge/data`.

Lateral positions count towards the overtaking side, stations `s` along the direction of travel.
The cornering stiffness of an axle is its side force per slip angle, C_f in front and C_r at the
rear [N/rad]; `VehicleSpecs` holds it per axle load [1/rad].
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
"""Arrays of shape (simulation, vehicle) by the name of their field of `VehicleParameters`. Their
dtypes vary; `step_parameters.step_parameters` converts them to float32."""

_LAMP_OFF = np.float32(1e9)
"""One over the intensity of a lamp that is off [1/cd]. It is finite, because the step multiplies it
by a threshold of illuminance that may be 0, and 0 times infinity is NaN."""


def vehicle_parameters(context: StepContext) -> FieldArrays:
    """Fields of `VehicleParameters` that are computed from bodies and starts.

    Lengths are in m and forces in N; a flag is 0 or 1. `power` and `max_speed` replace the fields
    of `VehicleSpecs` of these names. The caller adds the other fields of `VehicleSpecs` that
    `VehicleParameters` has, unchanged.

    - Body: `half_length`, `half_width`; `half_track`, half the distance of the left and right
      wheels; `blocks_view`, the flag of a body that hides the road ahead from drivers behind it;
      `shelters_wind`, the flag of a body that shelters vehicles to its lee from side wind; `spray`,
      the spray behind the vehicle relative to the spray of a car [1].
    - Inertia: `inverse_mass` [1/kg], `inverse_inertia` about the vertical axis [1/(kg m^2)];
      `cg_front`, `cg_rear`, the distances of the centre of gravity from the front and the rear
      axle, both positive; `inverse_wheelbase` [1/m].
    - Drive: `launch_force`, the largest drive force at low speed; `power` at the wheels [W];
      `drag`, the drag force per squared air speed [N s^2/m^2]; `rolling`, the rolling resistance;
      `max_speed` [m/s]; `max_brake_force`, the strongest braking force, positive; `front_drive`,
      the share of the drive force at the front axle [1].
    - Tyres: `understeer`, see `understeer_gradient`; `moment_angle` and `side_lag`, see the
      functions of these names; `has_truck_tyres`, the flag of a truck: its tyres and the height of
      its driver's eye differ.
    - Wind: `side_wind`, the side force per squared air speed at the wind angle that gives the
      largest force [N s^2/m^2]; `wind_centre`, the distance of the centre of wind pressure ahead of
      the middle between the axles, negative behind it; `wind_arm`, the distance of that middle
      ahead of the centre of gravity, negative behind it.
    - Lamps: `initial_lights`, the lamps that are on at the start, a sum of bits of `Lights`;
      `inverse_tail_lamp`, `inverse_head_lamp`, one over the luminous intensity to the rear and to
      the front [1/cd]; `looming_width`, the width that other drivers see grow as they approach;
      `log_contrast`, the logarithm of the contrast of the body against its background [1].
    - Start: `start_s`, `start_d`, position of the body's centre along and across the road, and
      `start_lane`, all three counted in the vehicle's own direction, see `_start`; `start_speed`
      [m/s]; `travel_sign`, 1 along the road and -1 against it.

    Args:
        context: The batch, its weather, the constants and the enabled effects.

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

    K = (1 / c_f - 1 / c_r) / g, with the cornering stiffnesses c per axle load; positive for a
    vehicle that understeers.

    Args:
        vehicles: Bodies, shape (simulation, vehicle).
        constants: Constants of the model.

    Returns:
        Shape (simulation, vehicle) [rad s^2/m].

    Source:
        Gillespie, Fundamentals of Vehicle Dynamics (1992), chapter 6.
    """
    return (ONE / vehicles.front_stiffness - ONE / vehicles.rear_stiffness) / constants.gravity


def moment_angle(vehicles: VehicleSpecs, constants: ModelConstants) -> F32:
    """Wheel angle per yaw moment, such as the moment of side wind, to hold a straight course.

    It is (1 / C_f + 1 / C_r) / l with the wheelbase l, and follows from the equations of the steady
    single-track model (one wheel per axle) at a yaw rate of 0.

    Args:
        vehicles: Bodies, shape (simulation, vehicle).
        constants: Constants of the model.

    Returns:
        Shape (simulation, vehicle) [rad/(N m)].
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
    """Time constant of the tyres' side force for each m/s of speed: m / (C_f + C_r), mass m.

    Args:
        vehicles: Bodies, shape (simulation, vehicle).
        constants: Constants of the model.

    Returns:
        Shape (simulation, vehicle) [s^2/m].

    Source:
        The side-slip time constant of the single-track model (Gillespie 1992, chapter 6).
    """
    front_load_share = _cg_to_rear(vehicles) / vehicles.wheelbase
    rear_load_share = ONE - front_load_share
    # The mean of the stiffnesses per axle load, times the weight m g, is C_f + C_r.
    mean_stiffness = (
        vehicles.front_stiffness * front_load_share + vehicles.rear_stiffness * rear_load_share
    )
    return ONE / (constants.gravity * mean_stiffness)


def _shape(vehicles: VehicleSpecs, effects: EnabledEffects) -> FieldArrays:
    """Half lengths and widths, and the effects of a body on other vehicles."""
    is_tall = (vehicles.kind == VehicleKind.TRUCK) | (vehicles.kind == VehicleKind.VAN)
    return {
        "half_length": HALF * vehicles.length,
        "half_width": HALF * vehicles.width,
        "half_track": HALF * vehicles.track_width,
        "blocks_view": is_tall & effects.occlusion,
        # Not `& effects.wake`: disabling that effect sets the constant `shelter_factor` to 1.
        "shelters_wind": is_tall,
        "spray": vehicles.spray_factor,
    }


def _inertia(vehicles: VehicleSpecs) -> FieldArrays:
    """Levers, and masses as inverses: the step multiplies by them instead of dividing."""
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
    # `unlawful_presence` is the flag of bicycles, which the law bans from motorways. A study that
    # the package repeats (Pinto, Dutra and Fonseca 2023) has them on its motorway at 50 to
    # 120 km/h, so their top speed is raised to the speed at which they start.
    raised_max_speed = maximum(vehicles.max_speed, scenario.start_speed)
    return {
        "launch_force": vehicles.mass * vehicles.launch_accel,
        # `power_share` is the mean share of the power at the wheels; gear changes interrupt the
        # drive.
        "power": constant("model.dynamics.power_share") * vehicles.power,
        "drag": constants.half_air_density * vehicles.drag_area,
        "rolling": vehicles.rolling_resistance * vehicles.mass * constants.gravity,
        "max_speed": np.where(vehicles.unlawful_presence, raised_max_speed, vehicles.max_speed),
        "max_brake_force": vehicles.mass * vehicles.peak_decel,
        "front_drive": vehicles.front_drive_share,
    }


def _tyres(vehicles: VehicleSpecs, constants: ModelConstants) -> FieldArrays:
    """Steering response, and the flag of truck tyres."""
    return {
        "understeer": understeer_gradient(vehicles, constants),
        "moment_angle": moment_angle(vehicles, constants),
        "side_lag": side_lag(vehicles, constants),
        "has_truck_tyres": vehicles.kind == VehicleKind.TRUCK,
    }


def _wind_surface(vehicles: VehicleSpecs, constants: ModelConstants) -> FieldArrays:
    """Side force of the wind per squared air speed, and its levers.

    The yaw moment about the centre of gravity is the side force times the lever
    `wind_centre` cos(a) + `wind_arm`, with the angle a between air speed and vehicle. So the centre
    of wind pressure moves to the middle between the axles as the wind turns to the side.
    """
    return {
        "side_wind": constants.half_air_density
        * vehicles.side_area
        * vehicles.wind_side_coefficient,
        # The ratio counts forward from the middle between the axles.
        "wind_centre": vehicles.wind_centre_ratio * vehicles.wheelbase,
        # The middle lies wheelbase / 2 behind the front axle, the centre of gravity `cg_to_front`:
        # the lever is `cg_to_front` - wheelbase / 2 = (`cg_to_front` - `cg_to_rear`) / 2.
        "wind_arm": HALF * (vehicles.cg_to_front - _cg_to_rear(vehicles)),
    }


def _lamps(context: StepContext) -> FieldArrays:
    """Lamps and contrast: low beam at night, in rain and in thick fog; fog lamps in thick fog.

    Bicycles drive without lamps. By day drivers judge an approach by the width of the body,
    at night by `lamp_separation`, the distance of the lamps or the diameter of a single one.

    A scenario may replace the physical effects of its weather by random lateral pushes
    (`Scenario.pushes`). Then the effective weather, also of `context.conditions`, is a dry, clear
    day. Lamps are on in the recorded night all the same, as in the study with such pushes (Pinto,
    Dutra and Fonseca 2023), but have no effect. Otherwise recorded and effective weather are the
    same.
    """
    vehicles, conditions = context.scenario.vehicles, context.conditions
    has_lamps = vehicles.kind != VehicleKind.BICYCLE
    is_recorded_night = context.scenario.weather.night[:, None]
    is_effective_night = context.effective_scenario.weather.night[:, None]
    fog_limit = visibility.extinction_of_range(constant("model.lights.fog_lamp_range"))
    is_foggy = (conditions.fog_extinction > fog_limit)[:, None]
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
        # The step needs the logarithm: by Koschmieder's law a vehicle is visible up to the optical
        # depth (extinction times distance) log(contrast) - log(threshold).
        "log_contrast": log(vehicles.contrast),
    }


def _start(scenario: Scenario) -> FieldArrays:
    """States at the start, each vehicle in the frame of its own direction.

    A two-way road has two equally wide lanes: `Scenario.start_lane` is 0 along the road and 1 for
    oncoming vehicles. These have a frame (coordinate system) of their own, turned by half a circle
    about the middle of the road: s becomes length - s, and each lane takes the place of the other.
    So an oncoming vehicle starts in lane 0 of its frame, between the same borders as a vehicle
    along the road.
    """
    road = road_parameters(scenario.road)
    borders = road.boundaries
    # Where a simulation has fewer vehicles than the array has columns, the lane index may be any
    # number: keep it in the range of `borders`.
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
