"""Surrogate measures of safety for a follower behind a leader: times, distances, decelerations.

`gap` is the distance from bumper to bumper, negative while the two overlap along the road;
`closing_speed` is the follower's speed minus the leader's, positive while the gap shrinks. Speeds
are 0 or more. Arguments are float32 arrays or numbers whose shapes broadcast; every function works
element by element and returns float32 of the common shape. The time of an event that never happens
is infinite. The tables of results and the rules of the law (`labels`) use these functions.

`ZERO`, `HALF`, `ONE` and `TWO` are float32 numbers. Where `np.where` rejects a quotient, its
denominator is replaced by 1 first, so that NumPy does not warn of a division by 0.
"""

import numpy as np

from overtaking.core.arrays import F32, F32Like, Mask
from overtaking.core.float32_math import HALF, ONE, TWO, ZERO, as_f32

_INFINITY = np.float32(np.inf)

_MIN_DIVISOR = np.float32(1e-20)
"""Divisors up to this count as 0, such as speeds [m/s]. Quotients then stay far below 3e38, where
float32 ends. A choice: far below any speed that matters."""


def time_gap(gap: F32Like, speed: F32Like) -> F32:
    """Time in which a follower covers the gap to its leader at its speed [s].

    Args:
        gap: [m].
        speed: Speed of the follower [m/s].

    Returns:
        gap / speed; 0 where the two overlap, else infinite at a standstill.
    """
    is_moving = speed > _MIN_DIVISOR
    time = np.maximum(gap, ZERO) / np.where(is_moving, speed, ONE)
    return np.where(is_moving | (gap <= 0), time, _INFINITY)


def time_headway(gap: F32Like, leader_length: F32Like, speed: F32Like) -> F32:
    """Time between the two front bumpers at a point of the road, THW [s].

    Args:
        gap: [m].
        leader_length: Length of the leader [m].
        speed: Speed of the follower [m/s].

    Returns:
        (gap + leader_length) / speed; 0 where the follower's front is not behind the leader's
        front, else infinite at a standstill.
    """
    return time_gap(gap + leader_length, speed)


def ttc(gap: F32Like, closing_speed: F32Like) -> F32:
    """Time to collision at constant speeds, TTC [s].

    Args:
        gap: [m].
        closing_speed: [m/s].

    Returns:
        gap / closing_speed; 0 where the two overlap, else infinite if the gap does not shrink.

    Source:
        Hayward (1972), Near-miss determination through use of a scale of danger.
    """
    is_closing = closing_speed > _MIN_DIVISOR
    time = np.maximum(gap, ZERO) / np.where(is_closing, closing_speed, ONE)
    return np.where(is_closing | (gap <= 0), time, _INFINITY)


def mttc(gap: F32Like, closing_speed: F32Like, closing_accel: F32Like) -> F32:
    """Time to collision at constant accelerations, MTTC [s].

    As in the source, the accelerations stay constant for ever: a vehicle that brakes comes to a
    standstill and then reverses.

    Args:
        gap: [m].
        closing_speed: [m/s].
        closing_accel: Acceleration of the follower minus acceleration of the leader [m/s^2].

    Returns:
        The first t > 0 with closing_accel t^2 / 2 + closing_speed t = gap; 0 where the two overlap,
        else infinite if the equation has no such solution.

    Source:
        Ozbay, Yang, Bartin, Mudigonda (2008), TRB 2083, 105-113.
    """
    distance = np.maximum(gap, ZERO)
    square = closing_speed * closing_speed + TWO * closing_accel * distance
    root = np.sqrt(np.maximum(square, ZERO))
    # The solution has two forms, 2 gap / (v + root) and (root - v) / a, with the closing speed v
    # and the closing acceleration a. Take the form that adds two numbers of the same sign: the
    # other subtracts nearly equal numbers and loses digits.
    is_opening = closing_speed < 0
    denominator = np.where(is_opening, closing_accel, closing_speed + root)
    numerator = np.where(is_opening, root - closing_speed, TWO * distance)
    has_solution = (square >= 0) & (denominator > _MIN_DIVISOR)
    time = numerator / np.where(has_solution, denominator, ONE)
    return np.where(gap <= 0, ZERO, np.where(has_solution, time, _INFINITY))


