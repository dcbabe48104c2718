"""Weather, and weather without one of its factors."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from overtaking.core.arrays import F32, U8, Mask
from overtaking.core.errors import ConfigError
from overtaking.knowledge.carla_catalogue import weather_presets
from overtaking.knowledge.toml_reader import constant
from overtaking.model.batch import AxisEnd, Batch, FieldSpec, with_field_docs

NO_PRESET = np.uint8(255)
"""Value of `Weather.preset` for any other weather."""


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class LateralPushes(Batch):
    """Effects of weather as in the study: lateral pushes and less sight instead of physics.

    The road is dry, and air, rain and wind have no other effect.
    """

    accel: Annotated[float, FieldSpec("Lateral acceleration of a push", "m/s^2", 0.0, 50.0)]
    duration: Annotated[float, FieldSpec("How long a push lasts", "s", 0.05, 10.0)]
    interval: Annotated[
        float, FieldSpec("From one push to the next at 100 % of rain and wind", "s", 0.05, 1000.0)
    ]
    sight_distance: Annotated[
        float,
        FieldSpec("Field of vision by night, under clouds, towards the sun", "m", 1.0, 1000.0),
    ]


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class Weather(Batch):
    """Weather of each simulation; every array has shape (simulation,)."""

    preset: Annotated[
        U8,
        FieldSpec(
            "Index of the weather preset, or `NO_PRESET` if each quantity was drawn by itself",
            "1",
            0,
            AxisEnd("preset"),
            missing=int(NO_PRESET),
        ),
    ]
    cloudiness: Annotated[F32, FieldSpec("CARLA's cloudiness", "%", 0.0, 100.0)]
    rain: Annotated[F32, FieldSpec("CARLA's precipitation", "%", 0.0, 100.0)]
    puddles: Annotated[F32, FieldSpec("CARLA's precipitation deposits", "%", 0.0, 100.0)]
    wind: Annotated[F32, FieldSpec("CARLA's wind intensity", "%", 0.0, 100.0)]
    wind_direction: Annotated[
        F32,
        FieldSpec(
            "Where the wind blows to, anticlockwise from the direction of travel",
            "rad",
            -math.tau,
            math.tau,
        ),
    ]
    fog: Annotated[F32, FieldSpec("CARLA's fog density", "%", 0.0, 100.0)]
    sun_altitude: Annotated[
        F32, FieldSpec("Height of the sun above the horizon", "rad", -1.5708, 1.5708)
    ]
    sun_azimuth: Annotated[
        F32, FieldSpec("Anticlockwise from the direction of travel", "rad", -math.tau, math.tau)
    ]
    night: Annotated[Mask, FieldSpec("Whether it is night")]
    low_sun: Annotated[Mask, FieldSpec("Whether the sun stands low ahead")]

    def axis_lengths(self) -> Mapping[str, int]:
        """Number of weather presets."""
        return {"preset": len(weather_presets())}

    def without(self, *factors: str) -> "Weather":
        """The same weather without some factors; the preset is then `NO_PRESET`.

        Args:
            factors: Names in `REMOVABLE_FACTORS`, in any order. Without rain the road is dry and
                has no puddles, and the clouds of the rain are gone.

        Raises:
            ConfigError: A name is not in `REMOVABLE_FACTORS`.
        """
        for name in sorted(set(factors) - set(REMOVABLE_FACTORS)):
            raise ConfigError.unknown_choice(
                what="without", where="weather", choices=REMOVABLE_FACTORS, got=name
            )
        weather = self
        # In a fixed order, because night and glare both move the sun.
        for name, remove in _REMOVERS.items():
            weather = remove(weather) if name in factors else weather
        return weather


_NOON = np.float32(np.pi / 4)
"""A sun that neither dazzles nor leaves twilight [rad]."""


def _without_wind(weather: Weather) -> Weather:
    """Weather without wind and gusts."""
    return _with_consequences(weather.replace(wind=np.zeros_like(weather.wind)))


def _without_rain(weather: Weather) -> Weather:
    """Weather without rain, and without the puddles and clouds that came with it."""
    zero = np.zeros_like(weather.rain)
    clouds = np.where(weather.rain > 0, zero, weather.cloudiness)
    return _with_consequences(weather.replace(rain=zero, puddles=zero, cloudiness=clouds))


def _without_fog(weather: Weather) -> Weather:
    """Weather without fog."""
    return _with_consequences(weather.replace(fog=np.zeros_like(weather.fog)))


def _without_night(weather: Weather) -> Weather:
    """Weather by day: the sun stands high where it was night."""
    altitude = np.where(weather.night, _NOON, weather.sun_altitude)
    return _with_consequences(
        weather.replace(night=np.zeros_like(weather.night), sun_altitude=altitude)
    )


def _without_glare(weather: Weather) -> Weather:
    """Weather without a low sun: by day it stands high."""
    altitude = np.where(weather.night, weather.sun_altitude, _NOON)
    return _with_consequences(weather.replace(sun_altitude=altitude))


_REMOVERS: dict[str, Callable[[Weather], Weather]] = {
    "wind": _without_wind,
    "rain": _without_rain,
    "fog": _without_fog,
    "night": _without_night,
    "glare": _without_glare,
}

REMOVABLE_FACTORS = tuple(_REMOVERS)
"""Names of the factors that `Weather.without` removes."""


def _with_consequences(weather: Weather) -> Weather:
    """The same weather without a preset, and with the right `low_sun`."""
    low, high = (
        constant("weather.glare.min_sun_altitude"),
        constant("weather.glare.max_sun_altitude"),
    )
    is_low = (weather.sun_altitude >= low) & (weather.sun_altitude <= high)
    is_ahead = np.abs(weather.sun_azimuth) < constant("weather.glare.half_width")
    is_clear = weather.cloudiness < constant("weather.glare.max_cloud_percent")
    no_preset = np.full_like(weather.preset, NO_PRESET)
    return weather.replace(preset=no_preset, low_sun=is_low & is_ahead & is_clear)
