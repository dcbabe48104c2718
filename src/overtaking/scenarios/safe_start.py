"""Repairs starts so that every driver can avoid the vehicle ahead."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, U8, Mask
from overtaking.core.native import maximum, minimum
from overtaking.knowledge.toml_reader import constant, number
from overtaking.model.road import Road
from overtaking.model.vehicles import DriverTraits, VehicleKind, VehicleSpecs
from overtaking.model.weather import Weather
from overtaking.scenarios.random_draws import (
    sort_columns,
    unsort_columns,
)
from overtaking.scenarios.specification import StartsSection
from overtaking.world import road_surface
from overtaking.world.constants import model_constants

USABLE_SHARE = number("sampling.toml", "safety.usable_grip_share")
"""The share of the peak friction that a surprised driver uses."""


def assumed_start_decel(
    vehicles: VehicleSpecs, weather: Weather, road: Road, lane: U8, speed: F32
) -> F32:
    """Deceleration that a driver can count on from a speed down [m/s^2].

    Friction falls with speed, so that of the highest speed is on the safe side for all of the
    braking. Puddles count with the part of the lane that they cover.

    Args:
        vehicles: Bodies, shape (simulation, vehicle).
        weather: Weather, shape (simulation,).
        road: The road.
        lane: Lane of each vehicle, 0 the slowest, (simulation, vehicle).
        speed: Speed from which it brakes, (simulation, vehicle) [m/s].
    """
    c = model_constants()
    truck = (vehicles.kind == VehicleKind.T).astype(np.float32)
    columns = road_surface.friction_at_speed(c, speed, vehicles.tyre_wear, truck)
    water = _film(weather, road)[np.arange(lane.shape[0])[:, None], lane]
    depth, cover = (
        road_surface.puddle_depth(weather.puddles),
        road_surface.puddle_cover(weather.puddles),
    )
    dry = road_surface.friction_at_film(c, columns, water)
    deep = road_surface.friction_at_film(c, columns, water + depth[:, None])
    grip = dry + cover[:, None] * (deep - dry)
    return minimum(
        vehicles.peak_decel,
        np.float32(USABLE_SHARE * number("model.toml", "nature.gravity")) * grip,
    )


def _film(weather: Weather, road: Road) -> F32:
    """Film of water outside puddles, shape (simulation, lane) [mm]."""
    rate = road_surface.rain_rate(weather.rain)
    least = road_surface.min_wet_film(rate, weather.puddles)
    # Water runs to the slow side, so a lane drains those on its fast side. In float64 until here:
    # the start of a simulation keeps its bits on every road.
    path = np.abs(road.boundaries[-1] - road.centres).astype(np.float32)
    texture = np.asarray(constant("weather.film.texture_depth_mm"))
    return road_surface.lane_film(
        least[:, None],
        road_surface.film_rain_factor(rate)[:, None],
        road_surface.film_path_factor(path),
        texture,
    )


REACTION_MARGIN = number("sampling.toml", "safety.reaction_margin")
"""Starts allow for a reaction this much longer than the driver's own: at night, in haze."""

CLEARANCE = number("sampling.toml", "safety.clearance")
"""Smallest gap between two vehicles after braking [m]."""

MAX_KEPT_GAP_SHARE = number("sampling.toml", "safety.max_kept_gap_share")
"""A vehicle that has to move back keeps at most this share of the room behind it. The share is
drawn, so that starts do not pile up at the end of the zone."""

RoadSpeeds = Callable[[F32, U8, NDArray[np.intp]], F32]
"""From positions [m], lanes and slots, shape (simulation,), to speeds [m/s] that drivers choose for
the bends and limits at and ahead of them."""
_NO_LANE = np.uint8(100)  # Above every lane; each empty slot has one of its own.


