"""Traffic of one direction at a density."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from overtaking.core.arrays import F32, U8, U64, Mask
from overtaking.core.native import exp, maximum, minimum
from overtaking.core.random_numbers import Stream
from overtaking.core.units import mps_from_kmh
from overtaking.knowledge.toml_reader import number
from overtaking.knowledge.vehicle_classes import VEHICLE_CLASS_NAMES
from overtaking.model.road import Road
from overtaking.model.vehicles import Role
from overtaking.scenarios.driver_sampling import (
    drivers_with_speed,
    max_cruise_factor,
    sample_traits,
)
from overtaking.scenarios.random_draws import (
    MAX_SIGMAS,
    NumberTransform,
    RandomStream,
    choose_weighted,
    scale_to_range,
    sort_columns,
    unsort_columns,
    weights_of,
)
from overtaking.scenarios.safe_start import StartZone, TrafficStart
from overtaking.scenarios.specification import Specification
from overtaking.scenarios.traffic_specification import FlowTraffic
from overtaking.scenarios.vehicle_sampling import kind_number, sample_vehicles, top_speeds

APPROACH_MARGIN = number("sampling.toml", "flow.approach_margin")
"""By how much an end of the traffic may approach faster than is thought [m/s]."""

EGO_SPEED_SHARE = number("sampling.toml", "flow.ego_speed_share")
"""What the ego drives at is between the speed of its lane and what it wants, at this part."""

MIN_SPACING = number("sampling.toml", "flow.min_spacing")
"""Least part of a distance of centres that is vehicles [m]; with `LEAST_TIME_GAP` it is what no
spacing goes below."""

MIN_TIME_GAP = number("sampling.toml", "flow.min_time_gap")
"""Least part of a distance of centres that is time at the lane's speed [s]."""

RELAXING_DECEL = number("sampling.toml", "flow.relaxing_decel")
"""A vehicle farther behind than it wants may be faster by what braking this softly makes up for
[m/s^2]: the comfortable braking of the calm."""
_FREE = np.float32(1e6)  # Position [m] and speed [m/s] of an absent vehicle.


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleLayout:
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


def draw_ego_lane(flow: FlowTraffic, seed: int, index: U64) -> U8:
    """The lane that the ego starts in, shape (simulation,)."""
    u = RandomStream(seed, index, Stream.LAYOUT).uniform()
    weights = [flow.lanes[lane].density for lane in flow.ego_lanes]
    return np.array(flow.ego_lanes, np.uint8)[choose_weighted(u, weights)]


def place_around_ego(
    flow: FlowTraffic,
    seed: int,
    index: U64,
    lane: U8,
    wish: F32,
    horizon: float,
    bend: Callable[[str, F32], F32],
) -> VehicleLayout:
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
    noise = RandomStream(seed, index, Stream.LAYOUT)
    noise.uniform()  # The ego's lane.
    per_metre = scale_to_range(bend("density", noise.uniform()), *_per_metre(flow))
    ends = _TrafficEnds(flow, per_metre, lane, wish, [noise.uniform() for _ in flow.lanes])
    fewest, most = flow.vehicles
    valid, lanes, places = [np.ones(len(index), np.bool_)], [lane], [np.zeros_like(wish)]
    for slot in range(1, most):
        needed = ends.time < np.float32(horizon)
        valid.append(needed | (slot < fewest))
        chosen, place = ends.add(noise.normal(), valid[-1])
        lanes.append(chosen)
        places.append(place)
    return VehicleLayout(
        valid=np.stack(valid, axis=1),
        lane=np.stack(lanes, axis=1),
        s=np.stack(places, axis=1),
        time=ends.time,
    )


def vehicle_kinds(flow: FlowTraffic, u: F32, lane: U8) -> U8:
    """Vehicle types by lane; the ego, in slot 0, never has two wheels.

    Args:
        flow: What the specification says about traffic.
        u: Uniform numbers, shape (simulation, vehicle).
        lane: Lanes, the same shape.
    """
    kind = np.zeros(u.shape, np.uint8)
    for lane_index, one in enumerate(flow.lanes):
        weights = weights_of(one.types, VEHICLE_CLASS_NAMES)
        four_wheels = list(weights)
        for name in ("MC", "B"):
            four_wheels[VEHICLE_CLASS_NAMES.index(name)] = 0.0
        drawn = choose_weighted(u, weights)
        drawn[:, 0] = choose_weighted(u[:, 0], four_wheels)
        kind = np.where(lane == lane_index, drawn, kind)
    return kind


def desired_speeds(flow: FlowTraffic, cruise_factor: F32, kind: U8, lane: U8) -> F32:
    """The speed that each driver wants on a free road, (simulation, vehicle) [m/s]."""
    free = [mps_from_kmh(flow.free_speed_kmh.get(name, 1.0)) for name in VEHICLE_CLASS_NAMES]
    lanes = [one.wish for one in flow.lanes]
    return np.array(free, np.float32)[kind] * cruise_factor * np.array(lanes, np.float32)[lane]


