"""Draws weather and light: rain, water on the road, wind, fog, clouds and the place of the sun.

`sample_weather` takes section `[weather]` of a specification and returns a `Weather`, arrays of
shape (simulation,). Its percentages have the meaning of the simulator CARLA: 100 is the heaviest
rain, the strongest wind, the densest fog. A *preset* is a named weather of CARLA, such as
`ClearNoon`. In *independent* weather each quantity is drawn by itself. Directions are anticlockwise
from the direction of travel [rad]. The *study* is Pinto, Dutra and Fonseca (2023).

*Importance sampling* draws rare scenarios more often: it may replace random numbers of independent
weather, by name (`random_draws`). Numbers are computed in float32 with the functions of
`core.native`, which give the same bits on every machine. `number` reads a value of the folder
`knowledge/data` in SI units, so degrees in radians; percentages stay percentages.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from overtaking.core.float32_math import PI
from overtaking.core.native import log, maximum, minimum, power
from overtaking.core.random_numbers import Stream
from overtaking.core.units import rad_from_deg
from overtaking.knowledge.carla_catalogue import WeatherPreset, weather_presets
from overtaking.knowledge.toml_reader import number
from overtaking.model.weather import NO_PRESET, Weather, can_sun_dazzle, is_dazzling
from overtaking.scenarios.random_draws import (
    NumberTransform,
    RandomStream,
    SampleBlock,
    choose_weighted,
    identity_transform,
    scale_to_range,
    weights_of,
)
from overtaking.scenarios.specification import IndependentWeather, PresetWeather

if TYPE_CHECKING:
    from overtaking.core.arrays import F32, U8, Mask


SUN_AHEAD = number("sampling.weather.sun_ahead")
"""If the sun of a preset is low enough to dazzle, its direction is within this angle of the
direction of travel [rad], 10 degrees. The size is a choice, below the 25 degrees up to which the
sun dazzles. So such a preset always dazzles: in the study the sun of ClearSunset is at the driver's
eye level."""

RAIN_CLOUDS_PERCENT = number("sampling.weather.rain_clouds_percent")
"""Smallest cloudiness with rain [%], 60: the smallest among the study's presets with rain. Under so
many clouds the sun does not dazzle (`can_sun_dazzle`), so independent weather has no glare in rain.
"""

MIN_PUDDLES_PER_RAIN = number("sampling.weather.rain_puddles")
"""Smallest percentage of water on the road, over the percentage of rain [1], 0.5, a choice."""

_MIN_TAIL = np.float32(2.0**-24)
"""Smallest 1 - u of which a logarithm is taken, to keep it finite. Uniform numbers u stay 2^-24 or
more below 1, but importance sampling may round them up to 1."""


def sample_weather(block: SampleBlock) -> Weather:
    """Draw the weather of each simulation of a block.

    Args:
        block: The simulations, with their specification and their random numbers.
    """
    stream = block.stream(Stream.WEATHER)
    return draw_weather(block.specification.weather, stream, block.proposal.transform)


def draw_weather(
    section: PresetWeather | IndependentWeather,
    stream: RandomStream,
    transform: NumberTransform = identity_transform,
) -> Weather:
    """Draw weather, shape (simulation,).

    Presets state no directions of wind and sun, so both kinds of weather draw them here. The field
    `low_sun` is true where a low sun ahead dazzles the drivers.

    Args:
        section: Section `[weather]` of a specification.
        stream: The stream `Stream.WEATHER`, before its first draw.
        transform: Takes the name of a quantity of independent weather and its random numbers, and
            returns the numbers to use. By default they are the same. Importance sampling replaces
            quantities in `specification.PROPOSAL_UNIFORMS`, never the direction of the wind.
    """
    # All numbers come from one stream: another order would change the weather of every seed.
    wind_direction = scale_to_range(stream.uniform(), -PI, PI)
    sun_u = stream.uniform()
    if isinstance(section, PresetWeather):
        return _preset_weather(section, stream, wind_direction, sun_u)
    return _independent_weather(section, stream, wind_direction, sun_u, transform)


def _preset_weather(
    section: PresetWeather, stream: RandomStream, wind_direction: F32, sun_u: F32
) -> Weather:
    """Draw a preset in each simulation.

    Args:
        section: Weights of the presets.
        stream: The stream of the weather.
        wind_direction: Direction to which the wind blows, shape (simulation,) [rad].
        sun_u: Uniform numbers in (0, 1) that decide the direction of the sun, shape (simulation,).
    """
    preset = choose_weighted(
        stream.uniform(), weights_of(section.presets, tuple(weather_presets()))
    )
    altitude = _preset_value("sun_altitude_deg", preset) * np.float32(rad_from_deg(1.0))
    cloudiness = _preset_value("cloudiness_percent", preset)
    azimuth_ahead = scale_to_range(sun_u, -SUN_AHEAD, SUN_AHEAD)
    any_azimuth = scale_to_range(sun_u, -PI, PI)
    azimuth = np.where(can_sun_dazzle(altitude, cloudiness), azimuth_ahead, any_azimuth)
    return Weather(
        preset=preset,
        cloudiness=cloudiness,
        rain=_preset_value("precipitation_percent", preset),
        puddles=_preset_value("precipitation_deposits_percent", preset),
        wind=_preset_value("wind_intensity_percent", preset),
        wind_direction=wind_direction,
        fog=_preset_value("fog_density_percent", preset),
        sun_altitude=altitude,
        sun_azimuth=azimuth,
        night=_is_night(altitude),
        low_sun=is_dazzling(altitude, azimuth, cloudiness),
    )


def _quantity_from_uniform(
    u: F32,
    limits: tuple[float, float],
    exponent: float | None,
    weibull: tuple[float, float] | None = None,
) -> F32:
    """Values of a quantity, shape (simulation,) [%], from one of three distributions.

    Args:
        u: Uniform numbers in (0, 1), shape (simulation,). A larger number gives a larger value.
        limits: Smallest and largest value, low and high [%].
        exponent: Exponent e of low + (high - low) u^e; None for a uniform distribution.
        weibull: Scale [%] and shape of a Weibull distribution above low, limited to high; None for
            one of the other two.
    """
    if weibull is not None:
        scale, shape = weibull
        # The inverse of the Weibull distribution: scale (-ln(1 - u))^(1 / shape).
        minus_log_tail = -log(maximum(np.float32(1.0) - u, _MIN_TAIL))
        excess = np.float32(scale) * power(minus_log_tail, np.float32(1.0 / shape))
        return minimum(np.float32(limits[0]) + excess, np.float32(limits[1]))
    if exponent is not None:
        u = power(u, np.float32(exponent))
    return scale_to_range(u, *limits)


def _independent_weather(
    section: IndependentWeather,
    stream: RandomStream,
    wind_direction: F32,
    sun_u: F32,
    transform: NumberTransform,
) -> Weather:
    """Draw each quantity of the weather by itself.

    Args:
        section: Distributions of the quantities.
        stream: The stream of the weather.
        wind_direction: Direction to which the wind blows, shape (simulation,) [rad].
        sun_u: Uniform numbers in (0, 1) that decide the direction of the sun, shape (simulation,).
        transform: Returns the numbers to use in place of the random numbers with a name.
    """
    # The order of the draws is fixed, see `draw_weather`.
    is_rainy = transform("rains", stream.uniform()) < np.float32(section.rain_probability)
    u = transform("rain", stream.uniform())
    rain = _quantity_from_uniform(
        u, section.rain_percent, section.rain_exponent, section.rain_weibull
    )
    rain = np.where(is_rainy, rain, np.float32(0.0))
    is_foggy = transform("foggy", stream.uniform()) < np.float32(section.fog_probability)
    u = transform("fog", stream.uniform())
    fog = _quantity_from_uniform(u, section.fog_percent, section.fog_exponent)
    fog = np.where(is_foggy, fog, np.float32(0.0))
    u = transform("puddles", stream.uniform())
    puddles = _quantity_from_uniform(
        u, section.puddles_percent, section.puddles_exponent, section.puddles_weibull
    )
    # Rain needs clouds and leaves water on the road.
    puddles = maximum(puddles, np.float32(MIN_PUDDLES_PER_RAIN) * rain)
    min_cloudiness = np.where(rain > 0, np.float32(RAIN_CLOUDS_PERCENT), np.float32(0.0))
    u = transform("clouds", stream.uniform())
    cloudiness = maximum(scale_to_range(u, *section.cloudiness_percent), min_cloudiness)
    u = transform("wind", stream.uniform())
    wind = _quantity_from_uniform(
        u, section.wind_percent, section.wind_exponent, section.wind_weibull
    )
    min_altitude, max_altitude = (rad_from_deg(angle) for angle in section.sun_altitude_deg)
    altitude = scale_to_range(transform("sun", stream.uniform()), min_altitude, max_altitude)
    azimuth = scale_to_range(transform("sun_direction", sun_u), -PI, PI)
    return Weather(
        preset=np.full(sun_u.shape, NO_PRESET),
        cloudiness=cloudiness,
        rain=rain,
        puddles=puddles,
        wind=wind,
        wind_direction=wind_direction,
        fog=fog,
        sun_altitude=altitude,
        sun_azimuth=azimuth,
        night=_is_night(altitude),
        low_sun=is_dazzling(altitude, azimuth, cloudiness),
    )


def _is_night(altitude: F32) -> Mask:
    """Whether the sun is below the horizon, a choice: drawn weather has no dusk.

    It is dusk where `Weather.night` is false although the sun is below the horizon. A recording may
    state that.

    Args:
        altitude: Height of the sun above the horizon, any shape [rad].
    """
    return altitude < np.float32(0.0)


@cache
def _preset_values(field: str) -> F32:
    """A field of `WeatherPreset` in every preset, shape (preset,)."""
    presets: tuple[WeatherPreset, ...] = tuple(weather_presets().values())
    return np.array([getattr(preset, field) for preset in presets], np.float32)


def _preset_value(field: str, preset: U8) -> F32:
    """A field of the preset of each simulation, in the unit of its name, shape (simulation,)."""
    return _preset_values(field)[preset]
