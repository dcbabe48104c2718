"""Draws the traffic of a road with one direction at a density, as in profile `motorway`.

`sample_motorway_traffic` takes section `[traffic]` of a specification with `mode = "flow"`, the
mode of such roads, and returns vehicles, drivers, lanes and a function for stations and speeds.
`sampler` calls it once for each block of simulations. The *ego* is the vehicle whose overtaking is
studied; it has slot 0. A *slot* is the position of a vehicle in the second axis of arrays, a
*station* a distance along the road. From the *deadline* on, a simulation ends as soon as the ego
neither overtakes nor is about to overtake, because it never began or has given up.

The traffic has ends: in each lane, the outermost vehicle ahead of the ego and the outermost one
behind it. Vehicles are placed from the ego outwards until all slots are filled, or until the ego
would see no end before the deadline and for the duration of a common overtake after it. Two simpler
ways were rejected: on a ring the ego would meet the same trucks again, and vehicles that are moved
from far behind to far ahead would make recorded states jump by a kilometre.

Arrays that decide scenarios are computed in float32 with the functions of `core.native`, which give
the same bits on every machine. *Importance sampling* draws rare scenarios more often: it may
replace random numbers, by name, and gives each simulation a weight (`random_draws`).
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from overtaking.core.arrays import F32, U8, Mask
from overtaking.core.errors import InfeasibleError
from overtaking.core.native import exp, maximum, minimum
from overtaking.core.random_numbers import Stream
from overtaking.core.units import mps_from_kmh
from overtaking.knowledge.toml_reader import number
from overtaking.knowledge.vehicle_classes import VEHICLE_CLASS_NAMES
from overtaking.model.scenario import MAX_VEHICLES
from overtaking.model.vehicles import EGO_SLOT, VehicleSpecs
from overtaking.scenarios.driver_sampling import (
    drivers_with_speed,
    max_cruise_factor,
    sample_traits,
)
from overtaking.scenarios.random_draws import (
    MAX_SIGMAS,
    NumberTransform,
    SampleBlock,
    choose_weighted,
    scale_to_range,
    sort_columns,
    unsort_columns,
    weights_of,
)
from overtaking.scenarios.safe_start import StartStates, StartZone, TrafficStart
from overtaking.scenarios.specification import Specification
from overtaking.scenarios.specification_values import TWO_WHEELERS
from overtaking.scenarios.traffic_specification import END_MARGIN, FlowTraffic
from overtaking.scenarios.vehicle_sampling import kind_number, sample_vehicles, top_speeds

# These numbers are choices; `knowledge/data/sampling.toml` has values and reasons, in section
# [flow]. They are Python floats, because `road_length` computes in float64.

APPROACH_MARGIN = number("sampling.flow.approach_margin")
"""The ego may approach an end of the traffic faster than estimated, by up to this speed [m/s]."""

EGO_SPEED_SHARE = number("sampling.flow.ego_speed_share")
"""The ego's estimated speed lies between the mean speed of its lane (share 0) and its desired speed
(share 1): other vehicles hold it up at times [1]."""

MIN_SPACING = number("sampling.flow.min_spacing")
"""Smallest distance between the centres of two vehicles of a lane at standstill [m]."""

MIN_TIME_GAP = number("sampling.flow.min_time_gap")
"""The smallest distance between centres is `MIN_SPACING` plus this time times the mean speed of the
lane [s]."""

RELAXING_DECEL = number("sampling.flow.relaxing_decel")
"""Deceleration of a vehicle that rolls without brakes [m/s^2]. A vehicle with a larger gap than its
driver wants may start faster than its leader. The difference is limited, so that rolling alone
brings the vehicle to its leader's speed before the gap is smaller than the desired one. So no
driver has to brake because of the start."""

PASSING_SPEED_FACTOR = number("sampling.flow.passing_speed_factor")
"""Largest speed while overtaking, over the desired speed [1]."""

OVERTAKE_DURATION = number("sampling.flow.overtake_duration")
"""Duration of a common overtake [s]. Vehicles are placed so that the ego sees no end of the traffic
for this long after the stated deadline, unless the slots run out."""

_FREE = np.float32(1e6)
"""Station [m] and speed [m/s] of an imaginary leader where the lane ahead is free: far away and
fast, so that it limits no follower."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleLayout:
    """Lanes and stations of the ego and the vehicles around it, shape (simulation, vehicle).

    Attributes:
        valid: Whether the slot holds a vehicle.
        lane: Lane, 0 the slowest.
        s: Station of the centre [m]. The zero does not matter: motorway traffic counts from the ego
            and has negative stations behind it.
    """

    valid: Mask
    lane: U8
    s: F32