@dataclass(frozen=True, slots=True, kw_only=True)
class StartZone:
    """Where vehicles may start.

    Attributes:
        low: Smallest position along the road [m].
        high: Largest position along the road [m].
        ego_lanes: Lanes for the ego, 0 the slowest.
        num_lanes: Lanes of the road.
        max_in_lane: Vehicles that fit into one lane of the zone, however long they are.
    """

    low: float
    high: float
    ego_lanes: tuple[int, ...]
    num_lanes: int
    max_in_lane: int


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnStarts:
    """Starts as drawn, shape (simulation, vehicle); empty slots hold numbers, too.

    Attributes:
        valid: Whether the slot holds a vehicle.
        lane: Lane, 0 the slowest.
        s: Position along the road [m].
        speed: Speed that the vehicle comes with [m/s].
        kept_gap_share: Part of the room behind it that the vehicle keeps if it has to move back
            [1].
    """

    valid: Mask
    lane: U8
    s: F32
    speed: F32
    kept_gap_share: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowerLimits:
    """Properties that limit how close behind another vehicle one may start; (simulation, vehicle).

    Attributes:
        length: Bumper to bumper [m].
        reaction_time: The driver's own [s].
        decel: Braking that the driver can count on [m/s^2].
    """

    length: F32
    reaction_time: F32
    decel: F32


def repair_starts(
    draft: DrawnStarts,
    followers: FollowerLimits,
    starts: StartsSection,
    zone: StartZone,
    paces: RoadSpeeds | None = None,
) -> tuple[F32, F32]:
    """Positions without overlap, and speeds from which everyone can avoid the vehicle ahead.

    No vehicle starts faster than its driver takes the bends and limits at and ahead of the start.

    Args:
        draft: Starts as drawn.
        followers: Lengths, reactions and brakes.
        starts: What the specification asks of a start.
        zone: Where vehicles may start.
        paces: Speeds for the road; None where it is straight and has one limit.

    Returns:
        Positions [m] and speeds [m/s], shape (simulation, vehicle).
    """
    # Bad starts are repaired, not drawn again: otherwise the number of draws would depend on luck,
    # and the accepted starts would follow a distribution that no profile states.
    order = np.argsort(np.where(draft.valid, draft.s, np.inf), axis=1, kind="stable")
    no_lane = _NO_LANE + np.arange(order.shape[1], dtype=np.uint8)
    row = _SortedVehicles(
        lane=sort_columns(np.where(draft.valid, draft.lane, no_lane), order),
        s=sort_columns(draft.s, order),
        speed=sort_columns(draft.speed, order),
        kept=sort_columns(draft.kept_gap_share, order),
        half=sort_columns(np.float32(0.5) * followers.length, order),
        reaction=sort_columns(np.float32(REACTION_MARGIN) * followers.reaction_time, order),
        decel=sort_columns(followers.decel, order),
        min_gap=np.float32(starts.min_gap_m),
        slot=list(order.T),
        paces=paces,
    )
    rearmost = _separate(row, zone)
    for rank in range(len(row.s)):
        row.slow_for_road(rank)
    if not starts.allow_doomed:
        _make_collisions_avoidable(row, rearmost)
    return unsort_columns(row.s, order), unsort_columns(row.speed, order)


@dataclass(slots=True, kw_only=True)
class _SortedVehicles:
    """The vehicles of each simulation from the rearmost to the foremost, one array for each.

    Attributes:
        lane: Lane; one of its own for an empty slot.
        s: Position [m].
        speed: Speed [m/s].
        kept: See `DrawnStarts`.
        half: Half of the length [m].
        reaction: Time until the driver brakes [s].
        decel: Braking that the driver can count on [m/s^2].
        min_gap: Smallest gap between two in a lane [m].
        slot: Slot of the vehicle.
        paces: Speeds for bends and limits (`RoadSpeeds`); None on a road without them.
    """

    lane: list[U8]
    s: list[F32]
    speed: list[F32]
    kept: list[F32]
    half: list[F32]
    reaction: list[F32]
    decel: list[F32]
    min_gap: np.float32
    slot: list[NDArray[np.intp]]
    paces: RoadSpeeds | None

    def slow_for_road(self, rank: int) -> None:
        """Let a vehicle be no faster than its driver goes into what the road has ahead of it."""
        if self.paces is not None:
            pace = self.paces(self.s[rank], self.lane[rank], self.slot[rank])
            self.speed[rank] = minimum(self.speed[rank], pace)

    def apart(self, rear: int, front: int) -> F32:
        """Least distance of the centres of two vehicles; minus infinity in different lanes [m]."""
        distance = self.half[rear] + self.half[front] + self.min_gap
        return np.where(self.lane[rear] == self.lane[front], distance, np.float32(-np.inf))


