"""Single frames of a recording: positions, speeds, lanes and lamps of the ego and the others.

Recorded positions are integers in millimetres. A distance is their difference, converted to metres
afterwards: float32 positions beyond 16 km are coarser than 1 mm.

Left means the overtaking side, also in left-hand traffic: lateral values in metres are mirrored by
`overtaking_sign`. Arrays named `rows` or `simulation` are indices of simulations in the batch. The
frame of an event that does not occur is `NEVER`, -1.
"""

from dataclasses import dataclass
from typing import NamedTuple, TypeVar

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
"""Step of a recorded heading [rad]."""

OCCUPANCY_REACH_MM = 100_000
"""Reach ahead of and behind the ego within which a lane's occupancy is measured, a choice [mm]."""

_LATERAL_SPEED_HALF_WINDOW_MS = 100
"""Half of the time over which a lateral speed is measured [ms], a choice of this model.

It is a time and no number of frames, so that recordings of the same drive at 20 Hz and at 25 Hz
have the same events.
"""


class Instants(NamedTuple):
    """Single frames of simulations; an index into arrays of shape (simulation, time).

    Attributes:
        simulation: Row of the simulation, shape (instant,).
        frame: The frame, same shape.
    """

    simulation: IndexArray
    frame: IndexArray


class VehicleInstants(NamedTuple):
    """Vehicles in single frames; an index into arrays of shape (simulation, vehicle, time).

    Attributes:
        simulation: Row of the simulation, shape (instant,).
        slot: Slot of the vehicle, same shape.
        frame: A frame in which it is recorded, same shape.
    """

    simulation: IndexArray
    slot: IndexArray
    frame: Frames


def at_frame(values: NDArray[T], frames: Frames) -> NDArray[T]:
    """Values of shape (simulation, time) at one frame of each simulation.

    At `NEVER` the result is the value of frame 0, and callers ignore it.
    """
    return values[np.arange(len(frames)), np.maximum(frames, 0)]


def scatter(values: NDArray[T], simulations: IndexArray | Mask, num_simulations: int) -> NDArray[T]:
    """An array of all simulations: `values` in the rows `simulations`, 0 in the others."""
    scattered = np.zeros(num_simulations, values.dtype)
    scattered[simulations] = values
    return scattered


def overtaking_sign(road: Road) -> np.float32:
    """+1 in right-hand traffic, where `d` grows to the overtaking side; -1 in left-hand traffic."""
    return np.float32(1.0 if road.driving_side is DrivingSide.RIGHT else -1.0)


def lane_borders(road: Road) -> F32:
    """Lateral positions of the lane borders from the right to the left, (border,) [m].

    On a two-way road the last border is the outer edge of the opposing lane.
    """
    borders = overtaking_sign(road) * as_f32(road.lane_boundaries)
    neighbour = road.overtaking_side_neighbour
    if road.is_two_way and neighbour is not None:
        borders = np.append(borders, borders[-1] + np.float32(neighbour.width))
    return borders


def slot_or_ego(vehicle: U8) -> IndexArray:
    """Slot of each vehicle; the slot of the ego in place of `NO_VEHICLE`, which is no index."""
    return np.where(vehicle == NO_VEHICLE, EGO_SLOT, vehicle).astype(np.intp)


def half_length_sum(trajectories: Trajectories, rows: IndexArray, slot: IndexArray) -> F32:
    """Half of the sum of the lengths of the ego and a vehicle, shape (instant,) [m]."""
    length = trajectories.scenario.vehicles.length
    return np.float32(0.5) * (length[rows, EGO_SLOT] + length[rows, slot])


def lateral_footprint(
    road: Road,
    d: NDArray[np.integer],
    heading: tuple[NDArray[np.integer], float],
    length: F32,
    width: F32,
) -> tuple[F32, F32]:
    """Extent of vehicles across the road; all arrays have one shape.

    Args:
        road: The road.
        d: Recorded lateral position [mm].
        heading: Recorded heading [0.1 mrad], and the direction to subtract from it to get the angle
            to the road [rad], as in `Trajectories.headings_and_origin`.
        length: Length of each vehicle [m].
        width: Width of each vehicle [m].

    Returns:
        Lateral position of the centre, growing to the left, and distance from there to the
        outermost corner on either side [m].
    """
    lateral_position = overtaking_sign(road) * (as_f32(d) * METRES_PER_MM)
    sine, cosine = sincos(as_f32(heading[0]) * ANGLE_RESOLUTION_F32 - np.float32(heading[1]))
    half_length, half_width = length * np.float32(0.5), width * np.float32(0.5)
    return lateral_position, half_length * np.abs(sine) + half_width * np.abs(cosine)


