"""Single frames of a recording: positions, speeds, lanes and lamps of the ego and the others.

Distances are subtracted as recorded integers and become metres afterwards: no digit is lost far
along the road. A `FrameSpan` holds the first and last frame of a span in each simulation.
"""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, I32, U8, IndexArray, Mask
from overtaking.core.float32_math import as_f32, sincos
from overtaking.model.ego_signals import EgoSignals
from overtaking.model.road import DrivingSide, Road
from overtaking.model.trajectories import NO_VEHICLE, Lights, Trajectories
from overtaking.model.vehicles import EGO_SLOT

Frames = NDArray[np.integer]

T = TypeVar("T", bound=np.generic)

METRES_PER_MM = np.float32(1e-3)

ANGLE_RESOLUTION_F32 = np.float32(1e-4)

OCCUPANCY_REACH_MM = 100_000
"""How far ahead and behind a lane's occupancy is counted [mm]."""

_LATERAL_SPEED_HALF_WINDOW_MS = 100
"""Half of the time over which the lateral speed is measured [ms]."""


def at_frame(values: NDArray[T], frames: Frames) -> NDArray[T]:
    """`values` (simulation, time) at one frame each; where that is `NEVER`, at the first frame."""
    return values[np.arange(len(frames)), np.maximum(frames, 0)]


def scatter(values: NDArray[T], simulations: IndexArray | Mask, count: int) -> NDArray[T]:
    """Values of some of `count` simulations among all, 0 for the others."""
    spread = np.zeros(count, values.dtype)
    spread[simulations] = values
    return spread


def overtaking_sign(road: Road) -> np.float32:
    """+1 where `d` grows to the left in the law's sense, -1 in left-hand traffic."""
    return np.float32(1.0 if road.driving_side is DrivingSide.RIGHT else -1.0)


def lane_borders(road: Road) -> F32:
    """Lane borders from the right to the left, including the opposing lane [m]."""
    borders = overtaking_sign(road) * as_f32(road.lane_boundaries)
    neighbour = road.overtaking_side_neighbour
    if road.is_two_way and neighbour is not None:
        borders = np.append(borders, borders[-1] + np.float32(neighbour.width))
    return borders


def slot_or_ego(vehicle: U8) -> IndexArray:
    """Slot of each vehicle; the slot of the ego in place of `NO_VEHICLE`."""
    return np.where(vehicle == NO_VEHICLE, EGO_SLOT, vehicle).astype(np.intp)


def half_length_sum(trajectories: Trajectories, rows: IndexArray, slot: IndexArray) -> F32:
    """Half of the lengths of the ego and a vehicle together, shape (instant,) [m]."""
    length = trajectories.scenario.vehicles.length
    return np.float32(0.5) * (length[rows, EGO_SLOT] + length[rows, slot])


def lateral_footprint(
    road: Road, d: Frames, heading: tuple[Frames, float], length: F32, width: F32
) -> tuple[F32, F32]:
    """Where bodies lie across the road; all arrays of one shape.

    Args:
        road: The road.
        d: Recorded lateral position [mm].
        heading: Recorded heading, and the direction that it is measured from, as
            `Trajectories.headings` has them [0.1 mrad, rad].
        length: Of the bodies [m].
        width: Of the bodies [m].

    Returns:
        Position of the centre, growing to the left, and how far the corners reach to either side
        of that [m].
    """
    across = overtaking_sign(road) * (as_f32(d) * METRES_PER_MM)
    sine, cosine = sincos(as_f32(heading[0]) * ANGLE_RESOLUTION_F32 - np.float32(heading[1]))
    half_length, half_width = length * np.float32(0.5), width * np.float32(0.5)
    return across, half_length * np.abs(sine) + half_width * np.abs(cosine)


def is_oncoming(trajectories: Trajectories) -> Mask:
    """Which vehicles come against the road, shape (simulation, vehicle); none on one-way roads.

    The heading in the first recorded frame decides: a vehicle that spins later does not become
    oncoming.
    """
    valid = trajectories.scenario.vehicles.valid
    if not trajectories.road.is_two_way:
        return np.zeros_like(valid)
    first = (
        np.zeros(valid.shape, np.intp)
        if trajectories.is_recorded is None
        else trajectories.is_recorded.argmax(axis=2)
    )
    headings, direction = trajectories.headings_and_origin
    heading = np.take_along_axis(headings, first[:, :, None], axis=2)[:, :, 0]
    against = sincos(as_f32(heading) * ANGLE_RESOLUTION_F32 - np.float32(direction))[1] < 0
    against[:, EGO_SLOT] = False
    return valid & against


