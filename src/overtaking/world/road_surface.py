"""Film of water on the road, and friction of tyres."""

from functools import cache

import numpy as np

from overtaking.core.arrays import F32
from overtaking.core.float32_math import clamp, maximum, minimum, power
from overtaking.knowledge.toml_reader import constant
from overtaking.world.constants import ModelConstants

PERCENT = np.float32(0.01)
_ZERO = np.float32(0.0)
_FULL = np.float32(100.0)

# The phases of neighbouring wheel paths differ by the golden ratio, whose multiples fill a period
# evenly, and by its square. The field of puddles is part of the step: the engine has them too.
_PHASE_STEP_1 = np.float32(0.618_034)
_PHASE_STEP_2 = np.float32(0.381_966)


def rain_rate(rain: F32) -> F32:
    """Rain rate of CARLA's precipitation percentage [mm/h].

    Args:
        rain: 0 to 100 [%], any shape.
    """
    share = np.asarray(rain, np.float32) * PERCENT
    rate = constant("weather.rain.max_rate_mmph") * power(share, constant("weather.rain.exponent"))
    return np.where(share > 0, rate, _ZERO)


def min_wet_film(rate: F32, puddles: F32) -> F32:
    """Film of a road that is wet by rain or by what lies on it, 0 on a dry one [mm].

    Args:
        rate: Rain rate, any shape [mm/h].
        puddles: CARLA's precipitation deposits, same shape [%].
    """
    wet = (rate > 0) | (puddles >= constant("weather.film.wet_deposits_percent"))
    return np.where(wet, constant("weather.film.wet_film_mm"), _ZERO)


def puddle_depth(puddles: F32) -> F32:
    """Depth of a puddle above the film [mm] at CARLA's precipitation deposits [%], any shape."""
    from_percent = constant("weather.puddles.from_percent")
    deep = maximum(puddles - from_percent, np.zeros_like(puddles)) / (_FULL - from_percent)
    return constant("weather.puddles.max_film_mm") * deep


def puddle_cover(puddles: F32) -> F32:
    """Share of the road under puddles, 0 to 1, at CARLA's precipitation deposits [%], any shape."""
    return PERCENT * constant("weather.puddles.full_cover") * puddles


def film_rain_factor(rate: F32) -> F32:
    """Factor A(R) of the film above the texture, film = A(R) B(L) - MTD [mm].

    Args:
        rate: Rain rate, any shape [mm/h].

    Source:
        Gallaway et al. 1979, metric form.
    """
    scale, slope = _of_every_road()
    rain = power(np.asarray(rate, np.float32), constant("weather.film.rate_exponent"))
    film = scale * rain / slope
    return np.where(rate > 0, film, _ZERO)


@cache
def _of_every_road() -> tuple[F32, F32]:
    """Coefficient times texture, and slope, of `film_per_rain`."""
    texture = power(
        constant("weather.film.texture_depth_mm"), constant("weather.film.texture_exponent")
    )
    slope = power(constant("weather.film.cross_slope"), constant("weather.film.slope_exponent"))
    return constant("weather.film.coefficient") * texture, slope


def film_path_factor(path: F32) -> F32:
    """Factor B(L) of a drainage path of `path` metres, so that outer lanes are wetter.

    Source:
        Gallaway et al. 1979, metric form.
    """
    return power(np.asarray(path, np.float32), constant("weather.film.path_exponent"))


def lane_film(min_film: F32, rain_factor: F32, path_factor: F32, texture: F32) -> F32:
    """Film on a lane outside puddles [mm]: never below `min_film`, the film of any wet road."""
    return maximum(min_film, rain_factor * path_factor - texture)


def floor(x: F32) -> F32:
    """Largest whole number not above `x`, |x| < 2**22."""
    nearest = np.rint(x)
    return np.where(nearest > x, nearest - np.float32(1.0), nearest)


