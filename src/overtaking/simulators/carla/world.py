"""A world of CARLA: its map and time, and our vehicles, lamps and weather in CARLA's terms."""

import math
from functools import cache
from typing import Any

import numpy as np

from overtaking.core.errors import ConfigError, OvertakingError
from overtaking.knowledge.carla_catalogue import CarlaVehicle, carla_vehicles, weather_presets
from overtaking.knowledge.vehicle_classes import COLOUR_NAMES, VEHICLE_CLASS_NAMES, colours
from overtaking.model.road import Road
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Lights
from overtaking.model.weather import NO_PRESET
from overtaking.recordings.opendrive_writer import covering, write_opendrive
from overtaking.simulators.carla.library import CALL_TIME, LOAD_TIME

TICK = 0.05
"""Length of a tick [s]: the interval of our drivers' decisions."""

MAPS = {"town06": "Town06", "motorway": "motorway"}
"""CARLA's map of each of our roads; only the headless server has the second. Maps of roads that
bend or have two directions are made of their OpenDRIVE."""

_BEYOND = 2000.0
"""How far such a map goes on before and behind a level road [m]."""

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
def _candidates(name: str) -> tuple[CarlaVehicle, ...]:
    """The vehicles of CARLA that may stand for a class."""
    every = [one for one in carla_vehicles().values() if one.vehicle_class == name]
    return tuple(one for one in every if not any(word in one.blueprint for word in _HIDDEN))


class SimulationLostError(OvertakingError, RuntimeError):
    """A simulation that the server could not run; another attempt may succeed."""

    @classmethod
    def because(cls, where: str, what: str, expected: str, got: str) -> "SimulationLostError":
        """The error for one thing that went wrong."""
        return cls(what=what, where=where, expected=expected, got=got, next_step="try again")


def fresh_world(client: Any, road: Road, *, delta: float = TICK) -> Any:
    """An empty world of the map that has this road; time passes in ticks of `delta` [s]."""
    client.set_timeout(LOAD_TIME)
    world = _loaded_world(client, road)
    client.set_timeout(CALL_TIME)
    synchronous(world, delta=delta)
    return world


def _loaded_world(client: Any, road: Road) -> Any:
    name = MAPS.get(road.name)
    if name is None and (road.is_curved or road.is_two_way):
        return client.generate_opendrive_world(write_opendrive(road_of_map(road)))
    here = client.get_world().get_map().name.rsplit("/", 1)[-1]
    if name is None or here == name:
        return client.reload_world()
    every = [one.rsplit("/", 1)[-1] for one in client.get_available_maps()]
    if name not in every:
        raise ConfigError(
            what=f"map {name}",
            where="the CARLA server",
            expected="to be there",
            got=", ".join(every[:8]),
            next_step="start a server that has it, or choose another road",
        )
    return client.load_world(name)


def road_of_map(road: Road) -> Road:
    """The road that a map is made of: a level one goes on, for who drives beyond its ends."""
    is_level = road.course is None or not road.course.grade
    return covering(road, -_BEYOND, road.length + _BEYOND) if is_level else road


def synchronous(world: Any, *, delta: float = TICK) -> None:
    """Let time pass by ticks only, each `delta` long [s]."""
    settings = world.get_settings()
    settings.synchronous_mode, settings.fixed_delta_seconds = True, delta
    # Real servers divide a tick into steps of their own; ours does so anyway.
    settings.substepping, settings.max_substep_delta_time, settings.max_substeps = True, 0.01, 10
    world.apply_settings(settings)


def leave(world: Any, sensors: list[Any], others: list[Any]) -> None:
    """Stop and remove actors, and let the server run freely, as it was found."""
    for sensor in sensors:
        sensor.stop()
    for actor in [*sensors, *others]:
        actor.destroy()
    settings = world.get_settings()
    settings.synchronous_mode, settings.fixed_delta_seconds = False, None
    world.apply_settings(settings)


def set_weather(carla: Any, world: Any, scenario: Scenario) -> None:
    """Set the weather of a batch of one."""
    world.set_weather(carla.WeatherParameters(**weather_fields(scenario)))


def blueprint_of(world: Any, scenario: Scenario, slot: int) -> Any:
    """The blueprint of a vehicle of a batch of one, painted."""
    blueprint = world.get_blueprint_library().find(blueprint_for(scenario, slot))
    if blueprint.has_attribute("color"):
        blueprint.set_attribute("color", paint(scenario, slot))
    return blueprint


class Lamps:
    """The lamps of vehicles, switched only where they change.

    Args:
        carla: The module.
        actors: Vehicles by slot.
    """

    def __init__(self, carla: Any, actors: dict[int, Any]) -> None:
        """Nothing is known of any lamp yet."""
        self._carla, self._actors = carla, actors
        self._lit: dict[int, int] = {}

    def switch(self, slot: int, bits: int) -> None:
        """Switch the lamps of a vehicle to our `Lights` bits."""
        if self._lit.get(slot) != bits:
            self._lit[slot] = bits
            self._actors[slot].set_light_state(lamps(self._carla, bits))


def blueprint_for(scenario: Scenario, slot: int) -> str:
    """The vehicle of CARLA of the same class whose length is nearest.

    Args:
        scenario: A batch of one.
        slot: Slot of the vehicle.
    """
    vehicles = scenario.vehicles
    length = float(vehicles.length[0, slot])
    found = _candidates(VEHICLE_CLASS_NAMES[int(vehicles.kind[0, slot])])
    return min(found, key=lambda one: (abs(one.size[0] - length), one.blueprint)).blueprint


def paint(scenario: Scenario, slot: int) -> str:
    """The colour of a vehicle as the attribute of a blueprint."""
    name = COLOUR_NAMES[int(scenario.vehicles.colour[0, slot])]
    return ",".join(str(part) for part in colours()[name].rgb)


def weather_fields(scenario: Scenario) -> dict[str, float]:
    """The weather of a batch of one by the names of `carla.WeatherParameters`.

    A preset is CARLA's own, with the scenario's azimuth of the sun. A sampled weather sets the
    fields that our model knows; the others are those of ClearNoon.
    """
    weather = scenario.weather
    preset = int(weather.preset[0])
    every = list(weather_presets().values())
    base = weather_presets()["ClearNoon"] if preset == int(NO_PRESET) else every[preset]
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
    """The role name that gives the headless server what CARLA's weather has no field for.

    A real server takes it for a name like any other; there, weather moves nothing anyway.
    """
    direction = math.remainder(float(scenario.weather.wind_direction[0]), math.tau)
    return f"overtaking.scenario {scenario.seed} {int(scenario.scenario_index[0])} {direction:.9f}"


def lamps(carla: Any, bits: int) -> Any:
    """`carla.VehicleLightState` of our `Lights` bits."""
    state = carla.VehicleLightState
    on = 0
    for light, names in _LAMPS.items():
        if bits & light:
            on |= sum(int(getattr(state, name)) for name in names)
    return state(on)
