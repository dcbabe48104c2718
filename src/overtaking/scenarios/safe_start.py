"""Repairs starts so that no vehicles overlap and every driver can brake for the vehicle ahead.

The three samplers of traffic (placed, motorway, two-way) return a `TrafficStart`. `sampler` obtains
stations and speeds from it, and `repair_starts` moves vehicles along their lane and slows them
where necessary. Without a repair, a driver may start so fast and near that no braking helps, and
its collision says nothing about overtaking.

Arrays have shape (simulation, vehicle) unless stated otherwise; a *slot* is a position in the
second axis, and the ego, the vehicle under study, has slot 0. A *station* `s` is the distance of a
vehicle's centre along the road, in its own direction of travel: a follower has the smaller station
in both directions. Oncoming vehicles of a two-way road have a lane number of their own, 1.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

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

# The next four numbers are choices; section [safety] of `knowledge/data/sampling.toml` has values
# and reasons. `number` reads an entry as a float, `constant` as a float32.

USABLE_SHARE = number("sampling.safety.usable_grip_share")
"""Share of the peak friction that a surprised driver uses [1]."""

REACTION_MARGIN = number("sampling.safety.reaction_margin")
"""Factor on the driver's reaction time, because reactions are slower at night and in haze [1]."""

CLEARANCE = number("sampling.safety.clearance")
"""Smallest gap between two vehicles after braking [m]."""

MAX_KEPT_GAP_SHARE = number("sampling.safety.max_kept_gap_share")
"""Largest value of `DrawnStarts.kept_gap_share` [1]."""

