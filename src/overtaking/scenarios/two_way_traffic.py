"""Draws the traffic of a two-way road: the ego's direction and the oncoming vehicles.

Vehicles arrive with random headways. While they are placed, each vehicle has a station along its
own direction: stations of oncoming vehicles count from the far end of the road. A vehicle that
would drive into a slower one ahead follows it.

Three constants have the values of `motorway_traffic`: `END_MARGIN` [m], `PASSING_MARGIN` (largest
speed while overtaking over the desired speed) and `RETURN_TIME` (duration of a common overtake
[s]).
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, F64, U8, U64, Mask
from overtaking.core.native import log, minimum
from overtaking.core.random_numbers import Stream
from overtaking.core.units import mps_from_kmh
from overtaking.knowledge.toml_reader import number
from overtaking.knowledge.vehicle_classes import VEHICLE_CLASS_NAMES
from overtaking.model.vehicles import EGO_SLOT, VehicleKind, VehicleSpecs
from overtaking.scenarios.driver_sampling import (
    drivers_with_speed,
    max_cruise_factor,
    sample_traits,
)
from overtaking.scenarios.motorway_traffic import (
    PASSING_MARGIN,
    RETURN_TIME,
    VehicleLayout,
    following_starts,
)
from overtaking.scenarios.random_draws import (
    NumberTransform,
    ProposalSampler,
    RandomStream,
    SampleBlock,
    choose_weighted,
    scale_to_range,
    weights_of,
)
from overtaking.scenarios.safe_start import StartStates, StartZone, TrafficStart
from overtaking.scenarios.specification import Specification
from overtaking.scenarios.traffic_specification import END_MARGIN, TwoWayTraffic
from overtaking.scenarios.vehicle_sampling import sample_vehicles, top_speeds, with_semitrailers

MAX_HEADWAY = number("sampling.two_way.max_headway")
"""Longest headway between two arrivals [s]; the ego rarely meets a vehicle that comes later.

The limit holds for all headways, so the road can be short. At low flows it makes traffic denser
than stated: with a minimum of 1.5 s the mean headway at 100 vehicles per hour is 30 s instead of
36 s, at 50 per hour 41 s instead of 72 s; at 400 per hour the difference is below 0.01 s."""

MAX_PLATOON_HEADWAY = number("sampling.two_way.max_platoon_headway")
"""An ego that is held up at the start follows the vehicle ahead within this headway [s]."""

MIN_DEADLINE = np.float32(1.0)
"""A deadline must be positive. Where the road behind the last oncoming vehicle is in sight almost
at once, the computed deadline is zero or negative, and this one holds [s]."""

_DRAWS_PER_DESIRED_SPEED = 2
"""Numbers that `_desired_speeds` draws for each vehicle but the ego. `flows_per_second` skips them,
because the flows come after them in the same stream."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrivalProcess:
    """Arrivals at a point of the road with shifted exponential headways.

    A headway is a minimum plus an exponential part, and at most `MAX_HEADWAY`.

    Attributes:
        min_headway: Shortest time between two vehicles [s].
        mean_headway: Mean time between them before the limit, shape (simulation,) [s]. It exceeds
            `min_headway`, because `TwoWayTraffic` refuses flows above 90 % of 1 / `min_headway`.
        speed: Speed that converts headways into distances [m/s].
    """

    min_headway: float
    mean_headway: F32
    speed: np.float32

    def next_headway(self, stream: RandomStream) -> F32:
        """Time until the next vehicle, shape (simulation,) [s]."""
        shortest = np.float32(self.min_headway)
        headway = shortest - (self.mean_headway - shortest) * log(stream.uniform())
        return minimum(headway, np.full_like(headway, MAX_HEADWAY))


class Arrivals(NamedTuple):
    """Arrivals in the ego's direction and in the other."""

    own: ArrivalProcess
    oncoming: ArrivalProcess


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnSlots:
    """One vehicle for each slot; arrays have shape (simulation, vehicle).

    Stations count along each vehicle's own direction; for oncoming vehicles they begin at the far
    end of the road. A follower therefore has the smaller station in both directions.

    Attributes:
        vehicles: Vehicles, trucks with their semitrailers.
        traits: Traits of the drivers by name.
        desired_speed: Speed that each driver wants on a free road [m/s].
        s: Station of the centre [m].
        is_oncoming: Whether the vehicle drives in the other direction.
    """

    vehicles: VehicleSpecs
    traits: Mapping[str, F32]
    desired_speed: F32
    s: F32
    is_oncoming: Mask


