"""Draws lanes, positions and speeds of placed vehicles, and repairs starts that cannot be.

Drawn vehicles may overlap, or leave a driver no way to avoid the vehicle ahead. Each repair is a
fixed number of passes over the vehicles, never a new draw, so a start is a function of its
simulation's number alone.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking import knowledge
from overtaking.core.arrays import F32, U8, U64, Mask
from overtaking.core.compiled import maximum, minimum, power
from overtaking.core.philox import Stream
from overtaking.core.units import mps_from_kmh
from overtaking.model.vehicles import Role
from overtaking.scenarios.bodies import top_speeds
from overtaking.scenarios.noise import Noise, in_order, out_of_order, spread
from overtaking.scenarios.people import LEAD_SLOT
from overtaking.scenarios.schema import Starts, Traffic

REACTION_MARGIN = knowledge.number("starts.toml", "safety.reaction_margin")
"""Starts allow for a reaction this much longer than the driver's own: at night, in haze."""

CLEARANCE = knowledge.number("starts.toml", "safety.clearance")
"""Smallest gap between two vehicles after braking [m]."""

MOST_KEPT = knowledge.number("starts.toml", "safety.most_kept")
"""A vehicle that has to move back keeps at most this share of the room behind it. The share is
drawn, so that starts do not pile up at the end of the zone."""

Paces = Callable[[F32, U8, NDArray[np.intp]], F32]
"""From positions [m], lanes and slots, shape (simulation,), to speeds [m/s] that drivers choose for
the bends and limits at and ahead of them."""

_NO_LANE = np.uint8(100)  # Above every lane; each empty slot has one of its own.


@dataclass(frozen=True, slots=True, kw_only=True)
class Zone:
    """Where vehicles may start.

    Attributes:
        low: Smallest position along the road [m].
        high: Largest position along the road [m].
        ego_lanes: Lanes for the ego, 0 the slowest.
        num_lanes: Lanes of the road.
        most_in_lane: Vehicles that fit into one lane of the zone, however long they are.
    """

    low: float
    high: float
    ego_lanes: tuple[int, ...]
    num_lanes: int
    most_in_lane: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """Starts as drawn, shape (simulation, vehicle); empty slots hold numbers, too.

    Attributes:
        valid: Whether the slot holds a vehicle.
        lane: Lane, 0 the slowest.
        s: Position along the road [m].
        speed: Speed that the vehicle comes with [m/s].
        kept: Part of the room behind it that the vehicle keeps if it has to move back [1].
    """

    valid: Mask
    lane: U8
    s: F32
    speed: F32
    kept: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class Followers:
    """Properties that limit how close behind another vehicle one may start; (simulation, vehicle).

    Attributes:
        length: Bumper to bumper [m].
        reaction_time: The driver's own [s].
        decel: Braking that the driver can count on [m/s^2].
    """

    length: F32
    reaction_time: F32
    decel: F32


def draw_layout(traffic: Traffic, zone: Zone, seed: int, index: U64, kind: U8) -> Draft:
    """Number of vehicles, their lanes, positions and speeds, each on its own.

    The ego and its leader get the smaller and the larger of two positions. Anyone else who comes
    to lie between them in their lane takes the leader's position, and the leader theirs.

    Args:
        traffic: What the specification says about vehicles.
        zone: Where they may start.
        seed: Seed of the data set.
        index: Simulation numbers, shape (simulation,).
        kind: Vehicle types, shape (simulation, vehicle).
    """
    noise = Noise(seed, index, Stream.LAYOUT)
    slots = range(kind.shape[1])
    fewest, most = traffic.vehicles
    count = fewest + noise.integer(most - fewest + 1)
    own_lane = np.array(zone.ego_lanes, np.uint8)[noise.integer(len(zone.ego_lanes))]
    positions: list[F32] = []
    lanes: list[U8] = []
    speeds: list[F32] = []
    kept: list[F32] = []
    for slot in slots:
        positions.append(spread(noise.uniform(), zone.low, zone.high))
        lanes.append(noise.integer(zone.num_lanes).astype(np.uint8))
        speeds.append(_speed(traffic, noise.uniform(), kind[:, slot], is_lead=slot == LEAD_SLOT))
        kept.append(spread(noise.uniform(), 0.0, MOST_KEPT))
    lanes[Role.EGO] = lanes[LEAD_SLOT] = own_lane
    valid = [slot < count for slot in slots]
    _limit_lanes(lanes, valid, zone)
    _put_lead_next(positions, lanes, valid)
    return Draft(
        valid=np.stack(valid, axis=1),
        lane=np.stack(lanes, axis=1),
        s=np.stack(positions, axis=1),
        speed=np.stack(speeds, axis=1),
        kept=np.stack(kept, axis=1),
    )


