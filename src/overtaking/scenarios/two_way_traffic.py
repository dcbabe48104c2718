"""Draws the traffic of a two-way road: the ego's direction and the oncoming vehicles.

`sample_two_way_traffic` takes section `[traffic]` of a specification with `mode = "two-way"` and
returns vehicles, drivers, lanes and a function for stations and speeds. `sampler` calls it once for
each block of simulations. The *ego* is the vehicle whose overtaking is studied; it has slot 0. A
*slot* is the position of a vehicle in the second axis of arrays; slots 1 and following are the
vehicles ahead of the ego, those behind it, and the oncoming ones.

Vehicles arrive with random *headways*, times between arrivals at a point of the road, which a
typical speed converts into distances. While vehicles are placed, each has a *station* along its own
direction: stations of oncoming vehicles count from the far end of the road. A vehicle that would
drive into a slower one ahead follows it. The *horizon* is the longest duration of a simulation.
From the *deadline* on, it also ends as soon as the ego neither overtakes nor is about to overtake,
because it never began or has given up.

Three constants also hold for motorway traffic: `END_MARGIN` (smallest distance of vehicles from the
ends of the road [m]), `PASSING_SPEED_FACTOR` (largest speed while overtaking over the desired
speed) and `OVERTAKE_DURATION` (duration of a common overtake [s]).

*Importance sampling* draws rare scenarios more often. For this, `proposal.transform` replaces a
random number, by its name, and weighs the simulation (`random_draws`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, F64, U8, U64, Mask
from overtaking.core.native import log, maximum, minimum
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
    OVERTAKE_DURATION,
    PASSING_SPEED_FACTOR,
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
"""Longest headway [s], 60 s, a choice. The ego rarely meets a vehicle that comes later.

The limit keeps the road short, whose length covers the longest possible headways. At low flows it
makes traffic denser than stated: with a minimum of 1.5 s the mean headway at 100 vehicles per hour
is 30 s instead of 36 s, at 50 per hour 41 s instead of 72 s; at 400 per hour the difference is
below 0.01 s."""

MAX_PLATOON_HEADWAY = number("sampling.two_way.max_platoon_headway")
"""An ego that is held up at the start follows the vehicle ahead within this headway, 4 s, a choice
[s]."""

MIN_DEADLINE = np.float32(1.0)
"""Smallest deadline [s], a choice: a scenario needs a positive one. Where the road behind the last
oncoming vehicle is in sight almost at once, the computed deadline is zero or negative."""

_DRAWS_PER_DESIRED_SPEED = 2
"""Random numbers that `_desired_speeds` takes from its stream for each vehicle but the ego. The
flows follow in the same stream, so `flows_per_second` first skips these numbers."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrivalProcess:
    """Arrivals in one direction with shifted exponential headways.

    A headway is a minimum plus an exponentially distributed part, and at most `MAX_HEADWAY`.

    Attributes:
        min_headway: Shortest headway [s].
        mean_headway: Mean headway without the limit `MAX_HEADWAY`, shape (simulation,) [s]. It
            exceeds `min_headway`, because `TwoWayTraffic` refuses flows above 90 % of
            1 / `min_headway`.
        speed: Speed that converts headways into distances, the same for all vehicles [m/s].
    """

    min_headway: float
    mean_headway: F32
    speed: np.float32

    def next_headway(self, stream: RandomStream) -> F32:
        """Time until the next vehicle, shape (simulation,) [s].

        Args:
            stream: Takes one uniform number of each simulation from it.
        """
        shortest = np.float32(self.min_headway)
        # -log(u) is exponentially distributed with a mean of 1.
        headway = shortest - (self.mean_headway - shortest) * log(stream.uniform())
        return minimum(headway, np.float32(MAX_HEADWAY))


