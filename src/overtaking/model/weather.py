"""Weather, and weather without one of its factors."""

import math
from collections.abc import Callable, Iterable, Mapping
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
    sight: Annotated[
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
    horizon_line: Annotated[Mask, FieldSpec("Whether the sun stands low ahead")]

    def axis_lengths(self) -> Mapping[str, int]:
        """How many presets there are."""
        return {"preset": len(weather_presets())}


_NOON = np.float32(np.pi / 4)
"""A sun that neither dazzles nor leaves twilight [rad]."""


def dry(weather: Weather) -> Weather:
    """Without rain, and without the film, spray, puddles and clouds that it brings."""
    zero = np.zeros_like(weather.rain)
    clouds = np.where(weather.rain > 0, zero, weather.cloudiness)
    return _with_consequences(weather.replace(rain=zero, puddles=zero, cloudiness=clouds))


def still(weather: Weather) -> Weather:
    """Without wind and gusts."""
    return _with_consequences(weather.replace(wind=np.zeros_like(weather.wind)))


def clear(weather: Weather) -> Weather:
    """Without fog."""
    return _with_consequences(weather.replace(fog=np.zeros_like(weather.fog)))


def bright(weather: Weather) -> Weather:
    """By day: the sun stands high where it was night."""
    altitude = np.where(weather.night, _NOON, weather.sun_altitude)
    return _with_consequences(
        weather.replace(night=np.zeros_like(weather.night), sun_altitude=altitude)
    )


def without_glare(weather: Weather) -> Weather:
    """Without a low sun: by day it stands high."""
    altitude = np.where(weather.night, weather.sun_altitude, _NOON)
    return _with_consequences(weather.replace(sun_altitude=altitude))


REMOVABLE_FACTORS: dict[str, Callable[[Weather], Weather]] = {
    "wind": still,
    "rain": dry,
    "fog": clear,
    "night": bright,
    "glare": without_glare,
}
"""Functions that remove a factor from weather, by its name."""


def without(weather: Weather, names: Iterable[str]) -> Weather:
    """Weather with several things taken away, in the order of `REMOVABLE_FACTORS`.

    Args:
        weather: Weather of each simulation, shape (simulation,).
        names: Names in `REMOVABLE_FACTORS`.

    Raises:
        ConfigError: One of them is no such name.
    """
    factors = set(names)
    for name in sorted(factors - set(REMOVABLE_FACTORS)):
        raise ConfigError.unknown_choice("without", "weather", REMOVABLE_FACTORS, name)
    for name, take in REMOVABLE_FACTORS.items():
        weather = take(weather) if name in factors else weather
    return weather


def _with_consequences(weather: Weather) -> Weather:
    """The same with what follows from it: no preset, and whether the low sun dazzles."""
    low, high = (
        constant("weather.glare.min_sun_altitude"),
        constant("weather.glare.max_sun_altitude"),
    )
    is_low = (weather.sun_altitude >= low) & (weather.sun_altitude <= high)
    is_ahead = np.abs(weather.sun_azimuth) < constant("weather.glare.half_width")
    is_clear = weather.cloudiness < constant("weather.glare.max_cloud_percent")
    free = np.full_like(weather.preset, NO_PRESET)
    return weather.replace(preset=free, horizon_line=is_low & is_ahead & is_clear)
