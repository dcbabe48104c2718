"""Draws traffic as it is met: the ego among others, lane by lane, at a density.

There is room for few vehicles, and only those matter that the ego meets or that it sees. So they
are added one by one, each at that end of the traffic, in some lane ahead or behind, which would
come into the ego's sight first: slow vehicles far ahead in the slow lane, fast ones far behind in
the fast lane. The simulation ends before the ego sees the nearest end (ADR 16).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from overtaking import knowledge
from overtaking.core.arrays import F32, U8, U64, Mask
from overtaking.core.compiled import exp, maximum, minimum
from overtaking.core.philox import Stream
from overtaking.core.units import mps_from_kmh
from overtaking.knowledge import VEHICLE_CLASS_ORDER
from overtaking.scenarios.noise import Noise, choose, in_order, out_of_order, spread, weights_of
from overtaking.scenarios.schema_flow import Flow

UNCERTAINTY = knowledge.number("starts.toml", "flow.uncertainty")
"""By how much an end of the traffic may approach faster than is thought [m/s]."""

OWN_SHARE = knowledge.number("starts.toml", "flow.own_share")
"""What the ego drives at is between the speed of its lane and what it wants, at this part."""

BODY = knowledge.number("starts.toml", "flow.body")
"""Least part of a distance of centres that is vehicles [m]; with `LEAST_TIME_GAP` it is what no
spacing goes below."""

LEAST_TIME_GAP = knowledge.number("starts.toml", "flow.least_time_gap")
"""Least part of a distance of centres that is time at the lane's speed [s]."""

RELAXING_DECEL = knowledge.number("starts.toml", "flow.relaxing_decel")
"""A vehicle farther behind than it wants may be faster by what braking this softly makes up for
[m/s^2]: the comfortable braking of the calm."""

_FREE = np.float32(1e6)  # Position [m] and speed [m/s] of an absent vehicle.


@dataclass(frozen=True, slots=True, kw_only=True)
class FlowLayout:
    """Lanes and positions of the vehicles around the ego, slot 0, and how long it stays among them.

    Attributes:
        valid: Whether the slot holds a vehicle, (simulation, vehicle).
        lane: Lane, 0 the slowest, (simulation, vehicle).
        s: Position along the road, of the ego 0, (simulation, vehicle) [m].
        time: When the ego may see the first end of the traffic, (simulation,) [s].
    """

    valid: Mask
    lane: U8
    s: F32
    time: F32


def own_lane(flow: Flow, seed: int, index: U64) -> U8:
    """The lane that the ego starts in, shape (simulation,)."""
    u = Noise(seed, index, Stream.LAYOUT).uniform()
    weights = [flow.lanes[lane].density for lane in flow.ego_lanes]
    return np.array(flow.ego_lanes, np.uint8)[choose(u, weights)]


def surround(
    flow: Flow,
    seed: int,
    index: U64,
    lane: U8,
    wish: F32,
    horizon: float,
    bend: Callable[[str, F32], F32],
) -> FlowLayout:
    """Place vehicles around the ego until the traffic is long enough or all slots are taken.

    Args:
        flow: What the specification says about traffic.
        seed: Seed of the data set.
        index: Simulation numbers, shape (simulation,).
        lane: The ego's lane, shape (simulation,).
        wish: The speed that the ego wants, shape (simulation,) [m/s].
        horizon: How long the ego must not see an end, if there are vehicles enough [s].
        bend: Draws the density from where more happens (see `proposal`).
    """
    noise = Noise(seed, index, Stream.LAYOUT)
    noise.uniform()  # The ego's lane.
    per_metre = spread(bend("density", noise.uniform()), *_per_metre(flow))
    ends = _Ends(flow, per_metre, lane, wish, [noise.uniform() for _ in flow.lanes])
    fewest, most = flow.vehicles
    valid, lanes, places = [np.ones(len(index), np.bool_)], [lane], [np.zeros_like(wish)]
    for slot in range(1, most):
        needed = ends.time < np.float32(horizon)
        valid.append(needed | (slot < fewest))
        chosen, place = ends.add(noise.normal(), valid[-1])
        lanes.append(chosen)
        places.append(place)
    return FlowLayout(
        valid=np.stack(valid, axis=1),
        lane=np.stack(lanes, axis=1),
        s=np.stack(places, axis=1),
        time=ends.time,
    )