class Arrivals(NamedTuple):
    """Arrivals in the ego's direction (`own`) and in the other direction."""

    own: ArrivalProcess
    oncoming: ArrivalProcess


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnSlots:
    """One vehicle for each slot; arrays have shape (simulation, vehicle).

    Attributes:
        vehicles: Vehicles, trucks with their semitrailers.
        traits: Parameters of the drivers by name, see `driver_sampling`.
        desired_speed: Speed that each driver wants on a free road [m/s].
        s: Station of the centre along the vehicle's own direction, so that a follower has the
            smaller station in both directions [m].
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
        block: The simulations that are drawn together, with their random numbers.
        traffic: Section `[traffic]` of the specification.

    Returns:
        Vehicles and drivers. Rain, fog and night lower the desired speeds, and with them the gaps.
        So the caller computes these speeds first and passes them to `states_at_speed`, which
        returns the stations, for oncoming vehicles from the far end of the road.
    """
    drawn = _draw_slots(block, traffic)
    # Vehicles beyond an end of the road are left out; the road is so long that the ego meets no
    # such oncoming vehicle before the horizon. The ego itself stays in slot 0, because
    # `TwoWayTraffic` refuses a range of its start, `start_s_m`, that begins within END_MARGIN.
    first_s, last_s = np.float32(END_MARGIN), np.float32(block.road.length - END_MARGIN)
    slots = _pack_slots(drawn, (drawn.s > first_s) & (drawn.s < last_s))
    lane = slots.is_oncoming.astype(np.uint8)  # Lane 0 in the ego's direction, lane 1 against it.
    layout = VehicleLayout(valid=slots.vehicles.valid, lane=lane, s=slots.s)
    return TrafficStart(
        vehicles=slots.vehicles,
        drivers=drivers_with_speed(slots.traits, slots.desired_speed),
        lane=lane,
        # `safe_start.repair_starts` moves a vehicle back that starts too near to its leader, into
        # the space behind it; a share of 0 of this space must stay free. Vehicles may move back
        # even beyond the beginning of the road: negative stations are valid, and the smallest one,
        # `low`, is farther back than any vehicle needs.
        kept_gap_share=np.zeros_like(slots.desired_speed),
        zone=StartZone.whole_road(block.road, low=-block.road.length),
        deadline=_attempt_deadline(block, traffic, drawn),
        states_at_speed=partial(_states_at_speed, layout, slots),
        is_oncoming=slots.is_oncoming,
    )


def road_length(specification: Specification, traffic: TwoWayTraffic) -> float:
    """Length of a road for the ego and all oncoming vehicles that it can meet [m].

    The sum of the ego's farthest start, a length for the vehicles ahead of it, and the stretch from
    which oncoming vehicles come. That stretch is the distance that two vehicles at the highest
    passing speed cover towards each other before the horizon, plus the sight distance. It is at
    most the distance over which all oncoming vehicles are spread at the longest headways.

    Known fault: with no or one oncoming vehicle, the stretch is so short that a fast ego may leave
    the road. With one, profile `rural` has 2.5 km of road beyond the farthest start, and the
    fastest driver wants to drive 3.0 km before the horizon.

    Args:
        specification: The specification of the scenarios: its horizon and its drivers.
        traffic: Section `[traffic]` of the specification.
    """
    horizon = specification.time.horizon_s
    max_speed = PASSING_SPEED_FACTOR * max_desired_speed(specification, traffic)
    max_oncoming_length = traffic.oncoming * MAX_HEADWAY * float(_typical_speed(traffic))
    length_within_reach = traffic.sight_m + 2.0 * max_speed * horizon
    # As if all vehicles ahead had headways of at most 4 s, a choice: only the first one ahead of a
    # held-up ego has. `sample_two_way_traffic` leaves out vehicles beyond the end of the road.
    platoon_length = traffic.ahead * MAX_PLATOON_HEADWAY * max_speed
    oncoming_stretch = min(max_oncoming_length, length_within_reach)
    return traffic.start_s_m[1] + platoon_length + oncoming_stretch + END_MARGIN


def flows_per_second(specification: Specification, seed: int, scenario_index: U64) -> F64:
    """Flows in the ego's direction and in the other, shape (2, simulation) [vehicles per second].

    Draws the flows of existing scenarios once more, because scenarios do not store them; the
    validation of profiles relates the frequency of passing to them. The limit `MAX_HEADWAY` makes
    the traffic denser than the flow at low flows.

    Args:
        specification: A specification with traffic on a two-way road.
        seed: Seed of the data set, 0 <= seed < 2**64.
        scenario_index: Index of each scenario, shape (simulation,).
    """
    traffic = specification.traffic
    assert isinstance(traffic, TwoWayTraffic)  # The caller ensures it.
    stream = RandomStream(seed, scenario_index, Stream.LAYOUT)
    for _ in range(_DRAWS_PER_DESIRED_SPEED * (traffic.num_slots - 1)):
        stream.uniform()
    proposal = ProposalSampler(specification.proposal or (), seed, scenario_index)
    flows = _flows_per_hour(traffic, stream, proposal.transform)
    return np.array(flows, np.float64) / 3600.0


