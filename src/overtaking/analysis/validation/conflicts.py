"""Hard braking, and near-crashes: little time to collision and a hard reaction to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.validation.places import Moments, next_to
from overtaking.analysis.validation.traffic import limit
from overtaking.model.trajectories import NO_VEHICLE

if TYPE_CHECKING:
    from overtaking.analysis.validation.tally import Array, Tally
    from overtaking.analysis.validation.traffic import Batch


def count(tally: Tally, batch: Batch) -> None:
    """Add the episodes of hard braking and the near-crashes of a batch."""
    at = reactions(batch)
    braking = batch.runs.states.accel_lon[at.place]
    for name in ("hard_braking", "very_hard_braking"):
        _add(tally, batch, name, episodes(at.where(braking < -1e3 * limit(name)), batch.interval_s))
    _add(tally, batch, "near_crashes", near_crashes(batch, at))


def reactions(batch: Batch, vehicles: slice = slice(None)) -> Moments:
    """All moments in which some vehicles brake or steer hard, by simulation, vehicle and frame."""
    states = batch.runs.states
    along = states.accel_lon[:, vehicles] < -1e3 * limit("hard_braking")
    across = np.abs(states.accel_lat[:, vehicles].astype(np.int32)) > 1e3 * limit("hard_steering")
    simulation, vehicle, frame = np.nonzero(batch.sound[:, vehicles] & (along | across))
    return Moments(simulation=simulation, vehicle=vehicle + (vehicles.start or 0), frame=frame)


def near_crashes(batch: Batch, at: Moments) -> Moments:
    """The first moments of the near-crashes among hard reactions."""
    near = at.where(_time_to_collision(batch, at) < limit("near_crash_ttc"))
    near = episodes(near, batch.interval_s)
    return near.where(~_ends_in_contact(batch, near))


def episodes(at: Moments, interval_s: float) -> Moments:
    """The first moment of each episode: close moments of one vehicle are one episode.

    Args:
        at: Moments, growing by simulation, vehicle and frame.
        interval_s: Time between frames [s].
    """
    gap = round(limit("same_episode") / interval_s)
    apart = np.ones(len(at.frame), np.bool_)
    apart[1:] = (
        (np.diff(at.simulation) != 0) | (np.diff(at.vehicle) != 0) | (np.diff(at.frame) > gap)
    )
    return at.where(apart)


def _add(tally: Tally, batch: Batch, name: str, at: Moments) -> None:
    weight = batch.weight[at.simulation]
    tally.add(name, batch.group[at.simulation], weight)
    tally.add(f"{name}_squares", batch.group[at.simulation], weight**2)


def _time_to_collision(batch: Batch, at: Moments) -> Array:
    """Time to the leader in the lane at the present speeds, infinite without one [s]."""
    speed = batch.runs.states.speed
    gap, slot = next_to(batch, at, batch.runs.states.lane[at.place], ahead=True)
    closing = 1e-3 * (speed[at.place] - speed[at.simulation, slot, at.frame].astype(np.float64))
    return np.where(closing > 0.0, np.maximum(gap, 0.0) / np.maximum(closing, 1e-6), np.inf)


def _ends_in_contact(batch: Batch, at: Moments) -> Array:
    """Whether the vehicle touches another within the next seconds: an accident, no near one."""
    contacts, pair = batch.runs.contacts, (at.simulation, at.vehicle)
    left = 1e-3 * contacts.time[pair] - at.frame * batch.interval_s
    return (contacts.partner[pair] != NO_VEHICLE) & (left < limit("accident_follows"))
