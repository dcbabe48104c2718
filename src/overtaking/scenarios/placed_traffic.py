"""Draws traffic as the study of Pinto, Dutra and Fonseca (2023) does: each vehicle independently.

A few vehicles get random lanes, stations and speeds in a short *zone* of a road with one direction.
A *station* is the distance of a vehicle's centre along the road. The *ego* (slot 0), whose
overtaking is studied, starts behind a *leader* (slot 1) in its lane; a *slot* is the position of a
vehicle in the second axis of arrays. `sampler` calls `start_zone` once, which checks that the
specification fits the road, and `sample_placed_traffic` for each block of simulations. The drawn
starts may overlap or leave no time to brake. Later `safe_start.repair_starts` moves and slows the
vehicles; its smallest gap, `starts.min_gap_m`, decides how many vehicles fit into a zone.
"""

import math
from functools import partial

import numpy as np

from overtaking.core.arrays import F32, U8, Mask
from overtaking.core.errors import ConfigError, InfeasibleError
from overtaking.core.native import maximum, minimum, power
from overtaking.core.random_numbers import Stream
from overtaking.core.units import kmh_from_mps, mps_from_kmh
from overtaking.knowledge.vehicle_classes import VEHICLE_CLASS_NAMES
from overtaking.model.road import Road
from overtaking.model.vehicles import EGO_SLOT
from overtaking.scenarios.driver_sampling import LEADER_SLOT, drivers_from_speeds, sample_traits
from overtaking.scenarios.random_draws import SampleBlock, scale_to_range
from overtaking.scenarios.safe_start import (
    MAX_KEPT_GAP_SHARE,
    DrawnStarts,
    StartStates,
    StartZone,
    TrafficStart,
)
from overtaking.scenarios.specification import Specification
from overtaking.scenarios.traffic_specification import PlacedTraffic
from overtaking.scenarios.vehicle_sampling import (
    max_length,
    sample_vehicles,
    top_speeds,
    vehicle_kinds,
    with_able_bicycles,
)

_ROUNDING_MARGIN = 0.01
"""Length of a zone that rounding may take [m], far above the errors of float32 stations: less than
half a millimetre on roads up to 5 km."""


def sample_placed_traffic(
    block: SampleBlock, traffic: PlacedTraffic, zone: StartZone
) -> TrafficStart:
    """Draw the vehicles, drivers and starts of a block.

    Args:
        block: The simulations that are drawn together, with their random numbers.
        traffic: Section `[traffic]` of the specification.
        zone: The part of the road on which vehicles may start, see `start_zone`.
    """
    kinds = partial(vehicle_kinds, traffic)
    max_vehicles = traffic.vehicles[1]
    # All slots get a vehicle and a driver; `drawn.valid` selects the vehicles that take part.
    vehicles = sample_vehicles(block, kinds, traffic.colours, max_vehicles)
    # The transform lets importance sampling, which draws rare scenarios more often, replace some of
    # the random numbers.
    traits = sample_traits(block, vehicles.kind, block.proposal.transform)
    drawn = draw_placed_starts(block, traffic, zone, vehicles.kind)
    drivers = drivers_from_speeds(traits, drawn.speed, top_speeds()[vehicles.kind])
    vehicles = vehicles.replace(valid=drawn.valid)
    deadline = np.float32(block.specification.time.attempt_deadline_s)
    return TrafficStart(
        # The study has bicycles at 50 km/h and more, so bicycles have no top speed here and get the
        # power that their speed requires.
        vehicles=with_able_bicycles(vehicles, drivers.desired_speed),
        drivers=drivers,
        lane=drawn.lane,
        kept_gap_share=drawn.kept_gap_share,
        zone=zone,
        # The argument, the desired speed in the weather, has no effect: the vehicles start at the
        # drawn speeds in any weather.
        states_at_speed=lambda _: StartStates(drawn.s, drawn.speed),
        deadline=np.full(block.scenario_index.shape, deadline, np.float32),
    )


