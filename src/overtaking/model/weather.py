"""Weather as an input of a simulation, and weather without some of its factors.

`scenarios` draws the weather, and readers of recordings fill it in. The functions of `world`
turn it into friction, sight distance and wind forces. `Weather.without` answers "what if"
questions: the same scene without rain, fog, wind, night or glare.

Percentages are the settings of the simulator CARLA, 0 to 100 without physical meaning; `world`
converts them, such as 100 % of rain to a rate in mm/h. `FieldSpec` declares description, unit,
smallest and largest value of a field; `missing` is a further value, which is null in tables.
`AxisEnd` limits an index to less than the number that `axis_lengths` states. `with_field_docs`
lists the fields in the docstring of the class.
"""

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
"""Value of `Weather.preset` for a weather that is not one of CARLA's named weathers."""


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class LateralPushes(Batch):
    """Effects of weather as in the study that this package reproduces: pushes and less sight.

    They replace physics: the road is dry, and fog, rain and wind have no other effect. In CARLA,
    where the study (`pinto-2023` in docs/reference/sources.md) was made, weather does not act on
    vehicles. Every vehicle is pushed to the leeward side, the more often the more rain and wind
    there is; `docs/explanation/pushes.md` has the formula. Weather reduces sight only under the
    three conditions of the field `sight_distance`, each of which suffices; they are the study's.
    """

    accel: Annotated[float, FieldSpec("Lateral acceleration of a push", "m/s^2", 0.0, 50.0)]
    # The shortest times are one decision of the drivers, 0.05 s. The other bounds are chosen: wider
    # than any sensible value, to catch wrong units.
    duration: Annotated[float, FieldSpec("Duration of a push", "s", 0.05, 10.0)]
    interval: Annotated[
        float,
        FieldSpec(
            "Time from one push to the next at 100 % of rain and of wind, longer with less",
            "s",
            0.05,
            1000.0,
        ),
    ]
    sight_distance: Annotated[
        float,
        FieldSpec(
            "Sight distance at night, above 60 % of clouds and towards a low sun", "m", 1.0, 1000.0
        ),
    ]


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class Weather(Batch):
    """Weather of each simulation; every array has shape (simulation,).

    The direction of travel is the ego's, along the road. Where weather is drawn, `night` is true
    for a negative altitude of the sun, and `low_sun` follows from the position of the sun and the
    clouds. Recordings may state these two flags themselves; the modules that read them then assume
    a position of the sun.
    """

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
    # Directions may count from -pi to pi, as drawn ones do, or from 0 to 2 pi.
    wind_direction: Annotated[
        F32,
        FieldSpec(
            "Direction towards which the wind blows, anticlockwise from the direction of travel",
            "rad",
            -math.tau,
            math.tau,
        ),
    ]
    fog: Annotated[F32, FieldSpec("CARLA's fog density", "%", 0.0, 100.0)]
    # Altitudes from -pi / 2 to pi / 2, rounded up so that float32 values of the ends are valid.
    sun_altitude: Annotated[
        F32,
        FieldSpec("Angle of the sun above the horizon, negative at night", "rad", -1.5708, 1.5708),
    ]
    sun_azimuth: Annotated[
        F32,
        FieldSpec(
            "Direction of the sun, anticlockwise from the direction of travel",
            "rad",
            -math.tau,
            math.tau,
        ),
    ]
    night: Annotated[Mask, FieldSpec("Whether it is night")]
    low_sun: Annotated[Mask, FieldSpec("Whether a low sun ahead dazzles the drivers")]

    def axis_lengths(self) -> Mapping[str, int]:
        """Number of weather presets, which limits the index `preset`."""
        return {"preset": len(weather_presets())}

    def without(self, *factors: str) -> "Weather":
        """The same weather without some factors.

        Args:
            factors: Names in `REMOVABLE_FACTORS`; their order has no effect. "rain" also removes
                all puddles, and the clouds of simulations with rain. "night" puts the sun high in
                simulations at night, "glare" in simulations by day.

        Returns:
            The weather with preset `NO_PRESET`; without any factor, the weather itself.

        Raises:
            ConfigError: A name is not in `REMOVABLE_FACTORS`.
        """
        if unknown := sorted(set(factors) - set(REMOVABLE_FACTORS)):
            raise ConfigError.unknown_choice(
                what="without", where="weather", choices=REMOVABLE_FACTORS, got=unknown[0]
            )
        weather = self
        for name in factors:
            weather = _REMOVERS[name](weather)
        return weather.replace(preset=np.full_like(weather.preset, NO_PRESET)) if factors else self


