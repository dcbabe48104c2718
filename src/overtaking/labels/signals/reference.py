"""The signals as a person reads them; `crates/overtaking-core/src/signals.rs` is the fast twin.

Distances along the road are subtracted as recorded integers, so that no digit is lost far from the
origin, and become metres afterwards.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask, as_f32, maximum, minimum, sincos
from overtaking.labels.signals.conditions import Conditions, conditions
from overtaking.model.road import DrivingSide, Road
from overtaking.model.signals import Around, Signals
from overtaking.model.trajectory import NO_VEHICLE, Trajectories
from overtaking.model.vehicles import Role
from overtaking.world.constants import constants, known
from overtaking.world.friction import at_film, speed_columns
from overtaking.world.visibility import LEAST_EXTINCTION, lamp_range

I32 = NDArray[np.int32]
U8 = NDArray[np.uint8]

METRES = np.float32(1e-3)
RADIANS = np.float32(1e-4)

OCCUPANCY_REACH_MM = 100_000
"""How far ahead and behind a lane's occupancy is counted [mm]."""

_PER_FULL_LANE = np.float32(1.0 / (4 * OCCUPANCY_REACH_MM))
_NOBODY = np.int32(2**31 - 1)
_LAST_CODE = 255
_SMOOTHING_MS = 100
"""Half of the time over which the lateral speed is measured [ms]."""


