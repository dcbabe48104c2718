"""CARLA's vehicles, props and weather presets."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

from overtaking.knowledge.toml_reader import read_records


@dataclass(frozen=True, slots=True, kw_only=True)
class CarlaVehicle:
    """A vehicle of CARLA's catalogue.

    Attributes:
        blueprint: Its id, such as "vehicle.audi.a2".
        base_type: CARLA's name of its kind: car, truck, van, bus, motorcycle or bicycle.
        vehicle_class: Class of `vehicle_classes` that decides its physics.
        size: Length, width and height of its bounding box [m].
    """

    blueprint: str
    base_type: str
    vehicle_class: str
    size: tuple[float, float, float]


@cache
def carla_vehicles() -> Mapping[str, CarlaVehicle]:
    """The vehicles by id, in alphabetical order."""
    vehicles = read_records(CarlaVehicle, "carla_vehicles.toml").values()
    return MappingProxyType({vehicle.blueprint: vehicle for vehicle in vehicles})


@dataclass(frozen=True, slots=True, kw_only=True)
class PropBlueprint:
    """A prop of CARLA's catalogue, such as a traffic cone.

    Attributes:
        blueprint: Its id, such as "static.prop.trafficcone01".
        size: Length, width and height of its bounding box [m].
    """

    blueprint: str
    size: tuple[float, float, float]


@cache
def props() -> Mapping[str, PropBlueprint]:
    """The props by id, in alphabetical order."""
    props_by_key = read_records(PropBlueprint, "carla_props.toml").values()
    return MappingProxyType({prop.blueprint: prop for prop in props_by_key})


# Our field, whose name ends in its unit, to the field of CARLA.
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
    """The fields of a named weather; percentages are 0 to 100 without physical meaning.

    Attributes:
        in_pinto2023: Whether the study `pinto-2023` used it.
        cloudiness_percent: Cover of the sky.
        precipitation_percent: Rain.
        precipitation_deposits_percent: Puddles.
        wind_intensity_percent: Wind.
        sun_azimuth_deg: Direction of the sun; -1 keeps the sun where it is.
        sun_altitude_deg: Height of the sun; negative at night.
        fog_density_percent: Fog.
        fog_distance: Distance at which the fog begins [m].
        wetness_percent: Sheen of the road, for cameras only.
        fog_falloff: Thinning of the fog with height.
        scattering_intensity: Light that the fog scatters.
        mie_scattering_scale: Haze around lights.
        rayleigh_scattering_scale: Blue of the sky.
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
    """The presets by name, the eight of the study `pinto-2023` first."""
    return read_records(WeatherPreset, "carla_weather.toml")
