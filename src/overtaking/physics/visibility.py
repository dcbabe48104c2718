"""How far one sees: extinction, contrast, lamps, glare."""

import numpy as np

from overtaking.core.elementary import F32, Mask, exp, log, maximum, minimum, power
from overtaking.knowledge import Quantity, quantities


def _number(name: str) -> np.float32:
    entry = quantities("weather.toml")[name]
    if not isinstance(entry, Quantity):
        raise TypeError(name)
    return np.float32(entry.number)


def meteorological_range(fog: F32) -> F32:
    """Meteorological optical range of CARLA's fog density [m]."""
    clear, thick = _number("fog.clear_range"), _number("fog.thick_range")
    return clear * exp(np.asarray(fog, np.float32) * np.float32(0.01) * log(thick / clear))


def fog_extinction(fog: F32) -> F32:
    """Extinction coefficient of fog [1/m] (Koschmieder)."""
    return _number("fog.transmission_depth") / meteorological_range(fog)


def rain_extinction(rate: F32) -> F32:
    """Extinction coefficient of falling rain at rest [1/m] (Marshall and Palmer)."""
    scaled = power(np.asarray(rate, np.float32), _number("rain_sight.exponent"))
    return np.where(rate > 0, _number("rain_sight.coefficient") * scaled, np.float32(0.0))


def glare_factor(sun_altitude: F32, angle: F32, cloudiness: F32) -> F32:
    """Share of contrast left when looking within `angle` of a low sun, 1 without glare.

    Args:
        sun_altitude: [rad].
        angle: Horizontal angle between line of sight and sun, 0 to pi [rad].
        cloudiness: [%].

    Source:
        Veiling luminance of Stiles and Holladay.
    """
    degrees = np.float32(57.295_78)
    theta = np.sqrt(sun_altitude * sun_altitude + angle * angle) * degrees
    theta = maximum(theta, _number("glare.smallest_angle_deg"))
    veil = _number("glare.coefficient") * _number("glare.sun_illuminance") / (theta * theta)
    luminance = _number("glare.road_luminance")
    low = (sun_altitude >= _number("glare.lowest_sun")) & (
        sun_altitude <= _number("glare.highest_sun")
    )
    dazzled = (
        low
        & (angle < _number("glare.half_width"))
        & (cloudiness < _number("glare.most_cloud_percent"))
    )
    return np.where(dazzled, luminance / (luminance + veil), np.float32(1.0))


def contrast_threshold(night: Mask, dusk: Mask, rate: F32) -> F32:
    """Smallest contrast that is seen through a wet windscreen [1]."""
    dark = np.where(dusk, _number("contrast.threshold_dusk"), _number("contrast.threshold_day"))
    threshold = np.where(night, _number("contrast.threshold_night"), dark)
    return threshold * (np.float32(1.0) + rate / _number("rain_sight.screen_rate_mmph"))


def lamp_threshold(night: Mask, dusk: Mask) -> F32:
    """Smallest illuminance at the eye at which a lamp is seen [lx] (Allard)."""
    dark = np.where(dusk, _number("lamps.threshold_dusk"), _number("lamps.threshold_day"))
    return np.where(night, _number("lamps.threshold_night"), dark)


def lamp_range(extinction: F32, intensity: F32, threshold: F32) -> F32:
    """Distance at which a lamp of `intensity` [cd] falls to `threshold` [lx] [m] (Allard).

    Solves I exp(-beta r) / r^2 = E for r by Newton's method on its logarithm.
    """
    target = log(intensity / threshold)
    clear = np.sqrt(intensity / threshold)
    r = minimum(clear, np.float32(4.0) / maximum(extinction, np.float32(1e-6)))
    for _ in range(8):
        excess = np.float32(2.0) * log(r) + extinction * r - target
        r = r - r * excess / (np.float32(2.0) + extinction * r)
        r = maximum(r, np.float32(0.5))
    return r


def contrast_range(extinction: F32, contrast: F32, threshold: F32) -> F32:
    """Distance at which `contrast` falls to `threshold` [m] (Koschmieder)."""
    return maximum(log(contrast / threshold), np.float32(0.0)) / maximum(
        extinction, np.float32(1e-7)
    )