def sample_two_way_traffic(block: SampleBlock, traffic: TwoWayTraffic) -> TrafficStart:
    """Draw vehicles in both directions of a road, the ego among them.

    Args:
        block: The simulations that are drawn together.
        traffic: Section `[traffic]` of the specification.
    """
    drawn = _draw_slots(block, traffic)
    # A vehicle beyond an end of the road is left out: no other meets it before the horizon. The ego
    # stays in slot 0, because `TwoWayTraffic` refuses a `start_s_m` that begins within END_MARGIN.
    first_s, last_s = np.float32(END_MARGIN), np.float32(block.road.length - END_MARGIN)
    slots = _pack_slots(drawn, (drawn.s > first_s) & (drawn.s < last_s))
    lane = slots.is_oncoming.astype(np.uint8)  # Lane 0 in the ego's direction, lane 1 against it.
    layout = VehicleLayout(
        valid=slots.vehicles.valid,
        lane=lane,
        s=slots.s,
        # `following_starts` does not read the time; `_attempt_deadline` handles the end of the
        # oncoming traffic.
        time=np.full(len(lane), block.specification.time.horizon_s, np.float32),
    )
    return TrafficStart(
        vehicles=slots.vehicles,
        drivers=drivers_with_speed(slots.traits, slots.desired_speed),
        lane=lane,
        # A vehicle that starts too near moves back as far as safe braking requires, and keeps no
        # share of the space behind it. That space may reach beyond the beginning of the road.
        kept_gap_share=np.zeros_like(slots.desired_speed),
        zone=StartZone.whole_road(block.road, low=-block.road.length),
        deadline=_attempt_deadline(block, traffic, drawn),
        states_at_speed=partial(_states_at_speed, layout, slots),
        is_oncoming=slots.is_oncoming,
    )


def road_length(specification: Specification, traffic: TwoWayTraffic) -> float:
    """Length of a road for the ego and all oncoming vehicles that it can meet [m].

    From the start on the road come, one behind the other: the ego's farthest start, the platoon
    ahead of it, and the stretch from which oncoming vehicles come. That stretch is as long as the
    distance that closes before the horizon if both drive at the highest passing speed, plus the
    sight distance; it is shorter if all oncoming vehicles fit into less. Vehicles ahead that are
    drawn beyond the end are left out.

    With no or one oncoming vehicle the road can be too short for a fast ego: with one, profile
    `rural` has 2.5 km of road beyond the farthest start, and the fastest driver wants to drive
    3.0 km before the horizon.
    """
    horizon = specification.time.horizon_s
    max_speed = PASSING_MARGIN * max_desired_speed(specification, traffic)
    drawn_length = traffic.oncoming * MAX_HEADWAY * float(_typical_speed(traffic))
    length_within_reach = traffic.sight_m + 2.0 * max_speed * horizon
    platoon = traffic.ahead * MAX_PLATOON_HEADWAY * max_speed
    return traffic.start_s_m[1] + platoon + min(drawn_length, length_within_reach) + END_MARGIN


def flows_per_second(specification: Specification, seed: int, scenario_index: U64) -> F64:
    """Vehicles per second in the ego's direction and in the other, shape (2, simulation).

    These are the flows as drawn; the limit `MAX_HEADWAY` makes the traffic denser at low flows.

    Args:
        specification: A specification with traffic on a two-way road.
        seed: Seed of the data set.
        scenario_index: Index of each scenario, shape (simulation,).
    """
    traffic = specification.traffic
    assert isinstance(traffic, TwoWayTraffic)
    stream = RandomStream(seed, scenario_index, Stream.LAYOUT)
    for _ in range(_DRAWS_PER_DESIRED_SPEED * (traffic.num_slots - 1)):
        stream.uniform()
    proposal = ProposalSampler(specification.proposal or (), seed, scenario_index)
    flows = _flows_per_hour(traffic, stream, proposal.transform)
    return np.array(flows, np.float64) / 3600.0


def max_desired_speed(specification: Specification, traffic: TwoWayTraffic) -> float:
    """The highest speed that a driver may want [m/s]."""
    free_speed = mps_from_kmh(max(traffic.free_speed_kmh.values()))
    return max_cruise_factor(specification.drivers) * free_speed