def drac(gap: F32Like, closing_speed: F32Like) -> F32:
    """Deceleration that just avoids a collision with a leader of constant speed, DRAC [m/s^2].

    Args:
        gap: [m].
        closing_speed: [m/s].

    Returns:
        closing_speed^2 / (2 gap); 0 if the gap does not shrink, infinite where it shrinks while the
        two overlap. Values above AASHTO's comfortable deceleration, 3.4 m/s^2, usually count as
        critical.

    Source:
        Cooper and Ferguson (1976).
    """
    approach = np.maximum(closing_speed, ZERO)
    has_gap = gap > 0
    decel = approach * approach / (TWO * np.where(has_gap, gap, ONE))
    return np.where(has_gap | (approach == 0), decel, _INFINITY)


def is_ttc_critical(time_to_collision: F32Like, threshold: F32Like) -> Mask:
    """Whether a time to collision is critical: above 0 and at most the threshold.

    The total time for which it is critical is the time exposed time-to-collision, TET. A time to
    collision of 0 does not count: the collision has happened.

    Args:
        time_to_collision: Result of `ttc`, may be infinite [s].
        threshold: Positive [s].

    Source:
        Minderhoud and Bovy (2001), Extended time-to-collision measures for road traffic safety
        assessment, Accident Analysis and Prevention 33(1), 89-97.
    """
    return np.asarray((time_to_collision > 0) & (time_to_collision <= threshold), dtype=np.bool_)


def ttc_shortfall(time_to_collision: F32Like, threshold: F32Like) -> F32:
    """Threshold minus a critical time to collision, 0 if the time is not critical [s].

    Its integral over time is the time integrated time-to-collision, TIT [s^2].

    Args:
        time_to_collision: Result of `ttc`, may be infinite [s].
        threshold: Positive [s].

    Source:
        Minderhoud and Bovy (2001), as `is_ttc_critical`.
    """
    is_critical = is_ttc_critical(time_to_collision, threshold)
    critical_time = np.where(is_critical, time_to_collision, ZERO)
    return np.where(is_critical, threshold - critical_time, ZERO)


def looming(gap: F32Like, closing_speed: F32Like, width: F32Like) -> F32:
    """Speed at which the visual angle of the leader's rear grows [rad/s].

    The derivative of the angle 2 atan(width / (2 gap)) is
    width closing_speed / (gap^2 + width^2 / 4). It is negative while the angle shrinks. The result
    is 0 where the two overlap, as the follower then sees no rear.

    Args:
        gap: Distance between the follower's eye and the leader's rear [m].
        closing_speed: [m/s].
        width: Width of the rear, 0 or more [m].

    Source:
        Hoffmann and Mortimer (1996), Scaling of relative velocity between vehicles.
    """
    distance = np.maximum(gap, ZERO)
    square = distance * distance + HALF * HALF * width * width
    # The lower limit is for a width of 0: the square of a tiny gap is 0 in float32.
    return np.where(gap > 0, width * closing_speed / np.maximum(square, _MIN_DIVISOR), ZERO)


def assumed_decel(friction: F32Like, *, share: F32Like, limit: F32Like, gravity: F32Like) -> F32:
    """Deceleration to pass to `safe_distance`: min(limit, share mu g) [m/s^2].

    Args:
        friction: Friction coefficient mu of tyres and road [1].
        share: Share of the friction that the driver uses [1].
        limit: Largest deceleration that the brakes or the driver allow, positive [m/s^2].
        gravity: Acceleration of gravity g [m/s^2].
    """
    return np.minimum(share * gravity * friction, limit)