def lateral_speed_half_window(interval_ms: int) -> int:
    """Frames on either side over which the lateral speed is measured."""
    return max(1, round(_LATERAL_SPEED_HALF_WINDOW_MS / interval_ms))


def lateral_speed_at(
    trajectories: Trajectories,
    rows: IndexArray,
    slot: IndexArray,
    frames: Frames,
    half: Frames | int | None = None,
) -> F32:
    """Speed to the left of vehicles at single frames; all arrays of one shape [m/s].

    Args:
        trajectories: The batch.
        rows: Simulations.
        slot: A vehicle of each.
        frames: A frame of each in which it is recorded.
        half: Frames on either side over which to measure, where there are as many; those over
            about 0.2 s by default.

    Returns:
        A central difference, one-sided beside frames without the vehicle.
    """
    interval, d = trajectories.scenario.frame_interval_ms, trajectories.states.d
    half = lateral_speed_half_window(interval) if half is None else half
    earlier, later = _recorded_window(trajectories, rows, slot, frames, half)
    moved = d[rows, slot, later] - d[rows, slot, earlier]
    elapsed = np.maximum((later - earlier) * interval, np.int32(1))
    return overtaking_sign(trajectories.road) * (as_f32(moved) / as_f32(elapsed))


def _recorded_window(
    trajectories: Trajectories,
    rows: IndexArray,
    slot: IndexArray,
    frames: Frames,
    half: Frames | int,
) -> tuple[I32, I32]:
    """The farthest frames within `half` of some that the vehicle is recorded up to."""
    last = np.maximum(trajectories.num_frames[rows] - 1, np.int32(0))
    later = np.minimum(frames + half, last).astype(np.int32)
    earlier = np.minimum(np.maximum(frames - half, 0), last).astype(np.int32)
    if trajectories.is_recorded is None:
        return earlier, later
    ends = [frames.astype(np.int32)] * 2
    for step in range(1, int(np.max(half, initial=0)) + 1):
        for side, (direction, limit) in enumerate(((-1, earlier), (1, later))):
            candidate = ends[side] + np.int32(direction)
            is_within = (limit - candidate) * direction >= 0
            has_state = trajectories.is_recorded[
                rows, slot, np.where(is_within, candidate, ends[side])
            ]
            is_unbroken = np.abs(ends[side] - frames) == step - 1
            ends[side] = np.where(is_within & has_state & is_unbroken, candidate, ends[side])
    return ends[0], ends[1]


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleSnapshot:
    """A vehicle along the road, as in `TargetSignals`; arrays have shape (instant,).

    `valid` says where there is one and it is recorded; elsewhere the values mean nothing.
    """

    valid: Mask
    ego_lead: F32
    gap: F32
    speed: F32


def vehicle_snapshot(
    trajectories: Trajectories, vehicle: U8, rows: IndexArray, frames: Frames
) -> VehicleSnapshot:
    """A vehicle along the road at single frames; the first frame where one is negative.

    Args:
        trajectories: The batch.
        vehicle: Slot of the vehicle at each instant, `NO_VEHICLE` without one, shape
            (instant,).
        rows: Simulations, same shape.
        frames: A frame of each, same shape.
    """
    frame, slot = np.maximum(frames, 0), slot_or_ego(vehicle)
    ego_lead = ego_lead_over(trajectories, rows, slot, frame)
    has_vehicle = (vehicle != NO_VEHICLE) & (frame < trajectories.num_frames[rows])
    if trajectories.is_recorded is not None:
        has_vehicle &= trajectories.is_recorded[rows, slot, frame]
    return VehicleSnapshot(
        valid=has_vehicle,
        ego_lead=ego_lead,
        gap=np.abs(ego_lead) - half_length_sum(trajectories, rows, slot),
        speed=as_f32(trajectories.states.speed[rows, slot, frame]) * METRES_PER_MM,
    )


def ego_lead_over(
    trajectories: Trajectories, rows: IndexArray, slot: IndexArray, frames: Frames
) -> F32:
    """Centre of the ego minus centre of a vehicle along the road at single frames [m]."""
    s = trajectories.states.s
    return as_f32(s[rows, EGO_SLOT, frames] - s[rows, slot, frames]) * METRES_PER_MM