@dataclass(frozen=True, slots=True, kw_only=True)
class EgoStart:
    """The ego's lane and the speed that it wants, which decide where the traffic is placed.

    Attributes:
        lane: Lane, 0 the slowest, shape (simulation,).
        desired_speed: Desired speed, shape (simulation,) [m/s].
    """

    lane: U8
    desired_speed: F32


def sample_motorway_traffic(block: SampleBlock, flow: FlowTraffic) -> TrafficStart:
    """Draw vehicles of one direction, the ego among them.

    Args:
        block: The simulations that are drawn together, with their random numbers.
        flow: Section `[traffic]` of the specification.

    Returns:
        Vehicles and drivers. Rain, fog and night lower the desired speeds, and with them the gaps.
        So the caller computes these speeds first and passes them to `states_at_speed`, which
        returns the stations.

    Raises:
        InfeasibleError: An end of the traffic is in sight at the start of a simulation.
    """
    lane = draw_ego_lane(block, flow)
    desired_speed, transform = _ego_desired_speed(block, flow, lane)
    ego = EgoStart(lane=lane, desired_speed=desired_speed)
    layout, end_in_sight_time = place_around_ego(block, flow, ego)
    _check_ends_out_of_sight(block, flow, end_in_sight_time)
    kinds = partial(vehicle_kinds, flow, lane=layout.lane)
    max_vehicles = flow.vehicles[1]
    # All slots get a vehicle and a driver; `layout.valid` selects the vehicles that take part.
    vehicles = sample_vehicles(block, kinds, flow.colours, max_vehicles)
    traits = sample_traits(block, vehicles.kind, transform)
    speeds = desired_speeds(flow, traits["cruise_factor"], vehicles.kind, layout.lane)
    speeds = minimum(speeds, top_speeds()[vehicles.kind])
    stated_deadline = np.float32(block.specification.time.attempt_deadline_s)
    return TrafficStart(
        vehicles=vehicles.replace(valid=layout.valid),
        drivers=drivers_with_speed(traits, speeds),
        lane=layout.lane,
        # `safe_start.repair_starts` moves a vehicle back that starts too near to its leader. This
        # share of the free space behind the vehicle is then not used. It is above 0 only in placed
        # traffic, where starts would otherwise pile up at the end of a short zone.
        kept_gap_share=np.zeros_like(speeds),
        zone=StartZone.whole_road(block.road),
        states_at_speed=partial(_states_at_speed, layout, vehicles, traits),
        # Where the slots run out, the deadline is the time at which an end may come into sight: an
        # attempt after it would meet an empty road. A deadline earlier by `OVERTAKE_DURATION`, as
        # on two-way roads, would shorten the time for attempts in dense traffic by 25 s; it is left
        # out, a choice. So an ego may see an end during a late attempt; `overtaking validate`
        # measures how often egos see an end.
        deadline=minimum(end_in_sight_time, stated_deadline),
    )


