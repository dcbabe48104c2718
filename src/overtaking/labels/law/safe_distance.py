"""Gaps that the law demands ahead and behind, their margins, and stopping distances.

A margin is a gap minus the gap that the law demands, negative in a breach. Gaps are measured
between bumpers. All arrays of a call have the same shape.
"""

from collections.abc import Callable

import numpy as np

from overtaking.core.arrays import F32, F32Like
from overtaking.core.float32_math import as_f32, clamp, maximum, minimum
from overtaking.knowledge.toml_reader import constant, load_quantity
from overtaking.labels.law.case import neighbour_at
from overtaking.labels.law.numbers import (
    ABRUPT_BRAKING,
    ENTRY_TTC,
    MAX_DECEL,
    REACTION_TIME,
    RETURN_FREE_TIME,
    RETURN_RANGE,
    STOPPING_REACTION_TIME,
)
from overtaking.labels.snapshots import Frames, at_frame
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.safety_measures import Encounter
from overtaking.model.verdicts import Case
from overtaking.world.road_surface import stopping_distance
from overtaking.world.surrogate_safety import assumed_decel, safe_distance

GapMargin = Callable[[F32, F32, F32, F32], F32]
"""Margin of a gap [m] as a function of four arrays.

They are the gap to the other vehicle [m], the speed of the ego [m/s], the closing speed, positive
while the gap shrinks [m/s], and `decel_for_safe_distance` [m/s^2].
"""

GRIP_DECEL = f"{load_quantity('friction.table.usable_share').bare()} mu g"
"""`decel_with_all_grip` as a formula, such as `0.9 mu g`, for the predicates of rules."""

REACTION_AND_DECEL = f"t = {REACTION_TIME}, b = min({MAX_DECEL}, {GRIP_DECEL})"
"""Reaction time and deceleration of the safe distance, for the predicates of rules."""


def decel_for_safe_distance(friction: F32) -> F32:
    """Deceleration that the safe distance assumes for both vehicles [m/s^2].

    Args:
        friction: Peak friction under the ego [1].
    """
    # Frames after the end of a recording have friction 0. The floor avoids a division by 0 there;
    # the results are not used.
    return assumed_decel(
        np.maximum(friction, constant("friction.table.floor")),
        share=constant("friction.table.usable_share"),
        limit=MAX_DECEL.f32,
        gravity=constant("model.nature.gravity"),
    )


def decel_with_all_grip(friction: F32) -> F32:
    """Deceleration with all usable friction, for rules about sight [m/s^2].

    A choice: it may exceed `MAX_DECEL`, 8 m/s^2, as 0.9 mu g does for a friction mu above 0.9.

    Args:
        friction: Peak friction under the ego [1].
    """
    grip = np.maximum(friction, constant("friction.table.floor"))
    return constant("friction.table.usable_share") * constant("model.nature.gravity") * grip


def stopping_distance_for_sight(speed: F32, friction: F32) -> F32:
    """Distance in which the ego stops for an obstacle that comes into sight [m].

    Args:
        speed: Speed of the ego [m/s].
        friction: Peak friction under the ego [1].
    """
    return stopping_distance(
        speed, as_f32(STOPPING_REACTION_TIME.f32), decel_with_all_grip(friction)
    )


def lawful_gap(rear_speed: F32Like, closing_speed: F32Like, decel: F32) -> F32:
    """Safe distance of a vehicle to the vehicle ahead [m].

    The Portuguese Article 18(1) demands enough distance and states no number; the numbers are
    choices.

    Args:
        rear_speed: Speed of the vehicle behind [m/s].
        closing_speed: Speed of the vehicle behind minus speed of the vehicle ahead [m/s].
        decel: `decel_for_safe_distance` [m/s^2].
    """
    return safe_distance(
        rear_speed,
        rear_speed - closing_speed,
        reaction_time=REACTION_TIME.f32,
        follower_decel=decel,
        leader_decel=decel,
    )


def margin_to_leader(gap: F32, speed: F32, closing_speed: F32, decel: F32) -> F32:
    """Gap to the vehicle ahead minus the safe distance [m]; a `GapMargin`."""
    return gap - lawful_gap(speed, closing_speed, decel)