def triangle_wave(x: F32) -> F32:
    """A wave of period 1 between 0 and 1, uniform over a period."""
    return np.abs(np.float32(2.0) * (x - floor(x)) - np.float32(1.0))


def puddle_depth_share(
    c: ModelConstants, s: F32, path: F32, phase_1: F32, phase_2: F32, reach: F32
) -> F32:
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
    wave = triangle_wave(s * c.inverse_puddle_wave_1 + phase_1 + _PHASE_STEP_1 * path)
    wave = wave + triangle_wave(s * c.inverse_puddle_wave_2 + phase_2 + _PHASE_STEP_2 * path)
    return clamp((reach - wave) * c.puddle_slope, _ZERO, np.float32(1.0))


_ENDLESS = np.float32(1e6)
"""Distance beyond which sight does not limit the speed; its square still fits float32 [m]."""


def friction_at_speed(c: ModelConstants, speed: F32, wear: F32, truck: F32) -> list[F32]:
    """Friction at the four film knots for a speed, a tread and a type of tyre.

    Args:
        c: Constants.
        speed: [m/s], any shape.
        wear: Tread wear, 0 new to 1 worn.
        truck: 1 for truck tyres: less friction when dry, half of the loss by speed when wet.

    Returns:
        One array for each knot of the film.

    Source:
        Bosch Automotive Handbook, friction of tyres; linear between its knots, clamped outside.
    """
    v0, v1, v2 = c.friction_speeds
    low = clamp((speed - v0) / (v1 - v0), np.float32(0.0), np.float32(1.0))
    high = clamp((speed - v1) / (v2 - v1), np.float32(0.0), np.float32(1.0))
    columns = []
    for knot in range(4):
        rows = [
            c.friction_new[i][knot] + wear * (c.friction_worn[i][knot] - c.friction_new[i][knot])
            for i in range(3)
        ]
        change = low * (rows[1] - rows[0]) + high * (rows[2] - rows[1])
        if knot == 0:
            scale = np.float32(1.0) + truck * (c.truck_dry_factor - np.float32(1.0))
            columns.append(scale * (rows[0] + change))
        elif knot == 1:
            columns.append(rows[0] + change)
        else:
            kept = np.float32(1.0) + truck * (c.truck_loss_factor - np.float32(1.0))
            columns.append(rows[0] + kept * change)
    return columns


def friction_at_film(c: ModelConstants, columns: list[F32], film: F32) -> F32:
    """Friction on a film [mm], from the columns of `speed_columns`; never below the floor."""
    h0, h1, h2, h3 = c.friction_films
    a = clamp((film - h0) / (h1 - h0), np.float32(0.0), np.float32(1.0))
    b = clamp((film - h1) / (h2 - h1), np.float32(0.0), np.float32(1.0))
    d = clamp((film - h2) / (h3 - h2), np.float32(0.0), np.float32(1.0))
    value = columns[0] + a * (columns[1] - columns[0])
    value = value + b * (columns[2] - columns[1])
    value = value + d * (columns[3] - columns[2])
    return maximum(value, c.friction_floor)


def peak_friction(c: ModelConstants, speed: F32, film: F32, wear: F32, truck: F32) -> F32:
    """Peak friction coefficient; arguments as in `speed_columns` and `at_film`."""
    return friction_at_film(c, friction_at_speed(c, speed, wear, truck), film)


def stopping_distance(speed: F32, reaction_time: F32, decel: F32) -> F32:
    """Distance to a stop: v t + v^2 / (2 b) [m]."""
    return speed * reaction_time + speed * speed / (np.float32(2.0) * decel)


def stoppable_speed(distance: F32, reaction_time: F32, decel: F32) -> F32:
    """Speed from which one stops within `distance`, the inverse of `stopping_distance` [m/s]."""
    bt = decel * reaction_time
    return np.sqrt(bt * bt + np.float32(2.0) * decel * minimum(distance, _ENDLESS)) - bt