_FIRST_EMPTY_LANE = np.uint8(100)
"""First lane number of empty slots. Each empty slot gets a lane of its own, so that it limits no
vehicle. Roads have at most 8 lanes and scenarios at most 32 slots, so numbers fit into 8 bits."""


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
        num_lanes: Number of lanes of the road.
        max_in_lane: Number of the longest vehicles, with the smallest gaps, that fit into one lane
            of the zone.
    """

    low: float
    high: float
    ego_lanes: tuple[int, ...]
    num_lanes: int
    max_in_lane: int

    @classmethod
    def whole_road(cls, road: Road, low: float = 0.0) -> Self:
        """A zone for traffic that fills the road: all lanes, without a limit of vehicles in a lane.

        Args:
            road: The road.
            low: Smallest station [m]. It is negative if vehicles may move back beyond the beginning
                of the road.
        """
        return cls(
            low=low,
            high=road.length,
            ego_lanes=tuple(range(road.num_lanes)),
            num_lanes=road.num_lanes,
            max_in_lane=255,  # More than the vehicles of a scenario, at most 32.
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class TrafficStart:
    """Vehicles and drivers of a block of simulations, before their stations are known.

    Attributes:
        vehicles: Vehicles; `vehicles.valid` is false in empty slots.
        drivers: Drivers.
        lane: Lane, 0 the slowest.
        kept_gap_share: See `DrawnStarts`.
        zone: The part of the road on which they may start.
        deadline: From this time on a simulation also ends as soon as the ego neither overtakes nor
            is about to overtake, because it never began or has given up, shape (simulation,) [s].
        states_at_speed: Function from desired speeds [m/s] to stations and speeds. `sampler` calls
            it after it has drawn the weather, which changes desired speeds, and once more if bends
            or local limits slow the vehicles.
        is_oncoming: Vehicles that drive in the other direction, with stations from the far end of
            the road; None on roads with one direction.
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
"""Function that draws the traffic of a block of simulations."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnStarts:
    """Starts as drawn, before their repair; empty slots hold numbers without meaning.

    Attributes:
        valid: Whether the slot holds a vehicle.
        lane: Lane, 0 the slowest.
        s: Station [m].
        speed: Speed [m/s].
        kept_gap_share: A vehicle that starts too near moves back, but leaves this share of the
            space behind it free; if that is not enough, it also starts slower. In placed traffic
            the share is drawn, so that starts do not pile up at the end of the short zone; in other
            traffic it is 0 [1].
    """

    valid: Mask
    lane: U8
    s: F32
    speed: F32
    kept_gap_share: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowerLimits:
    """Properties that decide the smallest gap at which a vehicle may start behind another one.

    Attributes:
        length: Length, bumper to bumper [m].
        reaction_time: Reaction time of the driver [s].
        decel: Deceleration that the driver can count on, positive [m/s^2].
    """

    length: F32
    reaction_time: F32
    decel: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadSpeeds:
    """Speeds to which drivers slow down for bends and local speed limits, here and farther ahead.

    Attributes:
        road: A road with bends, slopes or several speed limits, as the simulation uses it.
        speed_limit: Highest limit of the road [m/s].
        max_lateral_accel: Largest lateral acceleration that drivers accept in a bend, shape
            (simulation,) [m/s^2].
        factors: Quantities that decide the desired speed under a limit, arrays of shape
            (simulation, vehicle).
    """

    road: RoadParameters
    speed_limit: np.float32
    max_lateral_accel: F32
    factors: DesiredSpeedFactors

    def speed_at(self, s: F32, lane: U8, slot: IndexArray) -> F32:
        """Speeds of one vehicle of each simulation, shape (simulation,) [m/s].

        Args:
            s: Stations in the vehicles' own directions, shape (simulation,) [m].
            lane: Lanes, shape (simulation,). A number beyond the lanes of the road's own direction
                means that the vehicle is oncoming.
            slot: Slots of the vehicles, shape (simulation,).
        """
        simulation = np.arange(len(slot))
        factors = DesiredSpeedFactors(*(factor[simulation, slot] for factor in self.factors))
        return self._speeds(s, lane, factors)

    def speeds_of_all(self, s: F32, lane: U8) -> F32:
        """Speeds of all vehicles, shape (simulation, vehicle) [m/s].

        Args:
            s: Stations in the vehicles' own directions, shape (simulation, vehicle) [m].
            lane: Lanes, as in `speed_at`, the same shape.
        """
        # Transposed, so that the last axis broadcasts with `max_lateral_accel`.
        factors = DesiredSpeedFactors(*(factor.T for factor in self.factors))
        return self._speeds(s.T, lane.T, factors).T

    def _speeds(self, s: F32, lane: U8, factors: DesiredSpeedFactors) -> F32:
        """The smaller of the speeds for limits and for bends; infinite where neither slows."""
        constants = model_constants()
        is_oncoming = lane >= self.road.num_own_lanes
        limit = allowed_speed(constants, self.road, s, is_oncoming)
        desired_speed = adapted_speed(factors, limit)
        # The callers' speeds already obey `speed_limit`, so only lower limits matter here.
        desired_speed = np.where(limit < self.speed_limit, desired_speed, np.float32(np.inf))
        max_in_bends = bend_speed(constants, self.road, self.max_lateral_accel, s, is_oncoming)
        return minimum(max_in_bends, desired_speed)


def assumed_start_decel(
    vehicles: VehicleSpecs, weather: Weather, road: Road, lane: U8, speed: F32
) -> F32:
    """Deceleration that a driver can count on when braking from a speed, positive [m/s^2].

    Friction is lowest at the highest speed, so its value at the start of braking is a lower bound
    for the rest. Puddles are weighted by the share of the lane that they cover.

    Args:
        vehicles: Vehicles, shape (simulation, vehicle).
        weather: Weather, shape (simulation,).
        road: The road; its lanes drain differently.
        lane: Lane of each vehicle, 0 the slowest, shape (simulation, vehicle).
        speed: Speed at which it begins to brake, shape (simulation, vehicle) [m/s].

    Returns:
        Decelerations, shape (simulation, vehicle), at most what the brakes allow.
    """
    constants = model_constants()
    is_truck = (vehicles.kind == VehicleKind.TRUCK).astype(np.float32)
    # Friction on several depths of water, between which `friction_at_film` interpolates.
    friction_by_film = road_surface.friction_at_speed(
        constants, speed, vehicles.tyre_wear, is_truck
    )
    film = _lane_films(weather, road)[np.arange(lane.shape[0])[:, None], lane]
    puddle_film = film + road_surface.puddle_depth(weather.puddles)[:, None]
    cover = road_surface.puddle_cover(weather.puddles)[:, None]
    outside = road_surface.friction_at_film(constants, friction_by_film, film)
    in_puddle = road_surface.friction_at_film(constants, friction_by_film, puddle_film)
    friction = outside + cover * (in_puddle - outside)
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

    Three passes: separate the vehicles, slow them for bends and limits, and make collisions
    avoidable. Vehicles stay in their lanes and in their order. In placed traffic the repair lowered
    the share of simulations with a collision in the first three seconds from 20 % to 2 %.

    Args:
        drawn: Starts as drawn.
        limits: Lengths, reactions and brakes.
        section: Section `[starts]` of the specification. With its key `allow_doomed`, vehicles may
            start so fast and near that no braking helps: the third pass is left out.
        zone: The part of the road on which vehicles may start.
        road_speeds: Speeds for bends and local limits; None on a road without them.

    Returns:
        Stations and speeds, shape (simulation, vehicle), without meaning where a slot is empty.
    """
    # Bad starts are repaired, not drawn again: redrawing would make the number of draws random, and
    # the accepted starts would follow a distribution that no profile states.
    order = np.argsort(np.where(drawn.valid, drawn.s, np.inf), axis=1, kind="stable")
    empty_slot_lanes = _FIRST_EMPTY_LANE + np.arange(order.shape[1], dtype=np.uint8)
    vehicles = _SortedVehicles(
        lane=sort_columns(np.where(drawn.valid, drawn.lane, empty_slot_lanes), order),
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
    rear_limits = _separate(vehicles, zone)
    for rank in range(len(vehicles.s)):
        vehicles.slow_for_road(rank)
    if not section.allow_doomed:
        _make_collisions_avoidable(vehicles, rear_limits)
    return StartStates(
        s=unsort_columns(vehicles.s, order), speed=unsort_columns(vehicles.speed, order)
    )


def _lane_films(weather: Weather, road: Road) -> F32:
    """Film of water outside puddles, shape (simulation, lane) [mm].

    Source:
        Gallaway et al. 1979; the formula is in `road_surface.lane_film`.
    """
    rate = road_surface.rain_rate(weather.rain)
    min_film = road_surface.min_wet_film(rate, weather.puddles)
    # Water runs from the fastest lane to the slowest, so its path to a lane begins at the edge
    # beside the fastest lane. The length of this path is computed in float64 and rounded once:
    # another order of rounding would change the starts of existing seeds.
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
    """The vehicles of each simulation by rank, from the rearmost (0) to the foremost.

    Each list has one array of shape (simulation,) for each rank. Empty slots come last, each in a
    lane of its own. The passes of the repair replace the arrays of `s` and `speed`.

    Attributes:
        lane: Lane.
        s: Station [m].
        speed: Speed [m/s].
        kept_gap_share: See `DrawnStarts`.
        half_length: Half of the length [m].
        reaction_time: Time until the driver brakes, with the margin [s].
        decel: Deceleration that the driver can count on, positive [m/s^2].
        min_gap: Smallest gap between two vehicles in a lane, the same for all [m].
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
    slot: list[IndexArray]
    road_speeds: RoadSpeeds | None

    def slow_for_road(self, rank: int) -> None:
        """Limit the speed of the vehicles of a rank for bends and limits; no effect without any."""
        if self.road_speeds is not None:
            limit = self.road_speeds.speed_at(self.s[rank], self.lane[rank], self.slot[rank])
            self.speed[rank] = minimum(self.speed[rank], limit)

    def min_distance(self, rear: int, front: int) -> F32:
        """Smallest distance of the centres of two ranks, shape (simulation,) [m].

        Minus infinity, which limits nothing, where the vehicles are in different lanes.
        """
        distance = self.half_length[rear] + self.half_length[front] + self.min_gap
        return np.where(self.lane[rear] == self.lane[front], distance, np.float32(-np.inf))


def _separate(vehicles: _SortedVehicles, zone: StartZone) -> list[F32]:
    """Move vehicles forward until no gap is too small, then back into the zone; changes `s`.

    All vehicles fit: `placed_traffic.start_zone` checks short zones, and others are long enough.

    Returns:
        For each rank the smallest station that leaves space in the zone for all vehicles behind it,
        shape (simulation,) [m].
    """
    s = vehicles.s
    rear_limits = [np.full_like(s[0], zone.low) for _ in s]
    for front in range(1, len(s)):
        for rear in range(front):
            distance = vehicles.min_distance(rear, front)
            s[front] = maximum(s[front], s[rear] + distance)
            rear_limits[front] = maximum(rear_limits[front], rear_limits[rear] + distance)
    high = np.full_like(s[0], zone.high)
    for rear in reversed(range(len(s))):
        s[rear] = minimum(s[rear], high)
        for front in range(rear + 1, len(s)):
            s[rear] = minimum(s[rear], s[front] - vehicles.min_distance(rear, front))
    return rear_limits


def _make_collisions_avoidable(vehicles: _SortedVehicles, rear_limits: list[F32]) -> None:
    """Move back and slow each vehicle that could not avoid the vehicle ahead of it.

    From the foremost to the rearmost, because the limits of a follower depend on the final start of
    its leader. A vehicle that is too fast first moves back as far as it may, then slows.

    The calculation assumes that the leader has, from the first moment on, the lowest speed of all
    vehicles ahead in the lane. This is the worst case: braking to that speed takes time, and leaves
    the follower more space. A follower at that speed is safe, so no vehicle slows below the slowest
    one ahead.

    Args:
        vehicles: The vehicles; their stations and speeds change.
        rear_limits: The smallest stations, from `_separate`.
    """
    # For each rank, the lowest speed of its vehicle and of all vehicles ahead of it in its lane.
    lowest_speed = list(vehicles.speed)
    for follower in reversed(range(len(vehicles.s) - 1)):
        contact_s, speed_ahead = _contact_and_speed_ahead(vehicles, follower, lowest_speed)
        reaction_time, decel = vehicles.reaction_time[follower], vehicles.decel[follower]
        closing_speed = maximum(vehicles.speed[follower] - speed_ahead, np.zeros_like(speed_ahead))
        # The leader may have moved back, so restore the smallest gap first.
        s = minimum(vehicles.s[follower], contact_s - vehicles.min_gap)
        safe_s = minimum(s, contact_s - _avoiding_gap(closing_speed, reaction_time, decel))
        # Not negative, because the leader is never behind its own rear limit, and the limits of two
        # vehicles in a lane are as far apart as their smallest distance.
        free_space = s - rear_limits[follower]
        min_s = rear_limits[follower] + vehicles.kept_gap_share[follower] * free_space
        s = maximum(safe_s, min_s)
        vehicles.s[follower] = s
        closing_speed = _avoidable_closing_speed(contact_s - s, reaction_time, decel)
        vehicles.speed[follower] = minimum(vehicles.speed[follower], speed_ahead + closing_speed)
        # The vehicle may have moved back to a bend.
        vehicles.slow_for_road(follower)
        lowest_speed[follower] = minimum(vehicles.speed[follower], speed_ahead)


def _contact_and_speed_ahead(
    vehicles: _SortedVehicles, follower: int, lowest_speed: list[F32]
) -> tuple[F32, F32]:
    """The station at which a follower touches its leader, and the lowest speed ahead.

    Args:
        vehicles: The vehicles by rank.
        follower: Rank of the follower.
        lowest_speed: For each rank in front of the follower, the lowest speed of its vehicle and of
            all vehicles ahead of it in its lane, shape (simulation,) [m/s].

    Returns:
        Stations of the follower's centre [m] and lowest speeds ahead [m/s], shape (simulation,);
        both are infinite, and so limit nothing, where the lane ahead is free.
    """
    contact_s = np.full_like(vehicles.s[follower], np.inf)
    speed = np.full_like(contact_s, np.inf)
    # From the front, so that the nearest vehicle in the lane of the follower overwrites the others.
    for leader in reversed(range(follower + 1, len(vehicles.s))):
        is_same_lane = vehicles.lane[leader] == vehicles.lane[follower]
        touching_s = (
            vehicles.s[leader] - vehicles.half_length[leader] - vehicles.half_length[follower]
        )
        contact_s = np.where(is_same_lane, touching_s, contact_s)
        speed = np.where(is_same_lane, lowest_speed[leader], speed)
    return contact_s, speed


def _avoiding_gap(closing_speed: F32, reaction_time: F32, decel: F32) -> F32:
    """Gap from which braking leaves the clearance: clearance + dv t + dv^2 / 2b [m].

    Args:
        closing_speed: Speed dv of the follower minus speed ahead, shape (simulation,) [m/s].
        reaction_time: Time t until the follower brakes [s].
        decel: Its deceleration b [m/s^2].
    """
    braking = closing_speed * closing_speed / (np.float32(2.0) * decel)
    return np.float32(CLEARANCE) + closing_speed * reaction_time + braking


def _avoidable_closing_speed(gap: F32, reaction_time: F32, decel: F32) -> F32:
    """Closing speed for which a gap is just wide enough, the inverse of `_avoiding_gap` [m/s].

    Zero where the gap is smaller than the clearance.
    """
    distance = maximum(gap - np.float32(CLEARANCE), np.zeros_like(gap))
    speed_loss = decel * reaction_time
    return np.sqrt(speed_loss * speed_loss + np.float32(2.0) * decel * distance) - speed_loss
