"""From a blueprint to a body of our model, and from CARLA's weather to ours."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.knowledge.carla_catalogue import carla_vehicles
from overtaking.knowledge.vehicle_classes import (
    COLOUR_NAMES,
    VEHICLE_CLASS_NAMES,
    colours,
    vehicle_classes,
)
from overtaking.model.road import Road
from overtaking.model.scenario import Scenario
from overtaking.model.vehicles import VehicleSpecs
from overtaking.model.weather import NO_PRESET, Weather


class Nature(NamedTuple):
    """What CARLA's weather leaves open.

    Attributes:
        seed: Seed of gusts and puddles.
        simulation: Number of the simulation whose gusts and puddles they are.
        wind_direction: Where the wind blows to, anticlockwise from the direction of travel [rad].
    """

    seed: int
    simulation: int = 0
    wind_direction: float = math.pi / 2.0


_LIKE_THE_CLASS = (
    "mass", "cg_height", "front_stiffness", "rear_stiffness", "launch_accel", "drag_area",
    "side_area", "rolling_resistance", "peak_decel", "wind_side_coefficient", "wind_centre_ratio",
    "front_drive_share", "track_width", "spray_factor", "lamp_separation",
)  # fmt: skip
_HALF_WORN = 0.5
_WHOLE = {"kind": np.uint8, "colour": np.uint8}
_FLAGS = ("valid", "two_wheeler", "unlawful_presence")

Body = dict[str, float]
"""The numbers of one vehicle, as `VehicleSpecs` names them."""


def body_of(blueprint: str) -> Body:
    """The middle vehicle of the blueprint's class, with the blueprint's own size.

    Args:
        blueprint: Id of a vehicle, such as "vehicle.audi.a2".
    """
    known = carla_vehicles()[blueprint]
    one = vehicle_classes()[known.vehicle_class]
    length, width, height = known.size
    body: Body = {name: float(getattr(one, name).number) for name in _LIKE_THE_CLASS}
    wheelbase = float(one.wheelbase.number) * length / float(one.length.number)
    front = float(one.cg_to_front_ratio.number) * wheelbase
    arms = front * (wheelbase - front)
    grey = COLOUR_NAMES.index("grey")
    return body | {
        "valid": 1.0,
        "kind": float(VEHICLE_CLASS_NAMES.index(known.vehicle_class)),
        "colour": float(grey),
        "contrast": float(colours()["grey"].contrast.number),
        "length": length,
        "width": width,
        "height": height,
        "wheelbase": wheelbase,
        "cg_to_front": front,
        "yaw_inertia": float(one.inertia_factor.number) * body["mass"] * arms,
        "power": float(one.specific_power.number) * body["mass"],
        "max_speed": float(one.governed_speed.number),
        "tyre_wear": _HALF_WORN,
        "two_wheeler": float(one.two_wheeler),
        "unlawful_presence": 0.0,
    }


def scenario_of(
    road: Road, bodies: Sequence[Body], weather: Sequence[float], nature: Nature
) -> Scenario:
    """A scenario of one simulation: `world.step_parameters` computes forces and friction from it.

    Args:
        road: The road under the vehicles.
        bodies: One or more vehicles.
        weather: The fourteen numbers of `carla.WeatherParameters`.
        nature: What they leave open.
    """
    from overtaking.scenarios.recording_defaults import default_drivers

    shape = (1, len(bodies))
    return Scenario(
        profile="carla",
        road=road,
        seed=nature.seed,
        frame_interval_ms=50,
        scenario_index=np.array([nature.simulation], np.uint64),
        horizon=np.ones(1, np.float32),
        attempt_deadline=np.ones(1, np.float32),
        weight=np.ones(1),
        vehicles=_specs(bodies),
        drivers=default_drivers(shape),
        weather=weather_of(weather, nature.wind_direction),
        start_s=np.zeros(shape, np.float32),
        start_lane=np.zeros(shape, np.uint8),
        start_speed=np.zeros(shape, np.float32),
    )


def weather_of(values: Sequence[float], wind_direction: float) -> Weather:
    """Our weather from `carla.WeatherParameters`, percentages cut to 0 to 100."""
    cloudiness, rain, puddles, wind, azimuth, altitude, fog, *_ = values

    def number(value: float) -> NDArray[np.float32]:
        return np.array([value], np.float32)

    def percent(value: float) -> NDArray[np.float32]:
        return number(min(max(value, 0.0), 100.0))

    return Weather(
        preset=np.array([NO_PRESET]),
        cloudiness=percent(cloudiness),
        rain=percent(rain),
        puddles=percent(puddles),
        wind=percent(wind),
        fog=percent(fog),
        wind_direction=number(wind_direction),
        sun_altitude=number(math.radians(altitude)),
        sun_azimuth=number(math.remainder(math.radians(azimuth), math.tau)),
        night=np.array([altitude < 0.0]),
        low_sun=np.array([False]),
    )


def _specs(bodies: Sequence[Body]) -> VehicleSpecs:
    columns: dict[str, Any] = {}
    for field in dataclasses.fields(VehicleSpecs):
        values = np.array([[body[field.name] for body in bodies]], np.float32)
        if field.name in _FLAGS:
            columns[field.name] = values > 0
        else:
            columns[field.name] = values.astype(_WHOLE.get(field.name, np.float32))
    return VehicleSpecs(**columns)