def max_desired_speed(specification: Specification, traffic: TwoWayTraffic) -> float:
    """The highest desired speed of any driver [m/s].

    Args:
        specification: The specification of the scenarios: its drivers.
        traffic: Section `[traffic]` of the specification.
    """
    free_speed = mps_from_kmh(max(traffic.free_speed_kmh.values()))
    return max_cruise_factor(specification.drivers) * free_speed


def _draw_slots(block: SampleBlock, traffic: TwoWayTraffic) -> DrawnSlots:
    """Draw the ego, the vehicles ahead of it, those behind it, and the oncoming ones."""
    kinds = partial(_vehicle_kinds, traffic)
    vehicles = sample_vehicles(block, kinds, traffic.colours, traffic.num_slots)
    traits = sample_traits(block, vehicles.kind, block.proposal.transform)

    # All draws below come from one stream: another order would change the scenarios of every seed.
    # `proposal.transform` lets importance sampling replace a number, by its name.
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
    """Move the vehicles on the road to the first slots: a scenario has no empty slot before others.

    They stay in the order in which they were drawn. In all later slots `vehicles.valid` is False;
    these slots hold the vehicles that are left out.

    Args:
        drawn: A vehicle in each slot.
        is_on_road: Vehicles that stay, shape (simulation, vehicle).
    """
    order = np.argsort(~is_on_road, axis=1, kind="stable")

    def pack(values: NDArray[Any]) -> NDArray[Any]:
        return np.take_along_axis(values, order, axis=1)

    names = (field.name for field in fields(drawn.vehicles))
    columns = {name: pack(getattr(drawn.vehicles, name)) for name in names}
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
    """Stations of the ego, then of the vehicles ahead, then of the vehicles behind [m].

    Each group begins with the vehicle nearest to the ego. An ego that is held up has a short
    headway to the vehicle ahead; `following_starts` then makes it follow if it is faster.

    Args:
        block: The simulations that are drawn together.
        traffic: Section `[traffic]` of the specification.
        stream: The stream of the layout.
        arrivals: Arrivals in the ego's direction.
        ego_s: Station of the ego, shape (simulation,) [m].
    """
    u = block.proposal.transform("held_up", stream.uniform())
    is_held_up = u < np.float32(traffic.held_up)
    # `min_headway_s` may be larger than the longest headway of a platoon; it then is the headway.
    max_headway = max(traffic.min_headway_s, MAX_PLATOON_HEADWAY)
    platoon_headway = scale_to_range(stream.uniform(), traffic.min_headway_s, max_headway)
    stations, foremost_s, rearmost_s = [ego_s], ego_s, ego_s
    for rank in range(traffic.ahead):
        headway = arrivals.next_headway(stream)
        if rank == 0:
            headway = np.where(is_held_up, platoon_headway, headway)
        foremost_s = foremost_s + headway * arrivals.speed
        stations.append(foremost_s)
    for _ in range(traffic.behind):
        rearmost_s = rearmost_s - arrivals.next_headway(stream) * arrivals.speed
        stations.append(rearmost_s)
    return stations


def _oncoming_stations(
    traffic: TwoWayTraffic, stream: RandomStream, arrivals: ArrivalProcess, ego_s: F32
) -> list[F32]:
    """Stations of the oncoming vehicles from the far end, nearest to the ego first [m].

    All of them start beyond the ego, so the stations decrease.

    Args:
        traffic: Section `[traffic]` of the specification.
        stream: The stream of the layout.
        arrivals: Arrivals in the other direction.
        ego_s: Station of the ego, also from the far end, shape (simulation,) [m].
    """
    stations = []
    station = ego_s
    for rank in range(traffic.oncoming):
        headway = arrivals.next_headway(stream)
        if rank == 0:
            # The ego arrives at a random moment between two oncoming vehicles. A simplification:
            # more random moments fall into long headways, but this one is drawn like all others.
            headway = headway * stream.uniform()
        station = station - headway * arrivals.speed
        stations.append(station)
    return stations


def _draw_semitrailers(traffic: TwoWayTraffic, stream: RandomStream) -> Mask:
    """Slots that get a semitrailer if their vehicle is a truck, shape (simulation, vehicle)."""
    u = np.stack([stream.uniform() for _ in range(traffic.num_slots)], axis=1)
    return u < np.float32(traffic.semitrailers)