def road_length(specification: Specification, flow: FlowTraffic) -> float:
    """Length of a road that no vehicle leaves before the end of the simulation [m].

    The road is the sum of the longest traffic at the start and the longest way of its foremost
    vehicle. `place_around_ego` extends the traffic only at an end that the ego would see within the
    time T, the deadline plus `OVERTAKE_DURATION`, or until there are the fewest vehicles of the
    specification. So the length of the traffic is at most

        sights ahead and behind + (both closing speeds + both margins) T + two spacings

    If such traffic has fewer vehicles than the specification requires, a spacing is added for each
    missing vehicle. The traffic has at least three vehicles in each lane: one near the ego and one
    at each end. The two spacings in the formula count with their largest length, the spacings of
    missing vehicles with the mean, as they are many.

    A closing speed is the speed at which the ego and an end of the traffic approach each other, a
    negative one counting as 0. If both are positive, their sum is at most the range of the lanes'
    mean speeds. If only one is positive, the ego's estimated speed is above or below the mean
    speeds of all lanes.

    The function takes the larger of this bound and a simpler one, which is larger for long
    simulations: T is their duration, and the range plus the largest speed of a vehicle stands for
    the closing speeds. The simpler bound stays because another length of the road would change the
    hashes of data sets. In profile `motorway`, the road is 7 km longer than the foremost vehicle
    needs.

    Args:
        specification: The specification of the scenarios: its duration and its drivers.
        flow: Section `[traffic]` of the specification.
    """
    duration = specification.time.horizon_s
    end_time = specification.time.attempt_deadline_s + OVERTAKE_DURATION
    lane_speeds = [mps_from_kmh(lane.speed_kmh) for lane in flow.lanes]
    speed_range = max(lane_speeds) - min(lane_speeds) + 2.0 * APPROACH_MARGIN
    speed_factor = max(lane.speed_factor for lane in flow.lanes)
    speed_factor *= max_cruise_factor(specification.drivers)
    max_speed = speed_factor * mps_from_kmh(max(flow.free_speed_kmh.values()))
    max_ego_speed = EGO_SPEED_SHARE * max_speed + (1.0 - EGO_SPEED_SHARE) * max(lane_speeds)
    min_ego_speed = (1.0 - EGO_SPEED_SHARE) * min(lane_speeds)  # As if it wanted to stand.
    closing_speeds = max(max_ego_speed - min(lane_speeds), max(lane_speeds) - min_ego_speed)
    max_approach_speed = closing_speeds + 2.0 * APPROACH_MARGIN
    # `FlowLane.density` is a relative number. The density of a lane is at least the mean density of
    # all lanes over this ratio.
    density_ratio = max(lane.density for lane in flow.lanes)
    density_ratio /= min(lane.density for lane in flow.lanes)
    max_mean_spacing = 1e3 * density_ratio / flow.density_per_km_lane[0]
    # A drawn spacing exceeds the mean by at most this factor, as normal numbers end at MAX_SIGMAS.
    # The last bit of `np.exp` depends on the machine; `sampler` rounds the length up to 100 m.
    max_spacing = max_mean_spacing * float(np.exp(flow.spacing_sigma * float(MAX_SIGMAS)))
    num_missing = max(flow.vehicles[0] - 3 * len(flow.lanes), 0)
    beyond_sight = max_approach_speed * end_time + num_missing * max_mean_spacing
    beyond_sight = max(beyond_sight, (speed_range + max_speed) * duration)
    traffic = sum(flow.sight_m) + beyond_sight + 2.0 * max_spacing
    longest_way = PASSING_SPEED_FACTOR * max_speed * duration
    return END_MARGIN + traffic + longest_way  # The rearmost vehicle starts at END_MARGIN.


def draw_ego_lane(block: SampleBlock, flow: FlowTraffic) -> U8:
    """Draw the lane in which the ego starts, in proportion to the densities of its lanes.

    Args:
        block: The simulations that are drawn together.
        flow: Section `[traffic]` of the specification.

    Returns:
        Lanes, 0 the slowest, shape (simulation,).
    """
    u = block.stream(Stream.LAYOUT).uniform()
    weights = [flow.lanes[lane].density for lane in flow.ego_lanes]
    return np.array(flow.ego_lanes, np.uint8)[choose_weighted(u, weights)]


def place_around_ego(
    block: SampleBlock, flow: FlowTraffic, ego: EgoStart
) -> tuple[VehicleLayout, F32]:
    """Place vehicles around the ego until the traffic is long enough or all slots are filled.

    Args:
        block: The simulations that are drawn together.
        flow: Section `[traffic]` of the specification.
        ego: The ego's lane and desired speed.

    Returns:
        The vehicles, with the ego in slot 0, at station 0, and filled slots before empty ones; and
        the earliest time at which the ego may see an end of the traffic, negative if it may see one
        at the start, shape (simulation,) [s].
    """
    stream = block.stream(Stream.LAYOUT)  # It begins anew, so its first number comes once more.
    stream.uniform()  # Skips the number that `draw_ego_lane` used.
    # Importance sampling may replace the number, so that some densities are drawn more often.
    u = block.proposal.transform("density", stream.uniform())
    vehicles_per_metre = scale_to_range(u, *_vehicles_per_metre(flow))
    # Each lane takes one number, also the ego's, so that all simulations take the same count.
    first_positions = [stream.uniform() for _ in flow.lanes]
    ends = _TrafficEnds(flow, vehicles_per_metre, ego, first_positions)
    end_time = np.float32(block.specification.time.attempt_deadline_s + OVERTAKE_DURATION)
    min_vehicles, max_vehicles = flow.vehicles
    valid = [np.ones(len(ego.lane), np.bool_)]
    lanes, stations = [ego.lane], [np.zeros_like(ego.desired_speed)]
    for slot in range(1, max_vehicles):
        # A vehicle is needed if an end would come into sight, or if there are too few vehicles.
        is_needed = (ends.time < end_time) | (slot < min_vehicles)
        lane, station = ends.add(stream.normal(), is_needed)
        valid.append(is_needed)
        lanes.append(lane)
        stations.append(station)
    layout = VehicleLayout(
        valid=np.stack(valid, axis=1), lane=np.stack(lanes, axis=1), s=np.stack(stations, axis=1)
    )
    return layout, ends.time


