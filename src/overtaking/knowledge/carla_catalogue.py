"""Vehicles, props and named weathers of the simulator CARLA 0.9.16.

The package draws its weather from the named weathers, and the server that imitates CARLA offers the
vehicles and props. The TOML files of `knowledge/data` hold the values. `read_records` checks them
and returns a mapping from the name of each table of a file to a dataclass, in SI units unless a
name ends in another unit. All callers share the cached mappings, so these are read-only.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

from overtaking.knowledge.toml_reader import read_records


@dataclass(frozen=True, slots=True, kw_only=True)
class CarlaVehicle:
    """A vehicle of CARLA's catalogue.

    Attributes:
        blueprint: CARLA's id of the model, such as "vehicle.audi.a2".
        base_type: CARLA's name of its kind: car, truck, van, bus, motorcycle or bicycle.
        vehicle_class: Name of the class in `vehicle_classes` whose physics it has, such as "S".
        size: Length, width and height of its bounding box [m].
    """

    blueprint: str
    base_type: str
    vehicle_class: str
    size: tuple[float, float, float]


@cache
def carla_vehicles() -> Mapping[str, CarlaVehicle]:
    """The vehicles by `blueprint`, in the alphabetical order of the file."""
    vehicles = read_records(CarlaVehicle, "carla_vehicles.toml").values()
    return MappingProxyType({vehicle.blueprint: vehicle for vehicle in vehicles})


@dataclass(frozen=True, slots=True, kw_only=True)
class PropBlueprint:
    """A prop of CARLA's catalogue: a loose object, such as a traffic cone.

    Attributes:
        blueprint: CARLA's id of the object, such as "static.prop.trafficcone01".
        size: Length, width and height of its bounding box [m].
    """

    blueprint: str
    size: tuple[float, float, float]


@cache
def props() -> Mapping[str, PropBlueprint]:
    """The props by `blueprint`, in the alphabetical order of the file."""
    props_by_key = read_records(PropBlueprint, "carla_props.toml").values()
    return MappingProxyType({prop.blueprint: prop for prop in props_by_key})


# Fields of `WeatherPreset` to fields of `carla.WeatherParameters`, in CARLA's order. CARLA takes
# percent and degrees, so the names end in these units: `read_records` then does not convert them.
_CARLA_FIELDS = {
    "cloudiness_percent": "cloudiness",
    "precipitation_percent": "precipitation",
    "precipitation_deposits_percent": "precipitation_deposits",
    "wind_intensity_percent": "wind_intensity",
    "sun_azimuth_deg": "sun_azimuth_angle",
    "sun_altitude_deg": "sun_altitude_angle",
    "fog_density_percent": "fog_density",
    "fog_distance": "fog_distance",
    "wetness_percent": "wetness",
    "fog_falloff": "fog_falloff",
    "scattering_intensity": "scattering_intensity",
    "mie_scattering_scale": "mie_scattering_scale",
    "rayleigh_scattering_scale": "rayleigh_scattering_scale",
    "dust_storm_percent": "dust_storm",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class WeatherPreset:
    """A named weather of CARLA; percentages are settings from 0 to 100, not physical quantities.

    The package uses clouds, rain, puddles, wind, fog density and the altitude of the sun; it draws
    the direction of the sun at random. CARLA's cameras use all numbers.

    Attributes:
        in_pinto2023: Whether `pinto-2023`, the study that this package reproduces, used it.
        cloudiness_percent: Clouds.
        precipitation_percent: Rain.
        precipitation_deposits_percent: Puddles.
        wind_intensity_percent: Wind.
        sun_azimuth_deg: Direction of the sun from CARLA's x axis towards its y axis, which points
            to the right of x; -1 asks CARLA to keep the sun of the map.
        sun_altitude_deg: Angle of the sun above the horizon; negative at night.
        fog_density_percent: Fog.
        fog_distance: Distance at which the fog begins [m].
        wetness_percent: Sheen of the road.
        fog_falloff: Thinning of the fog with height [1].
        scattering_intensity: Light that the fog scatters [1].
        mie_scattering_scale: Haze around lights [1].
        rayleigh_scattering_scale: Blue of the sky [1].
        dust_storm_percent: Dust in the air.
    """

    in_pinto2023: bool
    cloudiness_percent: float
    precipitation_percent: float
    precipitation_deposits_percent: float
    wind_intensity_percent: float
    sun_azimuth_deg: float
    sun_altitude_deg: float
    fog_density_percent: float
    fog_distance: float
    wetness_percent: float
    fog_falloff: float
    scattering_intensity: float
    mie_scattering_scale: float
    rayleigh_scattering_scale: float
    dust_storm_percent: float

    def carla_fields(self) -> dict[str, float]:
        """The fourteen values, named and ordered as in `carla.WeatherParameters`."""
        return {carla_field: getattr(self, field) for field, carla_field in _CARLA_FIELDS.items()}


@cache
def weather_presets() -> Mapping[str, WeatherPreset]:
    """The presets by name, in the order of the file; the study `pinto-2023` used the first eight.

    The weather of a simulation stores a preset as its position in this order.
    """
    return read_records(WeatherPreset, "carla_weather.toml")
