"""Extinction of air, contrast, lamps and glare: how far an object is visible.

The functions compute extinction coefficients, thresholds of perception, and ranges, the distances
up to which a driver sees an object. They take weather percentages of the driving simulator CARLA,
the position of the sun, and lamps. Ranges follow the laws of Koschmieder (objects by daylight) and
of Allard (lamps). The *extinction coefficient* is the share of light that air takes from a beam per
metre; times the distance it is the *optical depth*. The *meteorological optical range* is the
distance at which a contrast falls to 5 %.

`constant` reads the numbers, with their sources, from `knowledge/data/weather.toml`. It returns SI
values, so angles in radians, unless the name of the number ends in another unit, such as `_deg`.
Arguments are float32 arrays whose shapes broadcast; results have the common shape.

Results must have the same bits on every machine, which NumPy guarantees for its square root and
`where`, but not for its exponential functions and logarithms: these come from `core.float32_math`.
"""

from functools import cache

import numpy as np

from overtaking.core.arrays import F32, F32Like, Mask
from overtaking.core.float32_math import (
    ONE,
    TWO,
    ZERO,
    as_f32,
    exp,
    log,
    maximum,
    minimum,
    power,
    sincos,
)
from overtaking.core.units import deg_from_rad
from overtaking.knowledge.toml_reader import constant
from overtaking.world.road_surface import PERCENT

MIN_EXTINCTION = np.float32(1e-7)
"""Smallest extinction in `contrast_range` [1/m]. It keeps ranges finite where the effect of fog and
rain is disabled and the extinction is therefore 0; the clearest air of the model has 3e-4."""

MIN_ILLUMINANCE = np.float32(1e-12)
"""Smallest threshold to pass to `lamp_range`, which divides by it [lx].

Callers apply it where the limits of sight are disabled and the threshold is therefore 0. The
smallest real threshold, at night, is 8e-7 lx.
"""

_MIN_START_EXTINCTION = np.float32(1e-6)
"""Smallest extinction from which `lamp_range` starts [1/m], a choice. It avoids a division by 0
where the effect of fog and rain is disabled, and lies below the clearest air of the model."""

_NEWTON_STEPS = 8
"""Steps of Newton's method for the range of a lamp.

For lamps of 1 to 500 cd the relative error is below 1e-6 after five steps, in clear air and in the
thickest fog; three more are a reserve. `tests/reference/test_visibility.py` compares these lamps
with another solver.
"""

_MIN_LAMP_RANGE = np.float32(0.5)
"""Lower limit of the iteration, which keeps its logarithm finite [m].

It lies far below every result: a lamp of 1 cd by day in the thickest fog has a range of 35 m.
"""


def meteorological_range(fog: F32) -> F32:
    """Meteorological optical range at CARLA's fog density [m].

    The range falls geometrically from 10 km in clear air to 50 m at 100 %. CARLA's density has no
    physical meaning, so this is a choice: drivers perceive fog logarithmically.

    Args:
        fog: 0 to 100 [%], any shape.
    """
    share = np.asarray(fog, np.float32) * PERCENT  # 0 to 1.
    return constant("weather.fog.clear_range") * exp(share * _log_range_ratio())


@cache
def _log_range_ratio() -> F32:
    """Logarithm of the range in the thickest fog over the range in clear air."""
    return log(constant("weather.fog.thick_range") / constant("weather.fog.clear_range"))


def fog_extinction(fog: F32) -> F32:
    """Extinction coefficient at CARLA's fog density [1/m].

    Args:
        fog: 0 to 100 [%], any shape.
    """
    return extinction_of_range(meteorological_range(fog))


def extinction_of_range(optical_range: F32Like) -> F32:
    """Extinction coefficient of air with a meteorological optical range [1/m].

    Args:
        optical_range: The range, positive, any shape [m].

    Source:
        Koschmieder's law: the range is the distance at which 5 % of the contrast is left
        (WMO-No. 8), an optical depth of 3.0.
    """
    return constant("weather.fog.transmission_depth") / as_f32(optical_range)


def rain_extinction(rain_rate: F32) -> F32:
    """Extinction coefficient of falling rain, to an observer at rest [1/m].

    The simulation step multiplies it by 1 + speed / `weather.rain_sight.speed_scale`, because a
    faster car meets more rain: twice as much at the scale of 30 m/s, a choice.

    Args:
        rain_rate: Any shape [mm/h].

    Source:
        Marshall and Palmer (1948): N0 exp(-L D) drops of diameter D, with N0 = 8000 / (m^3 mm) and
        L = 4.1 R^-0.21 / mm. Each drop takes twice its cross-section from the light, which sums up
        to pi N0 / L^3, or 0.365 R^0.63 / km.
    """
    scaled = power(np.asarray(rain_rate, np.float32), constant("weather.rain_sight.exponent"))
    return np.where(rain_rate > 0, constant("weather.rain_sight.coefficient") * scaled, ZERO)


