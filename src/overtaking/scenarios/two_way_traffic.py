"""Draws the traffic of a two-way road: who goes along with the ego, and who comes.

Every vehicle has a position in the frame of its own direction while it is placed: oncoming ones
count from the end of the road. Arrivals come at random times, no nearer than a headway, and whoever
would drive into a slower one ahead follows it.
"""

from dataclasses import fields
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, U8, U64
from overtaking.core.native import log, minimum
from overtaking.core.random_numbers import Stream
from overtaking.core.units import mps_from_kmh
from overtaking.knowledge.toml_reader import number
from overtaking.knowledge.vehicle_classes import VEHICLE_CLASS_NAMES
from overtaking.model.road import Road
from overtaking.model.vehicles import Role, VehicleKind
from overtaking.scenarios.driver_sampling import (
    drivers_with_speed,
    max_cruise_factor,
    sample_traits,
)
from overtaking.scenarios.motorway_traffic import (
    END_MARGIN,
    PASSING_MARGIN,
    RETURN_TIME,
    VehicleLayout,
    following_starts,
)
from overtaking.scenarios.random_draws import (
    NumberTransform,
    ProposalSampler,
    RandomStream,
    choose_weighted,
    scale_to_range,
    weights_of,
)
from overtaking.scenarios.safe_start import StartZone, TrafficStart
from overtaking.scenarios.specification import Specification
from overtaking.scenarios.traffic_specification import TwoWayTraffic
from overtaking.scenarios.vehicle_sampling import sample_vehicles, top_speeds, with_semitrailers

MAX_HEADWAY = number("sampling.toml", "two_way.max_headway")
"""Arrivals are no farther apart than this [s]; what comes later is not met anyway."""

MAX_PLATOON_HEADWAY = number("sampling.toml", "two_way.max_platoon_headway")
"""Who is held up follows within this time [s]."""
_DRAWS_PER_DESIRED_SPEED = 2  # Of each vehicle but the ego, before the flows are drawn.
_OWN, _OTHER = np.uint8(0), np.uint8(1)


def sample_two_way_traffic(
    spec: Specification,
    traffic: TwoWayTraffic,
    road: Road,
    seed: int,
    index: U64,
    bend: NumberTransform,
) -> TrafficStart:
    """Traffic in both directions, the ego one of it.

    Args:
        spec: What to sample.
        traffic: Its traffic.
        road: The road, as long as it takes.
        seed: Seed of the data set.
        index: Simulation numbers, shape (simulation,).
        bend: Draws from where more happens.
    """
    bodies = sample_vehicles(
        partial(_vehicle_kinds, traffic), traffic.colours, seed, index, traffic.vehicles[1]
    )
    traits = sample_traits(spec.drivers, seed, index, bodies.kind, bend)
    noise = RandomStream(seed, index, Stream.LAYOUT)
    wishes = _desired_speeds(traffic, noise, traits["cruise_factor"], bodies.kind)
    wishes = minimum(wishes, top_speeds()[bodies.kind])
    own, other = (np.float32(3600.0) / one for one in _flows_per_hour(traffic, noise, bend))
    begin = scale_to_range(bend("start", noise.uniform()), *traffic.start_s_m)
    lane = np.zeros(bodies.kind.shape, np.uint8)
    lane[:, 1 + traffic.ahead + traffic.behind :] = _OTHER
    pace = _typical_speed(traffic)
    places = _own_direction_stations(traffic, noise, own, begin, pace, bend)
    coming = _oncoming_stations(traffic, noise, other, np.float32(road.length) - begin, pace)
    drawn = np.stack([noise.uniform() for _ in range(bodies.kind.shape[1])], axis=1)
    bodies = with_semitrailers(bodies, drawn < np.float32(traffic.semitrailers))
    s = np.stack([*places, *coming], axis=1)
    # Who would start beyond an end of the road is met by nobody.
    valid = (s > np.float32(END_MARGIN)) & (s < np.float32(road.length - END_MARGIN))
    order = np.argsort(~valid, axis=1, kind="stable")

    def filled_first(values: NDArray[Any]) -> NDArray[Any]:
        return np.take_along_axis(values, order, axis=1)

    valid, lane, s, wishes = (filled_first(one) for one in (valid, lane, s, wishes))
    traits = {name: filled_first(one) for name, one in traits.items()}
    bodies = bodies.replace(
        **{one.name: filled_first(getattr(bodies, one.name)) for one in fields(bodies)}
    )
    around = VehicleLayout(
        valid=valid,
        lane=lane,
        s=s,
        time=np.full(index.shape, spec.time.horizon_s, np.float32),
    )

    def paced(wanted: F32) -> tuple[F32, F32]:
        return following_starts(
            around, 0.5 * bodies.length, wanted, traits["time_gap"], traits["min_gap"]
        )

    first = coming[-1] if coming else np.full_like(begin, -np.inf)
    ahead = np.float32(road.length) - first - begin
    closing = np.float32(2.0 * max_desired_speed(spec, traffic))
    seen = (ahead - np.float32(traffic.sight_m)) / closing - np.float32(RETURN_TIME)
    deadline = minimum(seen, np.full_like(seen, spec.time.attempt_deadline_s))
    return TrafficStart(
        vehicles=bodies.replace(valid=valid),
        drivers=drivers_with_speed(traits, wishes),
        lane=lane,
        kept_gap_share=np.zeros_like(wishes),
        zone=unbounded(road),
        deadline=np.where(deadline < 1.0, np.float32(1.0), deadline),
        states_at_speed=paced,
        is_oncoming=lane == _OTHER,
    )


