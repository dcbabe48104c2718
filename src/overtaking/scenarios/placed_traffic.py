"""Vehicles placed independently, as in the study."""

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

_SLACK = 0.01  # Rounding may take this much of a zone [m].


def sample_placed_traffic(
    block: SampleBlock, traffic: PlacedTraffic, zone: StartZone
) -> TrafficStart:
    """Draw vehicles placed independently, as in the study.

    Args:
        block: The simulations that are drawn together.
        traffic: Section `[traffic]` of the specification.
        zone: The part of the road on which vehicles may start, see `start_zone`.
    """
    kinds = partial(vehicle_kinds, traffic)
    vehicles = sample_vehicles(block, kinds, traffic.colours, traffic.vehicles[1])
    traits = sample_traits(block, vehicles.kind, block.proposal.transform)
    drawn = draw_placed_starts(block, traffic, zone, vehicles.kind)
    drivers = drivers_from_speeds(traits, drawn.speed, top_speeds()[vehicles.kind])
    vehicles = vehicles.replace(valid=drawn.valid)
    deadline = np.float32(block.specification.time.attempt_deadline_s)
    return TrafficStart(
        vehicles=with_able_bicycles(vehicles, drivers.desired_speed),
        drivers=drivers,
        lane=drawn.lane,
        kept_gap_share=drawn.kept_gap_share,
        zone=zone,
        # The vehicles start at the drawn speeds in any weather.
        states_at_speed=lambda _: StartStates(drawn.s, drawn.speed),
        deadline=np.full(block.scenario_index.shape, deadline, np.float32),
    )


def start_zone(spec: Specification, traffic: PlacedTraffic, road: Road) -> StartZone:
    """Where vehicles may start on a road.

    Raises:
        ConfigError: The zone or a lane is not on the road.
        InfeasibleError: The zone is too small, or a vehicle too slow, for the specification.
    """
    lanes = _ego_lanes(spec, traffic, road)
    low, high = _start_range(spec, traffic, road)
    _check_speeds(spec, traffic)
    room = max_length(traffic) + spec.starts.min_gap_m
    fit = math.floor((high - low - _SLACK) / room) + 1 if high - low > _SLACK else 1
    max_vehicles = traffic.vehicles[1]
    if fit < 2 or fit * road.num_lanes < max_vehicles:
        raise InfeasibleError(
            what="traffic.vehicles",
            where=f"specification {spec.name}",
            expected=f"at most {fit * road.num_lanes if fit > 1 else 1} on {high - low:g} m of "
            f"{road.num_lanes} lanes, with {room:.1f} m for each vehicle",
            got=max_vehicles,
            next_step="ask for fewer vehicles, a longer zone, or smaller gaps",
        )
    return StartZone(low=low, high=high, ego_lanes=lanes, num_lanes=road.num_lanes, max_in_lane=fit)


def draw_placed_starts(
    block: SampleBlock, traffic: PlacedTraffic, zone: StartZone, kind: U8
) -> DrawnStarts:
    """Draw the number of vehicles and their lanes, stations and speeds, independently.

    The ego and its leader get the smaller and the larger of two stations. A vehicle between them
    in their lane takes the leader's station, and the leader takes the vehicle's.

    Args:
        block: The simulations that are drawn together.
        traffic: Section `[traffic]` of the specification.
        zone: The part of the road on which vehicles may start.
        kind: Vehicle classes, shape (simulation, vehicle).
    """
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
        speeds.append(_speed(traffic, stream.uniform(), kind[:, slot], is_leader=is_leader))
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
    """The zone of the starts along the road [m]."""
    key, ends = "spawn_s_m", traffic.spawn_s_m
    if traffic.spawn_x_m is not None:
        key = "spawn_x_m"
        middle = 0.5 * (road.lane_boundaries[0] + road.lane_boundaries[-1])
        _, y = road.to_world(0.5 * road.length, middle)
        along, _ = road.to_road(np.array(traffic.spawn_x_m), np.full(2, float(y)))
        ends = (float(along.min()), float(along.max()))
    assert ends is not None  # The specification has one of the two.
    half = 0.5 * max_length(traffic)
    if ends[0] < half or ends[1] > road.length - half:
        # As long as the profile's where the road allows, in whole metres.
        first = math.ceil(half)
        last = math.floor(min(road.length - half, first + ends[1] - ends[0] + _SLACK))
        ready = f"add --set traffic.spawn_s_m={first}..{last}"
        raise ConfigError(
            what=f"traffic.{key}",
            where=f"specification {spec.name} on road {road.name}",
            expected=f"{half:g} to {road.length - half:g} m along the road, so that all are on it",
            got=f"{ends[0]:g} to {ends[1]:g} m along it",
            next_step=ready if last > first else "choose a longer road",
        )
    return ends