def start_zone(spec: Specification, traffic: PlacedTraffic, road: Road) -> StartZone:
    """The part of a road on which vehicles may start; checks the specification against the road.

    Args:
        spec: The specification of the scenarios.
        traffic: Its section `[traffic]`.
        road: The road.

    Raises:
        ConfigError: A value is wrong for this road: the zone or a lane is not on it.
        InfeasibleError: The values contradict each other: too many vehicles for the zone, or a
            vehicle type too slow for its lowest speed.
    """
    ego_lanes = _ego_lanes(spec, traffic, road)
    low, high = _start_range(spec, traffic, road)
    _check_speeds(spec, traffic)
    length = high - low
    space_per_vehicle = max_length(traffic) + spec.starts.min_gap_m
    # The zone holds the centres of the vehicles, so n vehicles need n - 1 spaces.
    max_in_lane = 1
    if length > _ROUNDING_MARGIN:
        max_in_lane += math.floor((length - _ROUNDING_MARGIN) / space_per_vehicle)
    max_vehicles = traffic.vehicles[1]
    # The ego and its leader share a lane, so each lane must hold two.
    if max_in_lane < 2 or max_in_lane * road.num_lanes < max_vehicles:
        # A lane that holds one vehicle has no space for a leader: the ego alone is feasible.
        feasible_vehicles = max_in_lane * road.num_lanes if max_in_lane > 1 else 1
        raise InfeasibleError(
            what="traffic.vehicles",
            where=f"specification {spec.name}",
            expected=f"at most {feasible_vehicles} on {length:g} m of {road.num_lanes} lanes, "
            f"with {space_per_vehicle:.1f} m for each vehicle",
            got=max_vehicles,
            next_step="ask for fewer vehicles, a longer zone, or smaller gaps",
        )
    return StartZone(
        low=low,
        high=high,
        ego_lanes=ego_lanes,
        num_lanes=road.num_lanes,
        max_in_lane=max_in_lane,
    )


def draw_placed_starts(
    block: SampleBlock, traffic: PlacedTraffic, zone: StartZone, kind: U8
) -> DrawnStarts:
    """Draw the number of vehicles and their lanes, stations and speeds, independently.

    Two corrections follow: a vehicle in a full lane moves to another lane, and stations are
    exchanged until the leader is the next vehicle ahead of the ego in its lane.

    Args:
        block: The simulations that are drawn together.
        traffic: Section `[traffic]` of the specification.
        zone: The part of the road on which vehicles may start.
        kind: Vehicle classes, positions in `VEHICLE_CLASS_NAMES`, shape (simulation, vehicle).

    Returns:
        Starts that may overlap or be too fast. Slots without a vehicle hold meaningless numbers.
    """
    # All draws below come from one stream: another order would change the scenarios of every seed.
    stream = block.stream(Stream.LAYOUT)
    slots = range(kind.shape[1])
    min_vehicles, max_vehicles = traffic.vehicles
    num_vehicles = min_vehicles + stream.integer(max_vehicles - min_vehicles + 1)
    ego_lane = np.array(zone.ego_lanes, np.uint8)[stream.integer(len(zone.ego_lanes))]
    stations: list[F32] = []
    lanes: list[U8] = []
    speeds: list[F32] = []
    kept_gap_shares: list[F32] = []
    for slot in slots:
        stations.append(scale_to_range(stream.uniform(), zone.low, zone.high))
        lanes.append(stream.integer(zone.num_lanes).astype(np.uint8))
        is_leader = slot == LEADER_SLOT
        speeds.append(_start_speed(traffic, stream.uniform(), kind[:, slot], is_leader=is_leader))
        # A vehicle that `repair_starts` moves back leaves this share of the space behind it free.
        kept_gap_shares.append(scale_to_range(stream.uniform(), 0.0, MAX_KEPT_GAP_SHARE))
    lanes[EGO_SLOT] = lanes[LEADER_SLOT] = ego_lane
    valid = [slot < num_vehicles for slot in slots]
    _move_out_of_full_lanes(lanes, valid, zone)
    _put_leader_ahead_of_ego(stations, lanes, valid)
    return DrawnStarts(
        valid=np.stack(valid, axis=1),
        lane=np.stack(lanes, axis=1),
        s=np.stack(stations, axis=1),
        speed=np.stack(speeds, axis=1),
        kept_gap_share=np.stack(kept_gap_shares, axis=1),
    )