def _separate(row: _SortedVehicles, zone: StartZone) -> list[F32]:
    """Move vehicles forward until no gap is too small, then back into the zone.

    Returns:
        The rearmost position for each that leaves room in the zone for all behind it [m].
    """
    count = len(row.s)
    rearmost = [np.full_like(row.s[0], zone.low) for _ in range(count)]
    for front in range(1, count):
        for rear in range(front):
            apart = row.apart(rear, front)
            row.s[front] = maximum(row.s[front], row.s[rear] + apart)
            rearmost[front] = maximum(rearmost[front], rearmost[rear] + apart)
    high = np.full_like(row.s[0], zone.high)
    for rear in reversed(range(count)):
        row.s[rear] = minimum(row.s[rear], high)
        for front in range(rear + 1, count):
            row.s[rear] = minimum(row.s[rear], row.s[front] - row.apart(rear, front))
    return rearmost


def _make_collisions_avoidable(row: _SortedVehicles, rearmost: list[F32]) -> None:
    """Give everyone a way to avoid the vehicle ahead, from the front backwards.

    Who comes too fast starts farther back, as far as there is room, and then slower. The vehicle
    ahead is taken to have the lowest speed of all ahead in its lane from the first moment on, which
    is worse than any braking of its own down to that speed. A follower at that speed is safe, so
    no vehicle gets slower than the slowest was drawn.
    """
    lowest = list(row.speed)  # Of the vehicle and of all ahead of it in its lane.
    for follower in reversed(range(len(row.s) - 1)):
        bumper, ahead = _ahead(row, follower, lowest)
        reaction, decel = row.reaction[follower], row.decel[follower]
        closing = maximum(row.speed[follower] - ahead, np.zeros_like(ahead))
        position = minimum(row.s[follower], bumper - row.min_gap)
        wanted = minimum(position, bumper - _avoiding_gap(closing, reaction, decel))
        room = position - rearmost[follower]
        position = maximum(wanted, rearmost[follower] + row.kept[follower] * room)
        row.s[follower] = position
        closing = _avoidable_closing(bumper - position, reaction, decel)
        row.speed[follower] = minimum(row.speed[follower], ahead + closing)
        row.slow_for_road(follower)
        lowest[follower] = minimum(row.speed[follower], ahead)


def _ahead(row: _SortedVehicles, follower: int, lowest: list[F32]) -> tuple[F32, F32]:
    """Where a follower would touch the next in its lane [m], and the lowest speed ahead [m/s].

    Both are infinite where its lane is free.
    """
    contact = np.full_like(row.s[follower], np.inf)
    speed = np.full_like(contact, np.inf)
    for leader in reversed(range(follower + 1, len(row.s))):
        same = row.lane[leader] == row.lane[follower]
        touching = row.s[leader] - row.half[leader] - row.half[follower]
        contact = np.where(same, touching, contact)
        speed = np.where(same, lowest[leader], speed)
    return contact, speed


def _avoiding_gap(closing: F32, reaction: F32, decel: F32) -> F32:
    """Gap from which braking leaves the clearance: clearance + dv t + dv^2 / 2b [m]."""
    braking = closing * closing / (np.float32(2.0) * decel)
    return np.float32(CLEARANCE) + closing * reaction + braking


def _avoidable_closing(gap: F32, reaction: F32, decel: F32) -> F32:
    """Closing speed for which a gap is the `_avoiding_gap` [m/s]."""
    room = maximum(gap - np.float32(CLEARANCE), np.zeros_like(gap))
    before = decel * reaction
    return np.sqrt(before * before + np.float32(2.0) * decel * room) - before


@dataclass(frozen=True, slots=True, kw_only=True)
class TrafficStart:
    """All vehicles before the first frame, shape (simulation, vehicle).

    Attributes:
        vehicles: Bodies.
        drivers: People.
        lane: Lane, 0 the slowest.
        kept_gap_share: See `layout.Draft`.
        zone: Where they may start.
        deadline: A simulation without an attempt ends here, shape (simulation,) [s].
        states_at_speed: Positions [m] and speeds [m/s] from the speeds that drivers want in their
            weather.
        is_oncoming: Whose positions count from the end of the road, as they come the other way;
            None for nobody's.
    """

    vehicles: VehicleSpecs
    drivers: DriverTraits
    lane: U8
    kept_gap_share: F32
    zone: StartZone
    deadline: F32
    states_at_speed: Callable[[F32], tuple[F32, F32]]
    is_oncoming: Mask | None = None
