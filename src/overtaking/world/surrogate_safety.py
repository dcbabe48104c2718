"""Measures of conflict between two vehicles: times, distances and decelerations.

One vehicle follows another along the road. `gap` is from bumper to bumper, negative while they
overlap; `closing_speed` is positive while the gap shrinks. Every function takes arrays that
broadcast and gives float32; what never happens takes an infinite time.
"""

import numpy as np

from overtaking.core.arrays import F32, F32Like, Mask
from overtaking.core.float32_math import as_f32

_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)
_TWO = np.float32(2.0)
_HALF = np.float32(0.5)
_NEVER = np.float32(np.inf)

_MIN_SPEED = np.float32(1e-20)
"""Nothing moves so slowly; a gap over less would overflow float32 [m/s]."""


def time_gap(gap: F32Like, speed: F32Like) -> F32:
    """Time until the rear bumper ahead is reached at one's own speed [s].

    Args:
        gap: [m].
        speed: Of the vehicle behind [m/s].

    Returns:
        gap / speed; 0 where they overlap, infinite at a standstill.
    """
    moving = speed > _MIN_SPEED
    time = np.maximum(gap, _ZERO) / np.where(moving, speed, _ONE)
    return np.where(moving | (gap <= 0), time, _NEVER)


def time_headway(gap: F32Like, leader_length: F32Like, speed: F32Like) -> F32:
    """Time between the two front bumpers at a point of the road, THW [s].

    Args:
        gap: [m].
        leader_length: Length of the vehicle ahead [m].
        speed: Of the vehicle behind [m/s].
    """
    return time_gap(gap + leader_length, speed)


def ttc(gap: F32Like, closing_speed: F32Like) -> F32:
    """Time to collision at constant speeds [s]; 0 where they overlap, infinite if not closing.

    Source:
        Hayward (1972), Near-miss determination through use of a scale of danger.
    """
    closing = closing_speed > _MIN_SPEED
    time = np.maximum(gap, _ZERO) / np.where(closing, closing_speed, _ONE)
    return np.where(closing | (gap <= 0), time, _NEVER)


def mttc(gap: F32Like, closing_speed: F32Like, closing_accel: F32Like) -> F32:
    """Time to collision at constant accelerations, MTTC [s].

    The first t > 0 with closing_accel t^2 / 2 + closing_speed t = gap; 0 where they overlap,
    infinite if there is none. A vehicle that has stopped is thought to go on backwards, as in the
    source.

    Args:
        gap: [m].
        closing_speed: [m/s].
        closing_accel: Acceleration of the vehicle behind minus that of the one ahead [m/s^2].

    Source:
        Ozbay, Yang, Bartin, Mudigonda (2008), TRB 2083, 105-113.
    """
    distance = np.maximum(gap, _ZERO)
    square = closing_speed * closing_speed + _TWO * closing_accel * distance
    root = np.sqrt(np.maximum(square, _ZERO))
    # Each form of the root where it loses no digits: the sum of two numbers of one sign.
    opening = closing_speed < 0
    below = np.where(opening, closing_accel, closing_speed + root)
    above = np.where(opening, root - closing_speed, _TWO * distance)
    meets = (square >= 0) & (below > _MIN_SPEED)
    time = above / np.where(meets, below, _ONE)
    return np.where(gap <= 0, _ZERO, np.where(meets, time, _NEVER))


def drac(gap: F32Like, closing_speed: F32Like) -> F32:
    """Deceleration that just avoids a collision with a steady leader, DRAC [m/s^2].

    Never negative: 0 if not closing, infinite where they overlap and close.

    Source:
        Cooper and Ferguson (1976), via AASHTO's comfortable 3.4 m/s^2 as a usual threshold.
    """
    approach = np.maximum(closing_speed, _ZERO)
    room = gap > 0
    needed = approach * approach / (_TWO * np.where(room, gap, _ONE))
    return np.where(room | (approach == 0), needed, _NEVER)