def signals(trajectories: Trajectories) -> Signals:
    """The signals of a batch; see `model.signals.Signals`."""
    states, ego = trajectories.states, int(Role.EGO)
    given = conditions(trajectories)
    bodies = trajectories.scenario.vehicles
    across, reach = footprint(
        trajectories.road, states.d, states.heading, bodies.length, bodies.width
    )
    speed = as_f32(states.speed[:, ego]) * METRES
    lane = states.lane[:, ego]
    lit, unlit = _sights(given, speed)
    vehicle, distance = _nearest(trajectories)
    around = _to_neighbours(trajectories, vehicle, distance, across, reach)
    occupancy, count = _left_lane(trajectories)
    return Signals(
        frame_interval_ms=trajectories.scenario.frame_interval_ms,
        valid=trajectories.frame_valid,
        lane=lane,
        s=as_f32(states.s[:, ego]) * METRES,
        lateral=across[:, ego],
        lateral_speed=lateral_speed(trajectories, states.d[:, ego]),
        speed=speed,
        accel=as_f32(states.accel_lon[:, ego]) * METRES,
        right_reach=across[:, ego] - reach[:, ego],
        left_reach=across[:, ego] + reach[:, ego],
        left_occupancy=occupancy,
        left_count=count,
        friction=_friction(given, trajectories.road, speed, lane),
        sight_lit=lit,
        sight_unlit=unlit,
        vehicle=vehicle,
        gap=around.gap,
        closing_speed=around.closing_speed,
        lateral_gap=around.lateral_gap,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Neighbours:
    """Neighbours at single frames, as in `Signals`; arrays have shape (instant,)."""

    vehicle: U8
    gap: F32
    closing_speed: F32

    @property
    def exists(self) -> Mask:
        """Where there is somebody."""
        return self.vehicle != NO_VEHICLE


def neighbours_at(
    _: Trajectories,
    seen: Signals,
    place: Around | NDArray[np.intp],
    rows: NDArray[np.intp],
    frames: NDArray[np.intp],
) -> Neighbours:
    """The neighbours of single frames; arguments as in `labels.signals.engine.neighbours_at`."""
    at = (rows, place, frames)
    return Neighbours(
        vehicle=seen.vehicle[at], gap=seen.gap[at], closing_speed=seen.closing_speed[at]
    )


def side_of(road: Road) -> np.float32:
    """+1 where `d` grows to the left in the law's sense, -1 in left-hand traffic."""
    return np.float32(1.0 if road.driving_side is DrivingSide.RIGHT else -1.0)


def footprint(
    road: Road, d: NDArray[np.integer], heading: NDArray[np.integer], length: F32, width: F32
) -> tuple[F32, F32]:
    """Where bodies lie across the road.

    Args:
        road: The road.
        d: Recorded lateral position, shape (..., time) [mm].
        heading: Recorded heading, same shape [0.1 mrad].
        length: Of the bodies, shape (...,) [m].
        width: Of the bodies, shape (...,) [m].

    Returns:
        Position of the centre, growing to the left, and how far the corners reach to either side of
        that, shape (..., time) [m].
    """
    across = side_of(road) * (as_f32(d) * METRES)
    sine, cosine = sincos(as_f32(heading) * RADIANS - np.float32(road.heading))
    half_length = (length * np.float32(0.5))[..., None]
    half_width = (width * np.float32(0.5))[..., None]
    return across, half_length * np.abs(sine) + half_width * np.abs(cosine)


def lateral_speed(trajectories: Trajectories, d: I32) -> F32:
    """Speed to the left of vehicles that are in all frames, one a simulation [m/s].

    Args:
        trajectories: The batch, for its times and its side.
        d: Recorded lateral position, shape (simulation, time) [mm].

    Returns:
        A central difference over about 0.2 s, one-sided at the ends, shape (simulation, time).
    """
    num_frames = d.shape[1]
    interval = trajectories.scenario.frame_interval_ms
    half = half_window(interval)
    frame = np.arange(num_frames, dtype=np.int32)
    last = maximum_of(trajectories.num_frames[:, None] - 1, 0)
    later = np.minimum(frame + half, last)
    earlier = np.minimum(np.maximum(frame - half, 0), last)
    moved = np.take_along_axis(d, later, axis=1) - np.take_along_axis(d, earlier, axis=1)
    elapsed = maximum_of((later - earlier) * interval, 1)
    return side_of(trajectories.road) * (as_f32(moved) / as_f32(elapsed))


def lateral_speed_at(
    trajectories: Trajectories,
    rows: NDArray[np.intp],
    slot: NDArray[np.intp],
    frames: NDArray[np.integer],
    half: NDArray[np.integer] | int | None = None,
) -> F32:
    """What `lateral_speed` says of vehicles at single frames; all arrays of one shape [m/s].

    Args:
        trajectories: The batch.
        rows: Simulations.
        slot: A vehicle of each.
        frames: A frame of each in which it is recorded.
        half: Frames on either side over which to measure, where there are as many; those of
            `lateral_speed` if left out.

    Returns:
        A central difference, one-sided beside frames without the vehicle.
    """
    interval, d = trajectories.scenario.frame_interval_ms, trajectories.states.d
    half = half_window(interval) if half is None else half
    earlier, later = _recorded_around(trajectories, rows, slot, frames, half)
    moved = d[rows, slot, later] - d[rows, slot, earlier]
    elapsed = maximum_of((later - earlier) * interval, 1)
    return side_of(trajectories.road) * (as_f32(moved) / as_f32(elapsed))


def _recorded_around(
    trajectories: Trajectories,
    rows: NDArray[np.intp],
    slot: NDArray[np.intp],
    frames: NDArray[np.integer],
    half: NDArray[np.integer] | int,
) -> tuple[I32, I32]:
    """The farthest frames within `half` of some that the vehicle is recorded up to."""
    last = maximum_of(trajectories.num_frames[rows] - 1, 0)
    later = np.minimum(frames + half, last).astype(np.int32)
    earlier = np.minimum(np.maximum(frames - half, 0), last).astype(np.int32)
    if trajectories.present is None:
        return earlier, later
    ends = [np.minimum(frames, last).astype(np.int32)] * 2
    for step in range(1, int(np.max(half, initial=0)) + 1):
        for place, (sign, limit) in enumerate(((-1, earlier), (1, later))):
            next_one = ends[place] + np.int32(sign)
            inside = (limit - next_one) * sign >= 0
            there = trajectories.present[rows, slot, np.where(inside, next_one, ends[place])]
            reached = np.abs(ends[place] - frames) == step - 1
            ends[place] = np.where(inside & there & reached, next_one, ends[place])
    return ends[0], ends[1]


def half_window(interval_ms: int) -> int:
    """Frames on either side over which the lateral speed is measured."""
    return max(1, round(_SMOOTHING_MS / interval_ms))


def maximum_of(values: I32, least: int) -> I32:
    """Integers, none of them below `least`."""
    return np.maximum(values, np.int32(least))


def _nearest(trajectories: Trajectories) -> tuple[U8, I32]:
    """Who is nearest in each place, and how far away its centre is [mm]."""
    states, ego = trajectories.states, int(Role.EGO)
    n, slots, frames = states.s.shape
    shape = (n, len(Around), frames)
    nearest = np.full(shape, _NOBODY)
    vehicle = np.full(shape, NO_VEHICLE)
    own_lane = states.lane[:, ego].astype(np.int32)
    on_road = own_lane < trajectories.road.num_lanes
    recorded = trajectories.state_valid
    for j in range(1, slots):
        ahead = states.s[:, j] - states.s[:, ego]
        shift = states.lane[:, j].astype(np.int32) - own_lane
        there = recorded[:, j] & on_road & (states.lane[:, j] < trajectories.road.num_lanes)
        for place in Around:
            is_leader = place % 2 == 0
            matches = there & (shift == _LANE_SHIFT[place]) & ((ahead >= 0) == is_leader)
            closer = matches & (np.abs(ahead) < nearest[:, place])
            nearest[:, place] = np.where(closer, np.abs(ahead), nearest[:, place])
            vehicle[:, place] = np.where(closer, np.uint8(j), vehicle[:, place])
    return vehicle, nearest


_LANE_SHIFT = {
    Around.LEADER: 0,
    Around.FOLLOWER: 0,
    Around.LEFT_LEADER: 1,
    Around.LEFT_FOLLOWER: 1,
    Around.RIGHT_LEADER: -1,
    Around.RIGHT_FOLLOWER: -1,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Gaps:
    """As in `Signals`; 0 where there is nobody."""

    gap: F32
    closing_speed: F32
    lateral_gap: F32


def _to_neighbours(
    trajectories: Trajectories, vehicle: U8, distance: I32, across: F32, reach: F32
) -> _Gaps:
    """Gaps and closing speeds to the vehicles that were found."""
    speeds, ego = trajectories.states.speed, int(Role.EGO)
    nobody = vehicle == NO_VEHICLE
    slot = np.where(nobody, 0, vehicle).astype(np.intp)
    half = trajectories.scenario.vehicles.length * np.float32(0.5)
    halves = np.take_along_axis(half, slot.reshape(len(slot), -1), axis=1).reshape(slot.shape)
    gap = as_f32(np.where(nobody, 0, distance)) * METRES - (half[:, ego, None, None] + halves)
    own, other = speeds[:, [ego]], np.take_along_axis(speeds, slot, axis=1)
    is_leader = (np.arange(len(Around)) % 2 == 0)[None, :, None]
    closing = as_f32(np.where(is_leader, own - other, other - own)) * METRES
    place = across[:, [ego]] - np.take_along_axis(across, slot, axis=1)
    aside = np.abs(place) - (reach[:, [ego]] + np.take_along_axis(reach, slot, axis=1))
    zero = np.float32(0.0)
    return _Gaps(
        gap=np.where(nobody, zero, gap),
        closing_speed=np.where(nobody, zero, closing),
        lateral_gap=np.where(nobody, zero, aside),
    )


def _left_lane(trajectories: Trajectories) -> tuple[F32, U8]:
    """Occupancy of the lane to the left, and the number of vehicles in it.

    Lengths are summed in whole half-millimetres, so that the order of the vehicles is irrelevant.
    """
    states, ego = trajectories.states, int(Role.EGO)
    num_lanes = trajectories.road.num_lanes
    length = _lengths(trajectories)
    own_lane = states.lane[:, ego].astype(np.int32)
    total = np.zeros(own_lane.shape, np.int32)
    count = np.zeros(own_lane.shape, np.uint8)
    for j in range(1, states.s.shape[1]):
        lane = states.lane[:, j].astype(np.int32)
        there = trajectories.state_valid[:, j] & (lane == own_lane + 1) & (lane < num_lanes)
        covered = _covered(states.s[:, j] - states.s[:, ego], length[:, j, None])
        total += np.where(there, covered, np.int32(0))
        count += there.astype(np.uint8)
    return as_f32(total) * _PER_FULL_LANE, count


def _lengths(trajectories: Trajectories) -> I32:
    """Lengths of all vehicles, shape (simulation, vehicle) [mm]."""
    return np.rint(trajectories.scenario.vehicles.length * np.float32(1000.0)).astype(np.int32)


def _covered(ahead: I32, length: I32) -> I32:
    """What a body covers of the road within reach of the ego [half a millimetre].

    Args:
        ahead: From the centre of the ego to that of the body [mm].
        length: Of the body [mm].
    """
    limit = np.int32(2 * OCCUPANCY_REACH_MM)
    # Twice the distance, cut so that a vehicle miles away cannot overflow.
    centre = np.clip(ahead, -limit, limit) * np.int32(2)
    front, rear = np.minimum(centre + length, limit), np.maximum(centre - length, -limit)
    return maximum_of(front - rear, 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftLane:
    """The lane to the left at one frame of each simulation, as in `Signals`."""

    occupancy: F32
    count: U8


def left_lane_at(
    trajectories: Trajectories, seen: Signals, frames: NDArray[np.integer]
) -> LeftLane:
    """What `left_occupancy` and `left_count` are at one frame of each simulation.

    Args:
        trajectories: The batch.
        seen: Its signals.
        frames: A recorded frame of each simulation.
    """
    states, rows = trajectories.states, np.arange(len(frames))
    if not seen.is_original:
        own = (rows, frames)
        return LeftLane(occupancy=seen.left_occupancy[own], count=seen.left_count[own])
    at = (rows, slice(None), frames)
    lane, s = states.lane[at].astype(np.int32), states.s[at]
    there = trajectories.scenario.vehicles.valid & (lane == lane[:, [Role.EGO]] + 1)
    there &= lane < trajectories.road.num_lanes
    if trajectories.present is not None:
        there &= trajectories.present[at]
    covered = _covered(s - s[:, [Role.EGO]], _lengths(trajectories))
    inside = np.where(there, covered, np.int32(0))
    return LeftLane(
        occupancy=as_f32(inside.sum(axis=1, dtype=np.int32)) * _PER_FULL_LANE,
        count=there.sum(axis=1, dtype=np.uint8),
    )


def _friction(given: Conditions, road: Road, speed: F32, lane: U8) -> F32:
    """Peak friction under the ego, shape (simulation, time)."""
    c = constants()
    # Beyond the slow edge counts as the slowest lane, beyond the fast edge as the fastest.
    nearest = np.where(lane == _LAST_CODE, 0, np.minimum(lane, road.num_lanes - 1))
    film = np.take_along_axis(given.film, nearest.astype(np.intp), axis=1)
    return at_film(c, speed_columns(c, speed, given.wear[:, None], given.truck[:, None]), film)


def _sights(given: Conditions, speed: F32) -> tuple[F32, F32]:
    """Distances at which a lit and an unlit vehicle are seen, shape (simulation, time) [m]."""
    rain = given.rain_extinction[:, None] * (np.float32(1.0) + speed / constants().rain_speed)
    air = given.fog_extinction[:, None] + rain
    depth = maximum(given.contrast_depth[:, None], np.float32(0.0))
    unlit = minimum(depth / maximum(air, LEAST_EXTINCTION), given.unlit_limit[:, None])
    lamp = lamp_range(air, given.lamp_intensity[:, None], given.lamp_threshold[:, None])
    return minimum(maximum(lamp, unlit), known("model.perception.range")), unlit
