"""Sight distances: extinction, contrast, lamps, glare."""

from functools import cache

import numpy as np

from overtaking.core.arrays import F32, F32Like, Mask
from overtaking.core.float32_math import as_f32, exp, log, maximum, minimum, power, sincos
from overtaking.core.units import deg_from_rad
from overtaking.knowledge.toml_reader import constant
from overtaking.world.road_surface import PERCENT

MIN_EXTINCTION = np.float32(1e-7)
"""Keeps ranges finite in perfectly clear air [1/m]."""

_NEWTON_STEPS = 8
"""More than convergence to the last bit takes, for any lamp and any fog."""


def meteorological_range(fog: F32) -> F32:
    """Meteorological optical range of CARLA's fog density [m].

    Args:
        fog: 0 to 100 [%], any shape.
    """
    share = np.asarray(fog, np.float32) * PERCENT
    return constant("weather.fog.clear_range") * exp(share * _log_range_ratio())


@cache
def _log_range_ratio() -> F32:
    """Logarithm of the range in the thickest fog over that in clear air."""
    return log(constant("weather.fog.thick_range") / constant("weather.fog.clear_range"))


def fog_extinction(fog: F32) -> F32:
    """Extinction coefficient of CARLA's fog density [1/m]."""
    return extinction_of_range(meteorological_range(fog))


def extinction_of_range(optical_range: F32Like) -> F32:
    """Extinction coefficient of air with a meteorological optical range [1/m] (Koschmieder)."""
    return constant("weather.fog.transmission_depth") / as_f32(optical_range)


def rain_extinction(rain_rate: F32) -> F32:
    """Extinction coefficient of falling rain at rest [1/m] (Marshall and Palmer)."""
    scaled = power(np.asarray(rain_rate, np.float32), constant("weather.rain_sight.exponent"))
    return np.where(
        rain_rate > 0, constant("weather.rain_sight.coefficient") * scaled, np.float32(0.0)
    )


def glare_factor(sun_altitude: F32, angle: F32, cloudiness: F32) -> F32:
    """Share of contrast left when looking within `angle` of a low sun, 1 without glare.

    Args:
        sun_altitude: [rad].
        angle: Horizontal angle between line of sight and sun, 0 to pi [rad].
        cloudiness: [%].

    Source:
        Veiling luminance of Stiles and Holladay.
    """
    sun_altitude = np.asarray(sun_altitude, np.float32)
    theta = np.sqrt(sun_altitude * sun_altitude + angle * angle) * np.float32(deg_from_rad(1.0))
    theta = maximum(theta, constant("weather.glare.min_angle_deg"))
    veil = constant("weather.glare.coefficient") * sun_illuminance(sun_altitude) / (theta * theta)
    luminance = constant("weather.glare.road_luminance")
    low = (sun_altitude >= constant("weather.glare.min_sun_altitude")) & (
        sun_altitude <= constant("weather.glare.max_sun_altitude")
    )
    dazzled = (
        low
        & (angle < constant("weather.glare.half_width"))
        & (cloudiness < constant("weather.glare.max_cloud_percent"))
    )
    return np.where(dazzled, luminance / (luminance + veil), np.float32(1.0))


def sun_illuminance(altitude: F32) -> F32:
    """Illuminance of the sun in clear air on a plane that faces it [lx].

    Args:
        altitude: Of the sun; below the horizon as at it [rad].

    Source:
        Kasten and Young 1989 (relative optical air mass); IES RP-21 (extinction of clear air).
    """
    degrees = maximum(altitude, np.float32(0.0)) * np.float32(deg_from_rad(1.0))
    sine, _ = sincos(maximum(altitude, np.float32(0.0)))
    offset, exponent = (
        constant("weather.sunlight.mass_offset_deg"),
        constant("weather.sunlight.exponent"),
    )
    haze = constant("weather.sunlight.mass_factor") * power(degrees + offset, -exponent)
    air_mass = np.float32(1.0) / (sine + haze)
    outside = constant("weather.sunlight.outside")
    return outside * exp(-constant("weather.sunlight.extinction") * air_mass)


def contrast_threshold(night: Mask, dusk: Mask, rain_rate: F32) -> F32:
    """Smallest contrast that is seen through a wet windscreen [1]."""
    dark = np.where(
        dusk,
        constant("weather.contrast.threshold_dusk"),
        constant("weather.contrast.threshold_day"),
    )
    threshold = np.where(night, constant("weather.contrast.threshold_night"), dark)
    return threshold * (
        np.float32(1.0) + rain_rate / constant("weather.rain_sight.screen_rate_mmph")
    )


def lamp_threshold(night: Mask, dusk: Mask) -> F32:
    """Smallest illuminance at the eye at which a lamp is seen [lx] (Allard)."""
    dark = np.where(
        dusk, constant("weather.lamps.threshold_dusk"), constant("weather.lamps.threshold_day")
    )
    return np.where(night, constant("weather.lamps.threshold_night"), dark)


def lamp_range(extinction: F32, intensity: F32, threshold: F32) -> F32:
    """Distance at which a lamp of `intensity` [cd] falls to `threshold` [lx] [m] (Allard).

    Solves I exp(-beta r) / r^2 = E for r by Newton's method on its logarithm.
    """
    target = log(intensity / threshold)
    clear = np.sqrt(intensity / threshold)
    # No lamp is seen farther than in clear air, nor through more than a few optical depths.
    r = minimum(clear, np.float32(4.0) / maximum(extinction, np.float32(1e-6)))
    for _ in range(_NEWTON_STEPS):
        excess = np.float32(2.0) * log(r) + extinction * r - target
        r = r - r * excess / (np.float32(2.0) + extinction * r)
        r = maximum(r, np.float32(0.5))
    return r


def contrast_range(extinction: F32, contrast: F32, threshold: F32) -> F32:
    """Distance at which `contrast` falls to `threshold` [m] (Koschmieder)."""
    depth = maximum(log(contrast / threshold), np.float32(0.0))
    return depth / maximum(extinction, MIN_EXTINCTION)