def _start_range(spec: Specification, traffic: PlacedTraffic, road: Road) -> tuple[float, float]:
    """Smallest and largest station at which the centre of a vehicle may start [m]."""
    key, stations = "spawn_s_m", traffic.spawn_s_m
    if traffic.spawn_x_m is not None:
        # The study states its zone by the world coordinate x, on a road almost parallel to x. Both
        # ends are projected onto the road at the y of the middle of the road.
        key = "spawn_x_m"
        middle = 0.5 * (road.lane_boundaries[0] + road.lane_boundaries[-1])
        _, y = road.to_world(0.5 * road.length, middle)
        ends, _ = road.to_road(np.array(traffic.spawn_x_m), np.full(2, float(y)))
        stations = (float(ends.min()), float(ends.max()))
    assert stations is not None  # `PlacedTraffic` requires exactly one of the two keys.
    half_length = 0.5 * max_length(traffic)
    first_s, last_s = half_length, road.length - half_length
    if stations[0] < first_s or stations[1] > last_s:
        # Propose a zone of the same length, or as much of it as the road has, in whole metres. The
        # margin keeps a rounding error from taking the last metre.
        low = math.ceil(first_s)
        high = math.floor(min(last_s, low + stations[1] - stations[0] + _ROUNDING_MARGIN))
        proposal = f"add --set traffic.spawn_s_m={low}..{high}"
        raise ConfigError(
            what=f"traffic.{key}",
            where=f"specification {spec.name} on road {road.name}",
            expected=f"{first_s:g} to {last_s:g} m along the road, so that all are on it",
            got=f"{stations[0]:g} to {stations[1]:g} m along it",
            next_step=proposal if high > low else "choose a longer road",
        )
    return stations


def _ego_lanes(spec: Specification, traffic: PlacedTraffic, road: Road) -> tuple[int, ...]:
    """Lanes for the ego, 0 the slowest; not the fastest, which has no faster lane beside it."""
    lanes = traffic.ego_lanes
    if lanes is None:
        lanes = tuple(range(road.num_lanes - 1))
    if not lanes or max(lanes) > road.num_lanes - 2:
        raise ConfigError(
            what="traffic.ego_lanes",
            where=f"specification {spec.name} on road {road.name}",
            expected=f"lanes with one on their faster side, 0 to {road.num_lanes - 2}"
            if road.num_lanes > 1
            else "a road with at least two lanes",
            got=list(lanes) or f"{road.num_lanes} lane",
            next_step="leave out the fastest lane" if lanes else "choose another road",
        )
    return lanes


def _check_speeds(spec: Specification, traffic: PlacedTraffic) -> None:
    """Raise InfeasibleError if a vehicle class cannot reach the lowest speed of a range.

    Bicycles pass: `top_speeds` is infinite for them, because `with_able_bicycles` gives them any
    speed.
    """
    for key, low_kmh, weights in (
        ("speed_kmh", traffic.speed_kmh[0], traffic.types),
        ("speed_kmh", traffic.speed_kmh[0], traffic.ego_types),
        ("leader_speed_kmh", traffic.leader_speed_kmh[0], traffic.types),
    ):
        for name, weight in weights.items():
            top_speed = float(top_speeds()[VEHICLE_CLASS_NAMES.index(name)])
            if weight > 0.0 and top_speed < mps_from_kmh(low_kmh):
                raise InfeasibleError(
                    what=f"traffic.{key}",
                    where=f"specification {spec.name}",
                    expected=f"a speed that type {name} reaches, {kmh_from_mps(top_speed):g} km/h",
                    got=f"{low_kmh:g} km/h at least",
                    next_step=f"lower it or leave out {name}",
                )


