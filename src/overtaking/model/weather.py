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
from overtaking.model.batch import Batch, documented, meant, within

NO_PRESET = np.uint8(255)
"""Preset of a weather that is none of the presets."""


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class LateralPushes(Batch):
    """How weather acts where it does not act by physics: as in the study, by pushes and less sight.

    The road is dry, and air, rain and wind do nothing else.
    """

    accel: Annotated[float, within(0.0, 50.0, "m/s^2", "Lateral acceleration of a push")]
    duration: Annotated[float, within(0.05, 10.0, "s", "How long a push lasts")]
    interval: Annotated[
        float, within(0.05, 1000.0, "s", "From one push to the next at 100 % of rain and wind")
    ]
    sight: Annotated[
        float, within(1.0, 1000.0, "m", "Field of vision by night, under clouds, towards the sun")
    ]


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Weather(Batch):
    """Weather of each simulation; every array has shape (simulation,)."""

    preset: Annotated[
        U8,
        within(
            0,
            "preset",
            "",
            "Index of the weather preset, or `NO_PRESET` if each quantity was drawn by itself",
            also=int(NO_PRESET),
        ),
    ]
    cloudiness: Annotated[F32, within(0.0, 100.0, "%", "CARLA's cloudiness")]
    rain: Annotated[F32, within(0.0, 100.0, "%", "CARLA's precipitation")]
    puddles: Annotated[F32, within(0.0, 100.0, "%", "CARLA's precipitation deposits")]
    wind: Annotated[F32, within(0.0, 100.0, "%", "CARLA's wind intensity")]
    wind_direction: Annotated[
        F32,
        within(
            -math.tau,
            math.tau,
            "rad",
            "Where the wind blows to, anticlockwise from the direction of travel",
        ),
    ]
    fog: Annotated[F32, within(0.0, 100.0, "%", "CARLA's fog density")]
    sun_altitude: Annotated[
        F32, within(-1.5708, 1.5708, "rad", "Height of the sun above the horizon")
    ]
    sun_azimuth: Annotated[
        F32, within(-math.tau, math.tau, "rad", "Anticlockwise from the direction of travel")
    ]
    night: Annotated[Mask, meant("Whether it is night")]
    horizon_line: Annotated[Mask, meant("Whether the sun stands low ahead")]

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


def undazzled(weather: Weather) -> Weather:
    """Without a low sun: by day it stands high."""
    altitude = np.where(weather.night, weather.sun_altitude, _NOON)
    return _with_consequences(weather.replace(sun_altitude=altitude))


REMOVABLE_FACTORS: dict[str, Callable[[Weather], Weather]] = {
    "wind": still,
    "rain": dry,
    "fog": clear,
    "night": bright,
    "glare": undazzled,
}
"""What can be taken away, by name."""


def without(weather: Weather, names: Iterable[str]) -> Weather:
    """Weather with several things taken away, in the order of `REMOVABLE_FACTORS`.

    Args:
        weather: Weather of each simulation, shape (simulation,).
        names: Names in `REMOVABLE_FACTORS`.

    Raises:
        ConfigError: One of them is no such name.
    """
    chosen = set(names)
    for name in sorted(chosen - set(REMOVABLE_FACTORS)):
        raise ConfigError.unknown_choice("without", "weather", REMOVABLE_FACTORS, name)
    for name, take in REMOVABLE_FACTORS.items():
        weather = take(weather) if name in chosen else weather
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