def _states_at_speed(layout: VehicleLayout, slots: DrawnSlots, speed: F32) -> StartStates:
    """Stations and speeds of vehicles that follow each other, with desired speeds `speed` [m/s]."""
    half_length = 0.5 * slots.vehicles.length
    time_gap, min_gap = slots.traits["time_gap"], slots.traits["min_gap"]
    return following_starts(layout, half_length, speed, time_gap, min_gap)


def _attempt_deadline(block: SampleBlock, traffic: TwoWayTraffic, drawn: DrawnSlots) -> F32:
    """The deadline of each simulation, see the module, shape (simulation,) [s].

    Only a fixed number of oncoming vehicles is drawn. The deadline is `OVERTAKE_DURATION` before
    the ego can see the empty road behind the last of them, so that a common overtake which begins
    at the deadline still meets complete traffic. Both vehicles are assumed to drive at the highest
    desired speed; higher speeds during an overtake are neglected, a choice.

    Args:
        block: The simulations that are drawn together.
        traffic: Section `[traffic]` of the specification.
        drawn: A vehicle in each slot as drawn, before any is left out: the last slot holds the
            farthest oncoming vehicle.
    """
    ego_s = drawn.s[:, EGO_SLOT]
    # Without oncoming vehicles, the last one is infinitely far: the stated deadline holds.
    last_oncoming_s = drawn.s[:, -1] if traffic.oncoming else np.full_like(ego_s, -np.inf)
    distance = np.float32(block.road.length) - last_oncoming_s - ego_s
    max_closing_speed = np.float32(2.0 * max_desired_speed(block.specification, traffic))
    time_until_in_sight = (distance - np.float32(traffic.sight_m)) / max_closing_speed
    deadline = time_until_in_sight - np.float32(OVERTAKE_DURATION)
    stated_deadline = np.full_like(deadline, block.specification.time.attempt_deadline_s)
    return maximum(minimum(deadline, stated_deadline), MIN_DEADLINE)


def _vehicle_kinds(traffic: TwoWayTraffic, u: F32) -> U8:
    """Vehicle classes, positions in `VEHICLE_CLASS_NAMES`, from uniform numbers of the same shape.

    Args:
        traffic: Section `[traffic]` of the specification.
        u: Numbers in (0, 1), shape (simulation, vehicle).
    """
    kind = choose_weighted(u, weights_of(traffic.types, VEHICLE_CLASS_NAMES))
    kind[:, EGO_SLOT] = choose_weighted(
        u[:, EGO_SLOT], weights_of(traffic.ego_types, VEHICLE_CLASS_NAMES)
    )
    return kind


def _typical_speed(traffic: TwoWayTraffic) -> np.float32:
    """Mean free speed of the vehicles, which converts headways into distances [m/s].

    The types of the ego and the lower speeds of slow vehicles do not enter: a choice.
    """
    # Versions of Python differ in the last bit of a `sum` in float64; float32 rounds it off.
    total = sum(traffic.types.values())
    mean = sum(traffic.free_speed_kmh[name] * share for name, share in traffic.types.items())
    return np.float32(mps_from_kmh(mean / total))


def _desired_speeds(
    traffic: TwoWayTraffic, stream: RandomStream, cruise_factor: F32, kind: U8
) -> F32:
    """The speed that each driver wants on a free road, shape (simulation, vehicle) [m/s].

    The ego and two-wheelers are never among the slow vehicles.

    Args:
        traffic: Section `[traffic]` of the specification.
        stream: The stream of the layout.
        cruise_factor: Trait of the driver, a factor on the free speed of the vehicle class, shape
            (simulation, vehicle).
        kind: Vehicle classes, the same shape.
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

    `traffic.flow_vph` is the mean of both directions, half of the flow of the road, and
    `traffic.split` the share of the busier direction in the flow of the road. Either direction is
    the busier one with a probability of one half.

    Args:
        traffic: Section `[traffic]` of the specification.
        stream: The stream of the layout, after the draws of `_desired_speeds`.
        transform: Importance sampling may replace the number "flow".
    """
    mean_flow = scale_to_range(transform("flow", stream.uniform()), *traffic.flow_vph)
    split = scale_to_range(stream.uniform(), *traffic.split)
    is_own_busier = stream.uniform() < np.float32(0.5)
    own_factor = np.float32(2.0) * np.where(is_own_busier, split, np.float32(1.0) - split)
    return mean_flow * own_factor, mean_flow * (np.float32(2.0) - own_factor)