def settle(
    draft: Draft, followers: Followers, starts: Starts, zone: Zone, paces: Paces | None = None
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
    row = _Row(
        lane=in_order(np.where(draft.valid, draft.lane, no_lane), order),
        s=in_order(draft.s, order),
        speed=in_order(draft.speed, order),
        kept=in_order(draft.kept, order),
        half=in_order(np.float32(0.5) * followers.length, order),
        reaction=in_order(np.float32(REACTION_MARGIN) * followers.reaction_time, order),
        decel=in_order(followers.decel, order),
        min_gap=np.float32(starts.min_gap_m),
        slot=list(order.T),
        paces=paces,
    )
    rearmost = _push_apart(row, zone)
    for rank in range(len(row.s)):
        row.slow_for_road(rank)
    if not starts.allow_doomed:
        _make_avoidable(row, rearmost)
    return out_of_order(row.s, order), out_of_order(row.speed, order)


def _speed(traffic: Traffic, u: F32, kind: U8, *, is_lead: bool) -> F32:
    """Speed between the limits of the specification and of the vehicle [m/s]."""
    low_kmh, high_kmh = traffic.lead_speed_kmh if is_lead else traffic.speed_kmh
    low, high = np.float32(mps_from_kmh(low_kmh)), np.float32(mps_from_kmh(high_kmh))
    if is_lead:
        u = power(u, np.full_like(u, traffic.lead_speed_exponent))
    return spread(u, low, minimum(np.full_like(u, high), top_speeds()[kind]))


def _limit_lanes(lanes: list[U8], valid: list[Mask], zone: Zone) -> None:
    """Move each vehicle in a full lane to the next lane with room; changes `lanes`."""
    if zone.most_in_lane >= len(lanes):
        return
    inside = [np.zeros(lanes[0].shape, np.uint8) for _ in range(zone.num_lanes)]
    for slot, present in enumerate(valid):
        lane = lanes[slot]
        for _ in range(zone.num_lanes - 1):
            full = np.zeros(lane.shape, np.bool_)
            for number, others in enumerate(inside):
                full |= (lane == number) & (others >= zone.most_in_lane)
            lane = np.where(full, (lane + np.uint8(1)) % np.uint8(zone.num_lanes), lane)
        lanes[slot] = lane
        for number, others in enumerate(inside):
            others += (lane == number) & present


def _put_lead_next(positions: list[F32], lanes: list[U8], valid: list[Mask]) -> None:
    """Order the ego, its leader and the vehicles between them; changes `positions`."""
    first, second = positions[Role.EGO], positions[LEAD_SLOT]
    ego, lead = minimum(first, second), maximum(first, second)
    for slot in range(LEAD_SLOT + 1, len(positions)):
        position = positions[slot]
        between = (
            valid[slot] & (lanes[slot] == lanes[Role.EGO]) & (position >= ego) & (position < lead)
        )
        positions[slot] = np.where(between, lead, position)
        lead = np.where(between, position, lead)
    positions[Role.EGO], positions[LEAD_SLOT] = ego, lead


@dataclass(slots=True, kw_only=True)
class _Row:
    """The vehicles of each simulation from the rearmost to the foremost, one array for each.

    Attributes:
        lane: Lane; one of its own for an empty slot.
        s: Position [m].
        speed: Speed [m/s].
        kept: See `Draft`.
        half: Half of the length [m].
        reaction: Time until the driver brakes [s].
        decel: Braking that the driver can count on [m/s^2].
        min_gap: Smallest gap between two in a lane [m].
        slot: Slot of the vehicle.
        paces: Speeds for bends and limits (`Paces`); None on a road without them.
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
    paces: Paces | None

    def slow_for_road(self, rank: int) -> None:
        """Let a vehicle be no faster than its driver goes into what the road has ahead of it."""
        if self.paces is not None:
            pace = self.paces(self.s[rank], self.lane[rank], self.slot[rank])
            self.speed[rank] = minimum(self.speed[rank], pace)

    def apart(self, rear: int, front: int) -> F32:
        """Least distance of the centres of two vehicles; minus infinity in different lanes [m]."""
        distance = self.half[rear] + self.half[front] + self.min_gap
        return np.where(self.lane[rear] == self.lane[front], distance, np.float32(-np.inf))


def _push_apart(row: _Row, zone: Zone) -> list[F32]:
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


def _make_avoidable(row: _Row, rearmost: list[F32]) -> None:
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


def _ahead(row: _Row, follower: int, lowest: list[F32]) -> tuple[F32, F32]:
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
