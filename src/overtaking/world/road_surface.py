"""Film of water on the road, friction of tyres, and stopping distances.

The functions compute films of water in mm and friction coefficients from weather percentages of the
driving simulator CARLA, positions, speeds and tyres. Rain feeds a *film* on the lanes, which runs
off from the crown, the highest line of the road. Puddles lie on top of the film, in a fixed pattern
along each wheel path. CARLA's *precipitation deposits* say how much water lies on the road, also
after the rain; the arguments `puddles` are deposits.

Numbers of the model come from `knowledge/data/weather.toml` (`constant`) and, where the simulation
step needs them, from `ModelConstants`. All functions are element by element: arguments are float32
arrays whose shapes broadcast, results have the common shape. The functions of `core.float32_math`
have results with the same bits on every machine and in the compiled engine.
"""

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

# Shifts of the two waves of puddles from one wheel path to the next, in wave lengths: neighbouring
# wheel paths have puddles at different places. The first is one over the golden ratio, the second
# its square, because multiples of these fill a period evenly. The engine has the same numbers.
_PHASE_STEP_1 = np.float32(0.618_034)
_PHASE_STEP_2 = np.float32(0.381_966)

_MAX_DISTANCE = np.float32(1e6)
"""Longer distances count as this in `stoppable_speed`, so that infinite sight gives a finite speed
[m]. A choice: no vehicle needs more to stop."""


def rain_rate(rain: F32) -> F32:
    """Rain rate at CARLA's precipitation percentage.

    Args:
        rain: 0 to 100 [%], any shape.

    Returns:
        Rates of the same shape [mm/h].
    """
    share = np.asarray(rain, np.float32) * PERCENT
    rate = constant("weather.rain.max_rate_mmph") * power(share, constant("weather.rain.exponent"))
    return np.where(share > 0, rate, ZERO)  # `power` of 0 is not exactly 0.


def min_wet_film(rate: F32, puddles: F32) -> F32:
    """Thinnest film of a road that rain or earlier rain has wetted, 0 on a dry road [mm].

    Args:
        rate: Rain rate, any shape [mm/h].
        puddles: CARLA's precipitation deposits, 0 to 100, same shape [%]. From 25 % on the whole
            road counts as wet.
    """
    is_wet = (rate > 0) | (puddles >= constant("weather.film.wet_deposits_percent"))
    return np.where(is_wet, constant("weather.film.wet_film_mm"), ZERO)


def puddle_depth(puddles: F32) -> F32:
    """Full depth of a puddle above the film [mm].

    It is 0 up to 50 % of deposits: such a road is damp, without standing water. `puddle_cover` is
    already above 0 for these deposits, but a puddle of depth 0 has no effect.

    Args:
        puddles: CARLA's precipitation deposits, 0 to 100, any shape [%].
    """
    from_percent = constant("weather.puddles.from_percent")
    share = maximum(puddles - from_percent, np.zeros_like(puddles)) / (_FULL - from_percent)
    return constant("weather.puddles.max_film_mm") * share


def puddle_cover(puddles: F32) -> F32:
    """Share of the road under puddles, 0 to 0.5, proportional to the deposits [1].

    Args:
        puddles: CARLA's precipitation deposits, 0 to 100, any shape [%].
    """
    return PERCENT * constant("weather.puddles.full_cover") * puddles


def film_rain_factor(rate: F32) -> F32:
    """Factor A(R) of the film above the texture of the road, film = A(R) B(L) - MTD [mm].

    R is the rain rate, L the length of the drainage path in m and MTD the mean texture depth in mm.
    A = 0.01485 MTD^0.11 R^0.59 / S^0.42 with the cross slope S, and B = L^0.43.

    Args:
        rate: Rain rate R, any shape [mm/h].

    Source:
        Gallaway et al. 1979, metric form.
    """
    texture_factor, slope_factor = _texture_and_slope_factors()
    rain = power(np.asarray(rate, np.float32), constant("weather.film.rate_exponent"))
    film = texture_factor * rain / slope_factor
    return np.where(rate > 0, film, ZERO)  # `power` of 0 is not exactly 0.