def _draw_slots(block: SampleBlock, traffic: TwoWayTraffic) -> DrawnSlots:
    """Draw the ego, the vehicles ahead of it, those behind it, and the oncoming ones."""
    kinds = partial(_vehicle_kinds, traffic)
    vehicles = sample_vehicles(block, kinds, traffic.colours, traffic.num_slots)
    traits = sample_traits(block, vehicles.kind, block.proposal.transform)

    # All draws below come from one stream: another order would change every seed's scenarios.
    # `transform` takes names of `specification.PROPOSAL_UNIFORMS`: "start", "held_up", "flow".
    stream = block.stream(Stream.LAYOUT)
    desired_speed = _desired_speeds(traffic, stream, traits["cruise_factor"], vehicles.kind)
    desired_speed = minimum(desired_speed, top_speeds()[vehicles.kind])
    arrivals = _arrivals(block, traffic, stream)
    ego_s = scale_to_range(block.proposal.transform("start", stream.uniform()), *traffic.start_s_m)
    own_s = _own_direction_stations(block, traffic, stream, arrivals.own, ego_s)
    ego_s_from_far_end = np.float32(block.road.length) - ego_s
    oncoming_s = _oncoming_stations(traffic, stream, arrivals.oncoming, ego_s_from_far_end)
    has_semitrailer = _draw_semitrailers(traffic, stream)

    s = np.stack([*own_s, *oncoming_s], axis=1)
    return DrawnSlots(
        vehicles=with_semitrailers(vehicles, has_semitrailer),
        traits=traits,
        desired_speed=desired_speed,
        s=s,
        is_oncoming=np.broadcast_to(np.arange(s.shape[1]) >= len(own_s), s.shape),
    )


def _pack_slots(drawn: DrawnSlots, is_on_road: Mask) -> DrawnSlots:
    """Vehicles on the road in the first slots, in the order in which they were drawn.

    The slots behind them keep the numbers of the other vehicles, and `vehicles.valid` is false.
    """
    order = np.argsort(~is_on_road, axis=1, kind="stable")

    def pack(values: NDArray[Any]) -> NDArray[Any]:
        return np.take_along_axis(values, order, axis=1)

    names = (field.name for field in fields(drawn.vehicles))
    columns = {name: pack(getattr(drawn.vehicles, name)) for name in names}
    # Every slot holds a vehicle as drawn, so only its place on the road decides.
    columns["valid"] = pack(is_on_road)
    return DrawnSlots(
        vehicles=drawn.vehicles.replace(**columns),
        traits={name: pack(values) for name, values in drawn.traits.items()},
        desired_speed=pack(drawn.desired_speed),
        s=pack(drawn.s),
        is_oncoming=pack(drawn.is_oncoming),
    )


def _arrivals(block: SampleBlock, traffic: TwoWayTraffic, stream: RandomStream) -> Arrivals:
    """Draw the flows of both directions."""
    speed = _typical_speed(traffic)
    own, oncoming = (
        ArrivalProcess(
            min_headway=traffic.min_headway_s,
            mean_headway=np.float32(3600.0) / flow,
            speed=speed,
        )
        for flow in _flows_per_hour(traffic, stream, block.proposal.transform)
    )
    return Arrivals(own, oncoming)


def _own_direction_stations(
    block: SampleBlock,
    traffic: TwoWayTraffic,
    stream: RandomStream,
    arrivals: ArrivalProcess,
    ego_s: F32,
) -> list[F32]:
    """Stations of the ego, then of the vehicles ahead, then of those behind [m].

    In each group the nearest comes first.
    """
    u = block.proposal.transform("held_up", stream.uniform())
    is_held_up = u < np.float32(traffic.held_up)
    platoon_headway = scale_to_range(stream.uniform(), traffic.min_headway_s, MAX_PLATOON_HEADWAY)
    stations, front, rear = [ego_s], ego_s, ego_s
    for rank in range(traffic.ahead):
        headway = arrivals.next_headway(stream)
        if rank == 0:
            headway = np.where(is_held_up, platoon_headway, headway)
        front = front + headway * arrivals.speed
        stations.append(front)
    for _ in range(traffic.behind):
        rear = rear - arrivals.next_headway(stream) * arrivals.speed
        stations.append(rear)
    return stations


def _oncoming_stations(
    traffic: TwoWayTraffic, stream: RandomStream, arrivals: ArrivalProcess, ego_s: F32
) -> list[F32]:
    """Stations of the oncoming vehicles from the far end, nearest to the ego first [m].

    Args:
        traffic: Section `[traffic]` of the specification.
        stream: The stream of the layout.
        arrivals: Arrivals in the other direction.
        ego_s: Station of the ego from the far end [m].
    """
    stations = []
    station = ego_s
    for rank in range(traffic.oncoming):
        headway = arrivals.next_headway(stream)
        if rank == 0:
            # The ego arrives at a random moment between two oncoming vehicles. This headway is
            # drawn like all others; the longer headways, into which more random moments fall, are
            # not favoured.
            headway = headway * stream.uniform()
        station = station - headway * arrivals.speed
        stations.append(station)
    return stations