def kinds(flow: Flow, u: F32, lane: U8) -> U8:
    """Vehicle types by lane; the ego, in slot 0, never has two wheels.

    Args:
        flow: What the specification says about traffic.
        u: Uniform numbers, shape (simulation, vehicle).
        lane: Lanes, the same shape.
    """
    kind = np.zeros(u.shape, np.uint8)
    for number, one in enumerate(flow.lanes):
        weights = weights_of(one.types, VEHICLE_CLASS_ORDER)
        four_wheels = list(weights)
        for name in ("MC", "B"):
            four_wheels[VEHICLE_CLASS_ORDER.index(name)] = 0.0
        drawn = choose(u, weights)
        drawn[:, 0] = choose(u[:, 0], four_wheels)
        kind = np.where(lane == number, drawn, kind)
    return kind


def wishes(flow: Flow, cruise_factor: F32, kind: U8, lane: U8) -> F32:
    """The speed that each driver wants on a free road, (simulation, vehicle) [m/s]."""
    free = [mps_from_kmh(flow.free_speed_kmh.get(name, 1.0)) for name in VEHICLE_CLASS_ORDER]
    lanes = [one.wish for one in flow.lanes]
    return np.array(free, np.float32)[kind] * cruise_factor * np.array(lanes, np.float32)[lane]


def equilibrium(
    around: FlowLayout, half: F32, wish: F32, time_gap: F32, min_gap: F32
) -> tuple[F32, F32]:
    """Positions [m] and speeds [m/s] at which everyone follows, (simulation, vehicle).

    No vehicle is faster or nearer than its driver wants: one that was drawn so starts farther back.
    Who is farther behind may be closing in, as fast as comfortable braking makes up for.

    Args:
        around: Lanes and positions.
        half: Half of the lengths [m].
        wish: Speeds wanted [m/s].
        time_gap: Time gaps wanted [s].
        min_gap: Gaps wanted at standstill [m].
    """
    order = np.argsort(np.where(around.valid, around.s, np.inf), axis=1, kind="stable")
    # Empty slots come last and have a lane of their own.
    lane = in_order(np.where(around.valid, around.lane, np.uint8(255)), order)
    place, length = in_order(around.s, order), in_order(half, order)
    wanted, time, rest = (in_order(values, order) for values in (wish, time_gap, min_gap))
    free = np.full_like(place[0], _FREE)
    rear, pace = ([free] * (int(around.lane.max(initial=0)) + 1) for _ in range(2))
    speed = [free] * len(place)
    for rank in reversed(range(len(place))):
        bumper, ahead = _of_lane(rear, lane[rank]), _of_lane(pace, lane[rank])
        followed = minimum(wanted[rank], ahead)
        nearest = bumper - length[rank] - rest[rank] - time[rank] * followed
        place[rank] = minimum(place[rank], nearest)
        closing = np.sqrt(np.float32(2.0 * RELAXING_DECEL) * (nearest - place[rank]))
        speed[rank] = minimum(wanted[rank], ahead + closing)
        for number in range(len(rear)):
            here = lane[rank] == number
            rear[number] = np.where(here, place[rank] - length[rank], rear[number])
            pace[number] = np.where(here, speed[rank], pace[number])
    return out_of_order(place, order), out_of_order(speed, order)


def _of_lane(values: list[F32], lane: U8) -> F32:
    """The value of each simulation's lane, a large one outside of all."""
    chosen = np.full_like(values[0], _FREE)
    for number, value in enumerate(values):
        chosen = np.where(lane == number, value, chosen)
    return chosen


def _per_metre(flow: Flow) -> tuple[float, float]:
    low, high = flow.density_per_km_lane
    return 1e-3 * low, 1e-3 * high