def _check_ends_out_of_sight(block: SampleBlock, flow: FlowTraffic, end_in_sight_time: F32) -> None:
    """InfeasibleError if the ego may see an end of the traffic at the start of a simulation.

    Such traffic is so dense that the largest number of vehicles does not fill the distance that the
    ego sees: every attempt would meet less traffic than stated.

    Args:
        block: The simulations that are drawn together.
        flow: Section `[traffic]` of the specification.
        end_in_sight_time: Earliest time at which the ego may see an end, negative if it may see one
            at the start, shape (simulation,) [s].
    """
    # A deadline must be positive, so time 0 counts as the start.
    is_in_sight = end_in_sight_time <= np.float32(0.0)
    if not is_in_sight.any():
        return
    behind, ahead = flow.sight_m
    low, high = flow.density_per_km_lane
    max_vehicles = flow.vehicles[1]
    remedy = "lower it or shorten traffic.sight_m"
    if max_vehicles < MAX_VEHICLES:
        remedy += f", or raise traffic.vehicles to at most {MAX_VEHICLES}"
    raise InfeasibleError(
        what="traffic.density_per_km_lane",
        where=f"specification {block.specification.name}",
        expected=f"a density at which {max_vehicles} vehicles reach beyond the sight of the ego, "
        f"{behind:g} m behind and {ahead:g} m ahead in each of {len(flow.lanes)} lanes",
        got=f"{low:g} to {high:g}, too dense in scenario "
        f"{block.scenario_index[int(np.argmax(is_in_sight))]}",
        next_step=remedy,
    )


def vehicle_kinds(flow: FlowTraffic, u: F32, lane: U8) -> U8:
    """Choose vehicle classes by the weights of each lane.

    The ego, in slot 0, is never a motorcycle or bicycle, which is a choice: it gets another class
    of its lane, in proportion to their weights.

    Args:
        flow: Section `[traffic]` of the specification.
        u: Uniform numbers in (0, 1), shape (simulation, vehicle).
        lane: Lanes, 0 the slowest, the same shape.

    Returns:
        Positions in `VEHICLE_CLASS_NAMES`, the same shape.
    """
    kind = np.zeros(u.shape, np.uint8)
    for lane_index, flow_lane in enumerate(flow.lanes):
        drawn = choose_weighted(u, weights_of(flow_lane.types, VEHICLE_CLASS_NAMES))
        # Other lanes, in which the ego never starts, may have types with two wheels only: without
        # these types all weights would be 0.
        if lane_index in flow.ego_lanes:
            ego_types = {**flow_lane.types, **dict.fromkeys(TWO_WHEELERS, 0.0)}
            ego_weights = weights_of(ego_types, VEHICLE_CLASS_NAMES)
            drawn[:, EGO_SLOT] = choose_weighted(u[:, EGO_SLOT], ego_weights)
        kind = np.where(lane == lane_index, drawn, kind)
    return kind


def desired_speeds(flow: FlowTraffic, cruise_factor: F32, kind: U8, lane: U8) -> F32:
    """The speed that each driver wants on a free road, shape (simulation, vehicle) [m/s].

    Args:
        flow: Section `[traffic]` of the specification.
        cruise_factor: Trait of the driver, a factor on the usual speed of the vehicle class, shape
            (simulation, vehicle).
        kind: Vehicle classes, the same shape.
        lane: Lanes, 0 the slowest, the same shape.
    """
    # `FlowTraffic` checks that each class of its lanes has a speed. Other classes are not drawn:
    # the 1 km/h only fills their places in the table.
    free = [mps_from_kmh(flow.free_speed_kmh.get(name, 1.0)) for name in VEHICLE_CLASS_NAMES]
    factors = [flow_lane.speed_factor for flow_lane in flow.lanes]
    return np.array(free, np.float32)[kind] * cruise_factor * np.array(factors, np.float32)[lane]