def is_oncoming(trajectories: Trajectories) -> Mask:
    """Whether vehicles drive against the road, (simulation, vehicle); false on one-way roads.

    The heading in the first recorded frame decides: a vehicle that spins later does not become
    oncoming.
    """
    valid = trajectories.scenario.vehicles.valid
    if not trajectories.road.is_two_way:
        return np.zeros_like(valid)
    first_frame = (
        np.zeros(valid.shape, np.intp)
        if trajectories.is_recorded is None  # Every vehicle is recorded in every frame.
        else trajectories.is_recorded.argmax(axis=2)
    )
    headings, direction = trajectories.headings_and_origin
    heading = np.take_along_axis(headings, first_frame[:, :, None], axis=2)[:, :, 0]
    _, cosine = sincos(as_f32(heading) * ANGLE_RESOLUTION_F32 - np.float32(direction))
    drives_against = cosine < 0
    drives_against[:, EGO_SLOT] = False
    return valid & drives_against


def lateral_speed_half_window(interval_ms: int) -> int:
    """Number of frames before and after a frame over which to measure its lateral speed."""
    return max(1, round(_LATERAL_SPEED_HALF_WINDOW_MS / interval_ms))


def lateral_speed_at(
    trajectories: Trajectories, vehicles: VehicleInstants, half_window: I32 | int | None = None
) -> F32:
    """Lateral speed of vehicles at single frames, positive to the left, shape (instant,) [m/s].

    Args:
        trajectories: The batch.
        vehicles: The vehicles and frames.
        half_window: Largest number of frames before and after, for all instants or for each of
            them; None for about 0.1 s.

    Returns:
        A central difference; one-sided beside frames in which the vehicle is not recorded, and 0
        if it is not recorded in any other frame of the window.
    """
    interval_ms, d = trajectories.scenario.frame_interval_ms, trajectories.states.d
    if half_window is None:
        half_window = lateral_speed_half_window(interval_ms)
    earlier, later = _recorded_window(trajectories, vehicles, half_window)
    simulation, slot, _ = vehicles
    shift = d[simulation, slot, later] - d[simulation, slot, earlier]
    elapsed = np.maximum((later - earlier) * interval_ms, np.int32(1))
    # Millimetres per millisecond are metres per second.
    return overtaking_sign(trajectories.road) * (as_f32(shift) / as_f32(elapsed))