def road_length(spec: Specification, traffic: TwoWayTraffic) -> float:
    """Length of a road that nobody leaves before the horizon [m]."""
    most = PASSING_MARGIN * max_desired_speed(spec, traffic)
    arrivals = traffic.oncoming * MAX_HEADWAY * float(_typical_speed(traffic))
    met = traffic.sight_m + 2.0 * most * spec.time.horizon_s
    platoon = traffic.ahead * MAX_PLATOON_HEADWAY * most
    return traffic.start_s_m[1] + platoon + min(arrivals, met) + END_MARGIN


def flows_per_second(spec: Specification, seed: int, index: U64) -> NDArray[np.float64]:
    """Vehicles per second in the ego's direction and in the other, shape (2, simulation).

    Args:
        spec: What is sampled, with traffic on a two-way road.
        seed: Seed of the data set.
        index: Simulation numbers, shape (simulation,).
    """
    traffic = spec.traffic
    assert isinstance(traffic, TwoWayTraffic)
    noise = RandomStream(seed, index, Stream.LAYOUT)
    for _ in range(_DRAWS_PER_DESIRED_SPEED * (traffic.vehicles[1] - 1)):
        noise.uniform()
    both = _flows_per_hour(traffic, noise, ProposalSampler(spec.proposal, seed, index).transform)
    return np.array(both, np.float64) / 3600.0


def max_desired_speed(spec: Specification, traffic: TwoWayTraffic) -> float:
    """The highest speed that anyone may want [m/s]."""
    return max_cruise_factor(spec.drivers) * mps_from_kmh(max(traffic.free_speed_kmh.values()))


def _vehicle_kinds(traffic: TwoWayTraffic, u: F32) -> U8:
    """Vehicle types from uniform numbers (simulation, vehicle)."""
    kind = choose_weighted(u, weights_of(traffic.types, VEHICLE_CLASS_NAMES))
    kind[:, Role.EGO] = choose_weighted(
        u[:, Role.EGO], weights_of(traffic.ego_types, VEHICLE_CLASS_NAMES)
    )
    return kind


def _typical_speed(traffic: TwoWayTraffic) -> np.float32:
    """The mean of what drivers want, by which headways become distances [m/s]."""
    total = sum(traffic.types.values())
    mean = sum(traffic.free_speed_kmh[name] * share for name, share in traffic.types.items())
    return np.float32(mps_from_kmh(mean / total))


