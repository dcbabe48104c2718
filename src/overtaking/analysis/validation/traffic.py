"""Counts the traffic of all vehicles: distances, gaps, accelerations, lane changes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.validation.tally import GROUPS, Array, Tally
from overtaking.knowledge import number
from overtaking.model.trajectory import NO_VEHICLE, Trajectories

if TYPE_CHECKING:
    from numpy.typing import NDArray

EVERY_S = 0.5
"""Interval at which gaps and accelerations are counted [s]: they change little in between."""

GAP_BINS, GAP_WIDTH = 400, 0.01
"""Bins of time gaps [s]."""

CHANGE_BINS, CHANGE_WIDTH = 400, 0.05
"""Bins of the durations of lane changes [s]."""

ACCEL_BINS, ACCEL_WIDTH = 600, 0.02
"""Bins of the amount of the lateral acceleration [m/s^2]."""

USUAL_ACCEL = (-3000, 2000)
"""Limits of everyday longitudinal accelerations [mm/s^2]."""

LONGEST_CHANGE_S = 20.0
_SMOOTHING_S = 0.25  # Half of the window that a lateral speed is taken over.


def limit(name: str) -> float:
    """A limit of `validation.toml`, SI."""
    return number("validation.toml", f"limits.{name}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """A recorded batch, prepared for counting.

    Attributes:
        runs: The recordings.
        group: Group of each simulation.
        weight: Weight of each simulation.
        sound: Whether a vehicle is present and has had no contact yet, shape
            (simulation, vehicle, time).
        interval_s: Time between frames [s].
    """

    runs: Trajectories
    group: NDArray[np.int64]
    weight: NDArray[np.float64]
    sound: NDArray[np.bool_]
    interval_s: float

    @property
    def sampled(self) -> slice:
        """Every so many frames, in which gaps and accelerations are counted."""
        return slice(None, None, max(1, round(EVERY_S / self.interval_s)))

    @classmethod
    def of(cls, runs: Trajectories) -> Batch:
        """Prepare a batch."""
        contacts, scenario = runs.contacts, runs.scenario
        untouched = np.where(contacts.partner == NO_VEHICLE, np.iinfo(np.int32).max, contacts.time)
        before = runs.time_ms[None, None, :] < untouched[:, :, None]
        there = scenario.vehicles.valid[:, :, None] & runs.frame_valid[:, None, :]
        return cls(
            runs=runs,
            group=(scenario.index % np.uint64(GROUPS)).astype(np.int64),
            weight=scenario.weight,
            sound=there & before & (runs.states.lane < runs.road.num_lanes),
            interval_s=1e-3 * scenario.frame_interval_ms,
        )


def count(tally: Tally, batch: Batch) -> None:
    """Add a batch to a tally."""
    _distances(tally, batch)
    _following(tally, batch)
    count_changes(tally, batch, batch.sound)


def count_changes(tally: Tally, batch: Batch, counted: Array) -> None:
    """Add lane changes of the counted vehicles and frames, with durations and distances."""
    lane = batch.runs.states.lane
    crossed = (lane[:, :, 1:] != lane[:, :, :-1]) & counted[:, :, 1:] & counted[:, :, :-1]
    simulation, vehicle, frame = np.nonzero(crossed)
    group, weight = batch.group[simulation], batch.weight[simulation]
    tally.add("changes", group, weight)
    seconds, whole = _durations(batch, simulation, vehicle, frame)
    place = np.round(seconds[whole] / CHANGE_WIDTH)
    tally.add_binned("durations", group[whole], place, weight[whole], CHANGE_BINS)
    metres = np.where(counted, batch.runs.states.speed, 0).sum(axis=(1, 2), dtype=np.float64)
    tally.add("metres", batch.group, batch.weight * 1e-3 * metres * batch.interval_s)


def _durations(
    batch: Batch, simulation: Array, vehicle: Array, frame: Array
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Duration of each sideways motion [s], and whether it was recorded from begin to end."""
    reach = round(LONGEST_CHANGE_S / batch.interval_s)
    half = max(1, round(_SMOOTHING_S / batch.interval_s))
    last = batch.runs.num_frames[simulation] - 1
    at = frame[:, None] + np.arange(-reach, reach + 1)[None, :]
    d = batch.runs.states.d[simulation[:, None], vehicle[:, None], np.clip(at, 0, last[:, None])]
    sideways = np.zeros(d.shape)
    sideways[:, half:-half] = (d[:, 2 * half :] - d[:, : -2 * half]) / (
        2e3 * half * batch.interval_s
    )
    towards = np.sign(sideways[:, reach])
    still = sideways * towards[:, None] < limit("moving_aside")
    before = np.argmax(still[:, reach::-1], axis=1)
    after = np.argmax(still[:, reach:], axis=1)
    begin, end = frame - before, frame + after
    whole = (towards != 0) & (before > 0) & (after > 0) & (begin > half) & (end < last - half)
    return (before + after - 1) * batch.interval_s, whole


