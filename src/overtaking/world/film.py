"""Water on the road: from rain to a film on each wheel path."""

from functools import cache

import numpy as np

from overtaking.core.arrays import F32
from overtaking.core.elementary import clamp, maximum, power
from overtaking.world.constants import Constants, known

PERCENT = np.float32(0.01)
_ZERO = np.float32(0.0)
_FULL = np.float32(100.0)

# The phases of neighbouring wheel paths differ by the golden ratio, whose multiples fill a period
# evenly, and by its square. The field of puddles is part of the step: the engine has them too.
_GOLDEN = np.float32(0.618_034)
_GOLDEN_SQUARE = np.float32(0.381_966)


def rain_rate(rain: F32) -> F32:
    """Rain rate of CARLA's precipitation percentage [mm/h].

    Args:
        rain: 0 to 100 [%], any shape.
    """
    share = np.asarray(rain, np.float32) * PERCENT
    rate = known("weather.rain.max_rate_mmph") * power(share, known("weather.rain.exponent"))
    return np.where(share > 0, rate, _ZERO)


def least_film(rate: F32, puddles: F32) -> F32:
    """Film of a road that is wet by rain or by what lies on it, 0 on a dry one [mm].

    Args:
        rate: Rain rate, any shape [mm/h].
        puddles: CARLA's precipitation deposits, same shape [%].
    """
    wet = (rate > 0) | (puddles >= known("weather.film.wet_deposits_percent"))
    return np.where(wet, known("weather.film.wet_film_mm"), _ZERO)


def puddle_depth(puddles: F32) -> F32:
    """Depth of a puddle above the film [mm] at CARLA's precipitation deposits [%], any shape."""
    from_percent = known("weather.puddles.from_percent")
    deep = maximum(puddles - from_percent, np.zeros_like(puddles)) / (_FULL - from_percent)
    return known("weather.puddles.max_film_mm") * deep


def puddle_cover(puddles: F32) -> F32:
    """Share of the road under puddles, 0 to 1, at CARLA's precipitation deposits [%], any shape."""
    return PERCENT * known("weather.puddles.full_cover") * puddles


def film_per_rain(rate: F32) -> F32:
    """Factor A(R) of the film above the texture, film = A(R) B(L) - MTD [mm].

    Args:
        rate: Rain rate, any shape [mm/h].

    Source:
        Gallaway et al. 1979, metric form.
    """
    scale, slope = _of_every_road()
    rain = power(np.asarray(rate, np.float32), known("weather.film.rate_exponent"))
    film = scale * rain / slope
    return np.where(rate > 0, film, _ZERO)


@cache
def _of_every_road() -> tuple[F32, F32]:
    """Coefficient times texture, and slope, of `film_per_rain`."""
    texture = power(known("weather.film.texture_depth_mm"), known("weather.film.texture_exponent"))
    slope = power(known("weather.film.cross_slope"), known("weather.film.slope_exponent"))
    return known("weather.film.coefficient") * texture, slope


def film_per_path(path: F32) -> F32:
    """Factor B(L) of a drainage path of `path` metres, so that outer lanes are wetter.

    Source:
        Gallaway et al. 1979, metric form.
    """
    return power(np.asarray(path, np.float32), known("weather.film.path_exponent"))


def lane_film(least: F32, per_rain: F32, per_path: F32, texture: F32) -> F32:
    """Film on a lane outside puddles [mm]: never below `least`, the film of any wet road."""
    return maximum(least, per_rain * per_path - texture)


def floor(x: F32) -> F32:
    """Largest whole number not above `x`, |x| < 2**22."""
    nearest = np.rint(x)
    return np.where(nearest > x, nearest - np.float32(1.0), nearest)


def triangle_wave(x: F32) -> F32:
    """A wave of period 1 between 0 and 1, uniform over a period."""
    return np.abs(np.float32(2.0) * (x - floor(x)) - np.float32(1.0))


def puddle(c: Constants, s: F32, path: F32, phase_1: F32, phase_2: F32, reach: F32) -> F32:
    """Depth of the puddle at a point, 0 to 1 of its full depth.

    Two triangle waves of incommensurate length add up to a field whose share below `reach` is
    reach**2 / 2 for reach <= 1: the share of the wheel path that is under water.

    Args:
        c: Constants.
        s: Position along the road [m].
        path: Number of the wheel path, two to a lane.
        phase_1: Random phase of the simulation in [0, 1).
        phase_2: Another one.
        reach: Threshold; sqrt(2 x covered share).
    """
    wave = triangle_wave(s * c.inverse_puddle_wave_1 + phase_1 + _GOLDEN * path)
    wave = wave + triangle_wave(s * c.inverse_puddle_wave_2 + phase_2 + _GOLDEN_SQUARE * path)
    return clamp((reach - wave) * c.puddle_slope, _ZERO, np.float32(1.0))