@cache
def _texture_and_slope_factors() -> tuple[F32, F32]:
    """0.01485 MTD^0.11 and S^0.42 of `film_rain_factor`: both are the same for all roads."""
    texture = power(
        constant("weather.film.texture_depth_mm"), constant("weather.film.texture_exponent")
    )
    slope = power(constant("weather.film.cross_slope"), constant("weather.film.slope_exponent"))
    return constant("weather.film.coefficient") * texture, slope


def film_path_factor(path: F32) -> F32:
    """Factor B(L) of the film, see `film_rain_factor`: lanes far from the crown are wetter [1].

    Args:
        path: Length L that the water has run from the crown, positive, any shape [m].

    Source:
        Gallaway et al. 1979, metric form.
    """
    return power(np.asarray(path, np.float32), constant("weather.film.path_exponent"))


def lane_film(min_film: F32, rain_factor: F32, path_factor: F32, texture: F32) -> F32:
    """Film on a lane outside puddles [mm].

    Args:
        min_film: Thinnest film of the road, result of `min_wet_film`, any shape [mm].
        rain_factor: Factor A, result of `film_rain_factor` [mm].
        path_factor: Factor B, result of `film_path_factor` [1].
        texture: Mean depth of the road's texture, MTD [mm].

    Source:
        Gallaway et al. 1979, metric form.
    """
    return maximum(min_film, rain_factor * path_factor - texture)


def floor(x: F32) -> F32:
    """Largest whole number not above `x`, as `np.floor`, with the operations of the engine.

    Args:
        x: Any shape, absolute values below 2**22: there the engine rounds to whole numbers exactly.
    """
    nearest = np.rint(x)
    return np.where(nearest > x, nearest - ONE, nearest)


def triangle_wave(x: F32) -> F32:
    """Triangle wave of period 1: falls linearly from 1 at 0 to 0 at 0.5 and rises again."""
    return np.abs(TWO * (x - floor(x)) - ONE)


def puddle_depth_share(
    constants: ModelConstants, s: F32, wheel_path: F32, phase_1: F32, phase_2: F32, threshold: F32
) -> F32:
    """Depth of the puddle at a point, as a share of its full depth, 0 outside puddles to 1.

    A puddle is where the sum of two triangle waves along the wheel path is below a threshold t. The
    wave lengths, 23 m and 37 m, have no common divisor, so the sum is distributed like the sum of
    two independent uniform numbers: on a share t^2 / 2 of the path it is below a threshold t <= 1.
    The farther the sum is below the threshold, the deeper is the water, up to the full depth.

    Args:
        constants: Constants of the model.
        s: Position along the road, any shape [m].
        wheel_path: Whole number of the wheel path, counted across the road, two to a lane.
        phase_1: Random phase of the first wave in this simulation, in [0, 1).
        phase_2: Random phase of the second wave, in [0, 1).
        threshold: sqrt(2 c), 0 to 1, for the share c of the road under puddles, result of
            `puddle_cover` [1].
    """
    # Positions in wave lengths.
    on_wave_1 = s * constants.inverse_puddle_wave_1 + phase_1 + _PHASE_STEP_1 * wheel_path
    on_wave_2 = s * constants.inverse_puddle_wave_2 + phase_2 + _PHASE_STEP_2 * wheel_path
    wave_sum = triangle_wave(on_wave_1) + triangle_wave(on_wave_2)
    return clamp((threshold - wave_sum) * constants.puddle_slope, ZERO, ONE)


def peak_friction(constants: ModelConstants, speed: F32, film: F32, wear: F32, truck: F32) -> F32:
    """Peak friction coefficient of a tyre at a speed on a film of water [1].

    It is the largest force of the tyre over its load, before it slides.

    Args:
        constants: Constants of the model.
        speed: Speed of the vehicle, any shape [m/s].
        film: Depth of the water [mm].
        wear: Tread wear, from 0 (new) to 1 (worn).
        truck: 1 for truck tyres, 0 for others.
    """
    columns = friction_at_speed(constants, speed, wear, truck)
    return friction_at_film(constants, columns, film)