def _distances(tally: Tally, batch: Batch) -> None:
    """Add vehicle-frames, accelerations and contacts."""
    states, sound = batch.runs.states, batch.sound
    seen = sound[:, :, batch.sampled]
    simulation = np.nonzero(seen)[0]
    lateral = np.abs(states.accel_lat[:, :, batch.sampled][seen].astype(np.int64))
    place = (1e-3 / ACCEL_WIDTH * lateral).astype(np.int64)
    group, weight = batch.group[simulation], batch.weight[simulation]
    tally.add_binned("lateral", group, place, weight, ACCEL_BINS)
    hardest = 1e3 * limit("hardest")
    along, across = (values.astype(np.float32) for values in (states.accel_lon, states.accel_lat))
    impossible = (along * along + across * across > hardest**2) & batch.runs.frame_valid[:, None]
    tally.add("impossible", batch.group, batch.weight * impossible.any(axis=(1, 2)))
    tally.add("simulations", batch.group, batch.weight)
    touched = (batch.runs.contacts.partner != NO_VEHICLE) & batch.runs.scenario.vehicles.valid
    tally.add("contacts", batch.group, batch.weight * 0.5 * touched.sum(axis=1))


def _following(tally: Tally, batch: Batch) -> None:
    """Add time gaps, times to collision, and whether accelerations are usual."""
    states = batch.runs.states
    speed = 1e-3 * _by_frame(states.speed, batch.sampled)
    accel, sound = (_by_frame(one, batch.sampled) for one in (states.accel_lon, batch.sound))
    gap, closing = _leaders(batch, batch.sampled)
    group, weight = (
        np.broadcast_to(one[:, None, None], sound.shape) for one in (batch.group, batch.weight)
    )
    time = gap / np.maximum(speed, 1.0)
    behind = sound & (time < limit("fastest_gap_time"))
    critical = behind & (closing * limit("critical_ttc") > gap)
    tally.add("behind", group[behind], weight[behind])
    tally.add("critical", group[critical], weight[critical])
    steady = behind & (np.abs(closing) < limit("followed_closing"))
    place = (time[steady] / GAP_WIDTH).astype(np.int64)
    tally.add_binned("gap_times", group[steady], place, weight[steady], GAP_BINS)
    calm = sound & ~critical
    usual = calm & (accel >= USUAL_ACCEL[0]) & (accel <= USUAL_ACCEL[1])
    tally.add("calm", group[calm], weight[calm])
    tally.add("usual", group[usual], weight[usual])


def _leaders(batch: Batch, frames: slice) -> tuple[Array, Array]:
    """Gap to the next vehicle ahead in the lane [m] and speed of approach [m/s].

    Returns:
        Both of shape (simulation, time, vehicle); the gap is infinite without a leader.
    """
    states, scenario = batch.runs.states, batch.runs.scenario
    s, speed = (1e-3 * _by_frame(one, frames) for one in (states.s, states.speed))
    lane = _by_frame(states.lane, frames).astype(np.float64)
    half = 0.5 * scenario.vehicles.length[:, None, :]
    # One sort for all lanes: by lane, then by place; vehicles that do not count come last.
    key = np.where(_by_frame(batch.sound, frames), 1e6 * lane + s, np.inf)
    order = np.argsort(key, axis=2)
    ordered, rear, front, pace = (
        np.take_along_axis(one, order, axis=2) for one in (key, s - half, s + half, speed)
    )
    with np.errstate(invalid="ignore"):
        same = ordered[:, :, 1:] // 1e6 == ordered[:, :, :-1] // 1e6
    gap, closing = np.full(s.shape, np.inf), np.zeros(s.shape)
    gap[:, :, :-1] = np.where(same, rear[:, :, 1:] - front[:, :, :-1], np.inf)
    closing[:, :, :-1] = np.where(same, pace[:, :, :-1] - pace[:, :, 1:], 0.0)
    back = np.argsort(order, axis=2)
    return np.take_along_axis(gap, back, axis=2), np.take_along_axis(closing, back, axis=2)


def _by_frame(values: Array, frames: slice) -> Array:
    """Some frames of (simulation, vehicle, time), as (simulation, time, vehicle)."""
    return values[:, :, frames].transpose(0, 2, 1)