def glare_factor(sun_altitude: F32, angle: F32, cloudiness: F32) -> F32:
    """Share of contrast that glare of a low sun leaves, 1 without glare.

    Light that scatters in the eye adds a veil of luminance 10 E / theta^2 to the luminance L of the
    road: L / (L + veil) of the contrast remains. E is the illuminance of the sun in lx and theta
    its angle from the line of sight in degrees.

    Args:
        sun_altitude: Angle of the sun above the horizon, any shape [rad].
        angle: Horizontal angle between line of sight and sun, 0 to pi [rad].
        cloudiness: CARLA's cloudiness, 0 to 100 [%]. Thick clouds prevent glare.

    Source:
        Veiling luminance of Stiles and Holladay.
    """
    sun_altitude = np.asarray(sun_altitude, np.float32)
    # The angle between two directions, as if they lay in a plane. Where the sun dazzles (up to 18
    # degrees high and 25 degrees aside), it exceeds the true angle by at most 1.2 %. Elsewhere
    # `is_dazzled` is false, and theta is not used.
    theta = np.sqrt(sun_altitude * sun_altitude + angle * angle) * np.float32(deg_from_rad(1.0))
    # The formula holds from 1 degree on.
    theta = maximum(theta, constant("weather.glare.min_angle_deg"))
    veil = constant("weather.glare.coefficient") * sun_illuminance(sun_altitude) / (theta * theta)
    luminance = constant("weather.glare.road_luminance")
    is_low = (sun_altitude >= constant("weather.glare.min_sun_altitude")) & (
        sun_altitude <= constant("weather.glare.max_sun_altitude")
    )
    is_dazzled = (
        is_low
        & (angle < constant("weather.glare.half_width"))
        & (cloudiness < constant("weather.glare.max_cloud_percent"))
    )
    return np.where(is_dazzled, luminance / (luminance + veil), ONE)


def sun_illuminance(altitude: F32) -> F32:
    """Illuminance of the sun in clear air on a plane that faces it [lx].

    E_0 exp(-c m) with the illuminance E_0 above the air, the extinction c of one vertical passage
    through clear air, and the relative air mass m = 1 / (sin h + 0.50572 (h + 6.07995)^-1.6364) at
    the altitude h in degrees.

    Args:
        altitude: Angle above the horizon, any shape; below the horizon it counts as 0 [rad].

    Source:
        Kasten and Young 1989 (relative optical air mass); IES RP-21 (extinction of clear air).
    """
    degrees = maximum(altitude, ZERO) * np.float32(deg_from_rad(1.0))
    sine, _ = sincos(maximum(altitude, ZERO))
    offset, exponent = (
        constant("weather.sunlight.mass_offset_deg"),
        constant("weather.sunlight.exponent"),
    )
    # The term keeps the air mass finite at the horizon, as the earth is round.
    curvature_term = constant("weather.sunlight.mass_factor") * power(degrees + offset, -exponent)
    air_mass = ONE / (sine + curvature_term)
    above_air = constant("weather.sunlight.outside")
    return above_air * exp(-constant("weather.sunlight.extinction") * air_mass)


def contrast_threshold(night: Mask, dusk: Mask, rain_rate: F32) -> F32:
    """Smallest contrast that a driver detects, larger through a windscreen wet from rain [1].

    Args:
        night: Whether it is night, any shape.
        dusk: Whether it is dusk; ignored at night.
        rain_rate: [mm/h].

    Source:
        By day 5 % (WMO-No. 8); the thresholds of dusk and night are choices. Water on the
        windscreen raises the threshold linearly with the rain rate (Hautiere et al. 2009) and
        doubles it at 50 mm/h (a choice).
    """
    without_night = np.where(
        dusk,
        constant("weather.contrast.threshold_dusk"),
        constant("weather.contrast.threshold_day"),
    )
    threshold = np.where(night, constant("weather.contrast.threshold_night"), without_night)
    return threshold * (ONE + rain_rate / constant("weather.rain_sight.screen_rate_mmph"))


def lamp_threshold(night: Mask, dusk: Mask) -> F32:
    """Smallest illuminance at the eye at which a driver detects a lamp [lx].

    Args:
        night: Whether it is night, any shape.
        dusk: Whether it is dusk; ignored at night.

    Source:
        ICAO Doc 9328, visual thresholds of illuminance for runway lights.
    """
    without_night = np.where(
        dusk, constant("weather.lamps.threshold_dusk"), constant("weather.lamps.threshold_day")
    )
    return np.where(night, constant("weather.lamps.threshold_night"), without_night)


def lamp_range(extinction: F32, intensity: F32, threshold: F32) -> F32:
    """Distance at which the illuminance of a lamp falls to a threshold [m].

    Args:
        extinction: Extinction coefficient of the air, any shape [1/m].
        intensity: Luminous intensity I of the lamp, positive [cd].
        threshold: Illuminance E at the eye, `MIN_ILLUMINANCE` or more [lx].

    Source:
        Allard's law, I exp(-beta r) / r^2 = E with the extinction beta, solved for the range r by
        Newton's method on its logarithm, 2 log r + beta r = log(I / E).
    """
    target = log(intensity / threshold)
    range_in_clear_air = np.sqrt(intensity / threshold)
    # The iteration starts at the range without extinction, or at an optical depth of 4 if that is
    # nearer: in the thickest fog, lamps of 1 to 500 cd have ranges at optical depths of 2 to 10. It
    # converges from either side, because the logarithm is concave: a step from beyond the range
    # ends before it, and later steps approach it from there.
    r = minimum(range_in_clear_air, np.float32(4.0) / maximum(extinction, _MIN_START_EXTINCTION))
    for _ in range(_NEWTON_STEPS):
        # The derivative of the excess by r is (2 + extinction r) / r.
        excess = TWO * log(r) + extinction * r - target
        r = r - r * excess / (TWO + extinction * r)
        r = maximum(r, _MIN_LAMP_RANGE)
    return r


def contrast_range(extinction: F32, contrast: F32, threshold: F32) -> F32:
    """Distance at which a contrast falls to a threshold [m].

    Args:
        extinction: Extinction coefficient of the air, any shape [1/m].
        contrast: Contrast of the object against its background, seen from near, positive [1].
        threshold: Smallest contrast that a driver detects, positive [1].

    Returns:
        The range; 0 for a contrast below the threshold.

    Source:
        Koschmieder's law: a contrast falls by exp(-extinction times distance).
    """
    depth = maximum(log(contrast / threshold), ZERO)
    return depth / maximum(extinction, MIN_EXTINCTION)