def _ego_lanes(spec: Specification, traffic: PlacedTraffic, road: Road) -> tuple[int, ...]:
    """Lanes for the ego: never the fastest, because it has no lane to overtake in."""
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
    """InfeasibleError if a type of vehicle is slower than the slowest speed asked for."""
    for key, low, weights in (
        ("speed_kmh", traffic.speed_kmh[0], traffic.types),
        ("speed_kmh", traffic.speed_kmh[0], traffic.ego_types),
        ("leader_speed_kmh", traffic.leader_speed_kmh[0], traffic.types),
    ):
        for name, weight in weights.items():
            top = float(top_speeds()[VEHICLE_CLASS_NAMES.index(name)])
            if weight > 0.0 and top < mps_from_kmh(low):
                raise InfeasibleError(
                    what=f"traffic.{key}",
                    where=f"specification {spec.name}",
                    expected=f"a speed that type {name} reaches, {kmh_from_mps(top):g} km/h",
                    got=f"{low:g} km/h at least",
                    next_step=f"lower it or leave out {name}",
                )


def _speed(traffic: PlacedTraffic, u: F32, kind: U8, *, is_leader: bool) -> F32:
    """Speed between the limits of the specification and of the vehicle [m/s]."""
    low_kmh, high_kmh = traffic.leader_speed_kmh if is_leader else traffic.speed_kmh
    low, high = np.float32(mps_from_kmh(low_kmh)), np.float32(mps_from_kmh(high_kmh))
    if is_leader:
        u = power(u, np.full_like(u, traffic.leader_speed_exponent))
    return scale_to_range(u, low, minimum(np.full_like(u, high), top_speeds()[kind]))


def _move_out_of_full_lanes(lanes: list[U8], valid: list[Mask], zone: StartZone) -> None:
    """Move each vehicle in a full lane to the next lane with room; changes `lanes`."""
    if zone.max_in_lane >= len(lanes):
        return
    inside = [np.zeros(lanes[0].shape, np.uint8) for _ in range(zone.num_lanes)]
    for slot, present in enumerate(valid):
        lane = lanes[slot]
        for _ in range(zone.num_lanes - 1):
            full = np.zeros(lane.shape, np.bool_)
            for lane_index, others in enumerate(inside):
                full |= (lane == lane_index) & (others >= zone.max_in_lane)
            lane = np.where(full, (lane + np.uint8(1)) % np.uint8(zone.num_lanes), lane)
        lanes[slot] = lane
        for lane_index, others in enumerate(inside):
            others += (lane == lane_index) & present


def _put_leader_ahead_of_ego(positions: list[F32], lanes: list[U8], valid: list[Mask]) -> None:
    """Order the ego, its leader and the vehicles between them; changes `positions`."""
    first, second = positions[EGO_SLOT], positions[LEADER_SLOT]
    ego, lead = minimum(first, second), maximum(first, second)
    for slot in range(LEADER_SLOT + 1, len(positions)):
        position = positions[slot]
        between = (
            valid[slot] & (lanes[slot] == lanes[EGO_SLOT]) & (position >= ego) & (position < lead)
        )
        positions[slot] = np.where(between, lead, position)
        lead = np.where(between, position, lead)
    positions[EGO_SLOT], positions[LEADER_SLOT] = ego, lead
