"""The ego's own lane changes by the criteria that UN Regulations 79 and 157 give for systems.

A lane change manoeuvre begins when the body comes over the line. Whoever approaches from behind in
the new lane must need no more than 3 m/s^2 of braking (R79, 5.6.4.7), or 3.7 m/s^2 (R157), 0.4 s
after that, to keep as far behind as the ego drives in 1 s.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.validation.changes import Measured, lane_changes, measure
from overtaking.analysis.validation.places import Moments, next_to
from overtaking.knowledge.toml_reader import number
from overtaking.model.trajectories import Lights

if TYPE_CHECKING:
    from overtaking.analysis.validation.tally import Array
    from overtaking.analysis.validation.traffic import Batch


def of(name: str) -> float:
    """A number of `evaluation.toml`, SI."""
    return number(f"evaluation.{name}")


def columns(batch: Batch) -> dict[str, Array]:
    """How many lane changes each ego made from begin to end, and which miss a criterion."""
    is_ego = (np.arange(batch.sound.shape[1]) == 0)[:, None]
    made = measure(batch, lane_changes(batch, batch.sound & is_ego))
    there = ~np.isnan(made.crossing)
    needed = np.where(there, follower_braking(batch, made), 0.0)
    shown = indicated(batch, made)
    before_moving = (made.begin - shown) * batch.interval_s
    before_line = (made.over - shown) * batch.interval_s
    timely = (before_line >= of("change.line_after_least")) & (
        before_line <= of("change.line_after_most")
    )
    missed = {
        "changes": there,
        "forced_3": needed > of("change.braking_r79"),
        "forced_37": needed > of("change.braking_r157"),
        "early": there & (before_moving < of("change.signal_before")),
        "untimely": there & ~timely,
        "long": there & (made.crossing >= of("change.longest")),
    }
    simulation, scenes = made.of.at.simulation, len(batch.weight)
    return {
        name: np.bincount(simulation, one.astype(np.float64), minlength=scenes)
        for name, one in missed.items()
    }


def follower_braking(batch: Batch, made: Measured) -> Array:
    """The braking that the vehicle behind in the new lane needs, 0 without one [m/s^2].

    Infinite where the room is gone before it brakes.
    """
    found = made.of.at
    at = Moments(simulation=found.simulation, vehicle=found.vehicle, frame=made.over)
    gap, slot = next_to(batch, at, made.of.after, ahead=False)
    speed = 1e-3 * batch.runs.states.speed
    own = speed[at.place]
    behind = np.minimum(speed[at.simulation, slot, at.frame], of("change.fastest"))
    return needed_braking(gap, own, behind)


def needed_braking(gap: Array, own: Array, behind: Array) -> Array:
    """The braking of R79, 5.6.4.7, solved for the deceleration [m/s^2].

    Args:
        gap: Between the bumpers, infinite without a vehicle behind [m].
        own: Speed of the one that changes lanes [m/s].
        behind: Speed of the one behind [m/s].
    """
    faster = np.maximum(behind - own, 0.0)
    room = gap - faster * of("change.reaction") - own * of("change.time_gap")
    least = np.where(faster > 0.0, np.inf, 0.0)
    return np.where(room > 0.0, faster**2 / (2.0 * np.maximum(room, 1e-6)), least)


def indicated(batch: Batch, made: Measured) -> Array:
    """The frame since which the indicator has been on when the body comes over the line.

    That frame itself where it is off then.
    """
    found = made.of
    fast = np.where(found.after > found.before, 1, -1) * batch.runs.road.overtaking_sign > 0
    light = np.where(fast, Lights.INDICATOR_LEFT, Lights.INDICATOR_RIGHT)
    first = np.array(made.over, np.int64)
    lights = batch.runs.states.lights[:, 0]
    for place, (simulation, over, bit) in enumerate(
        zip(found.at.simulation, made.over, light, strict=True)
    ):
        off = np.flatnonzero((lights[simulation, : over + 1] & bit) == 0)
        first[place] = off[-1] + 1 if len(off) else 0
    return first
