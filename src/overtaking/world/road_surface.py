"""Film of water on the road, and friction of tyres."""

from functools import cache

import numpy as np

from overtaking.core.arrays import F32
from overtaking.core.float32_math import ONE, TWO, ZERO, clamp, maximum, minimum, power
from overtaking.knowledge.toml_reader import constant
from overtaking.world.constants import ModelConstants

PERCENT = np.float32(0.01)
"""One percent as a share [1]."""

_FULL = np.float32(100.0)
"""The largest value of CARLA's weather parameters [%]."""

# The phases of neighbouring wheel paths differ by the golden ratio, whose multiples fill a period
# evenly, and by its square. The field of puddles is part of the step: the engine has them too.
_PHASE_STEP_1 = np.float32(0.618_034)
_PHASE_STEP_2 = np.float32(0.381_966)

_MAX_DISTANCE = np.float32(1e6)
"""Distance beyond which sight does not limit the speed; its square still fits float32 [m]."""


def rain_rate(rain: F32) -> F32:
    """Rain rate at CARLA's precipitation percentage.

    Args:
        rain: 0 to 100 [%], any shape.

    Returns:
        Rates of the same shape [mm/h].
    """
    share = np.asarray(rain, np.float32) * PERCENT
    rate = constant("weather.rain.max_rate_mmph") * power(share, constant("weather.rain.exponent"))
    return np.where(share > 0, rate, ZERO)


def min_wet_film(rate: F32, puddles: F32) -> F32:
    """Thinnest film of a road that rain or earlier rain has wetted, 0 on a dry road [mm].

    Args:
        rate: Rain rate, any shape [mm/h].
        puddles: CARLA's precipitation deposits, 0 to 100, same shape [%].
    """
    is_wet = (rate > 0) | (puddles >= constant("weather.film.wet_deposits_percent"))
    return np.where(is_wet, constant("weather.film.wet_film_mm"), ZERO)


def puddle_depth(puddles: F32) -> F32:
    """Depth of a puddle above the film [mm].

    Args:
        puddles: CARLA's precipitation deposits, 0 to 100, any shape [%].
    """
    from_percent = constant("weather.puddles.from_percent")
    share = maximum(puddles - from_percent, np.zeros_like(puddles)) / (_FULL - from_percent)
    return constant("weather.puddles.max_film_mm") * share


def puddle_cover(puddles: F32) -> F32:
    """Share of the road under puddles, 0 to 1.

    Args:
        puddles: CARLA's precipitation deposits, 0 to 100, any shape [%].
    """
    return PERCENT * constant("weather.puddles.full_cover") * puddles


def film_rain_factor(rate: F32) -> F32:
    """Factor A(R) of the film above the texture: film = A(R) B(L) - MTD [mm].

    Args:
        rate: Rain rate, any shape [mm/h].

    Source:
        Gallaway et al. 1979, metric form.
    """
    scale, slope = _texture_and_slope_factors()
    rain = power(np.asarray(rate, np.float32), constant("weather.film.rate_exponent"))
    film = scale * rain / slope
    return np.where(rate > 0, film, ZERO)


@cache
def _texture_and_slope_factors() -> tuple[F32, F32]:
    """Coefficient times the factor of the texture, and the factor of the cross slope."""
    texture = power(
        constant("weather.film.texture_depth_mm"), constant("weather.film.texture_exponent")
    )
    slope = power(constant("weather.film.cross_slope"), constant("weather.film.slope_exponent"))
    return constant("weather.film.coefficient") * texture, slope


def film_path_factor(path: F32) -> F32:
    """Factor B(L) of the drainage path: the lanes far from the crown are wetter.

    Args:
        path: Length that the water has run, positive, any shape [m].

    Source:
        Gallaway et al. 1979, metric form.
    """
    return power(np.asarray(path, np.float32), constant("weather.film.path_exponent"))


def lane_film(min_film: F32, rain_factor: F32, path_factor: F32, texture: F32) -> F32:
    """Film on a lane outside puddles [mm].

    Args:
        min_film: Thinnest film of the road, see `min_wet_film`, any shape [mm].
        rain_factor: See `film_rain_factor`.
        path_factor: See `film_path_factor`.
        texture: Depth of the road's texture [mm].

    Source:
        Gallaway et al. 1979, metric form.
    """
    return maximum(min_film, rain_factor * path_factor - texture)


def floor(x: F32) -> F32:
    """Largest whole number not above `x`, |x| < 2**22."""
    nearest = np.rint(x)
    return np.where(nearest > x, nearest - ONE, nearest)


def triangle_wave(x: F32) -> F32:
    """A wave of period 1 between 0 and 1, uniformly distributed over a period."""
    return np.abs(TWO * (x - floor(x)) - ONE)


