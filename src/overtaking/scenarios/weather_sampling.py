"""Draws weather and light."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from overtaking.core.float32_math import PI
from overtaking.core.native import log, maximum, minimum, power
from overtaking.core.random_numbers import Stream
from overtaking.core.units import rad_from_deg
from overtaking.knowledge.carla_catalogue import WeatherPreset, weather_presets
from overtaking.knowledge.toml_reader import constant, number
from overtaking.model.weather import NO_PRESET, Weather
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
"""A preset's low sun stands within this angle of the direction of travel [rad]."""

RAIN_CLOUDS_PERCENT = number("sampling.weather.rain_clouds_percent")
"""It does not rain out of a sky with less cloud; CARLA's presets with rain have 60 and more."""
_MIN_TAIL = np.float32(2.0**-24)  # Keeps the logarithm of a tail finite.

MIN_PUDDLES_PER_RAIN = number("sampling.weather.rain_puddles")
"""Rain leaves at least this part of its percentage as water on the road."""


def sample_weather(block: SampleBlock) -> Weather:
    """Draw the weather of each simulation, as the specification's section `[weather]` says."""
    stream = block.stream(Stream.WEATHER)
    return draw_weather(block.specification.weather, stream, block.proposal.transform)


def draw_weather(
    section: PresetWeather | IndependentWeather,
    stream: RandomStream,
    transform: NumberTransform = identity_transform,
) -> Weather:
    """Draw weather, shape (simulation,).

    Both modes draw directions of wind and sun: presets state neither. In a preset whose sun is low
    enough to dazzle, the sun stands ahead, because in the study ClearSunset has the sun at the
    driver's eye level.

    Args:
        section: Section `[weather]` of a specification.
        stream: The stream `Stream.WEATHER`, before its first draw.
        transform: Transforms the numbers of independent weather, see `ProposalSampler`.
    """
    wind_direction = scale_to_range(stream.uniform(), -PI, PI)
    sun = stream.uniform()
    if isinstance(section, PresetWeather):
        return _from_presets(section, stream, wind_direction, sun)
    return _independent(section, stream, wind_direction, sun, transform)


def _from_presets(
    section: PresetWeather, stream: RandomStream, wind_direction: F32, sun: F32
) -> Weather:
    preset = choose_weighted(
        stream.uniform(), weights_of(section.presets, tuple(weather_presets()))
    )
    altitude = _of_preset("sun_altitude_deg", preset) * np.float32(rad_from_deg(1.0))
    cloudiness = _of_preset("cloudiness_percent", preset)
    ahead = scale_to_range(sun, -SUN_AHEAD, SUN_AHEAD)
    azimuth = np.where(is_low_sun(altitude, cloudiness), ahead, scale_to_range(sun, -PI, PI))
    return Weather(
        preset=preset,
        cloudiness=cloudiness,
        rain=_of_preset("precipitation_percent", preset),
        puddles=_of_preset("precipitation_deposits_percent", preset),
        wind=_of_preset("wind_intensity_percent", preset),
        wind_direction=wind_direction,
        fog=_of_preset("fog_density_percent", preset),
        sun_altitude=altitude,
        sun_azimuth=azimuth,
        night=altitude < np.float32(0.0),
        low_sun=is_dazzling(altitude, azimuth, cloudiness),
    )


def _from_uniform(
    u: F32,
    limits: tuple[float, float],
    exponent: float | None,
    weibull: tuple[float, float] | None = None,
) -> F32:
    """A number between limits, nearer to the lower one the larger the exponent is, or Weibull."""
    if weibull is not None:
        scale, shape = weibull
        depth = -log(maximum(np.float32(1.0) - u, np.full_like(u, _MIN_TAIL)))
        excess = np.float32(scale) * power(depth, np.full_like(u, 1.0 / shape))
        return minimum(np.float32(limits[0]) + excess, np.full_like(u, limits[1]))
    if exponent is not None:
        u = power(u, np.full_like(u, exponent))
    return scale_to_range(u, *limits)


def _independent(
    section: IndependentWeather,
    stream: RandomStream,
    wind_direction: F32,
    sun: F32,
    transform: NumberTransform,
) -> Weather:
    rains = transform("rains", stream.uniform()) < np.float32(section.rain_probability)
    u = transform("rain", stream.uniform())
    rain = _from_uniform(u, section.rain_percent, section.rain_exponent, section.rain_weibull)
    rain = np.where(rains, rain, np.float32(0.0))
    foggy = transform("foggy", stream.uniform()) < np.float32(section.fog_probability)
    fog = _from_uniform(
        transform("fog", stream.uniform()), section.fog_percent, section.fog_exponent
    )
    fog = np.where(foggy, fog, np.float32(0.0))
    wet = transform("puddles", stream.uniform())
    puddles = _from_uniform(
        wet, section.puddles_percent, section.puddles_exponent, section.puddles_weibull
    )
    clouds = np.where(rain > 0, np.float32(RAIN_CLOUDS_PERCENT), np.float32(0.0))
    sky = scale_to_range(transform("clouds", stream.uniform()), *section.cloudiness_percent)
    cloudiness = maximum(sky, clouds)
    u = transform("wind", stream.uniform())
    wind = _from_uniform(u, section.wind_percent, section.wind_exponent, section.wind_weibull)
    low_sun, high_sun = (rad_from_deg(angle) for angle in section.sun_altitude_deg)
    altitude = scale_to_range(transform("sun", stream.uniform()), low_sun, high_sun)
    azimuth = scale_to_range(transform("sun_direction", sun), -PI, PI)
    return Weather(
        preset=np.full(sun.shape, NO_PRESET),
        cloudiness=cloudiness,
        rain=rain,
        puddles=maximum(puddles, np.float32(MIN_PUDDLES_PER_RAIN) * rain),
        wind=wind,
        wind_direction=wind_direction,
        fog=fog,
        sun_altitude=altitude,
        sun_azimuth=azimuth,
        night=altitude < np.float32(0.0),
        low_sun=is_dazzling(altitude, azimuth, cloudiness),
    )


@cache
def _preset_table(field: str) -> F32:
    """A field of every preset, shape (preset,)."""
    presets: tuple[WeatherPreset, ...] = tuple(weather_presets().values())
    return np.array([getattr(preset, field) for preset in presets], np.float32)


def _of_preset(field: str, preset: U8) -> F32:
    return _preset_table(field)[preset]


def is_low_sun(altitude: F32, cloudiness: F32) -> Mask:
    """Whether the sun is low and the sky clear enough to dazzle a driver towards it."""
    low, high = (
        constant("weather.glare.min_sun_altitude"),
        constant("weather.glare.max_sun_altitude"),
    )
    is_clear = cloudiness < constant("weather.glare.max_cloud_percent")
    return (altitude >= low) & (altitude <= high) & is_clear


def is_dazzling(altitude: F32, azimuth: F32, cloudiness: F32) -> Mask:
    """The study's horizon line HL: the low sun stands ahead."""
    ahead = np.abs(azimuth) < constant("weather.glare.half_width")
    return is_low_sun(altitude, cloudiness) & ahead
