"""Surrogate measures of safety for a follower behind a leader: times, distances, decelerations.

`gap` is from bumper to bumper and negative while the two overlap; `closing_speed` is positive while
the gap shrinks. Every function takes arrays that broadcast and returns float32. The time of an
event that never happens is infinite.
"""

import numpy as np

from overtaking.core.arrays import F32, F32Like, Mask
from overtaking.core.float32_math import HALF, ONE, TWO, ZERO, as_f32

_NEVER = np.float32(np.inf)

_MIN_SPEED = np.float32(1e-20)
"""Slower vehicles count as standing: a gap divided by less would overflow float32 [m/s]."""


def time_gap(gap: F32Like, speed: F32Like) -> F32:
    """Time in which a follower covers the gap to its leader at its speed [s].

    Args:
        gap: [m].
        speed: Speed of the follower [m/s].

    Returns:
        gap / speed; 0 where the two overlap, infinite at a standstill.
    """
    is_moving = speed > _MIN_SPEED
    time = np.maximum(gap, ZERO) / np.where(is_moving, speed, ONE)
    return np.where(is_moving | (gap <= 0), time, _NEVER)


def time_headway(gap: F32Like, leader_length: F32Like, speed: F32Like) -> F32:
    """Time between the two front bumpers at a point of the road, THW [s].

    Args:
        gap: [m].
        leader_length: Length of the leader [m].
        speed: Speed of the follower [m/s].
    """
    return time_gap(gap + leader_length, speed)


def ttc(gap: F32Like, closing_speed: F32Like) -> F32:
    """Time to collision at constant speeds, TTC [s].

    Args:
        gap: [m].
        closing_speed: [m/s].

    Returns:
        gap / closing_speed; 0 where the two overlap, infinite if the gap does not shrink.

    Source:
        Hayward (1972), Near-miss determination through use of a scale of danger.
    """
    is_closing = closing_speed > _MIN_SPEED
    time = np.maximum(gap, ZERO) / np.where(is_closing, closing_speed, ONE)
    return np.where(is_closing | (gap <= 0), time, _NEVER)


def mttc(gap: F32Like, closing_speed: F32Like, closing_accel: F32Like) -> F32:
    """Time to collision at constant accelerations, MTTC [s].

    The first t > 0 with closing_accel t^2 / 2 + closing_speed t = gap; 0 where the two overlap,
    infinite if the equation has no such solution. A braking vehicle continues backwards after its
    standstill, as in the source.

    Args:
        gap: [m].
        closing_speed: [m/s].
        closing_accel: Acceleration of the follower minus acceleration of the leader [m/s^2].

    Source:
        Ozbay, Yang, Bartin, Mudigonda (2008), TRB 2083, 105-113.
    """
    distance = np.maximum(gap, ZERO)
    square = closing_speed * closing_speed + TWO * closing_accel * distance
    root = np.sqrt(np.maximum(square, ZERO))
    # Of the two forms of the solution, take the one that adds two numbers of the same sign: the
    # other subtracts nearly equal numbers and loses digits.
    is_opening = closing_speed < 0
    denominator = np.where(is_opening, closing_accel, closing_speed + root)
    numerator = np.where(is_opening, root - closing_speed, TWO * distance)
    has_solution = (square >= 0) & (denominator > _MIN_SPEED)
    time = numerator / np.where(has_solution, denominator, ONE)
    return np.where(gap <= 0, ZERO, np.where(has_solution, time, _NEVER))


def drac(gap: F32Like, closing_speed: F32Like) -> F32:
    """Deceleration that just avoids a collision with a steady leader, DRAC [m/s^2].

    Args:
        gap: [m].
        closing_speed: [m/s].

    Returns:
        closing_speed^2 / (2 gap); 0 if the gap does not shrink, infinite where it shrinks while the
        two overlap.

    Source:
        Cooper and Ferguson (1976), via AASHTO's comfortable 3.4 m/s^2 as a usual threshold.
    """
    approach = np.maximum(closing_speed, ZERO)
    has_gap = gap > 0
    decel = approach * approach / (TWO * np.where(has_gap, gap, ONE))
    return np.where(has_gap | (approach == 0), decel, _NEVER)


