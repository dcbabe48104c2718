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
    choose_weighted,
    scale_to_range,
    untransformed,
    weights_of,
)
from overtaking.scenarios.specification import IndependentWeather, PresetWeather

if TYPE_CHECKING:
    from overtaking.core.arrays import F32, U8, U64, Mask


SUN_AHEAD = number("sampling.toml", "weather.sun_ahead")
"""A preset's low sun stands within this angle of the direction of travel [rad]."""

RAIN_CLOUDS_PERCENT = number("sampling.toml", "weather.rain_clouds_percent")
"""It does not rain out of a sky with less cloud; CARLA's presets with rain have 60 and more."""
_MIN_TAIL = np.float32(2.0**-24)  # Keeps the logarithm of a tail finite.

MIN_PUDDLES_PER_RAIN = number("sampling.toml", "weather.rain_puddles")
"""Rain leaves at least this part of its percentage as water on the road."""


def sample_weather(
    spec: PresetWeather | IndependentWeather,
    seed: int,
    index: U64,
    bend: NumberTransform = untransformed,
) -> Weather:
    """Weather of each simulation, shape (simulation,).

    A wind direction is drawn in either mode, and a direction of the sun: the presets leave both
    open, and the road's bearing means nothing. In a preset whose sun is low enough to dazzle it
    stands ahead, as the study wants ClearSunset to have the sun at the driver's eye level.

    Args:
        spec: What the specification says about weather.
        seed: Seed of the data set.
        index: Simulation numbers, shape (simulation,).
        bend: Draws what is independent from where more happens (see `proposal`).
    """
    noise = RandomStream(seed, index, Stream.WEATHER)
    wind_direction = scale_to_range(noise.uniform(), -PI, PI)
    sun = noise.uniform()
    if isinstance(spec, PresetWeather):
        return _from_presets(spec, noise, wind_direction, sun)
    return _independent(spec, noise, wind_direction, sun, bend)


def _from_presets(
    spec: PresetWeather, noise: RandomStream, wind_direction: F32, sun: F32
) -> Weather:
    preset = choose_weighted(noise.uniform(), weights_of(spec.presets, tuple(weather_presets())))
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
        horizon_line=is_dazzling(altitude, azimuth, cloudiness),
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
        beyond = np.float32(scale) * power(depth, np.full_like(u, 1.0 / shape))
        return minimum(np.float32(limits[0]) + beyond, np.full_like(u, limits[1]))
    if exponent is not None:
        u = power(u, np.full_like(u, exponent))
    return scale_to_range(u, *limits)


def _independent(
    spec: IndependentWeather,
    noise: RandomStream,
    wind_direction: F32,
    sun: F32,
    bend: NumberTransform,
) -> Weather:
    rains = bend("rains", noise.uniform()) < np.float32(spec.rain_probability)
    u = bend("rain", noise.uniform())
    rain = _from_uniform(u, spec.rain_percent, spec.rain_exponent, spec.rain_weibull)
    rain = np.where(rains, rain, np.float32(0.0))
    foggy = bend("foggy", noise.uniform()) < np.float32(spec.fog_probability)
    fog = _from_uniform(bend("fog", noise.uniform()), spec.fog_percent, spec.fog_exponent)
    fog = np.where(foggy, fog, np.float32(0.0))
    wet = bend("puddles", noise.uniform())
    puddles = _from_uniform(wet, spec.puddles_percent, spec.puddles_exponent, spec.puddles_weibull)
    clouds = np.where(rain > 0, np.float32(RAIN_CLOUDS_PERCENT), np.float32(0.0))
    sky = scale_to_range(bend("clouds", noise.uniform()), *spec.cloudiness_percent)
    cloudiness = maximum(sky, clouds)
    u = bend("wind", noise.uniform())
    wind = _from_uniform(u, spec.wind_percent, spec.wind_exponent, spec.wind_weibull)
    low_sun, high_sun = (rad_from_deg(angle) for angle in spec.sun_altitude_deg)
    altitude = scale_to_range(bend("sun", noise.uniform()), low_sun, high_sun)
    azimuth = scale_to_range(bend("sun_direction", sun), -PI, PI)
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
        horizon_line=is_dazzling(altitude, azimuth, cloudiness),
    )


@cache
def _preset_table(field: str) -> F32:
    """A field of every preset, shape (preset,)."""
    found: tuple[WeatherPreset, ...] = tuple(weather_presets().values())
    return np.array([getattr(preset, field) for preset in found], np.float32)


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