def can_sun_dazzle(altitude: F32, cloudiness: F32) -> Mask:
    """Whether the sun is low and the sky clear enough to dazzle a driver towards the sun.

    Limits are in `knowledge/data/weather.toml`, section [glare]: 0 to 18 degrees, as the roof of
    the vehicle hides a higher sun, and 60 % of clouds, as in the study (`pinto-2023`).

    Args:
        altitude: Height of the sun above the horizon, any shape [rad].
        cloudiness: Clouds, the same shape [%].
    """
    low, high = (
        constant("weather.glare.min_sun_altitude"),
        constant("weather.glare.max_sun_altitude"),
    )
    is_clear = cloudiness < constant("weather.glare.max_cloud_percent")
    return (altitude >= low) & (altitude <= high) & is_clear


def is_dazzling(altitude: F32, azimuth: F32, cloudiness: F32) -> Mask:
    """Whether a low sun stands ahead, within 25 degrees (a choice): the field `Weather.low_sun`.

    The study (`pinto-2023`) calls such a sun "horizon line".

    Args:
        altitude: Height of the sun above the horizon, any shape [rad].
        azimuth: Direction of the sun, anticlockwise from the direction of travel, the same shape
            [rad].
        cloudiness: Clouds, the same shape [%].
    """
    is_ahead = sun_angle_ahead(azimuth) < constant("weather.glare.half_width")
    return can_sun_dazzle(altitude, cloudiness) & is_ahead


def sun_angle_ahead(azimuth: F32) -> F32:
    """Horizontal angle between the direction of travel and the sun, 0 to pi [rad].

    Args:
        azimuth: Direction of the sun from the direction of travel, -2 pi to 2 pi, any shape [rad].
    """
    angle = np.abs(azimuth)
    return np.where(angle > np.float32(np.pi), np.float32(math.tau) - angle, angle)


_HIGH_SUN = np.float32(np.pi / 4)
"""Altitude of the sun without night or without glare [rad]: 45 degrees, as in CARLA's presets of
noon. Glare ends at 18 degrees."""


def _without_wind(weather: Weather) -> Weather:
    """Weather without wind."""
    return weather.replace(wind=np.zeros_like(weather.wind))


def _without_rain(weather: Weather) -> Weather:
    """Weather without rain, its clouds, and all puddles.

    Clouds stay where it did not rain. No quantity says which part of the clouds comes with rain.
    """
    zero = np.zeros_like(weather.rain)
    is_rainy = weather.rain > 0
    clouds = np.where(is_rainy, zero, weather.cloudiness)
    # Where it does not rain, the flag stays as it is. In a recording that states the flag, the
    # position of the sun is assumed, so the flag need not follow from the position.
    dazzles = ~weather.night & is_dazzling(weather.sun_altitude, weather.sun_azimuth, clouds)
    low_sun = np.where(is_rainy, dazzles, weather.low_sun)
    return weather.replace(rain=zero, puddles=zero, cloudiness=clouds, low_sun=low_sun)


def _without_fog(weather: Weather) -> Weather:
    """Weather without fog."""
    return weather.replace(fog=np.zeros_like(weather.fog))


def _without_night(weather: Weather) -> Weather:
    """Weather by day: the sun stands high, and does not dazzle, where it was night."""
    return weather.replace(
        night=np.zeros_like(weather.night),
        sun_altitude=np.where(weather.night, _HIGH_SUN, weather.sun_altitude),
        low_sun=weather.low_sun & ~weather.night,
    )


def _without_glare(weather: Weather) -> Weather:
    """Weather without glare: the sun stands high by day, also where it did not dazzle.

    Chosen: the sun is then the same in all simulations by day.
    """
    altitude = np.where(weather.night, weather.sun_altitude, _HIGH_SUN)
    return weather.replace(sun_altitude=altitude, low_sun=np.zeros_like(weather.low_sun))


_REMOVERS: dict[str, Callable[[Weather], Weather]] = {
    "wind": _without_wind,
    "rain": _without_rain,
    "fog": _without_fog,
    "night": _without_night,
    "glare": _without_glare,
}

REMOVABLE_FACTORS = tuple(_REMOVERS)
"""Names of the factors that `Weather.without` removes."""