def following_starts(
    layout: VehicleLayout, half_length: F32, desired_speed: F32, time_gap: F32, min_gap: F32
) -> StartStates:
    """Stations and speeds at which every vehicle follows the vehicle ahead of it in its lane.

    No vehicle is faster than its driver wants, or nearer to its leader: a vehicle that was drawn
    nearer starts farther back. A vehicle with a larger gap may close in, see `RELAXING_DECEL`.
    Vehicles are treated from the foremost to the rearmost, so that each leader is placed before its
    follower. `two_way_traffic` also uses this function.

    Args:
        layout: Lanes and stations; all other arrays have the shape of its lanes.
        half_length: Half of the lengths [m].
        desired_speed: Desired speeds [m/s].
        time_gap: Desired time gaps [s].
        min_gap: Desired gaps at standstill [m].

    Returns:
        Stations of the centres [m] and speeds [m/s], the same shape, without meaning where a slot
        is empty.
    """
    order = np.argsort(np.where(layout.valid, layout.s, np.inf), axis=1, kind="stable")
    # From here on, lists hold one array of shape (simulation,) for each rank; rank 0 is the
    # rearmost vehicle of a simulation. Empty slots come last, in lane 255, which no vehicle has:
    # roads have at most 8 lanes.
    lane = sort_columns(np.where(layout.valid, layout.lane, np.uint8(255)), order)
    s, half = sort_columns(layout.s, order), sort_columns(half_length, order)
    desired, gap_time, standstill_gap = (
        sort_columns(values, order) for values in (desired_speed, time_gap, min_gap)
    )
    free = np.full_like(s[0], _FREE)
    num_lanes = int(layout.lane.max(initial=0)) + 1
    # Rear bumper [m] and speed of the vehicle that was placed last in each lane; it leads the next
    # vehicle in this lane.
    leader_rear_s, leader_speeds = [free] * num_lanes, [free] * num_lanes
    speed = [free] * len(s)
    for rank in reversed(range(len(s))):
        rear_s = _value_in_lane(leader_rear_s, lane[rank])
        leader_speed = _value_in_lane(leader_speeds, lane[rank])
        following_speed = minimum(desired[rank], leader_speed)
        nearest_s = rear_s - half[rank] - standstill_gap[rank] - gap_time[rank] * following_speed
        s[rank] = minimum(s[rank], nearest_s)
        # The speed that rolling takes away over the distance to `nearest_s`, which is not negative
        # now: v^2 = 2 b distance.
        closing_speed = np.sqrt(np.float32(2.0 * RELAXING_DECEL) * (nearest_s - s[rank]))
        speed[rank] = minimum(desired[rank], leader_speed + closing_speed)
        for lane_index in range(num_lanes):
            is_in_lane = lane[rank] == lane_index
            leader_rear_s[lane_index] = np.where(
                is_in_lane, s[rank] - half[rank], leader_rear_s[lane_index]
            )
            leader_speeds[lane_index] = np.where(is_in_lane, speed[rank], leader_speeds[lane_index])
    return StartStates(s=unsort_columns(s, order), speed=unsort_columns(speed, order))