def friction_at_speed(constants: ModelConstants, speed: F32, wear: F32, truck: F32) -> list[F32]:
    """Peak friction at the four films of the table of friction, for a speed and a tyre [1].

    This is the first half of `peak_friction`. A caller that needs several films at one speed calls
    it once, and then `friction_at_film` for each film.

    The table has rows for 50, 90 and 130 km/h and columns for 0, 0.2, 1 and 2 mm of water, once for
    new and once for worn tyres. Truck tyres have less friction on a dry road. On more than 0.2 mm
    they lose less friction with speed, as their high pressure delays hydroplaning.

    Args:
        constants: Constants of the model.
        speed: Speed of the vehicle, any shape [m/s].
        wear: Tread wear, from 0 (new) to 1 (worn).
        truck: 1 for truck tyres, 0 for others.

    Returns:
        One array for each of the four films.

    Source:
        Bosch Automotive Handbook, friction of tyres. The friction is linear between the speeds of
        the table, and constant beyond its ends.
    """
    v0, v1, v2 = constants.friction_speeds
    # Shares of the ways from the first to the second speed and from the second to the third.
    low = clamp((speed - v0) / (v1 - v0), ZERO, ONE)
    high = clamp((speed - v1) / (v2 - v1), ZERO, ONE)
    new, worn = constants.friction_new, constants.friction_worn
    columns = []
    for column in range(4):
        # The friction at each of the three speeds, for this wear.
        rows = [new[i][column] + wear * (worn[i][column] - new[i][column]) for i in range(3)]
        change = low * (rows[1] - rows[0]) + high * (rows[2] - rows[1])
        if column == 0:  # Dry.
            dry_factor = ONE + truck * (constants.truck_dry_factor - ONE)
            columns.append(dry_factor * (rows[0] + change))
        elif column == 1:  # 0.2 mm: truck tyres count as car tyres.
            columns.append(rows[0] + change)
        else:  # 1 mm and 2 mm.
            loss_factor = ONE + truck * (constants.truck_loss_factor - ONE)
            columns.append(rows[0] + loss_factor * change)
    return columns


def friction_at_film(constants: ModelConstants, columns: list[F32], film: F32) -> F32:
    """Peak friction on a film of water, at least `ModelConstants.friction_floor` [1].

    Args:
        constants: Constants of the model.
        columns: The friction at the four films of the table, result of `friction_at_speed`.
        film: Depth of the water, linear between the films of the table [mm].
    """
    h0, h1, h2, h3 = constants.friction_films
    # Shares of the ways from each film of the table to the next.
    share_1 = clamp((film - h0) / (h1 - h0), ZERO, ONE)
    share_2 = clamp((film - h1) / (h2 - h1), ZERO, ONE)
    share_3 = clamp((film - h2) / (h3 - h2), ZERO, ONE)
    friction = columns[0] + share_1 * (columns[1] - columns[0])
    friction = friction + share_2 * (columns[2] - columns[1])
    friction = friction + share_3 * (columns[3] - columns[2])
    return maximum(friction, constants.friction_floor)


def stopping_distance(speed: F32, reaction_time: F32, decel: F32) -> F32:
    """Distance to a stop: v t + v^2 / (2 b) [m].

    Args:
        speed: Speed v, any shape [m/s].
        reaction_time: Time t before the brakes act [s].
        decel: Deceleration b, positive [m/s^2].
    """
    return speed * reaction_time + speed * speed / (TWO * decel)


def stoppable_speed(distance: F32, reaction_time: F32, decel: F32) -> F32:
    """Speed from which a vehicle stops within a distance, the inverse of `stopping_distance` [m/s].

    The positive solution v of v t + v^2 / (2 b) = distance.

    Args:
        distance: Any shape, 0 or more, may be infinite [m].
        reaction_time: Time t before the brakes act [s].
        decel: Deceleration b, positive [m/s^2].
    """
    bt = decel * reaction_time
    return np.sqrt(bt * bt + TWO * decel * minimum(distance, _MAX_DISTANCE)) - bt
