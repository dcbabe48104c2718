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
from overtaking.model.verdicts import Case

Frames = NDArray[np.integer]

T = TypeVar("T", bound=np.generic)

METRES = np.float32(1e-3)

RADIANS = np.float32(1e-4)

OCCUPANCY_REACH_MM = 100_000
"""How far ahead and behind a lane's occupancy is counted [mm]."""

_SMOOTHING_MS = 100
"""Half of the time over which the lateral speed is measured [ms]."""


def at(values: NDArray[T], frames: Frames) -> NDArray[T]:
    """`values` (simulation, time) at one frame each; where that is `NEVER`, at the first frame."""
    return values[np.arange(len(frames)), np.maximum(frames, 0)]


def spread_over(values: NDArray[T], simulations: IndexArray | Mask, count: int) -> NDArray[T]:
    """Values of some of `count` simulations among all, 0 for the others."""
    spread = np.zeros(count, values.dtype)
    spread[simulations] = values
    return spread


def frames_within(start: I32, stop: I32) -> tuple[IndexArray, IndexArray]:
    """Simulation and frame of each frame from `start` to `stop`, both within it, in order."""
    length = np.maximum(stop - start + 1, 0)
    rows = np.repeat(np.arange(len(length)), length)
    before = np.cumsum(length) - length
    return rows, np.arange(rows.size) + np.repeat(start - before, length)


def side_of(road: Road) -> np.float32:
    """+1 where `d` grows to the left in the law's sense, -1 in left-hand traffic."""
    return np.float32(1.0 if road.driving_side is DrivingSide.RIGHT else -1.0)


def borders_of(road: Road) -> F32:
    """Lane borders from the right to the left, those of the lane of oncoming traffic too [m]."""
    borders = side_of(road) * as_f32(road.lane_boundaries)
    beyond = road.overtaking_side_neighbour
    if road.is_two_way and beyond is not None:
        borders = np.append(borders, borders[-1] + np.float32(beyond.width))
    return borders


def slot_of(vehicle: U8) -> IndexArray:
    """Slot of each vehicle; the ego's where there is none."""
    return np.where(vehicle == NO_VEHICLE, EGO_SLOT, vehicle).astype(np.intp)


def half_lengths(run: Trajectories, rows: IndexArray, slot: IndexArray) -> F32:
    """Half of the lengths of the ego and a vehicle together, shape (instant,) [m]."""
    length = run.scenario.vehicles.length
    return np.float32(0.5) * (length[rows, EGO_SLOT] + length[rows, slot])