def _recorded_window(
    trajectories: Trajectories, vehicles: VehicleInstants, half_window: I32 | int
) -> tuple[I32, I32]:
    """First and last frame of the window around each instant; it ends at a break in the track.

    A vehicle that leaves the recording and comes back has a break in its track. A difference across
    the break would be the speed between two unrelated places.
    """
    simulation, slot, frame = vehicles
    last_frame = np.maximum(trajectories.num_frames[simulation] - 1, np.int32(0))
    earliest = np.minimum(np.maximum(frame - half_window, 0), last_frame).astype(np.int32)
    latest = np.minimum(frame + half_window, last_frame).astype(np.int32)
    is_recorded = trajectories.is_recorded
    if is_recorded is None:  # Every vehicle is recorded in every frame.
        return earliest, latest

    def extend(limit: I32, direction: int) -> I32:
        """The farthest frame towards a limit that the track reaches without a break."""
        end = frame.astype(np.int32)
        for distance in range(1, int(np.max(half_window, initial=0)) + 1):
            candidate = end + np.int32(direction)
            is_within = (limit - candidate) * direction >= 0
            # An end that did not move in the last round has met a break, and stays.
            is_unbroken = np.abs(end - frame) == distance - 1
            has_state = is_recorded[simulation, slot, np.where(is_within, candidate, end)]
            end = np.where(is_within & is_unbroken & has_state, candidate, end)
        return end

    return extend(earliest, -1), extend(latest, 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleSnapshot:
    """One vehicle along the road at single frames; every array has shape (instant,).

    Attributes:
        valid: Whether there is a vehicle and it is recorded; otherwise the values are undefined.
        ego_lead: Station of the ego minus the vehicle's, from centre to centre [m].
        gap: Gap between the bumpers, whichever is ahead; negative where they overlap [m].
        speed: Speed of the vehicle [m/s].
    """

    valid: Mask
    ego_lead: F32
    gap: F32
    speed: F32


def vehicle_snapshot(
    trajectories: Trajectories, vehicle: U8, rows: IndexArray, frames: Frames
) -> VehicleSnapshot:
    """A vehicle along the road at single frames.

    Args:
        trajectories: The batch.
        vehicle: Slot of the vehicle at each instant, `NO_VEHICLE` without one, shape (instant,).
        rows: Row of the simulation, same shape.
        frames: The frame, same shape; `NEVER` counts as frame 0.
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
    """Station of the ego minus another vehicle's, between centres, shape (instant,) [m]."""
    s = trajectories.states.s
    return as_f32(s[rows, EGO_SLOT, frames] - s[rows, slot, frames]) * METRES_PER_MM


def lateral_position_and_gap(
    trajectories: Trajectories, signals: EgoSignals, vehicles: VehicleInstants
) -> tuple[F32, F32]:
    """Position of vehicles across the road, and their gap to the ego, at single frames.

    Args:
        trajectories: The batch.
        signals: Signals of the batch.
        vehicles: The vehicles and frames.

    Returns:
        Lateral position of the centre, growing to the left, and gap between the sides of ego and
        vehicle, negative where they overlap across the road; shape (instant,) [m].
    """
    simulation, slot, frame = vehicles
    bodies = trajectories.scenario.vehicles
    headings, direction = trajectories.headings_and_origin
    lateral_position, reach = lateral_footprint(
        trajectories.road,
        trajectories.states.d[vehicles],
        (headings[vehicles], direction),
        bodies.length[simulation, slot],
        bodies.width[simulation, slot],
    )
    instants = simulation, frame
    ego_reach = (signals.left_edge[instants] - signals.right_edge[instants]) * np.float32(0.5)
    lateral_distance = np.abs(lateral_position - signals.lateral_position[instants])
    return lateral_position, lateral_distance - (ego_reach + reach)


def is_in_lane(trajectories: Trajectories, lane: I32, frames: Frames) -> Mask:
    """Whether each vehicle is in a lane at one frame of each simulation, (simulation, vehicle).

    Args:
        trajectories: The batch.
        lane: A lane index for each simulation, shape (simulation,). An index of `num_lanes` or more
            means the opposing lane or a place off the road; the result is then false.
        frames: A frame of each simulation, same shape.
    """
    rows = np.arange(len(frames))
    is_inside = trajectories.states.lane[rows, :, frames] == lane[:, None]
    is_inside &= (lane < trajectories.road.num_lanes)[:, None]
    is_inside &= trajectories.scenario.vehicles.valid
    if trajectories.is_recorded is not None:
        is_inside &= trajectories.is_recorded[rows, :, frames]
    return is_inside


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftLaneOccupancy:
    """The lane to the left of the ego at one frame of each simulation; shape (simulation,).

    Attributes:
        occupancy: Share of the lane within `OCCUPANCY_REACH_MM` of the ego that vehicles cover, by
            their lengths [1].
        count: Number of vehicles in the lane, at any distance.
    """

    occupancy: F32
    count: U8


def left_lane_occupancy(trajectories: Trajectories, frames: Frames) -> LeftLaneOccupancy:
    """The lane to the left of the ego at one recorded frame of each simulation."""
    rows = np.arange(len(frames))
    ego_lane = trajectories.states.lane[rows, EGO_SLOT, frames].astype(np.int32)
    s = trajectories.states.s[rows, :, frames]
    is_on_left = is_in_lane(trajectories, ego_lane + 1, frames)
    # `limit`, `length`, `centre`, `front` and `rear` are in half-millimetres: half a length is then
    # an integer, and a sum of integers is the same in any order of the vehicles.
    limit = np.int32(2 * OCCUPANCY_REACH_MM)
    length = np.rint(trajectories.scenario.vehicles.length * np.float32(1000.0)).astype(np.int32)
    # Twice the distance of a far vehicle could overflow, so distances [mm] are limited first: to
    # `limit` millimetres, 200 m, where no vehicle reaches into the 100 m that count.
    centre = np.clip(s - s[:, [EGO_SLOT]], -limit, limit) * np.int32(2)
    front, rear = np.minimum(centre + length, limit), np.maximum(centre - length, -limit)
    length_within_reach = np.where(is_on_left, np.maximum(front - rear, np.int32(0)), np.int32(0))
    # The lane within reach, ahead and behind, is 2 `limit` long.
    return LeftLaneOccupancy(
        occupancy=as_f32(length_within_reach.sum(axis=1, dtype=np.int32)) * np.float32(0.5 / limit),
        count=is_on_left.sum(axis=1, dtype=np.uint8),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameSpan:
    """A span of frames of each simulation, both ends included; empty if `last` is before `first`.

    Attributes:
        first: First frame, shape (simulation,).
        last: Last frame, shape (simulation,).
    """

    first: I32
    last: I32

    @property
    def is_nonempty(self) -> Mask:
        """Whether the span has a frame, shape (simulation,)."""
        return self.last >= self.first

    @property
    def packed_ends(self) -> I32:
        """All first frames, then all last frames, in one array for compiled functions."""
        return np.concatenate([self.first, self.last], dtype=np.int32)

    def select(self, rows: IndexArray) -> "FrameSpan":
        """The spans of some simulations."""
        return FrameSpan(first=self.first[rows], last=self.last[rows])

    def mask(self, rows: IndexArray, num_frames: int) -> Mask:
        """Whether each frame is in the span, for some simulations, shape (row, time)."""
        frame = np.arange(num_frames, dtype=np.int32)
        return (frame >= self.first[rows, None]) & (frame <= self.last[rows, None])

    def instants(self) -> Instants:
        """The frames of all spans, in the order of simulations and frames."""
        length = np.maximum(self.last - self.first + 1, 0)
        simulation = np.repeat(np.arange(len(length)), length)
        num_before = np.cumsum(length) - length  # Instants of all earlier simulations.
        frame = np.arange(simulation.size) + np.repeat(self.first - num_before, length)
        return Instants(simulation, frame)


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherVehicles:
    """All vehicles at one frame of each simulation; arrays have shape (simulation, vehicle).

    Attributes:
        valid: Whether the slot has a vehicle other than the ego that is recorded in that frame.
        ego_lead: Station of the ego minus the vehicle's: positive for vehicles behind the ego [m].
        gap: Gap between the bumpers of vehicle and ego, negative where they overlap [m].
        speed: Speed in the vehicle's own direction, never negative [m/s].
        lane: Lane index.
        lights: Bits of `Lights`.
        is_oncoming: Whether the vehicle's heading in that frame points against the road. A choice:
            a vehicle that has spun round is oncoming here, but not for the function `is_oncoming`.
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
    """All vehicles at one frame of each of some simulations.

    Args:
        trajectories: The batch.
        frame: A frame of each simulation, shape (simulation,); `NEVER` counts as frame 0.
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
    _, cosine = sincos(as_f32(headings[instants]) * ANGLE_RESOLUTION_F32 - np.float32(direction))
    return OtherVehicles(
        valid=_is_recorded_other(trajectories, simulation, frame),
        ego_lead=ego_lead,
        gap=np.abs(ego_lead) - (half_length + half_length[:, [EGO_SLOT]]),
        speed=as_f32(states.speed[instants]) * METRES_PER_MM,
        lane=states.lane[instants],
        lights=states.lights[instants],
        is_oncoming=cosine < 0,
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
    # Stations are in mm, speeds in mm/s.
    is_near = np.abs(s - s[:, [EGO_SLOT]]) <= reach * 1000.0
    is_slow = is_near & (states.speed[simulation, :, frame] < below * 1000.0)
    is_slow &= _is_recorded_other(trajectories, simulation, frame)
    return is_slow.sum(axis=1, dtype=np.int32)


def _is_recorded_other(trajectories: Trajectories, simulation: IndexArray, frame: Frames) -> Mask:
    """Whether a vehicle is recorded at an instant and is not the ego, shape (instant, vehicle)."""
    valid = trajectories.scenario.vehicles.valid[simulation]  # An index array makes a copy.
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