def _ego_desired_speed(
    block: SampleBlock, flow: FlowTraffic, lane: U8
) -> tuple[F32, NumberTransform]:
    """The speed that the ego wants, and the transform that gives its traits once more.

    The traffic is placed by the ego's desired speed, so the ego is drawn alone first and once more
    with the other vehicles. Both times it gets the same random numbers: each slot has a stream of
    its own, which `SampleBlock` begins anew for each caller. Importance sampling must see each
    number only once, because each call of `block.proposal.transform` multiplies the weight of the
    simulation. So the returned transform keeps the replaced numbers of the ego for the second draw.

    Args:
        block: The simulations that are drawn together.
        flow: Section `[traffic]` of the specification.
        lane: The ego's lane, shape (simulation,).

    Returns:
        Desired speeds, shape (simulation,) [m/s], and the transform for the second draw.
    """
    u = kind_number(block, EGO_SLOT)[:, None]
    kind = vehicle_kinds(flow, u, lane[:, None])
    ego_numbers: dict[str, F32] = {}

    def replay_ego_numbers(name: str, number: F32) -> F32:
        # Names of the ego's numbers begin with "ego_". The others come in the second draw alone.
        if not name.startswith("ego_"):
            return block.proposal.transform(name, number)
        if name not in ego_numbers:
            ego_numbers[name] = block.proposal.transform(name, number)
        return ego_numbers[name]

    traits = sample_traits(block, kind, replay_ego_numbers)
    speed = desired_speeds(flow, traits["cruise_factor"], kind, lane[:, None])
    return minimum(speed, top_speeds()[kind])[:, 0], replay_ego_numbers


def _states_at_speed(
    layout: VehicleLayout, vehicles: VehicleSpecs, traits: dict[str, F32], desired_speed: F32
) -> StartStates:
    """Stations and speeds of vehicles that follow each other and want `desired_speed` [m/s].

    Stations count from the beginning of the road; the rearmost vehicle is at `END_MARGIN`.
    """
    half_length, time_gap = 0.5 * vehicles.length, traits["time_gap"]
    states = following_starts(layout, half_length, desired_speed, time_gap, traits["min_gap"])
    rearmost_s = np.where(layout.valid, states.s, np.float32(np.inf)).min(axis=1)
    return states._replace(s=states.s - rearmost_s[:, None] + np.float32(END_MARGIN))


def _value_in_lane(values: list[F32], lane: U8) -> F32:
    """The value that belongs to the lane of each simulation; `_FREE` outside of all lanes.

    Args:
        values: For each lane, an array of shape (simulation,).
        lane: Lane in each simulation, shape (simulation,).
    """
    lane_value = np.full_like(values[0], _FREE)
    for lane_index, value in enumerate(values):
        lane_value = np.where(lane == lane_index, value, lane_value)
    return lane_value


def _vehicles_per_metre(flow: FlowTraffic) -> tuple[float, float]:
    """Smallest and largest mean density of a lane [1/m]."""
    low, high = flow.density_per_km_lane
    return 1e-3 * low, 1e-3 * high