def puddle_depth_share(
    constants: ModelConstants, s: F32, path: F32, phase_1: F32, phase_2: F32, threshold: F32
) -> F32:
    """Depth of the puddle at a point, 0 to 1 of its full depth.

    Two triangle waves of incommensurate length add up to a field whose share below a threshold t is
    t**2 / 2 for t <= 1: the share of the wheel path that is under water.

    Args:
        constants: Constants of the model.
        s: Position along the road, any shape [m].
        path: Number of the wheel path, two to a lane.
        phase_1: Random phase of the simulation, in [0, 1).
        phase_2: Random phase of the second wave, in [0, 1).
        threshold: sqrt(2 x covered share).
    """
    wave = triangle_wave(s * constants.inverse_puddle_wave_1 + phase_1 + _PHASE_STEP_1 * path)
    wave = wave + triangle_wave(
        s * constants.inverse_puddle_wave_2 + phase_2 + _PHASE_STEP_2 * path
    )
    return clamp((threshold - wave) * constants.puddle_slope, ZERO, ONE)


def peak_friction(constants: ModelConstants, speed: F32, film: F32, wear: F32, truck: F32) -> F32:
    """Peak friction coefficient of a tyre; arguments as in the two functions below."""
    columns = friction_at_speed(constants, speed, wear, truck)
    return friction_at_film(constants, columns, film)


def friction_at_speed(constants: ModelConstants, speed: F32, wear: F32, truck: F32) -> list[F32]:
    """Friction at the four knots of the film, for a speed, a tread and a type of tyre.

    Args:
        constants: Constants of the model.
        speed: Speed of the vehicle, any shape [m/s].
        wear: Tread wear, from 0 (new) to 1 (worn).
        truck: 1 for truck tyres, whose friction is lower on a dry road, and which lose less of it
            with speed on a wet one; else 0.

    Returns:
        One array for each knot of the film.

    Source:
        Bosch Automotive Handbook, friction of tyres; linear between its knots, clamped outside.
    """
    v0, v1, v2 = constants.friction_speeds
    low = clamp((speed - v0) / (v1 - v0), ZERO, ONE)
    high = clamp((speed - v1) / (v2 - v1), ZERO, ONE)
    new, worn = constants.friction_new, constants.friction_worn
    columns = []
    for knot in range(4):
        rows = [new[i][knot] + wear * (worn[i][knot] - new[i][knot]) for i in range(3)]
        change = low * (rows[1] - rows[0]) + high * (rows[2] - rows[1])
        if knot == 0:  # Dry.
            dry_factor = ONE + truck * (constants.truck_dry_factor - ONE)
            columns.append(dry_factor * (rows[0] + change))
        elif knot == 1:  # At the thinnest film neither factor of trucks applies.
            columns.append(rows[0] + change)
        else:
            loss_factor = ONE + truck * (constants.truck_loss_factor - ONE)
            columns.append(rows[0] + loss_factor * change)
    return columns


def friction_at_film(constants: ModelConstants, columns: list[F32], film: F32) -> F32:
    """Friction on a film of water, never below the floor of the table.

    Args:
        constants: Constants of the model.
        columns: The friction at the knots of the film, see `friction_at_speed`.
        film: Depth of the water [mm].
    """
    h0, h1, h2, h3 = constants.friction_films
    a = clamp((film - h0) / (h1 - h0), ZERO, ONE)
    b = clamp((film - h1) / (h2 - h1), ZERO, ONE)
    d = clamp((film - h2) / (h3 - h2), ZERO, ONE)
    value = columns[0] + a * (columns[1] - columns[0])
    value = value + b * (columns[2] - columns[1])
    value = value + d * (columns[3] - columns[2])
    return maximum(value, constants.friction_floor)


def stopping_distance(speed: F32, reaction_time: F32, decel: F32) -> F32:
    """Distance to a stop: v t + v^2 / (2 b) [m].

    Args:
        speed: Any shape [m/s].
        reaction_time: Time before the brakes act [s].
        decel: Deceleration, positive [m/s^2].
    """
    return speed * reaction_time + speed * speed / (TWO * decel)


def stoppable_speed(distance: F32, reaction_time: F32, decel: F32) -> F32:
    """Speed from which a vehicle stops within a distance, the inverse of `stopping_distance` [m/s].

    Args:
        distance: Any shape, may be infinite [m].
        reaction_time: Time before the brakes act [s].
        decel: Deceleration, positive [m/s^2].
    """
    bt = decel * reaction_time
    return np.sqrt(bt * bt + TWO * decel * minimum(distance, _MAX_DISTANCE)) - bt