def _start_speed(traffic: PlacedTraffic, u: F32, kind: U8, *, is_leader: bool) -> F32:
    """Speed of one vehicle in the range of the specification, at most its top speed [m/s].

    Args:
        traffic: Section `[traffic]` of the specification.
        u: Uniform numbers in (0, 1), shape (simulation,).
        kind: Vehicle class, shape (simulation,).
        is_leader: Whether the vehicle is the ego's leader, whose range and distribution differ.
    """
    low_kmh, high_kmh = traffic.leader_speed_kmh if is_leader else traffic.speed_kmh
    low, high = np.float32(mps_from_kmh(low_kmh)), np.float32(mps_from_kmh(high_kmh))
    if is_leader:
        # An exponent above 1 makes slow leaders more frequent.
        u = power(u, np.float32(traffic.leader_speed_exponent))
    return scale_to_range(u, low, minimum(top_speeds()[kind], high))


def _move_out_of_full_lanes(lanes: list[U8], valid: list[Mask], zone: StartZone) -> None:
    """Move each vehicle in a full lane to the next lane with space; changes `lanes`.

    It goes through the slots in order. The ego and its leader have the first two slots and keep
    their lane, because each lane has space for at least two vehicles.

    Args:
        lanes: For each slot the lanes, shape (simulation,).
        valid: For each slot whether it holds a vehicle, shape (simulation,).
        zone: The zone in which the vehicles start.
    """
    if zone.max_in_lane >= len(lanes):
        return  # All vehicles fit into one lane.
    num_in_lanes = [np.zeros(lanes[0].shape, np.uint8) for _ in range(zone.num_lanes)]
    for slot, is_valid in enumerate(valid):
        lane = lanes[slot]
        # After the last lane comes lane 0. `start_zone` ensures that some lane has space.
        for _ in range(zone.num_lanes - 1):
            is_full = np.zeros(lane.shape, np.bool_)
            for lane_index, num_in_lane in enumerate(num_in_lanes):
                is_full |= (lane == lane_index) & (num_in_lane >= zone.max_in_lane)
            lane = np.where(is_full, (lane + np.uint8(1)) % np.uint8(zone.num_lanes), lane)
        lanes[slot] = lane
        for lane_index, num_in_lane in enumerate(num_in_lanes):
            num_in_lane += (lane == lane_index) & is_valid


def _put_leader_ahead_of_ego(stations: list[F32], lanes: list[U8], valid: list[Mask]) -> None:
    """Exchange stations until the leader is the next vehicle ahead of the ego; changes `stations`.

    The ego gets the smaller and the leader the larger of their two stations. Each vehicle between
    them in their lane exchanges stations with the leader, which thereby comes nearer to the ego.
    The leader always exists: a simulation has at least two vehicles.

    Args:
        stations: For each slot the stations, shape (simulation,) [m].
        lanes: For each slot the lanes, shape (simulation,).
        valid: For each slot whether it holds a vehicle, shape (simulation,).
    """
    ego_s = minimum(stations[EGO_SLOT], stations[LEADER_SLOT])
    leader_s = maximum(stations[EGO_SLOT], stations[LEADER_SLOT])
    for slot in range(LEADER_SLOT + 1, len(stations)):
        s = stations[slot]
        is_between = valid[slot] & (lanes[slot] == lanes[EGO_SLOT]) & (s >= ego_s) & (s < leader_s)
        stations[slot] = np.where(is_between, leader_s, s)
        leader_s = np.where(is_between, s, leader_s)
    stations[EGO_SLOT], stations[LEADER_SLOT] = ego_s, leader_s