def lateral_position_and_gap(
    trajectories: Trajectories,
    signals: EgoSignals,
    rows: IndexArray,
    slot: IndexArray,
    frames: Frames,
) -> tuple[F32, F32]:
    """Vehicles across the road at single frames: `lateral` and `lateral_gap` of `TargetSignals`.

    Args:
        trajectories: The batch.
        signals: Its signals.
        rows: Simulations, shape (instant,).
        slot: A vehicle of each, same shape.
        frames: A frame of each, same shape.
    """
    states, bodies, ego_entry = trajectories.states, trajectories.scenario.vehicles, (rows, frames)
    entry, (headings, direction) = (rows, slot, frames), trajectories.headings_and_origin
    lateral_position, reach = lateral_footprint(
        trajectories.road,
        states.d[entry],
        (headings[entry], direction),
        bodies.length[rows, slot],
        bodies.width[rows, slot],
    )
    ego_reach = (signals.left_edge[ego_entry] - signals.right_edge[ego_entry]) * np.float32(0.5)
    return lateral_position, np.abs(lateral_position - signals.lateral_position[ego_entry]) - (
        ego_reach + reach
    )


def is_in_lane(trajectories: Trajectories, lane: I32, frames: Frames) -> Mask:
    """Which vehicles are in a driving lane at one frame of each simulation, (simulation, vehicle).

    Args:
        trajectories: The batch.
        lane: A lane index for each simulation, shape (simulation,).
        frames: A frame of each, same shape.
    """
    rows = np.arange(len(frames))
    inside = trajectories.states.lane[rows, :, frames] == lane[:, None]
    inside &= trajectories.scenario.vehicles.valid & (lane < trajectories.road.num_lanes)[:, None]
    return (
        inside
        if trajectories.is_recorded is None
        else inside & trajectories.is_recorded[rows, :, frames]
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftLaneOccupancy:
    """The lane to the left at one frame of each simulation, as in `EgoSignals`."""

    occupancy: F32
    count: U8


def left_lane_occupancy(trajectories: Trajectories, frames: Frames) -> LeftLaneOccupancy:
    """The lane to the left at one recorded frame of each simulation.

    Lengths are summed in whole half-millimetres: the order of the vehicles is irrelevant.
    """
    rows = np.arange(len(frames))
    ego_lane, s = (
        trajectories.states.lane[rows, EGO_SLOT, frames].astype(np.int32),
        trajectories.states.s[rows, :, frames],
    )
    is_on_left = is_in_lane(trajectories, ego_lane + 1, frames)
    limit = np.int32(2 * OCCUPANCY_REACH_MM)
    length = np.rint(trajectories.scenario.vehicles.length * np.float32(1000.0)).astype(np.int32)
    # Twice the distance, cut so that a vehicle miles away cannot overflow.
    centre = np.clip(s - s[:, [EGO_SLOT]], -limit, limit) * np.int32(2)
    front, rear = np.minimum(centre + length, limit), np.maximum(centre - length, -limit)
    length_within_reach = np.where(is_on_left, np.maximum(front - rear, np.int32(0)), np.int32(0))
    return LeftLaneOccupancy(
        occupancy=as_f32(length_within_reach.sum(axis=1, dtype=np.int32)) * np.float32(0.5 / limit),
        count=is_on_left.sum(axis=1, dtype=np.uint8),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameSpan:
    """From one frame to another, both within it; empty where `last` is before `first`.

    Attributes:
        first: First frame, shape (simulation,).
        last: Last frame, shape (simulation,).
    """

    first: I32
    last: I32

    @property
    def is_nonempty(self) -> Mask:
        """Whether it has a frame, shape (simulation,)."""
        return self.last >= self.first

    @property
    def packed_ends(self) -> I32:
        """First frames and then last frames, as compiled functions take them."""
        return np.concatenate([self.first, self.last], dtype=np.int32)

    def select(self, rows: IndexArray) -> "FrameSpan":
        """The spans of some simulations."""
        return FrameSpan(first=self.first[rows], last=self.last[rows])

    def mask(self, rows: IndexArray, num_frames: int) -> Mask:
        """Which frames it has in some simulations, shape (row, time)."""
        frame = np.arange(num_frames, dtype=np.int32)
        return (frame >= self.first[rows, None]) & (frame <= self.last[rows, None])

    def instants(self) -> tuple[IndexArray, IndexArray]:
        """Simulation and frame of each frame of the spans, in order."""
        length = np.maximum(self.last - self.first + 1, 0)
        simulation = np.repeat(np.arange(len(length)), length)
        num_before = np.cumsum(length) - length
        frame = np.arange(simulation.size) + np.repeat(self.first - num_before, length)
        return simulation, frame


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherVehicles:
    """All vehicles at one frame of each simulation; arrays have shape (simulation, vehicle).

    Attributes:
        valid: Whether this is a vehicle other than the ego, recorded in that frame.
        ego_lead: Centre of the ego minus its centre along the road: positive for those behind [m].
        gap: Between its bumper and the ego's, negative where they overlap [m].
        speed: Along its own direction [m/s].
        lane: Lane index.
        lights: `Lights`.
        is_oncoming: Whether it drives against the road.
    """

    valid: Mask
    ego_lead: F32
    gap: F32
    speed: F32
    lane: U8
    lights: U8
    is_oncoming: Mask

    @property
    def is_approaching(self) -> Mask:
        """Whether a vehicle is ahead of the ego and drives towards it."""
        return self.valid & self.is_oncoming & (self.ego_lead < 0)


def other_vehicles_at(
    trajectories: Trajectories, frame: I32, simulation: IndexArray | None = None
) -> OtherVehicles:
    """All vehicles at one frame of each of some simulations; frame 0 where `frame` is negative.

    Args:
        trajectories: The batch.
        frame: A frame of each simulation, shape (simulation,).
        simulation: Rows of the simulations in the batch, same shape; None for all of them.
    """
    states = trajectories.states
    if simulation is None:
        simulation = np.arange(len(frame))
    frame = np.maximum(frame, 0)
    instants = (simulation[:, None], np.arange(states.s.shape[1])[None, :], frame[:, None])
    half_length = trajectories.scenario.vehicles.length[simulation] * np.float32(0.5)
    s = states.s[instants]
    ego_lead = as_f32(s[:, [EGO_SLOT]] - s) * METRES_PER_MM
    headings, direction = trajectories.headings_and_origin
    heading = as_f32(headings[instants]) * ANGLE_RESOLUTION_F32 - np.float32(direction)
    return OtherVehicles(
        valid=_is_recorded_other(trajectories, simulation, frame),
        ego_lead=ego_lead,
        gap=np.abs(ego_lead) - (half_length + half_length[:, [EGO_SLOT]]),
        speed=as_f32(states.speed[instants]) * METRES_PER_MM,
        lane=states.lane[instants],
        lights=states.lights[instants],
        is_oncoming=sincos(heading)[1] < 0,
    )


def num_slow_vehicles(
    trajectories: Trajectories,
    simulation: IndexArray,
    frame: Frames,
    *,
    below: float,
    reach: float,
) -> I32:
    """Number of slow vehicles near the ego at single frames, shape (instant,).

    Args:
        trajectories: The batch.
        simulation: Row of the simulation of each instant, shape (instant,).
        frame: Frame of each instant, same shape.
        below: A vehicle is slow below this speed [m/s].
        reach: A vehicle is near within this distance along the road, from centre to centre [m].
    """
    states, s = trajectories.states, trajectories.states.s[simulation, :, frame]
    is_near = np.abs(s - s[:, [EGO_SLOT]]) <= reach * 1000.0
    is_slow = is_near & (states.speed[simulation, :, frame] < below * 1000.0)
    is_slow &= _is_recorded_other(trajectories, simulation, frame)
    return is_slow.sum(axis=1, dtype=np.int32)


def _is_recorded_other(trajectories: Trajectories, simulation: IndexArray, frame: Frames) -> Mask:
    """Whether a vehicle is recorded at an instant and is not the ego, shape (instant, vehicle)."""
    valid = trajectories.scenario.vehicles.valid[simulation]
    valid[:, EGO_SLOT] = False
    is_recorded = trajectories.is_recorded
    return valid if is_recorded is None else valid & is_recorded[simulation, :, frame]


def indicator_to_overtaking_side(road: Road) -> int:
    """The `Lights` bit that announces a move to the overtaking side."""
    is_right_hand = road.driving_side is DrivingSide.RIGHT
    return int(Lights.INDICATOR_LEFT if is_right_hand else Lights.INDICATOR_RIGHT)


def indicator_to_kerb_side(road: Road) -> int:
    """The `Lights` bit that announces a move to the kerb side."""
    both_indicators = int(Lights.INDICATOR_LEFT | Lights.INDICATOR_RIGHT)
    return both_indicators - indicator_to_overtaking_side(road)