def _draw_semitrailers(traffic: TwoWayTraffic, stream: RandomStream) -> Mask:
    """Slots that get a semitrailer if their vehicle is a truck, shape (simulation, vehicle)."""
    u = np.stack([stream.uniform() for _ in range(traffic.num_slots)], axis=1)
    return u < np.float32(traffic.semitrailers)


def _states_at_speed(layout: VehicleLayout, slots: DrawnSlots, speed: F32) -> StartStates:
    """Stations and speeds of vehicles that follow each other and want `speed` [m/s]."""
    half_length = 0.5 * slots.vehicles.length
    time_gap, min_gap = slots.traits["time_gap"], slots.traits["min_gap"]
    return following_starts(layout, half_length, speed, time_gap, min_gap)


def _attempt_deadline(block: SampleBlock, traffic: TwoWayTraffic, drawn: DrawnSlots) -> F32:
    """Time at which a simulation without an attempt ends, shape (simulation,) [s].

    Only a fixed number of oncoming vehicles is drawn. The deadline comes before the ego can see the
    empty road behind the last of them: by `RETURN_TIME`, so that a common overtake which begins at
    the deadline still meets complete traffic.
    """
    ego_s = drawn.s[:, EGO_SLOT]
    last_oncoming = drawn.s[:, -1] if traffic.oncoming else np.full_like(ego_s, -np.inf)
    distance = np.float32(block.road.length) - last_oncoming - ego_s
    max_closing_speed = np.float32(2.0 * max_desired_speed(block.specification, traffic))
    until_in_sight = (distance - np.float32(traffic.sight_m)) / max_closing_speed
    deadline = until_in_sight - np.float32(RETURN_TIME)
    longest = np.full_like(deadline, block.specification.time.attempt_deadline_s)
    deadline = minimum(deadline, longest)
    return np.where(deadline < MIN_DEADLINE, MIN_DEADLINE, deadline)


def _vehicle_kinds(traffic: TwoWayTraffic, u: F32) -> U8:
    """Vehicle classes from uniform numbers (simulation, vehicle)."""
    kind = choose_weighted(u, weights_of(traffic.types, VEHICLE_CLASS_NAMES))
    kind[:, EGO_SLOT] = choose_weighted(
        u[:, EGO_SLOT], weights_of(traffic.ego_types, VEHICLE_CLASS_NAMES)
    )
    return kind


def _typical_speed(traffic: TwoWayTraffic) -> np.float32:
    """Mean free speed of the vehicles, which converts headways into distances [m/s]."""
    # Versions of Python differ in the last bit of a `sum` in float64; float32 rounds it off.
    total = sum(traffic.types.values())
    mean = sum(traffic.free_speed_kmh[name] * share for name, share in traffic.types.items())
    return np.float32(mps_from_kmh(mean / total))


def _desired_speeds(
    traffic: TwoWayTraffic, stream: RandomStream, cruise_factor: F32, kind: U8
) -> F32:
    """The speed that each driver wants on a free road, (simulation, vehicle) [m/s].

    The ego and two-wheelers are never among the slow vehicles.
    """
    # A class without a free speed is never drawn: `TwoWayTraffic` requires a speed for each class
    # in `types` and `ego_types`. The 1 km/h fills its place in the table.
    free = [mps_from_kmh(traffic.free_speed_kmh.get(name, 1.0)) for name in VEHICLE_CLASS_NAMES]
    speed = np.array(free, np.float32)[kind] * cruise_factor
    low, high = (mps_from_kmh(limit) for limit in traffic.slow_speed_kmh)
    for slot in range(EGO_SLOT + 1, kind.shape[1]):
        is_slow = stream.uniform() < np.float32(traffic.slow_share)
        is_slow = is_slow & ~np.isin(kind[:, slot], (VehicleKind.MOTORCYCLE, VehicleKind.BICYCLE))
        slow_speed = scale_to_range(stream.uniform(), low, high)
        speed[:, slot] = np.where(is_slow, minimum(slow_speed, speed[:, slot]), speed[:, slot])
    return speed


def _flows_per_hour(
    traffic: TwoWayTraffic, stream: RandomStream, transform: NumberTransform
) -> tuple[F32, F32]:
    """Vehicles per hour in the ego's and in the other direction, shape (simulation,).

    `traffic.flow_vph` is the mean of both directions, half of the flow of the road.
    """
    mean_flow = scale_to_range(transform("flow", stream.uniform()), *traffic.flow_vph)
    split = scale_to_range(stream.uniform(), *traffic.split)
    is_busier = stream.uniform() < np.float32(0.5)
    own_factor = np.float32(2.0) * np.where(is_busier, split, np.float32(1.0) - split)
    return mean_flow * own_factor, mean_flow * (np.float32(2.0) - own_factor)