# Traffic on a ring would show the ego the same truck every minute and a half. Moving vehicles from
# far behind to far ahead would make recorded states jump by a kilometre. So the traffic has ends.
class _Ends:
    """The ends of the traffic, in each lane ahead and behind, and when the ego sees them."""

    def __init__(self, flow: Flow, per_metre: F32, lane: U8, wish: F32, phase: list[F32]) -> None:
        """Begin with the ego alone; in the other lanes the first vehicle is somewhere beside it."""
        mean = np.float32(sum(one.density for one in flow.lanes) / len(flow.lanes))
        speeds = [np.float32(mps_from_kmh(one.speed_kmh)) for one in flow.lanes]
        own = np.zeros_like(wish)
        for number, speed in enumerate(speeds):
            own = np.where(lane == number, speed, own)
        self._own = own + np.float32(OWN_SHARE) * (wish - own)
        self._speeds = speeds
        self._back, self._front = (np.float32(limit) for limit in flow.sight_m)
        self._sigma = np.float32(flow.spacing_sigma)
        self._least = [np.float32(BODY) + np.float32(LEAST_TIME_GAP) * v for v in speeds]
        self._spacing = [
            np.float32(1.0) / (per_metre * np.float32(one.density) / mean) for one in flow.lanes
        ]
        self._empty = [lane != number for number in range(len(speeds))]
        start = [
            np.where(empty, (u - np.float32(0.5)) * spacing, np.float32(0.0))
            for u, spacing, empty in zip(phase, self._spacing, self._empty, strict=True)
        ]
        self._ahead, self._behind = list(start), [-place for place in start]

    @property
    def time(self) -> F32:
        """When the ego may see the first of the ends [s]."""
        first = self._times()[0]
        for time in self._times()[1:]:
            first = minimum(first, time)
        return first

    def add(self, z: F32, wanted: Mask) -> tuple[U8, F32]:
        """Add a vehicle at the end that would be seen first; its lane and place [m]."""
        times = self._times()
        first = np.zeros(z.shape, np.uint8)
        soonest = times[0]
        for number, time in enumerate(times):
            sooner = time < soonest
            first = np.where(sooner, np.uint8(number), first)
            soonest = np.where(sooner, time, soonest)
        lane, place = np.zeros(z.shape, np.uint8), np.zeros_like(z)
        for number in range(len(self._speeds)):
            ahead, behind = first == 2 * number, first == 2 * number + 1
            distance = self._distance(number, z)
            front, back = self._ahead[number] + distance, self._behind[number] + distance
            place = np.where(ahead, front, np.where(behind, -back, place))
            lane = np.where(ahead | behind, np.uint8(number), lane)
            self._ahead[number] = np.where(ahead & wanted, front, self._ahead[number])
            self._behind[number] = np.where(behind & wanted, back, self._behind[number])
            self._empty[number] = self._empty[number] & ~((ahead | behind) & wanted)
        return lane, place

    def _times(self) -> list[F32]:
        """When the ego may see each end, lane by lane, ahead and behind [s]."""
        zero, spare = np.float32(0.0), np.float32(UNCERTAINTY)
        times: list[F32] = []
        for number, speed in enumerate(self._speeds):
            faster = self._own - speed
            away = maximum(faster, np.zeros_like(faster)) + spare
            times.append((self._ahead[number] - self._front) / away)
            towards = np.where(faster < zero, -faster, zero) + spare
            times.append((self._behind[number] - self._back) / towards)
        return times

    def _distance(self, lane: int, z: F32) -> F32:
        """From the end of a lane to the next vehicle [m]; the first of a lane is at its place."""
        least = self._least[lane]
        free = maximum(self._spacing[lane] - least, np.full_like(z, np.float32(1.0)))
        drawn = least + free * exp(self._sigma * z - np.float32(0.5) * self._sigma * self._sigma)
        return np.where(self._empty[lane], np.float32(0.0), drawn)