def footprint(
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
    across = side_of(road) * (as_f32(d) * METRES)
    sine, cosine = sincos(as_f32(heading[0]) * RADIANS - np.float32(heading[1]))
    half_length, half_width = length * np.float32(0.5), width * np.float32(0.5)
    return across, half_length * np.abs(sine) + half_width * np.abs(cosine)


def oncoming(run: Trajectories) -> Mask:
    """Which vehicles come against the road, shape (simulation, vehicle); none on one-way roads.

    The heading in the first recorded frame decides: who spins later does not become oncoming.
    """
    valid = run.scenario.vehicles.valid
    if not run.road.is_two_way:
        return np.zeros_like(valid)
    first = (
        np.zeros(valid.shape, np.intp)
        if run.is_recorded is None
        else run.is_recorded.argmax(axis=2)
    )
    headings, direction = run.headings_and_origin
    heading = np.take_along_axis(headings, first[:, :, None], axis=2)[:, :, 0]
    against = sincos(as_f32(heading) * RADIANS - np.float32(direction))[1] < 0
    against[:, EGO_SLOT] = False
    return valid & against


def half_window(interval_ms: int) -> int:
    """Frames on either side over which the lateral speed is measured."""
    return max(1, round(_SMOOTHING_MS / interval_ms))


def lateral_speed_at(
    run: Trajectories,
    rows: IndexArray,
    slot: IndexArray,
    frames: Frames,
    half: Frames | int | None = None,
) -> F32:
    """Speed to the left of vehicles at single frames; all arrays of one shape [m/s].

    Args:
        run: The batch.
        rows: Simulations.
        slot: A vehicle of each.
        frames: A frame of each in which it is recorded.
        half: Frames on either side over which to measure, where there are as many; those over
            about 0.2 s by default.

    Returns:
        A central difference, one-sided beside frames without the vehicle.
    """
    interval, d = run.scenario.frame_interval_ms, run.states.d
    half = half_window(interval) if half is None else half
    earlier, later = _recorded_around(run, rows, slot, frames, half)
    moved = d[rows, slot, later] - d[rows, slot, earlier]
    elapsed = np.maximum((later - earlier) * interval, np.int32(1))
    return side_of(run.road) * (as_f32(moved) / as_f32(elapsed))


def _recorded_around(
    run: Trajectories, rows: IndexArray, slot: IndexArray, frames: Frames, half: Frames | int
) -> tuple[I32, I32]:
    """The farthest frames within `half` of some that the vehicle is recorded up to."""
    last = np.maximum(run.num_frames[rows] - 1, np.int32(0))
    later = np.minimum(frames + half, last).astype(np.int32)
    earlier = np.minimum(np.maximum(frames - half, 0), last).astype(np.int32)
    if run.is_recorded is None:
        return earlier, later
    ends = [frames.astype(np.int32)] * 2
    for step in range(1, int(np.max(half, initial=0)) + 1):
        for side, (sign, limit) in enumerate(((-1, earlier), (1, later))):
            next_one = ends[side] + np.int32(sign)
            inside = (limit - next_one) * sign >= 0
            there = run.is_recorded[rows, slot, np.where(inside, next_one, ends[side])]
            reached = np.abs(ends[side] - frames) == step - 1
            ends[side] = np.where(inside & there & reached, next_one, ends[side])
    return ends[0], ends[1]


@dataclass(frozen=True, slots=True, kw_only=True)
class Along:
    """A vehicle along the road, as in `TargetSignals`; arrays have shape (instant,).

    `valid` says where there is one and it is recorded; elsewhere the values mean nothing.
    """

    valid: Mask
    lead: F32
    gap: F32
    speed: F32


def vehicle_at(run: Trajectories, vehicle: U8, rows: IndexArray, frames: Frames) -> Along:
    """A vehicle along the road at single frames; the first frame where one is negative.

    Args:
        run: The batch.
        vehicle: Slot of the vehicle at each instant, `NO_VEHICLE` for none, shape (instant,).
        rows: Simulations, same shape.
        frames: A frame of each, same shape.
    """
    frame, slot = np.maximum(frames, 0), slot_of(vehicle)
    lead = lead_at(run, rows, slot, frame)
    there = (vehicle != NO_VEHICLE) & (frame < run.num_frames[rows])
    if run.is_recorded is not None:
        there &= run.is_recorded[rows, slot, frame]
    return Along(
        valid=there,
        lead=lead,
        gap=np.abs(lead) - half_lengths(run, rows, slot),
        speed=as_f32(run.states.speed[rows, slot, frame]) * METRES,
    )


def lead_at(run: Trajectories, rows: IndexArray, slot: IndexArray, frames: Frames) -> F32:
    """Centre of the ego minus that of a vehicle along the road at single frames [m]."""
    s = run.states.s
    return as_f32(s[rows, EGO_SLOT, frames] - s[rows, slot, frames]) * METRES


def across_at(
    run: Trajectories, signals: EgoSignals, rows: IndexArray, slot: IndexArray, frames: Frames
) -> tuple[F32, F32]:
    """Vehicles across the road at single frames: `lateral` and `lateral_gap` of `TargetSignals`.

    Args:
        run: The batch.
        signals: Its signals.
        rows: Simulations, shape (instant,).
        slot: A vehicle of each, same shape.
        frames: A frame of each, same shape.
    """
    states, bodies, own = run.states, run.scenario.vehicles, (rows, frames)
    side, (headings, direction) = (rows, slot, frames), run.headings_and_origin
    across, reach = footprint(
        run.road,
        states.d[side],
        (headings[side], direction),
        bodies.length[rows, slot],
        bodies.width[rows, slot],
    )
    own_reach = (signals.left_edge[own] - signals.right_edge[own]) * np.float32(0.5)
    return across, np.abs(across - signals.lateral_position[own]) - (own_reach + reach)


def in_lane(run: Trajectories, lane: I32, frames: Frames) -> Mask:
    """Which vehicles are in a driving lane at one frame of each simulation, (simulation, vehicle).

    Args:
        run: The batch.
        lane: A lane index for each simulation, shape (simulation,).
        frames: A frame of each, same shape.
    """
    rows = np.arange(len(frames))
    inside = run.states.lane[rows, :, frames] == lane[:, None]
    inside &= run.scenario.vehicles.valid & (lane < run.road.num_lanes)[:, None]
    return inside if run.is_recorded is None else inside & run.is_recorded[rows, :, frames]


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftLane:
    """The lane to the left at one frame of each simulation, as in `EgoSignals`."""

    occupancy: F32
    count: U8


def left_lane_at(run: Trajectories, frames: Frames) -> LeftLane:
    """The lane to the left at one recorded frame of each simulation.

    Lengths are summed in whole half-millimetres: the order of the vehicles is irrelevant.
    """
    rows = np.arange(len(frames))
    own, s = run.states.lane[rows, EGO_SLOT, frames].astype(np.int32), run.states.s[rows, :, frames]
    there = in_lane(run, own + 1, frames)
    limit = np.int32(2 * OCCUPANCY_REACH_MM)
    length = np.rint(run.scenario.vehicles.length * np.float32(1000.0)).astype(np.int32)
    # Twice the distance, cut so that a vehicle miles away cannot overflow.
    centre = np.clip(s - s[:, [EGO_SLOT]], -limit, limit) * np.int32(2)
    front, rear = np.minimum(centre + length, limit), np.maximum(centre - length, -limit)
    inside = np.where(there, np.maximum(front - rear, np.int32(0)), np.int32(0))
    return LeftLane(
        occupancy=as_f32(inside.sum(axis=1, dtype=np.int32)) * np.float32(0.5 / limit),
        count=there.sum(axis=1, dtype=np.uint8),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """From one frame to another, both within it; empty where `stop` is before `start`.

    Attributes:
        start: First frame, shape (simulation,).
        stop: Last frame, shape (simulation,).
    """

    start: I32
    stop: I32

    @property
    def exists(self) -> Mask:
        """Whether it has a frame, shape (simulation,)."""
        return self.stop >= self.start

    @property
    def ends(self) -> I32:
        """First frames and then last frames, as compiled functions take them."""
        return np.concatenate([self.start, self.stop], dtype=np.int32)

    def at_rows(self, rows: IndexArray) -> "Span":
        """The spans of some simulations."""
        return Span(start=self.start[rows], stop=self.stop[rows])

    def mask(self, rows: IndexArray, num_frames: int) -> Mask:
        """Which frames it has in some simulations, shape (row, time)."""
        frame = np.arange(num_frames, dtype=np.int32)
        return (frame >= self.start[rows, None]) & (frame <= self.stop[rows, None])

    def frames(self) -> tuple[IndexArray, IndexArray]:
        """Simulation and frame of each of its frames, in order."""
        return frames_within(self.start, self.stop)


@dataclass(frozen=True, slots=True, kw_only=True)
class Others:
    """All vehicles at one frame of each simulation; arrays have shape (simulation, vehicle).

    Attributes:
        valid: Whether this is a vehicle other than the ego, recorded in that frame.
        lead: Centre of the ego minus its centre along the road: positive for those behind [m].
        gap: Between its bumper and the ego's, negative where they overlap [m].
        speed: Along its own direction [m/s].
        lane: Lane index.
        lights: `Lights`.
        oncoming: Whether it drives against the road.
    """

    valid: Mask
    lead: F32
    gap: F32
    speed: F32
    lane: U8
    lights: U8
    oncoming: Mask


def others_at(case: Case, frame: I32, rows: IndexArray | None = None) -> Others:
    """All vehicles at one frame of some simulations; frame 0 where that is negative.

    Args:
        case: The batch.
        frame: A frame of each, shape (simulation,).
        rows: Which simulations, same shape; all of them if left out.
    """
    run, states = case.trajectories, case.trajectories.states
    rows, frame = np.arange(len(frame)) if rows is None else rows, np.maximum(frame, 0)
    place = (rows[:, None], np.arange(states.s.shape[1])[None, :], frame[:, None])
    half = run.scenario.vehicles.length[rows] * np.float32(0.5)
    s = states.s[place]
    lead = as_f32(s[:, [EGO_SLOT]] - s) * METRES
    headings, direction = run.headings_and_origin
    heading = as_f32(headings[place]) * RADIANS - np.float32(direction)
    return Others(
        valid=_others_there(run, rows, frame),
        lead=lead,
        gap=np.abs(lead) - (half + half[:, [EGO_SLOT]]),
        speed=as_f32(states.speed[place]) * METRES,
        lane=states.lane[place],
        lights=states.lights[place],
        oncoming=sincos(heading)[1] < 0,
    )


def coming(others: Others) -> Mask:
    """Whether a vehicle is ahead of the ego and drives towards it, shape (instant, vehicle)."""
    return others.valid & others.oncoming & (others.lead < 0)


def num_slow(case: Case, rows: IndexArray, frames: Frames, *, below: float, reach: float) -> I32:
    """Number of others slower than `below` [m/s] and nearer than `reach` [m] at single frames.

    Args:
        case: The batch.
        rows: Simulations, shape (instant,).
        frames: A frame of each, same shape.
        below: [m/s].
        reach: Along the road, from centre to centre [m].
    """
    states, s = case.trajectories.states, case.trajectories.states.s[rows, :, frames]
    near = np.abs(s - s[:, [EGO_SLOT]]) <= reach * 1000.0
    slow = near & (states.speed[rows, :, frames] < below * 1000.0)
    slow &= _others_there(case.trajectories, rows, frames)
    return slow.sum(axis=1, dtype=np.int32)


def _others_there(run: Trajectories, rows: IndexArray, frames: Frames) -> Mask:
    """Which vehicles but the ego are recorded at single frames, shape (instant, vehicle)."""
    valid = run.scenario.vehicles.valid[rows]
    valid[:, EGO_SLOT] = False
    return valid if run.is_recorded is None else valid & run.is_recorded[rows, :, frames]


def out_indicator(case: Case) -> int:
    """The `Lights` bit that announces a move to the fast side."""
    right_hand = case.trajectories.road.driving_side is DrivingSide.RIGHT
    return int(Lights.INDICATOR_LEFT if right_hand else Lights.INDICATOR_RIGHT)


def back_indicator(case: Case) -> int:
    """The `Lights` bit that announces a move to the slow side."""
    both = int(Lights.INDICATOR_LEFT | Lights.INDICATOR_RIGHT)
    return both - out_indicator(case)