def safe_distance(
    follower_speed: F32Like,
    leader_speed: F32Like,
    *,
    reaction_time: F32Like,
    follower_decel: F32Like,
    leader_decel: F32Like,
) -> F32:
    """Gap at which a follower can still stop behind a leader that brakes suddenly [m].

    follower_speed t + follower_speed^2 / (2 b_follower) - leader_speed^2 / (2 b_leader), or 0 if
    that is negative. The formula compares the two positions at standstill, so it is exact for equal
    decelerations. For a follower that brakes harder than its leader it can be too small, because
    the two could touch before they stand.

    Args:
        follower_speed: [m/s].
        leader_speed: [m/s].
        reaction_time: Time t before the follower brakes [s].
        follower_decel: Deceleration b_follower, positive [m/s^2].
        leader_decel: Deceleration b_leader, positive [m/s^2].

    Source:
        Maierhofer et al. (2020), Formalization of interstate traffic rules in temporal logic;
        Rizaldi et al. (2016), A formally verified checker of the safe distance traffic rules.
    """
    # The terms of `picud` with the signs reversed; the gap is 0.
    gap_after_stop = picud(
        ZERO,
        follower_speed,
        leader_speed,
        reaction_time=reaction_time,
        follower_decel=follower_decel,
        leader_decel=leader_decel,
    )
    return np.maximum(-gap_after_stop, ZERO)


def picud(
    gap: F32Like,
    follower_speed: F32Like,
    leader_speed: F32Like,
    *,
    reaction_time: F32Like,
    follower_decel: F32Like,
    leader_decel: F32Like,
) -> F32:
    """Gap between two vehicles that have stopped after sudden braking, PICUD [m].

    Where `safe_distance` is positive, this is the gap minus it. A negative result is unsafe.

    Args:
        gap: Gap when the leader begins to brake [m].
        follower_speed: [m/s].
        leader_speed: [m/s].
        reaction_time: Time before the follower brakes [s].
        follower_decel: Positive [m/s^2].
        leader_decel: Positive [m/s^2].

    Source:
        Uno, Iida, Itsubo, Yasuhara (2002), A microscopic analysis of traffic conflict caused by
        lane-changing vehicle at weaving section.
    """
    # NumPy returns a scalar for operations on single numbers; `as_f32` makes it an array, as the
    # other functions return.
    stopping = follower_speed * (reaction_time + follower_speed / (TWO * follower_decel))
    return as_f32(gap - stopping + leader_speed * leader_speed / (TWO * leader_decel))


def rss_safe_gap(
    follower_speed: F32Like,
    leader_speed: F32Like,
    *,
    reaction_time: F32Like,
    accel: F32Like,
    follower_decel: F32Like,
    leader_decel: F32Like,
) -> F32:
    """Safe gap of responsibility-sensitive safety (RSS) in the same direction [m].

    Unlike `safe_distance` it assumes that the follower accelerates during its reaction time.

    Args:
        follower_speed: [m/s].
        leader_speed: [m/s].
        reaction_time: Time during which the follower may still accelerate [s].
        accel: Acceleration of the follower during that time, 0 or more [m/s^2].
        follower_decel: Weakest braking of the follower after that time, positive [m/s^2].
        leader_decel: Strongest braking of the leader, positive [m/s^2].

    Source:
        Shalev-Shwartz, Shammah, Shashua (2017), arXiv:1708.06374, Lemma 2.
    """
    speed_reached = follower_speed + reaction_time * accel
    reaction_distance = (follower_speed + HALF * accel * reaction_time) * reaction_time
    braking_distance = speed_reached * speed_reached / (TWO * follower_decel)
    leader_distance = leader_speed * leader_speed / (TWO * leader_decel)
    return np.maximum(reaction_distance + braking_distance - leader_distance, ZERO)
