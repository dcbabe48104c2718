"""Vehicles placed independently, as in the study."""

import math
from functools import partial

import numpy as np

from overtaking.core.arrays import F32, U8, U64, Mask
from overtaking.core.errors import ConfigError, InfeasibleError
from overtaking.core.native import maximum, minimum, power
from overtaking.core.random_numbers import Stream
from overtaking.core.units import kmh_from_mps, mps_from_kmh
from overtaking.knowledge.vehicle_classes import VEHICLE_CLASS_NAMES
from overtaking.model.road import Road
from overtaking.model.vehicles import Role
from overtaking.scenarios.driver_sampling import LEADER_SLOT, drivers_from_speeds, sample_traits
from overtaking.scenarios.random_draws import NumberTransform, RandomStream, scale_to_range
from overtaking.scenarios.safe_start import MAX_KEPT_GAP_SHARE, DrawnStarts, StartZone, TrafficStart
from overtaking.scenarios.specification import Specification
from overtaking.scenarios.traffic_specification import PlacedTraffic
from overtaking.scenarios.vehicle_sampling import (
    max_length,
    sample_vehicles,
    top_speeds,
    vehicle_kinds,
    with_able_bicycles,
)


def draw_placed_starts(
    traffic: PlacedTraffic, zone: StartZone, seed: int, index: U64, kind: U8
) -> DrawnStarts:
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
    noise = RandomStream(seed, index, Stream.LAYOUT)
    slots = range(kind.shape[1])
    fewest, most = traffic.vehicles
    count = fewest + noise.integer(most - fewest + 1)
    own_lane = np.array(zone.ego_lanes, np.uint8)[noise.integer(len(zone.ego_lanes))]
    positions: list[F32] = []
    lanes: list[U8] = []
    speeds: list[F32] = []
    kept: list[F32] = []
    for slot in slots:
        positions.append(scale_to_range(noise.uniform(), zone.low, zone.high))
        lanes.append(noise.integer(zone.num_lanes).astype(np.uint8))
        speeds.append(_speed(traffic, noise.uniform(), kind[:, slot], is_lead=slot == LEADER_SLOT))
        kept.append(scale_to_range(noise.uniform(), 0.0, MAX_KEPT_GAP_SHARE))
    lanes[Role.EGO] = lanes[LEADER_SLOT] = own_lane
    valid = [slot < count for slot in slots]
    _move_out_of_full_lanes(lanes, valid, zone)
    _put_leader_ahead_of_ego(positions, lanes, valid)
    return DrawnStarts(
        valid=np.stack(valid, axis=1),
        lane=np.stack(lanes, axis=1),
        s=np.stack(positions, axis=1),
        speed=np.stack(speeds, axis=1),
        kept_gap_share=np.stack(kept, axis=1),
    )


def _speed(traffic: PlacedTraffic, u: F32, kind: U8, *, is_lead: bool) -> F32:
    """Speed between the limits of the specification and of the vehicle [m/s]."""
    low_kmh, high_kmh = traffic.lead_speed_kmh if is_lead else traffic.speed_kmh
    low, high = np.float32(mps_from_kmh(low_kmh)), np.float32(mps_from_kmh(high_kmh))
    if is_lead:
        u = power(u, np.full_like(u, traffic.lead_speed_exponent))
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
    first, second = positions[Role.EGO], positions[LEADER_SLOT]
    ego, lead = minimum(first, second), maximum(first, second)
    for slot in range(LEADER_SLOT + 1, len(positions)):
        position = positions[slot]
        between = (
            valid[slot] & (lanes[slot] == lanes[Role.EGO]) & (position >= ego) & (position < lead)
        )
        positions[slot] = np.where(between, lead, position)
        lead = np.where(between, position, lead)
    positions[Role.EGO], positions[LEADER_SLOT] = ego, lead


_SLACK = 0.01  # Metres of a zone that rounding may take.


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
    most = traffic.vehicles[1]
    if fit < 2 or fit * road.num_lanes < most:
        raise InfeasibleError.of(
            what="traffic.vehicles",
            where=f"specification {spec.name}",
            expected=f"at most {fit * road.num_lanes if fit > 1 else 1} on {high - low:g} m of "
            f"{road.num_lanes} lanes, with {room:.1f} m for each vehicle",
            got=most,
            next_step="ask for fewer vehicles, a longer zone, or smaller gaps",
        )
    return StartZone(low=low, high=high, ego_lanes=lanes, num_lanes=road.num_lanes, max_in_lane=fit)


def _start_range(spec: Specification, traffic: PlacedTraffic, road: Road) -> tuple[float, float]:
    """The zone of the starts along the road [m]."""
    key, ends = "spawn_s_m", traffic.spawn_s_m
    if traffic.spawn_x_m is not None:
        key = "spawn_x_m"
        middle = 0.5 * (road.boundaries[0] + road.boundaries[-1])
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
        raise ConfigError.of(
            what=f"traffic.{key}",
            where=f"specification {spec.name} on road {road.name}",
            expected=f"{half:g} to {road.length - half:g} m along the road, so that all are on it",
            got=f"{ends[0]:g} to {ends[1]:g} m along it",
            next_step=ready if last > first else "choose a longer road",
        )
    return ends


def _ego_lanes(spec: Specification, traffic: PlacedTraffic, road: Road) -> tuple[int, ...]:
    """Lanes for the ego: never the fastest, beside which there is none to overtake in."""
    given = traffic.ego_lanes
    lanes = tuple(range(road.num_lanes - 1)) if given is None else given
    if not lanes or max(lanes) > road.num_lanes - 2:
        raise ConfigError.of(
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
        ("lead_speed_kmh", traffic.lead_speed_kmh[0], traffic.types),
    ):
        for name, weight in weights.items():
            top = float(top_speeds()[VEHICLE_CLASS_NAMES.index(name)])
            if weight > 0.0 and top < mps_from_kmh(low):
                raise InfeasibleError.of(
                    what=f"traffic.{key}",
                    where=f"specification {spec.name}",
                    expected=f"a speed that type {name} reaches, {kmh_from_mps(top):g} km/h",
                    got=f"{low:g} km/h at least",
                    next_step=f"lower it or leave out {name}",
                )


def sample_placed_traffic(
    spec: Specification,
    traffic: PlacedTraffic,
    zone: StartZone,
    seed: int,
    index: U64,
    bend: NumberTransform,
) -> TrafficStart:
    """Vehicles each on its own, as in the study."""
    bodies = sample_vehicles(
        partial(vehicle_kinds, traffic), traffic.colours, seed, index, traffic.vehicles[1]
    )
    traits = sample_traits(spec.drivers, seed, index, bodies.kind, bend)
    draft = draw_placed_starts(traffic, zone, seed, index, bodies.kind)
    drivers = drivers_from_speeds(traits, draft.speed, top_speeds()[bodies.kind])
    vehicles = with_able_bicycles(bodies.replace(valid=draft.valid), drivers.desired_speed)
    return TrafficStart(
        vehicles=vehicles,
        drivers=drivers,
        lane=draft.lane,
        kept_gap_share=draft.kept_gap_share,
        zone=zone,
        states_at_speed=lambda _: (
            draft.s,
            draft.speed,
        ),  # They come with their speeds, whatever the weather.
        deadline=np.full(index.shape, spec.time.attempt_deadline_s, np.float32),
    )
