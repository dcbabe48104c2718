"""Repairs starts so that every driver can avoid the vehicle ahead."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, U8, IndexArray, Mask
from overtaking.core.native import maximum, minimum
from overtaking.knowledge.toml_reader import constant, number
from overtaking.model.road import Road
from overtaking.model.vehicles import DriverTraits, VehicleKind, VehicleSpecs
from overtaking.model.weather import Weather
from overtaking.scenarios.random_draws import SampleBlock, sort_columns, unsort_columns
from overtaking.scenarios.specification import StartsSection
from overtaking.world import road_surface
from overtaking.world.constants import model_constants
from overtaking.world.driver_parameters import DesiredSpeedFactors, adapted_speed
from overtaking.world.road_parameters import RoadParameters, allowed_speed, bend_speed

USABLE_SHARE = number("sampling.safety.usable_grip_share")
"""Share of the peak friction that a surprised driver uses."""

REACTION_MARGIN = number("sampling.safety.reaction_margin")
"""Factor on the driver's reaction time, because reactions are slower at night and in haze."""

CLEARANCE = number("sampling.safety.clearance")
"""Smallest gap between two vehicles after braking [m]."""

MAX_KEPT_GAP_SHARE = number("sampling.safety.max_kept_gap_share")
"""A vehicle that has to move back keeps at most this share of the space behind it. The share is
drawn, so that starts do not pile up at the end of the zone."""

_NO_LANE = np.uint8(100)  # Above every lane; each empty slot gets a lane of its own from here on.