def entry_margin_ahead(
    gap: F32, speed: F32, closing_speed: F32, decel: F32, min_ttc: np.float32 = ENTRY_TTC.f32
) -> F32:
    """Margin of a gap to the vehicle ahead in a lane that the ego enters [m]; a `GapMargin`.

    The gap must be at least the safe distance, and the time to collision at least `min_ttc` [s].
    """
    gap_for_ttc = min_ttc * closing_speed
    return gap - np.maximum(lawful_gap(speed, closing_speed, decel), gap_for_ttc)


def entry_margin_behind(gap: F32, speed: F32, closing_speed: F32, decel: F32) -> F32:
    """Margin of a gap to the vehicle behind in a lane that the ego enters [m]; a `GapMargin`.

    The gap must be at least the safe distance of the vehicle behind, which must not have to brake
    harder than `ABRUPT_BRAKING`.
    """
    positive_closing_speed = np.maximum(closing_speed, np.float32(0.0))
    # The vehicle behind must brake by v^2 / (2 gap), with the closing speed v. It needs no abrupt
    # braking if the gap is at least v^2 / (2 ABRUPT_BRAKING).
    braking_distance = (
        positive_closing_speed * positive_closing_speed / (np.float32(2.0) * ABRUPT_BRAKING.f32)
    )
    return gap - np.maximum(
        lawful_gap(speed + closing_speed, closing_speed, decel), braking_distance
    )


def gap_in_right_lane(case: Case, frame: Frames) -> F32:
    """Margin of the gap in the lane to the ego's right, negative where it is too small [m].

    It is the smallest of three margins: the gap behind minus the safe distance of the vehicle
    behind, the gap ahead minus the safe distance of the ego, and the gap ahead minus the distance
    by which it shrinks in `RETURN_FREE_TIME`. It lies between plus and minus `RETURN_RANGE`. A lane
    that does not exist counts as empty.

    Args:
        case: The batch.
        frame: A frame of each simulation, shape (simulation,); at `NEVER` (-1), no frame, the lane
            counts as empty.
    """
    speed = at_frame(case.signals.speed, frame)
    decel = decel_for_safe_distance(at_frame(case.signals.friction, frame))
    ahead = neighbour_at(case, NeighbourRole.RIGHT_LEADER, frame)
    behind = neighbour_at(case, NeighbourRole.RIGHT_FOLLOWER, frame)
    return gap_between(speed, decel, ahead, behind)


def gap_between(speed: F32, decel: F32, ahead: Encounter, behind: Encounter) -> F32:
    """Margin of the gap between two neighbours in a lane, as in `gap_in_right_lane` [m].

    Args:
        speed: Speed of the ego [m/s].
        decel: `decel_for_safe_distance` [m/s^2].
        ahead: The neighbour ahead; its gap counts where it is `valid`.
        behind: The neighbour behind, likewise.
    """
    max_margin = RETURN_RANGE.f32
    gap_for_free_time = RETURN_FREE_TIME.f32 * ahead.closing_speed
    # The compiled engine also computes this margin, but not the entry margins above. Both results
    # must have the same bits, also for NaN and signed zeros, which NumPy's `maximum` and `minimum`
    # may treat in another way than the engine; the functions of this package do not.
    min_gap_ahead = maximum(lawful_gap(speed, ahead.closing_speed, decel), gap_for_free_time)
    min_gap_behind = lawful_gap(speed + behind.closing_speed, behind.closing_speed, decel)
    margin = np.full(len(speed), max_margin, np.float32)
    margin = np.where(ahead.valid, minimum(margin, ahead.gap - min_gap_ahead), margin)
    margin = np.where(behind.valid, minimum(margin, behind.gap - min_gap_behind), margin)
    return clamp(margin, -max_margin, max_margin)


def stop_margins(speed: F32, friction: F32, lit: F32, unlit: F32) -> dict[str, F32]:
    """Sight distances minus the stopping distance [m].

    Args:
        speed: Speed of the ego [m/s].
        friction: Peak friction under the ego, same shape [1].
        lit: Distance at which the driver sees a lit vehicle, same shape [m].
        unlit: Distance at which the driver sees an unlit vehicle, same shape [m].

    Returns:
        Margins to a lit and to an unlit vehicle, `stop_margin_lit` and `stop_margin_unlit`.
    """
    stop = stopping_distance_for_sight(speed, friction)
    return {"stop_margin_lit": lit - stop, "stop_margin_unlit": unlit - stop}
