"""Margins at single instants: to the vehicle ahead, and to a stop in the distance that is seen."""

import numpy as np

from overtaking.core.elementary import F32, as_f32
from overtaking.labels.features.encounters import Index
from overtaking.labels.law.distances import margin_of_gap, sure_decel
from overtaking.model.labels import Case
from overtaking.model.safety import Encounter
from overtaking.model.signals import Around
from overtaking.model.vehicles import Role
from overtaking.world.constants import known
from overtaking.world.friction import stopping_distance
from overtaking.world.measures import headway, picud, rss_longitudinal


def front_margins(case: Case, front: Encounter, rows: Index, frames: Index) -> dict[str, F32]:
    """What else there is to say of the vehicle ahead."""
    seen = case.signals
    speed, slot = seen.speed[rows, frames], seen.vehicle[rows, Around.LEADER, frames]
    length = case.trajectories.scenario.vehicles.length[rows, np.where(front.valid, slot, Role.EGO)]
    lead_speed = speed - front.closing_speed
    decel = known("labels.safety.picud_decel")
    safe = rss_longitudinal(
        speed,
        lead_speed,
        reaction_time=known("law.rss.reaction_time"),
        accel=known("law.rss.accel"),
        rear_decel=known("law.rss.rear_decel"),
        lead_decel=known("law.rss.lead_decel"),
    )
    return {
        "headway": headway(front.gap, length, speed),
        "picud": picud(
            front.gap,
            speed,
            lead_speed,
            reaction_time=known("labels.safety.picud_reaction_time"),
            rear_decel=decel,
            lead_decel=decel,
        ),
        "rss_margin": front.gap - safe,
        "lawful_margin": margin_of_gap(
            front.gap, speed, front.closing_speed, sure_decel(seen.friction[rows, frames])
        ),
    }


def stop_margins(speed: F32, friction: F32, lit: F32, unlit: F32) -> dict[str, F32]:
    """Distance at which something is seen minus the stopping distance [m].

    Args:
        speed: Of the ego [m/s].
        friction: Peak friction under it, same shape [1].
        lit: Distance at which a lit vehicle is seen, same shape [m].
        unlit: Distance at which an unlit one is seen, same shape [m].
    """
    # Beyond the end of a recording there is no friction, and none of this counts.
    grip = np.maximum(friction, known("friction.table.floor"))
    decel = known("friction.table.usable_share") * known("model.nature.gravity") * grip
    stop = stopping_distance(speed, as_f32(known("law.sight.reaction_time")), decel)
    return {"stop_margin_lit": lit - stop, "stop_margin_unlit": unlit - stop}