def _desired_speeds(
    traffic: TwoWayTraffic, noise: RandomStream, cruise_factor: F32, kind: U8
) -> F32:
    """The speed that each driver wants on a free road, (simulation, vehicle) [m/s]."""
    free = [mps_from_kmh(traffic.free_speed_kmh.get(name, 1.0)) for name in VEHICLE_CLASS_NAMES]
    wish = np.array(free, np.float32)[kind] * cruise_factor
    low, high = (mps_from_kmh(one) for one in traffic.slow_speed_kmh)
    for slot in range(Role.EGO + 1, kind.shape[1]):
        is_slow = noise.uniform() < np.float32(traffic.slow_share)
        is_slow = is_slow & ~np.isin(kind[:, slot], (VehicleKind.MC, VehicleKind.B))
        slow = scale_to_range(noise.uniform(), low, high)
        wish[:, slot] = np.where(is_slow, minimum(slow, wish[:, slot]), wish[:, slot])
    return wish


def _flows_per_hour(
    traffic: TwoWayTraffic, noise: RandomStream, bend: NumberTransform
) -> tuple[F32, F32]:
    """Vehicles per hour in the own and in the other direction, (simulation,)."""
    flow = scale_to_range(bend("flow", noise.uniform()), *traffic.flow_vph)
    split = scale_to_range(noise.uniform(), *traffic.split)
    is_busier = noise.uniform() < np.float32(0.5)
    own = np.float32(2.0) * np.where(is_busier, split, np.float32(1.0) - split)
    return flow * own, flow * (np.float32(2.0) - own)


def next_headway(traffic: TwoWayTraffic, noise: RandomStream, mean: F32) -> F32:
    """The time between two arrivals: a least one, and the rest at random [s]."""
    least = np.float32(traffic.least_headway_s)
    drawn = least - (mean - least) * log(noise.uniform())
    return minimum(drawn, np.full_like(drawn, MAX_HEADWAY))


def _own_direction_stations(
    traffic: TwoWayTraffic,
    noise: RandomStream,
    mean: F32,
    begin: F32,
    pace: np.float32,
    bend: NumberTransform,
) -> list[F32]:
    """Where those of the own direction start: the ego, those ahead, those behind [m].

    Args:
        traffic: What the specification says.
        noise: Random numbers.
        mean: Mean time between arrivals [s].
        begin: Position of the ego [m].
        pace: Speed by which times become distances [m/s].
        bend: Draws from where more happens.
    """
    places, front, rear = [begin], begin, begin
    held_up = bend("held_up", noise.uniform()) < np.float32(traffic.held_up)
    near = scale_to_range(noise.uniform(), traffic.least_headway_s, MAX_PLATOON_HEADWAY)
    for rank in range(traffic.ahead):
        headway = next_headway(traffic, noise, mean)
        if rank == 0:
            headway = np.where(held_up, near, headway)
        front = front + headway * pace
        places.append(front)
    for _ in range(traffic.behind):
        rear = rear - next_headway(traffic, noise, mean) * pace
        places.append(rear)
    return places


def _oncoming_stations(
    traffic: TwoWayTraffic, noise: RandomStream, mean: F32, ego: F32, pace: np.float32
) -> list[F32]:
    """Where those who come start, in their own direction, the nearest first [m].

    Args:
        traffic: What the specification says.
        noise: Random numbers.
        mean: Mean time between arrivals [s].
        ego: Position of the ego in the frame of the other direction [m].
        pace: Speed by which times become distances [m/s].
    """
    places: list[F32] = []
    place = ego
    for rank in range(traffic.oncoming):
        headway = next_headway(traffic, noise, mean)
        if rank == 0:
            headway = headway * noise.uniform()  # The ego comes at any time between two of them.
        place = place - headway * pace
        places.append(place)
    return places


def unbounded(road: Road) -> StartZone:
    """Unbounded zone: only checks of safe starts move vehicles."""
    return StartZone(
        low=-road.length, high=road.length, ego_lanes=(0,), num_lanes=2, max_in_lane=255
    )
