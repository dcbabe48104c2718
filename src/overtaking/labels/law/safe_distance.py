"""Lawful gaps with their numbers, decelerations, and the gap between two neighbours."""

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
"""Margin from gap, speed of the ego, closing speed and sure deceleration."""

GRIP_DECEL = f"{load_quantity('friction.table.usable_share').bare()} mu g"
"""`decel_with_all_grip` as a formula."""

REACTION_AND_DECEL = f"t = {REACTION_TIME}, b = min({MAX_DECEL}, {GRIP_DECEL})"
"""Reaction time and deceleration of the safe distance, with `decel_for_safe_distance`."""


def decel_for_safe_distance(friction: F32) -> F32:
    """Deceleration that both vehicles are thought capable of on the ego's friction [m/s^2]."""
    # Beyond the end of a recording there is no friction, and none of this counts.
    return assumed_decel(
        np.maximum(friction, constant("friction.table.floor")),
        share=constant("friction.table.usable_share"),
        limit=MAX_DECEL.f32,
        gravity=constant("model.nature.gravity"),
    )


def decel_with_all_grip(friction: F32) -> F32:
    """Deceleration with all the grip that a driver may count on, for rules about sight [m/s^2]."""
    grip = np.maximum(friction, constant("friction.table.floor"))
    return constant("friction.table.usable_share") * constant("model.nature.gravity") * grip


def stopping_distance_for_sight(speed: F32, friction: F32) -> F32:
    """Distance in which the ego stops for an obstacle that comes into sight [m]."""
    return stopping_distance(
        speed, as_f32(STOPPING_REACTION_TIME.f32), decel_with_all_grip(friction)
    )


def lawful_gap(rear_speed: F32Like, closing_speed: F32Like, decel: F32) -> F32:
    """Gap that Article 18(1) asks of the vehicle behind [m].

    Args:
        rear_speed: Of the vehicle behind [m/s].
        closing_speed: Its speed minus the speed of the vehicle ahead [m/s].
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
    """Margin of the ego's gap to the vehicle ahead: lawful [m]."""
    return gap - lawful_gap(speed, closing_speed, decel)


def entry_margin_ahead(
    gap: F32, speed: F32, closing_speed: F32, decel: F32, min_ttc: np.float32 = ENTRY_TTC.f32
) -> F32:
    """Margin of a gap to the vehicle ahead: lawful, and no collision for some time [m].

    The time to collision is at least `min_ttc` where the gap is at least `min_ttc` of closing
    speed.

    Args:
        gap: [m].
        speed: Of the ego [m/s].
        closing_speed: Of the ego [m/s].
        decel: `decel_for_safe_distance` [m/s^2].
        min_ttc: Smallest lawful time to collision [s].
    """
    distance_to_collision = min_ttc * closing_speed
    return gap - np.maximum(lawful_gap(speed, closing_speed, decel), distance_to_collision)


def entry_margin_behind(gap: F32, speed: F32, closing_speed: F32, decel: F32) -> F32:
    """Margin of a gap to the vehicle behind: lawful for it, and no abrupt braking [m].

    Args:
        gap: [m].
        speed: Of the ego [m/s].
        closing_speed: Of the vehicle behind [m/s].
        decel: `decel_for_safe_distance` [m/s^2].
    """
    approach = np.maximum(closing_speed, np.float32(0.0))
    # Braking of v^2 / (2 gap) is within the limit where the gap is at least v^2 / (2 limit).
    braking_distance = approach * approach / (np.float32(2.0) * ABRUPT_BRAKING.f32)
    return gap - np.maximum(
        lawful_gap(speed + closing_speed, closing_speed, decel), braking_distance
    )


def gap_in_right_lane(case: Case, frame: Frames) -> F32:
    """Room for the ego in the lane to its right, negative where it is taken, (simulation,) [m].

    The smallest of three margins: to the safe distances ahead and behind, and to the gap at which
    the vehicle ahead is reached in `RETURN_FREE_TIME`; at most `RETURN_RANGE` either way. A lane
    that does not exist counts as empty.

    Args:
        case: The batch.
        frame: A frame of each simulation; at `NEVER` the lane counts as empty.
    """
    speed, decel = (
        at_frame(case.signals.speed, frame),
        decel_for_safe_distance(at_frame(case.signals.friction, frame)),
    )
    ahead = neighbour_at(case, NeighbourRole.RIGHT_LEADER, frame)
    behind = neighbour_at(case, NeighbourRole.RIGHT_FOLLOWER, frame)
    return gap_between(speed, decel, ahead, behind)


def gap_between(speed: F32, decel: F32, ahead: Encounter, behind: Encounter) -> F32:
    """Room between two neighbours, as in `gap_in_right_lane` [m].

    Args:
        speed: Of the ego [m/s].
        decel: `decel_for_safe_distance` [m/s^2].
        ahead: The neighbour ahead.
        behind: The neighbour behind.
    """
    max_margin = RETURN_RANGE.f32
    distance_in_free_time = RETURN_FREE_TIME.f32 * ahead.closing_speed
    gap_ahead = maximum(lawful_gap(speed, ahead.closing_speed, decel), distance_in_free_time)
    gap_behind = lawful_gap(speed + behind.closing_speed, behind.closing_speed, decel)
    margin = np.full(len(speed), max_margin, np.float32)
    margin = np.where(ahead.valid, minimum(margin, ahead.gap - gap_ahead), margin)
    margin = np.where(behind.valid, minimum(margin, behind.gap - gap_behind), margin)
    return clamp(margin, -max_margin, max_margin)


def stop_margins(speed: F32, friction: F32, lit: F32, unlit: F32) -> dict[str, F32]:
    """Distance at which something is seen minus the stopping distance [m].

    Args:
        speed: Of the ego [m/s].
        friction: Peak friction under it, same shape [1].
        lit: Distance at which a lit vehicle is seen, same shape [m].
        unlit: Distance at which an unlit one is seen, same shape [m].
    """
    stop = stopping_distance_for_sight(speed, friction)
    return {"stop_margin_lit": lit - stop, "stop_margin_unlit": unlit - stop}
