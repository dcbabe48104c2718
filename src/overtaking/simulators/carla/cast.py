"""Which of CARLA's vehicles plays which of ours, and which of its weathers is which."""

import math
from functools import cache
from typing import Any

import numpy as np

from overtaking.knowledge import COLOUR_ORDER, VEHICLE_CLASS_ORDER, colours, presets
from overtaking.knowledge.blueprints import Blueprint, blueprints
from overtaking.model.scenario import Scenario
from overtaking.model.trajectory import Lights
from overtaking.model.weather import NO_PRESET

_HIDDEN = ("police", "ambulance", "firetruck", "cybertruck", "microlino")
"""Vehicles with blue lights have rights of their own; the last two stand for no class."""

_LAMPS = {
    Lights.LOW_BEAM: ("LowBeam", "Position"),
    Lights.HIGH_BEAM: ("HighBeam",),
    Lights.REAR_FOG: ("Fog",),
    Lights.BRAKE: ("Brake",),
    Lights.INDICATOR_LEFT: ("LeftBlinker",),
    Lights.INDICATOR_RIGHT: ("RightBlinker",),
}
"""Names of `carla.VehicleLightState` for each of our lamps."""


@cache
def _candidates(name: str) -> tuple[Blueprint, ...]:
    """The vehicles of CARLA that may play a class."""
    every = [one for one in blueprints().values() if one.vehicle_class == name]
    return tuple(one for one in every if not any(word in one.blueprint for word in _HIDDEN))


def blueprint_for(scenario: Scenario, slot: int) -> str:
    """The vehicle of the same class whose length is nearest to that of a vehicle of ours.

    Args:
        scenario: A batch of one.
        slot: Which vehicle.
    """
    vehicles = scenario.vehicles
    length = float(vehicles.length[0, slot])
    found = _candidates(VEHICLE_CLASS_ORDER[int(vehicles.kind[0, slot])])
    return min(found, key=lambda one: (abs(one.size[0] - length), one.blueprint)).blueprint


def paint(scenario: Scenario, slot: int) -> str:
    """The colour of a vehicle as the attribute of a blueprint."""
    name = COLOUR_ORDER[int(scenario.vehicles.colour[0, slot])]
    return ",".join(str(part) for part in colours()[name].rgb)


def weather_fields(scenario: Scenario) -> dict[str, float]:
    """The weather of a batch of one by the names of `carla.WeatherParameters`.

    A preset is CARLA's own, except that its sun stands where the scenario wants it; a sampled
    weather fills the fields that mean something to us and leaves the look to ClearNoon.
    """
    weather = scenario.weather
    preset = int(weather.preset[0])
    every = list(presets().values())
    base = presets()["ClearNoon"] if preset == int(NO_PRESET) else every[preset]
    # CARLA's azimuth is measured in its own frame, in which y points to the right.
    azimuth = -float(weather.sun_azimuth[0]) - scenario.road.heading
    fields = base.carla_fields() | {"sun_azimuth_angle": math.degrees(azimuth) % 360.0}
    if preset != int(NO_PRESET):
        return fields
    return fields | {
        "cloudiness": float(weather.cloudiness[0]),
        "precipitation": float(weather.rain[0]),
        "precipitation_deposits": float(weather.puddles[0]),
        "wind_intensity": float(weather.wind[0]),
        "fog_density": float(weather.fog[0]),
        "wetness": float(np.maximum(weather.rain[0], weather.puddles[0])),
        "sun_altitude_angle": math.degrees(float(weather.sun_altitude[0])),
    }


def nature(scenario: Scenario) -> str:
    """The role name that tells the headless server what CARLA's weather leaves open.

    To a real server it is a name like any other; there, weather moves nothing anyway.
    """
    direction = math.remainder(float(scenario.weather.wind_direction[0]), math.tau)
    return f"overtaking.scenario {scenario.seed} {int(scenario.index[0])} {direction:.9f}"


def lamps(carla: Any, bits: int) -> Any:
    """`carla.VehicleLightState` of our `Lights` bits."""
    state = carla.VehicleLightState
    on = 0
    for light, names in _LAMPS.items():
        if bits & light:
            on |= sum(int(getattr(state, name)) for name in names)
    return state(on)