def is_ttc_critical(time_to_collision: F32Like, threshold: F32Like) -> Mask:
    """Whether a time to collision counts as exposure: above 0, at most the threshold.

    The duration of the frames for which this is true is the time exposed, TET.

    Args:
        time_to_collision: [s].
        threshold: [s].

    Source:
        Minderhoud and Bovy (2001), Extended time-to-collision measures for road traffic safety
        assessment, Accident Analysis and Prevention 33(1), 89-97.
    """
    return np.asarray((time_to_collision > 0) & (time_to_collision <= threshold), dtype=np.bool_)


def ttc_shortfall(time_to_collision: F32Like, threshold: F32Like) -> F32:
    """Threshold minus a critical time to collision, 0 if the time is not critical [s].

    The integral over time is the time integrated, TIT.

    Args:
        time_to_collision: [s].
        threshold: [s].

    Source:
        Minderhoud and Bovy (2001), as `is_ttc_critical`.
    """
    is_critical = is_ttc_critical(time_to_collision, threshold)
    return np.where(is_critical, threshold - np.where(is_critical, time_to_collision, ZERO), ZERO)


def looming(gap: F32Like, closing_speed: F32Like, width: F32Like) -> F32:
    """Speed at which the visual angle of the leader's rear grows [rad/s].

    The derivative of the angle 2 atan(width / (2 gap)), negative while the angle shrinks, and 0
    where the two overlap: the follower then sees no rear.

    Args:
        gap: Distance between the follower's eye and the leader's rear [m].
        closing_speed: [m/s].
        width: Width of the rear [m].

    Source:
        Hoffmann and Mortimer (1996), Scaling of relative velocity between vehicles.
    """
    distance = np.maximum(gap, ZERO)
    square = distance * distance + HALF * HALF * width * width
    return np.where(gap > 0, width * closing_speed / np.maximum(square, _MIN_SPEED), ZERO)


def assumed_decel(friction: F32Like, *, share: F32Like, limit: F32Like, gravity: F32Like) -> F32:
    """Deceleration that a careful driver may count on: min(limit, share mu g) [m/s^2].

    Args:
        friction: Friction coefficient mu of tyres and road [1].
        share: Share of the friction that the driver uses [1].
        limit: Largest deceleration [m/s^2].
        gravity: [m/s^2].
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

    follower_speed t + follower_speed^2 / (2 b_follower) - leader_speed^2 / (2 b_leader), never
    negative. The formula compares the two positions at standstill, so it is exact for equal
    decelerations. A follower that brakes harder than its leader could touch it before both stand.

    Args:
        follower_speed: [m/s].
        leader_speed: [m/s].
        reaction_time: Time before the follower brakes [s].
        follower_decel: Positive [m/s^2].
        leader_decel: Positive [m/s^2].

    Source:
        Maierhofer et al. (2020), Formalization of interstate traffic rules in temporal logic;
        Rizaldi et al. (2016), A formally verified checker of the safe distance traffic rules.
    """
    return np.maximum(
        -picud(
            ZERO,
            follower_speed,
            leader_speed,
            reaction_time=reaction_time,
            follower_decel=follower_decel,
            leader_decel=leader_decel,
        ),
        ZERO,
    )


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

    It is the margin to `safe_distance` and has the same arguments. A negative gap is unsafe.

    Source:
        Uno, Iida, Itsubo, Yasuhara (2002), A microscopic analysis of traffic conflict caused by
        lane-changing vehicle at weaving section.
    """
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
    """Safe gap of responsibility-sensitive safety, same direction [m].

    Args:
        follower_speed: [m/s].
        leader_speed: [m/s].
        reaction_time: Time during which the follower may still accelerate [s].
        accel: Acceleration of the follower during that time [m/s^2].
        follower_decel: Deceleration that the follower reaches in any case [m/s^2].
        leader_decel: Largest deceleration of the leader [m/s^2].

    Source:
        Shalev-Shwartz, Shammah, Shashua (2017), arXiv:1708.06374, Lemma 2.
    """
    reached = follower_speed + reaction_time * accel
    reaction = (follower_speed + HALF * accel * reaction_time) * reaction_time
    stop = reached * reached / (TWO * follower_decel)
    return np.maximum(reaction + stop - leader_speed * leader_speed / (TWO * leader_decel), ZERO)