class _TrafficEnds:
    """The ends of the traffic, in each lane ahead and behind, and when the ego may see them.

    The estimate assumes that all vehicles of a lane drive at its mean speed. The ego drives at a
    speed between this mean and its desired speed (`EGO_SPEED_SHARE`). It sees an end as soon
    as it is within `FlowTraffic.sight_m`, which states a distance behind and one ahead.
    """

    def __init__(
        self, flow: FlowTraffic, vehicles_per_metre: F32, ego: EgoStart, first_positions: list[F32]
    ) -> None:
        """Begin with the ego alone; in each other lane a first station near the ego is drawn.

        Args:
            flow: Section `[traffic]` of the specification.
            vehicles_per_metre: Mean density of the lanes, shape (simulation,) [1/m].
            ego: The ego's lane and desired speed.
            first_positions: For each lane, uniform numbers in (0, 1), shape (simulation,). They
                place the first station within half of a mean spacing around the ego.
        """
        # `FlowLane.density` is relative: only its ratio to the mean of the lanes has a meaning.
        mean_relative_density = np.float32(
            sum(lane.density for lane in flow.lanes) / len(flow.lanes)
        )
        speeds = [np.float32(mps_from_kmh(lane.speed_kmh)) for lane in flow.lanes]
        lane_speed = np.array(speeds, np.float32)[ego.lane]
        speed_gain = np.float32(EGO_SPEED_SHARE) * (ego.desired_speed - lane_speed)
        self._ego_speed = lane_speed + speed_gain
        self._speeds = speeds
        self._sight_behind, self._sight_ahead = (np.float32(sight) for sight in flow.sight_m)
        self._sigma = np.float32(flow.spacing_sigma)
        self._min_spacing = [
            np.float32(MIN_SPACING) + np.float32(MIN_TIME_GAP) * speed for speed in speeds
        ]
        self._mean_spacing = [
            np.float32(1.0)
            / (vehicles_per_metre * np.float32(lane.density) / mean_relative_density)
            for lane in flow.lanes
        ]
        self._is_empty = [ego.lane != lane_index for lane_index in range(len(speeds))]
        first_s = [
            np.where(is_empty, (u - np.float32(0.5)) * spacing, np.float32(0.0))
            for u, spacing, is_empty in zip(
                first_positions, self._mean_spacing, self._is_empty, strict=True
            )
        ]
        # Distances of the ends from the ego's start, by lane [m]. In an empty lane both ends are at
        # the first station, so one of the two distances is negative.
        self._ahead, self._behind = list(first_s), [-s for s in first_s]

    @property
    def time(self) -> F32:
        """Earliest time at which the ego may see an end, shape (simulation,) [s]."""
        soonest, *later_times = self._times()
        for time in later_times:
            soonest = minimum(soonest, time)
        return soonest

    def add(self, z: F32, is_needed: Mask) -> tuple[U8, F32]:
        """Add a vehicle at the end that the ego would see first.

        Args:
            z: Standard normal numbers, which decide the spacing, shape (simulation,).
            is_needed: Simulations that get the vehicle; in the others the ends stay where they are,
                shape (simulation,).

        Returns:
            Lanes and stations [m] of the vehicle, shape (simulation,), without meaning where none
            is needed.
        """
        times = self._times()
        # Ends are numbered as in `_times`: 2 * lane for the end ahead, 2 * lane + 1 for the end
        # behind.
        first_end = np.zeros(z.shape, np.uint8)
        soonest = times[0]
        for end, time in enumerate(times):
            is_sooner = time < soonest
            first_end = np.where(is_sooner, np.uint8(end), first_end)
            soonest = np.where(is_sooner, time, soonest)
        lane, station = np.zeros(z.shape, np.uint8), np.zeros_like(z)
        for lane_index in range(len(self._speeds)):
            is_ahead, is_behind = first_end == 2 * lane_index, first_end == 2 * lane_index + 1
            spacing = self._draw_spacing(lane_index, z)
            ahead = self._ahead[lane_index] + spacing
            behind = self._behind[lane_index] + spacing
            station = np.where(is_ahead, ahead, np.where(is_behind, -behind, station))
            lane = np.where(is_ahead | is_behind, np.uint8(lane_index), lane)
            gets_ahead, gets_behind = is_ahead & is_needed, is_behind & is_needed
            self._ahead[lane_index] = np.where(gets_ahead, ahead, self._ahead[lane_index])
            self._behind[lane_index] = np.where(gets_behind, behind, self._behind[lane_index])
            self._is_empty[lane_index] = self._is_empty[lane_index] & ~(gets_ahead | gets_behind)
        return lane, station

    def _times(self) -> list[F32]:
        """Time at which the ego may see each end [s]: lane by lane, ahead and then behind.

        Each array has shape (simulation,). A time is negative if the end is in sight at the start.
        """
        zero, margin = np.float32(0.0), np.float32(APPROACH_MARGIN)
        times: list[F32] = []
        for lane_index, speed in enumerate(self._speeds):
            speed_difference = self._ego_speed - speed
            # The ego catches up with the end ahead; the end behind catches up with the ego. For an
            # end that recedes, the closing speed is the margin.
            closing_ahead = maximum(speed_difference, zero) + margin
            times.append((self._ahead[lane_index] - self._sight_ahead) / closing_ahead)
            closing_behind = maximum(-speed_difference, zero) + margin
            times.append((self._behind[lane_index] - self._sight_behind) / closing_behind)
        return times

    def _draw_spacing(self, lane: int, z: F32) -> F32:
        """Distance between centres, from the end of a lane to the next vehicle [m].

        A minimum plus a lognormal part. The first vehicle of a lane starts at the lane's first
        station itself, at a distance of 0.
        """
        shortest = self._min_spacing[lane]
        # In a lane so dense that the mean spacing exceeds the minimum by less than 1 m, the free
        # part is 1 m (a choice): spacings still vary, and the density is a little lower than drawn.
        mean_free = maximum(self._mean_spacing[lane] - shortest, np.float32(1.0))
        # The mean of exp(sigma z - sigma^2 / 2) is 1 for standard normal z.
        exponent = self._sigma * z - np.float32(0.5) * self._sigma * self._sigma
        spacing = shortest + mean_free * exp(exponent)
        return np.where(self._is_empty[lane], np.float32(0.0), spacing)