def is_ttc_critical(time_to_collision: F32Like, threshold: F32Like) -> Mask:
    """Whether a time to collision counts as exposure: above 0, at most `threshold` [s].

    The duration of the frames in which it does is the time exposed, TET.

    Source:
        Minderhoud and Bovy (2001), Extended time-to-collision measures for road traffic safety
        assessment, Accident Analysis and Prevention 33(1), 89-97.
    """
    return np.asarray((time_to_collision > 0) & (time_to_collision <= threshold), dtype=np.bool_)


def ttc_shortfall(time_to_collision: F32Like, threshold: F32Like) -> F32:
    """What a critical time to collision lacks to the threshold, else 0 [s].

    Its integral over time is the time integrated, TIT.

    Source:
        Minderhoud and Bovy (2001), as `is_critical`.
    """
    critical = is_ttc_critical(time_to_collision, threshold)
    return np.where(critical, threshold - np.where(critical, time_to_collision, _ZERO), _ZERO)


def looming(gap: F32Like, closing_speed: F32Like, width: F32Like) -> F32:
    """Speed at which the image of the rear of a vehicle ahead grows [rad/s].

    The derivative of its angle 2 atan(width / (2 gap)); negative while it shrinks. 0 where they
    overlap: there is no image of its rear then.

    Args:
        gap: From the eye to the rear [m].
        closing_speed: [m/s].
        width: Of the rear [m].

    Source:
        Hoffmann and Mortimer (1996), Scaling of relative velocity between vehicles.
    """
    room = np.maximum(gap, _ZERO)
    square = room * room + _HALF * _HALF * width * width
    return np.where(gap > 0, width * closing_speed / np.maximum(square, _MIN_SPEED), _ZERO)


def assumed_decel(friction: F32Like, *, share: F32Like, limit: F32Like, gravity: F32Like) -> F32:
    """Deceleration that a careful driver may count on: min(limit, share mu g) [m/s^2]."""
    return np.minimum(share * gravity * friction, limit)


def safe_distance(
    follower_speed: F32Like,
    leader_speed: F32Like,
    *,
    reaction_time: F32Like,
    follower_decel: F32Like,
    leader_decel: F32Like,
) -> F32:
    """Gap at which the rear vehicle can still stop behind one that brakes suddenly [m].

    follower_speed t + follower_speed^2 / (2 b_follower) - leader_speed^2 / (2 b_leader), never
    negative. It compares the places of standstill. So it is exact for equal decelerations; a rear
    vehicle that brakes harder than the leader could touch it on the way.

    Args:
        follower_speed: [m/s].
        leader_speed: [m/s].
        reaction_time: Before the rear vehicle brakes [s].
        follower_decel: Positive [m/s^2].
        leader_decel: Positive [m/s^2].

    Source:
        Maierhofer et al. (2020), Formalization of interstate traffic rules in temporal logic;
        Rizaldi et al. (2016), A formally verified checker of the safe distance traffic rules.
    """
    return np.maximum(
        -picud(
            _ZERO,
            follower_speed,
            leader_speed,
            reaction_time=reaction_time,
            follower_decel=follower_decel,
            leader_decel=leader_decel,
        ),
        _ZERO,
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
    """Gap that is left when both have stopped after sudden braking, PICUD [m]; negative: unsafe.

    Arguments as in `safe_distance`, to which it is the margin.

    Source:
        Uno, Iida, Itsubo, Yasuhara (2002), A microscopic analysis of traffic conflict caused by
        lane-changing vehicle at weaving section.
    """
    rear = follower_speed * (reaction_time + follower_speed / (_TWO * follower_decel))
    return as_f32(gap - rear + leader_speed * leader_speed / (_TWO * leader_decel))


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
        reaction_time: During which the rear vehicle may still accelerate [s].
        accel: Of the rear vehicle during that time [m/s^2].
        follower_decel: That the follower is sure to reach [m/s^2].
        leader_decel: Hardest braking of the leader [m/s^2].

    Source:
        Shalev-Shwartz, Shammah, Shashua (2017), arXiv:1708.06374, Lemma 2.
    """
    reached = follower_speed + reaction_time * accel
    reaction = (follower_speed + _HALF * accel * reaction_time) * reaction_time
    stop = reached * reached / (_TWO * follower_decel)
    return np.maximum(reaction + stop - leader_speed * leader_speed / (_TWO * leader_decel), _ZERO)
