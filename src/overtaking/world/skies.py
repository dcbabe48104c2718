"""Removes a factor from weather: rain with its effects, wind, fog, night, or a low sun."""

from collections.abc import Callable, Iterable

import numpy as np

from overtaking.core.errors import ConfigError
from overtaking.model.weather import NO_PRESET, Weather
from overtaking.world.constants import known

_NOON = np.float32(np.pi / 4)
"""A sun that neither dazzles nor leaves twilight [rad]."""


def dry(weather: Weather) -> Weather:
    """Without rain, and without the film, spray, puddles and clouds that it brings."""
    zero = np.zeros_like(weather.rain)
    clouds = np.where(weather.rain > 0, zero, weather.cloudiness)
    return _seen(weather.replace(rain=zero, puddles=zero, cloudiness=clouds))


def still(weather: Weather) -> Weather:
    """Without wind and gusts."""
    return _seen(weather.replace(wind=np.zeros_like(weather.wind)))


def clear(weather: Weather) -> Weather:
    """Without fog."""
    return _seen(weather.replace(fog=np.zeros_like(weather.fog)))


def bright(weather: Weather) -> Weather:
    """By day: the sun stands high where it was night."""
    altitude = np.where(weather.night, _NOON, weather.sun_altitude)
    return _seen(weather.replace(night=np.zeros_like(weather.night), sun_altitude=altitude))


def undazzled(weather: Weather) -> Weather:
    """Without a low sun: by day it stands high."""
    altitude = np.where(weather.night, weather.sun_altitude, _NOON)
    return _seen(weather.replace(sun_altitude=altitude))


WITHOUT: dict[str, Callable[[Weather], Weather]] = {
    "wind": still,
    "rain": dry,
    "fog": clear,
    "night": bright,
    "glare": undazzled,
}
"""What can be taken away, by name."""


def without(weather: Weather, names: Iterable[str]) -> Weather:
    """Weather with several things taken away, in the order of `WITHOUT`.

    Args:
        weather: Weather of each simulation, shape (simulation,).
        names: Names in `WITHOUT`.

    Raises:
        ConfigError: One of them is no such name.
    """
    chosen = set(names)
    for name in sorted(chosen - set(WITHOUT)):
        raise ConfigError.not_among("without", "weather", WITHOUT, name)
    for name, take in WITHOUT.items():
        weather = take(weather) if name in chosen else weather
    return weather


def _seen(weather: Weather) -> Weather:
    """The same with what follows from it: no preset, and whether the low sun dazzles."""
    low, high = known("weather.glare.lowest_sun"), known("weather.glare.highest_sun")
    is_low = (weather.sun_altitude >= low) & (weather.sun_altitude <= high)
    is_ahead = np.abs(weather.sun_azimuth) < known("weather.glare.half_width")
    is_clear = weather.cloudiness < known("weather.glare.most_cloud_percent")
    free = np.full_like(weather.preset, NO_PRESET)
    return weather.replace(preset=free, horizon_line=is_low & is_ahead & is_clear)