class StartStates(NamedTuple):
    """Stations [m] and speeds [m/s] at the start, shape (simulation, vehicle)."""

    s: F32
    speed: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class StartZone:
    """The part of the road on which vehicles may start.

    Attributes:
        low: Smallest station [m].
        high: Largest station [m].
        ego_lanes: Lanes for the ego, 0 the slowest.
        num_lanes: Lanes of the road.
        max_in_lane: Vehicles that fit into one lane of the zone, however long they are.
    """

    low: float
    high: float
    ego_lanes: tuple[int, ...]
    num_lanes: int
    max_in_lane: int

    @classmethod
    def whole_road(cls, road: Road, low: float = 0.0) -> Self:
        """A zone for traffic that fills the road and needs no other limit.

        Args:
            road: The road.
            low: Smallest station [m].
        """
        return cls(
            low=low,
            high=road.length,
            ego_lanes=tuple(range(road.num_lanes)),
            num_lanes=road.num_lanes,
            max_in_lane=255,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class TrafficStart:
    """Vehicles and drivers before their stations are known; arrays (simulation, vehicle).

    Attributes:
        vehicles: Vehicles.
        drivers: Drivers.
        lane: Lane, 0 the slowest.
        kept_gap_share: See `DrawnStarts`.
        zone: The part of the road on which they may start.
        deadline: Time at which a simulation without an attempt ends, shape (simulation,) [s].
        states_at_speed: Returns stations and speeds for the speeds that drivers want in their
            weather [m/s].
        is_oncoming: Vehicles that drive in the other direction, with stations from the far end of
            the road; None without any.
    """

    vehicles: VehicleSpecs
    drivers: DriverTraits
    lane: U8
    kept_gap_share: F32
    zone: StartZone
    deadline: F32
    states_at_speed: Callable[[F32], StartStates]
    is_oncoming: Mask | None = None


TrafficSampler = Callable[[SampleBlock], TrafficStart]
"""Draws the vehicles and drivers of a block."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnStarts:
    """Starts as drawn, shape (simulation, vehicle); empty slots hold numbers, too.

    Attributes:
        valid: Whether the slot holds a vehicle.
        lane: Lane, 0 the slowest.
        s: Station [m].
        speed: Speed that the vehicle arrives with [m/s].
        kept_gap_share: Share of the space behind it that the vehicle keeps if it has to move back
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
        length: Length, bumper to bumper [m].
        reaction_time: Reaction time of the driver [s].
        decel: Deceleration that the driver can count on [m/s^2].
    """

    length: F32
    reaction_time: F32
    decel: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadSpeeds:
    """Speeds that drivers choose for the bends and lower limits at and ahead of a station.

    Attributes:
        road: A road that varies along its length.
        speed_limit: Limit of the whole road [m/s].
        max_lateral_accel: Largest lateral acceleration that drivers ask for, (simulation,) [m/s^2].
        factors: The factors of the desired speeds, shape (simulation, vehicle).
    """

    road: RoadParameters
    speed_limit: np.float32
    max_lateral_accel: F32
    factors: DesiredSpeedFactors

    def speed_at(self, s: F32, lane: U8, slot: IndexArray) -> F32:
        """Speeds of one vehicle of each simulation, shape (simulation,) [m/s].

        Args:
            s: Stations in the vehicles' own directions, shape (simulation,) [m].
            lane: Lanes, shape (simulation,).
            slot: Slots, shape (simulation,).
        """
        simulation = np.arange(len(slot))
        factors = DesiredSpeedFactors(*(factor[simulation, slot] for factor in self.factors))
        return self._speeds(s, lane, factors)

    def speeds_of_all(self, s: F32, lane: U8) -> F32:
        """Speeds of all vehicles, shape (simulation, vehicle) [m/s].

        Args:
            s: Stations in the vehicles' own directions, shape (simulation, vehicle) [m].
            lane: Lanes, the same shape.
        """
        # Simulations go last, along the axis of `max_lateral_accel`.
        factors = DesiredSpeedFactors(*(factor.T for factor in self.factors))
        return self._speeds(s.T, lane.T, factors).T

    def _speeds(self, s: F32, lane: U8, factors: DesiredSpeedFactors) -> F32:
        constants = model_constants()
        is_oncoming = lane >= self.road.num_own_lanes
        limit = allowed_speed(constants, self.road, s, is_oncoming)
        desired_speed = adapted_speed(factors, limit)
        # Only a local limit below the limit of the road slows a start.
        desired_speed = np.where(limit < self.speed_limit, desired_speed, np.float32(np.inf))
        in_bend = bend_speed(constants, self.road, self.max_lateral_accel, s, is_oncoming)
        return minimum(in_bend, desired_speed)


def assumed_start_decel(
    vehicles: VehicleSpecs, weather: Weather, road: Road, lane: U8, speed: F32
) -> F32:
    """Deceleration that a driver can count on when braking from a speed [m/s^2].

    Friction falls with speed, so the friction at the start of braking is a safe value for all of
    it. Puddles count with the share of the lane that they cover.

    Args:
        vehicles: Vehicles, shape (simulation, vehicle).
        weather: Weather, shape (simulation,).
        road: The road.
        lane: Lane of each vehicle, 0 the slowest, (simulation, vehicle).
        speed: Speed at which it begins to brake, (simulation, vehicle) [m/s].
    """
    constants = model_constants()
    is_truck = (vehicles.kind == VehicleKind.TRUCK).astype(np.float32)
    columns = road_surface.friction_at_speed(constants, speed, vehicles.tyre_wear, is_truck)
    film = _lane_films(weather, road)[np.arange(lane.shape[0])[:, None], lane]
    depth = road_surface.puddle_depth(weather.puddles)
    cover = road_surface.puddle_cover(weather.puddles)
    outside = road_surface.friction_at_film(constants, columns, film)
    in_puddle = road_surface.friction_at_film(constants, columns, film + depth[:, None])
    friction = outside + cover[:, None] * (in_puddle - outside)
    usable_gravity = np.float32(USABLE_SHARE * number("model.nature.gravity"))
    return minimum(vehicles.peak_decel, usable_gravity * friction)


def repair_starts(
    drawn: DrawnStarts,
    limits: FollowerLimits,
    section: StartsSection,
    zone: StartZone,
    road_speeds: RoadSpeeds | None = None,
) -> StartStates:
    """Move and slow vehicles until none overlap and every driver can avoid the vehicle ahead.

    No vehicle starts faster than its driver takes the bends and limits at and ahead of the start.

    Args:
        drawn: Starts as drawn.
        limits: Lengths, reactions and brakes.
        section: Section `[starts]` of the specification.
        zone: The part of the road on which vehicles may start.
        road_speeds: Speeds for bends and limits; None on a road without them.
    """
    # Bad starts are repaired, not drawn again: otherwise the number of draws would depend on luck,
    # and the accepted starts would follow a distribution that no profile states.
    order = np.argsort(np.where(drawn.valid, drawn.s, np.inf), axis=1, kind="stable")
    no_lane = _NO_LANE + np.arange(order.shape[1], dtype=np.uint8)
    vehicles = _SortedVehicles(
        lane=sort_columns(np.where(drawn.valid, drawn.lane, no_lane), order),
        s=sort_columns(drawn.s, order),
        speed=sort_columns(drawn.speed, order),
        kept_gap_share=sort_columns(drawn.kept_gap_share, order),
        half_length=sort_columns(np.float32(0.5) * limits.length, order),
        reaction_time=sort_columns(np.float32(REACTION_MARGIN) * limits.reaction_time, order),
        decel=sort_columns(limits.decel, order),
        min_gap=np.float32(section.min_gap_m),
        slot=list(order.T),
        road_speeds=road_speeds,
    )
    rearmost = _separate(vehicles, zone)
    for rank in range(len(vehicles.s)):
        vehicles.slow_for_road(rank)
    if not section.allow_doomed:
        _make_collisions_avoidable(vehicles, rearmost)
    return StartStates(
        s=unsort_columns(vehicles.s, order), speed=unsort_columns(vehicles.speed, order)
    )


def _lane_films(weather: Weather, road: Road) -> F32:
    """Film of water outside puddles, shape (simulation, lane) [mm]."""
    rate = road_surface.rain_rate(weather.rain)
    min_film = road_surface.min_wet_film(rate, weather.puddles)
    # Water runs to the slow side, so a lane also drains the lanes on its fast side. The path is
    # computed in float64 and rounded once: the start of a simulation keeps its bits on every road.
    path = np.abs(road.lane_boundaries[-1] - road.lane_centres).astype(np.float32)
    texture = np.asarray(constant("weather.film.texture_depth_mm"))
    return road_surface.lane_film(
        min_film[:, None],
        road_surface.film_rain_factor(rate)[:, None],
        road_surface.film_path_factor(path),
        texture,
    )


@dataclass(slots=True, kw_only=True)
class _SortedVehicles:
    """The vehicles of each simulation from the rearmost to the foremost, one array for each.

    Attributes:
        lane: Lane; each empty slot has a lane of its own.
        s: Station [m].
        speed: Speed [m/s].
        kept_gap_share: See `DrawnStarts`.
        half_length: Half of the length [m].
        reaction_time: Time until the driver brakes [s].
        decel: Deceleration that the driver can count on [m/s^2].
        min_gap: Smallest gap between two vehicles in a lane [m].
        slot: Slot of the vehicle.
        road_speeds: Speeds for bends and limits; None on a road without them.
    """

    lane: list[U8]
    s: list[F32]
    speed: list[F32]
    kept_gap_share: list[F32]
    half_length: list[F32]
    reaction_time: list[F32]
    decel: list[F32]
    min_gap: np.float32
    slot: list[NDArray[np.intp]]
    road_speeds: RoadSpeeds | None

    def slow_for_road(self, rank: int) -> None:
        """Limit a vehicle's speed to its driver's choice for the bends and limits ahead."""
        if self.road_speeds is not None:
            limit = self.road_speeds.speed_at(self.s[rank], self.lane[rank], self.slot[rank])
            self.speed[rank] = minimum(self.speed[rank], limit)

    def min_distance(self, rear: int, front: int) -> F32:
        """Smallest distance of two centres; minus infinity in different lanes [m]."""
        distance = self.half_length[rear] + self.half_length[front] + self.min_gap
        return np.where(self.lane[rear] == self.lane[front], distance, np.float32(-np.inf))


def _separate(vehicles: _SortedVehicles, zone: StartZone) -> list[F32]:
    """Move vehicles forward until no gap is too small, then back into the zone.

    Returns:
        For each vehicle the smallest station that leaves space in the zone for all behind it [m].
    """
    s = vehicles.s
    rearmost = [np.full_like(s[0], zone.low) for _ in s]
    for front in range(1, len(s)):
        for rear in range(front):
            distance = vehicles.min_distance(rear, front)
            s[front] = maximum(s[front], s[rear] + distance)
            rearmost[front] = maximum(rearmost[front], rearmost[rear] + distance)
    high = np.full_like(s[0], zone.high)
    for rear in reversed(range(len(s))):
        s[rear] = minimum(s[rear], high)
        for front in range(rear + 1, len(s)):
            s[rear] = minimum(s[rear], s[front] - vehicles.min_distance(rear, front))
    return rearmost


def _make_collisions_avoidable(vehicles: _SortedVehicles, rearmost: list[F32]) -> None:
    """Let every driver be able to avoid the vehicle ahead, from the front backwards.

    A vehicle that is too fast starts farther back, as far as there is space, and then slower. The
    vehicle ahead counts with the lowest speed of all ahead in its lane from the first moment on,
    which is worse than any braking of its own down to that speed. A follower at that speed is safe,
    so no vehicle gets slower than the slowest was drawn.
    """
    lowest_speed = list(vehicles.speed)  # Of the vehicle and of all ahead of it in its lane.
    for follower in reversed(range(len(vehicles.s) - 1)):
        contact_s, speed_ahead = _contact_and_speed_ahead(vehicles, follower, lowest_speed)
        reaction_time, decel = vehicles.reaction_time[follower], vehicles.decel[follower]
        closing_speed = maximum(vehicles.speed[follower] - speed_ahead, np.zeros_like(speed_ahead))
        s = minimum(vehicles.s[follower], contact_s - vehicles.min_gap)
        safe_s = minimum(s, contact_s - _avoiding_gap(closing_speed, reaction_time, decel))
        space = s - rearmost[follower]
        s = maximum(safe_s, rearmost[follower] + vehicles.kept_gap_share[follower] * space)
        vehicles.s[follower] = s
        closing_speed = _avoidable_closing_speed(contact_s - s, reaction_time, decel)
        vehicles.speed[follower] = minimum(vehicles.speed[follower], speed_ahead + closing_speed)
        vehicles.slow_for_road(follower)
        lowest_speed[follower] = minimum(vehicles.speed[follower], speed_ahead)


def _contact_and_speed_ahead(
    vehicles: _SortedVehicles, follower: int, lowest_speed: list[F32]
) -> tuple[F32, F32]:
    """The station at which a follower touches the next vehicle in its lane, and the speed there.

    Returns:
        Stations of the follower's centre [m] and lowest speeds ahead [m/s], shape (simulation,);
        both are infinite where the lane ahead is free.
    """
    contact_s = np.full_like(vehicles.s[follower], np.inf)
    speed = np.full_like(contact_s, np.inf)
    for leader in reversed(range(follower + 1, len(vehicles.s))):
        is_same_lane = vehicles.lane[leader] == vehicles.lane[follower]
        touching = (
            vehicles.s[leader] - vehicles.half_length[leader] - vehicles.half_length[follower]
        )
        contact_s = np.where(is_same_lane, touching, contact_s)
        speed = np.where(is_same_lane, lowest_speed[leader], speed)
    return contact_s, speed


def _avoiding_gap(closing_speed: F32, reaction_time: F32, decel: F32) -> F32:
    """Gap from which braking leaves the clearance: clearance + dv t + dv^2 / 2b [m]."""
    braking = closing_speed * closing_speed / (np.float32(2.0) * decel)
    return np.float32(CLEARANCE) + closing_speed * reaction_time + braking


def _avoidable_closing_speed(gap: F32, reaction_time: F32, decel: F32) -> F32:
    """Closing speed for which a gap is the `_avoiding_gap` [m/s]."""
    distance = maximum(gap - np.float32(CLEARANCE), np.zeros_like(gap))
    speed_loss = decel * reaction_time
    return np.sqrt(speed_loss * speed_loss + np.float32(2.0) * decel * distance) - speed_loss