def following_starts(
    around: VehicleLayout, half: F32, wish: F32, time_gap: F32, min_gap: F32
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
    lane = sort_columns(np.where(around.valid, around.lane, np.uint8(255)), order)
    place, length = sort_columns(around.s, order), sort_columns(half, order)
    wanted, time, rest = (sort_columns(values, order) for values in (wish, time_gap, min_gap))
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
        for lane_index in range(len(rear)):
            here = lane[rank] == lane_index
            rear[lane_index] = np.where(here, place[rank] - length[rank], rear[lane_index])
            pace[lane_index] = np.where(here, speed[rank], pace[lane_index])
    return unsort_columns(place, order), unsort_columns(speed, order)


def _of_lane(values: list[F32], lane: U8) -> F32:
    """The value of each simulation's lane, a large one outside of all."""
    chosen = np.full_like(values[0], _FREE)
    for lane_index, value in enumerate(values):
        chosen = np.where(lane == lane_index, value, chosen)
    return chosen


def _per_metre(flow: FlowTraffic) -> tuple[float, float]:
    low, high = flow.density_per_km_lane
    return 1e-3 * low, 1e-3 * high


# Traffic on a ring would show the ego the same truck every minute and a half. Moving vehicles from
# far behind to far ahead would make recorded states jump by a kilometre. So the traffic has ends.
class _TrafficEnds:
    """The ends of the traffic, in each lane ahead and behind, and when the ego sees them."""

    def __init__(
        self, flow: FlowTraffic, per_metre: F32, lane: U8, wish: F32, phase: list[F32]
    ) -> None:
        """Begin with the ego alone; in the other lanes the first vehicle is somewhere beside it."""
        mean = np.float32(sum(one.density for one in flow.lanes) / len(flow.lanes))
        speeds = [np.float32(mps_from_kmh(one.speed_kmh)) for one in flow.lanes]
        own = np.zeros_like(wish)
        for lane_index, speed in enumerate(speeds):
            own = np.where(lane == lane_index, speed, own)
        self._own = own + np.float32(EGO_SPEED_SHARE) * (wish - own)
        self._speeds = speeds
        self._back, self._front = (np.float32(limit) for limit in flow.sight_m)
        self._sigma = np.float32(flow.spacing_sigma)
        self._least = [np.float32(MIN_SPACING) + np.float32(MIN_TIME_GAP) * v for v in speeds]
        self._spacing = [
            np.float32(1.0) / (per_metre * np.float32(one.density) / mean) for one in flow.lanes
        ]
        self._empty = [lane != lane_index for lane_index in range(len(speeds))]
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
        for rank, time in enumerate(times):
            sooner = time < soonest
            first = np.where(sooner, np.uint8(rank), first)
            soonest = np.where(sooner, time, soonest)
        lane, place = np.zeros(z.shape, np.uint8), np.zeros_like(z)
        for lane_index in range(len(self._speeds)):
            ahead, behind = first == 2 * lane_index, first == 2 * lane_index + 1
            distance = self._distance(lane_index, z)
            front, back = self._ahead[lane_index] + distance, self._behind[lane_index] + distance
            place = np.where(ahead, front, np.where(behind, -back, place))
            lane = np.where(ahead | behind, np.uint8(lane_index), lane)
            self._ahead[lane_index] = np.where(ahead & wanted, front, self._ahead[lane_index])
            self._behind[lane_index] = np.where(behind & wanted, back, self._behind[lane_index])
            self._empty[lane_index] = self._empty[lane_index] & ~((ahead | behind) & wanted)
        return lane, place

    def _times(self) -> list[F32]:
        """When the ego may see each end, lane by lane, ahead and behind [s]."""
        zero, spare = np.float32(0.0), np.float32(APPROACH_MARGIN)
        times: list[F32] = []
        for lane_index, speed in enumerate(self._speeds):
            faster = self._own - speed
            away = maximum(faster, np.zeros_like(faster)) + spare
            times.append((self._ahead[lane_index] - self._front) / away)
            towards = np.where(faster < zero, -faster, zero) + spare
            times.append((self._behind[lane_index] - self._back) / towards)
        return times

    def _distance(self, lane: int, z: F32) -> F32:
        """From the end of a lane to the next vehicle [m]; the first of a lane is at its place."""
        least = self._least[lane]
        free = maximum(self._spacing[lane] - least, np.full_like(z, np.float32(1.0)))
        drawn = least + free * exp(self._sigma * z - np.float32(0.5) * self._sigma * self._sigma)
        return np.where(self._empty[lane], np.float32(0.0), drawn)


PASSING_MARGIN = number("sampling.toml", "flow.passing_margin")
"""Largest speed while overtaking, over the desired speed."""

RETURN_TIME = number("sampling.toml", "flow.return_time")
"""How much longer than until the last attempt the traffic lasts where there are vehicles enough: a
common overtake [s]."""

END_MARGIN = number("sampling.toml", "flow.end_margin")
"""Road behind the rearmost vehicle [m]."""


def sample_motorway_traffic(
    spec: Specification, flow: FlowTraffic, road: Road, seed: int, index: U64, bend: NumberTransform
) -> TrafficStart:
    """Traffic as it is met, the ego one of it.

    Args:
        spec: What to sample.
        flow: Its traffic.
        road: The road.
        seed: Seed of the data set.
        index: Simulation numbers, shape (simulation,).
        bend: Draws from where more happens.
    """
    own_lane = draw_ego_lane(flow, seed, index)
    wish, bent = _ego_desired_speed(spec, flow, seed, index, own_lane, bend)
    until = spec.time.attempt_deadline_s + RETURN_TIME
    around = place_around_ego(flow, seed, index, own_lane, wish, until, bend)
    kinds = partial(vehicle_kinds, flow, lane=around.lane)
    bodies = sample_vehicles(kinds, flow.colours, seed, index, flow.vehicles[1])
    traits = sample_traits(spec.drivers, seed, index, bodies.kind, bent)
    wishes = desired_speeds(flow, traits["cruise_factor"], bodies.kind, around.lane)
    wishes = minimum(wishes, top_speeds()[bodies.kind])

    def pace(wanted: F32) -> tuple[F32, F32]:
        s, speed = following_starts(
            around, 0.5 * bodies.length, wanted, traits["time_gap"], traits["min_gap"]
        )
        return _on_road(s, around.valid), speed

    return TrafficStart(
        vehicles=bodies.replace(valid=around.valid),
        drivers=drivers_with_speed(traits, wishes),
        lane=around.lane,
        kept_gap_share=np.zeros_like(wishes),
        zone=unbounded(road),
        states_at_speed=pace,
        deadline=minimum(around.time, np.float32(spec.time.attempt_deadline_s)),
    )


def road_length(spec: Specification, flow: FlowTraffic) -> float:
    """Length of a road that no vehicle leaves before the horizon [m]."""
    speeds = [mps_from_kmh(lane.speed_kmh) for lane in flow.lanes]
    faster = max(speeds) - min(speeds) + 2.0 * APPROACH_MARGIN
    wish = max(lane.wish for lane in flow.lanes) * max_cruise_factor(spec.drivers)
    fastest = wish * mps_from_kmh(max(flow.free_speed_kmh.values()))
    free = max(lane.density for lane in flow.lanes) / min(lane.density for lane in flow.lanes)
    longest = 1e3 * free / flow.density_per_km_lane[0]
    longest *= float(np.exp(flow.spacing_sigma * float(MAX_SIGMAS)))
    traffic = sum(flow.sight_m) + (faster + fastest) * spec.time.horizon_s + 2.0 * longest
    return END_MARGIN + traffic + PASSING_MARGIN * fastest * spec.time.horizon_s


def _ego_desired_speed(
    spec: Specification, flow: FlowTraffic, seed: int, index: U64, lane: U8, bend: NumberTransform
) -> tuple[F32, NumberTransform]:
    """The speed that the ego wants [m/s], and what gives its temper and traits once more.

    The traffic is placed by what the ego wants, so it is drawn before the others are.
    """
    u = kind_number(seed, index, Role.EGO)[:, None]
    kind = vehicle_kinds(flow, u, lane[:, None])
    drawn: dict[str, F32] = {}

    def remembered(name: str, u: F32) -> F32:
        if not name.startswith("ego_"):
            return bend(name, u)
        if name not in drawn:
            drawn[name] = bend(name, u)
        return drawn[name]

    traits = sample_traits(spec.drivers, seed, index, kind, remembered)
    wish = desired_speeds(flow, traits["cruise_factor"], kind, lane[:, None])
    return minimum(wish, top_speeds()[kind])[:, 0], remembered


def _on_road(s: F32, valid: Mask) -> F32:
    """Positions along the road with the rearmost vehicle near its begin [m]."""
    rearmost = s[:, 0]
    for slot in range(1, s.shape[1]):
        place = np.where(valid[:, slot], s[:, slot], rearmost)
        rearmost = minimum(rearmost, place)
    return s - rearmost[:, None] + np.float32(END_MARGIN)


def unbounded(road: Road) -> StartZone:
    """Unbounded zone: only start-safety checks move vehicles."""
    lanes = tuple(range(road.num_lanes))
    return StartZone(
        low=0.0, high=road.length, ego_lanes=lanes, num_lanes=road.num_lanes, max_in_lane=255
    )
