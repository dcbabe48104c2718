"""Counts the traffic of all vehicles: distances, gaps, accelerations, time left of a free lane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.validation.tally import GROUPS, Array, Tally
from overtaking.knowledge.toml_reader import number
from overtaking.model.trajectories import NO_VEHICLE, Trajectories
from overtaking.model.vehicles import VehicleKind

if TYPE_CHECKING:
    from numpy.typing import NDArray

EVERY_S = 0.5
"""Interval at which gaps and accelerations are counted [s]: they change little in between."""

GAP_BINS, GAP_WIDTH = 400, 0.01
"""Bins of time gaps [s]."""

ACCEL_BINS, ACCEL_WIDTH = 600, 0.02
"""Bins of the amount of the lateral acceleration [m/s^2]."""

USUAL_ACCEL = (-3000, 2000)
"""Limits of everyday longitudinal accelerations [mm/s^2]."""

FREE_EVERY = 4
"""Every so many of these instants, whether the lane on the right is free: it takes all pairs."""

CARS = (VehicleKind.SMALL_CAR, VehicleKind.MEDIUM_CAR, VehicleKind.LARGE_CAR)


def limit(name: str) -> float:
    """A limit of `validation.toml`, SI."""
    return number(f"validation.limits.{name}")


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
        flows: On two-way roads, vehicles per second in the ego's direction and in the other, shape
            (2, simulation).
    """

    runs: Trajectories
    group: NDArray[np.int64]
    weight: NDArray[np.float64]
    sound: NDArray[np.bool_]
    interval_s: float
    flows: NDArray[np.float64] | None = None

    @property
    def sampled(self) -> slice:
        """Every so many frames, in which gaps and accelerations are counted."""
        return slice(None, None, max(1, round(EVERY_S / self.interval_s)))

    def metres(self, counted: Array | None = None) -> NDArray[np.float64]:
        """Distance that sound vehicles drove in each simulation, in all or counted frames [m]."""
        there = self.sound if counted is None else counted
        millimetres = np.where(there, self.runs.states.speed, 0).sum(axis=(1, 2), dtype=np.float64)
        return 1e-3 * self.interval_s * millimetres

    @classmethod
    def of(cls, runs: Trajectories, flows: Array | None = None) -> Batch:
        """Prepare a batch; `flows` as in the class."""
        contacts, scenario = runs.contacts, runs.scenario
        untouched = np.where(contacts.partner == NO_VEHICLE, np.iinfo(np.int32).max, contacts.time)
        before = runs.time_ms[None, None, :] < untouched[:, :, None]
        return cls(
            runs=runs,
            group=(scenario.scenario_index % np.uint64(GROUPS)).astype(np.int64),
            weight=scenario.weight,
            sound=runs.state_mask & before & (runs.states.lane < runs.road.num_lanes),
            interval_s=1e-3 * scenario.frame_interval_ms,
            flows=flows,
        )


def count(tally: Tally, batch: Batch) -> None:
    """Add a batch to a tally."""
    _distances(tally, batch)
    _following(tally, batch)
    _free_lanes(tally, batch)


def _distances(tally: Tally, batch: Batch) -> None:
    """Add distances, by day and by night, and accelerations."""
    states, sound = batch.runs.states, batch.sound
    seen = sound[:, :, batch.sampled]
    simulation = np.nonzero(seen)[0]
    lateral = np.abs(states.accel_lat[:, :, batch.sampled][seen].astype(np.int64))
    place = (1e-3 / ACCEL_WIDTH * lateral).astype(np.int64)
    group, weight = batch.group[simulation], batch.weight[simulation]
    tally.add_binned("lateral", group, place, weight, ACCEL_BINS)
    hardest = 1e3 * limit("hardest")
    along, across = (values.astype(np.float32) for values in (states.accel_lon, states.accel_lat))
    impossible = (along * along + across * across > hardest**2) & batch.runs.frame_mask[:, None]
    tally.add("impossible", batch.group, batch.weight * impossible.any(axis=(1, 2)))
    tally.add("simulations", batch.group, batch.weight)
    metres = batch.weight * batch.metres()
    tally.add("metres", batch.group, metres)
    tally.add("night_metres", batch.group, metres * batch.runs.scenario.weather.night)


def _following(tally: Tally, batch: Batch) -> None:
    """Add time gaps, times to collision, and whether accelerations are usual."""
    states = batch.runs.states
    speed = 1e-3 * by_frame(states.speed, batch.sampled)
    accel, sound = (by_frame(one, batch.sampled) for one in (states.accel_lon, batch.sound))
    gap, closing = leaders(batch, batch.sampled)
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


def _free_lanes(tally: Tally, batch: Batch) -> None:
    """Add the time of cars, and the part of it that they are on the left of a free lane."""
    step = batch.sampled.step * FREE_EVERY
    frames = slice(None, None, step)
    lane, s, sound = (
        by_frame(one, frames) for one in (batch.runs.states.lane, batch.runs.states.s, batch.sound)
    )
    reach = 1e3 * limit("free_ahead") * 1e-3 * by_frame(batch.runs.states.speed, frames)
    ahead = (s[..., None, :] - s[..., :, None]).astype(np.float64)
    near = (ahead > -1e3 * limit("free_behind")) & (ahead < reach[..., :, None])
    on_the_right = lane[..., None, :].astype(np.int16) == lane[..., :, None].astype(np.int16) - 1
    taken = (near & on_the_right & sound[..., None, :]).any(axis=3)
    cars = sound & np.isin(batch.runs.scenario.vehicles.kind, CARS)[:, None, :]
    group, weight = (
        np.broadcast_to(one[:, None, None], cars.shape) for one in (batch.group, batch.weight)
    )
    left = cars & (lane > 0) & ~taken
    tally.add("car_time", group[cars], weight[cars])
    tally.add("left_time", group[left], weight[left])


def leaders(batch: Batch, frames: slice) -> tuple[Array, Array]:
    """Gap to the next vehicle ahead in the lane [m] and speed of approach [m/s].

    Returns:
        Both of shape (simulation, time, vehicle); the gap is infinite without a leader.
    """
    states, scenario = batch.runs.states, batch.runs.scenario
    s, speed = (1e-3 * by_frame(one, frames) for one in (states.s, states.speed))
    lane = by_frame(states.lane, frames).astype(np.float64)
    half = 0.5 * scenario.vehicles.length[:, None, :]
    # One sort for all lanes: by lane, then by place; vehicles that do not count come last.
    key = np.where(by_frame(batch.sound, frames), 1e6 * lane + s, np.inf)
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


def by_frame(values: Array, frames: slice) -> Array:
    """Some frames of (simulation, vehicle, time), as (simulation, time, vehicle)."""
    return values[:, :, frames].transpose(0, 2, 1)
