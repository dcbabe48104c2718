"""Signals of the ego and its neighbours, one simulation after the other.

Formulas are applied to all frames of a simulation at once; neighbours are searched frame by frame.
`ego_signals.rs` of `crates/overtaking-labels` computes the same signals, sixteen frames at a time.
"""

from __future__ import annotations

import itertools
import math
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.core.float32_math import as_f32, maximum, minimum, sincos
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.signals import visibility_inputs
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.road import DrivingSide
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.world.constants import model_constants
from overtaking.world.road_surface import friction_at_film, friction_at_speed
from overtaking.world.surrogate_safety import drac, mttc, time_gap, ttc
from overtaking.world.visibility import MIN_EXTINCTION, lamp_range
from overtaking.world.weather_parameters import weather_effects

if TYPE_CHECKING:
    from overtaking.core.arrays import F32
    from overtaking.model.trajectories import Trajectories

METRES, HALF = np.float32(1e-3), np.float32(0.5)

SignalArray = np.ndarray[Any, Any]
"""A signal of one simulation, shape (time,) or (neighbour, time)."""


class SingleRun:
    """One simulation of a batch, with its recorded frames.

    Attributes:
        trajectories: The batch.
        row: Position of the simulation in the batch.
        num_frames: Number of recorded frames.
        num_slots: Number of slots for vehicles.
        road: The road.
        interval_ms: Time between two frames [ms].
        length: Length of each vehicle, shape (vehicle,) [m].
        s: Recorded positions along the road, by vehicle and frame [mm].
        speed: Recorded speeds, by vehicle and frame [mm/s].
        lane: Lanes by vehicle and frame; on two-way roads the opposing lane is one more lane.
        is_recorded: Whether a vehicle has a state, by vehicle and frame. Oncoming vehicles have
            none: no signal of a neighbour may find them.
        num_lanes: Number of lanes, with the opposing one.
    """

    def __init__(self, trajectories: Trajectories, row: int) -> None:
        """Take a simulation out of a batch."""
        self.trajectories, self.row = trajectories, row
        self.num_frames = int(trajectories.num_frames[row])
        self.road = trajectories.road
        self.interval_ms = trajectories.scenario.frame_interval_ms
        self.num_slots = trajectories.states.s.shape[1]
        self.length = trajectories.scenario.vehicles.length[row]
        self.s, self.lane = self.state("s").tolist(), self.state("lane").tolist()
        self.speed = self.state("speed").tolist()
        self.is_recorded = trajectories.state_mask[row, :, : self.num_frames].tolist()
        self.num_lanes = self.road.num_lanes
        if self.road.is_two_way:
            self._add_opposing_lane()
            self._remove_oncoming_vehicles()
            self.num_lanes += 1

    def _add_opposing_lane(self) -> None:
        """Give vehicles beyond the opposing lane a higher lane number than those in it."""
        opposing_lane = self.road.overtaking_side_neighbour
        assert opposing_lane is not None
        last_border = self.road.overtaking_sign * self.road.lane_boundaries[-1]
        outer_edge = 1000.0 * (last_border + opposing_lane.width)
        d = self.state("d").tolist()
        for slot, frame in itertools.product(range(self.num_slots), range(self.num_frames)):
            if self.lane[slot][frame] == self.num_lanes:
                self.lane[slot][frame] += self.road.overtaking_sign * d[slot][frame] > outer_edge

    def _remove_oncoming_vehicles(self) -> None:
        """Mark vehicles that first drive against the road as not recorded."""
        heading = self.state("heading").tolist()
        for slot in range(1, self.num_slots):
            first = first_true(self.is_recorded[slot])
            if math.cos(1e-4 * heading[slot][first] - self.road.heading) < 0:
                self.is_recorded[slot] = [False] * self.num_frames

    def state(self, name: str) -> SignalArray:
        """A recorded state, shape (vehicle, time)."""
        return getattr(self.trajectories.states, name)[self.row, :, : self.num_frames]

    def state_in_si(self, name: str, slot: int) -> F32:
        """A recorded state of one vehicle in metres and seconds, shape (time,)."""
        return as_f32(self.state(name)[slot]) * METRES

    def half_length_sum(self, slot: int) -> np.float32:
        """Half of the lengths of the ego and a vehicle together [m]."""
        return HALF * (self.length[0] + self.length[slot])

    @cached_property
    def overtaking_sign(self) -> np.float32:
        """+1 where lateral positions grow to the overtaking side, else -1."""
        return np.float32(1.0 if self.road.driving_side is DrivingSide.RIGHT else -1.0)

    def lateral_extent(self, slot: int) -> tuple[F32, F32]:
        """Position of a vehicle's centre to the left, and reach of its corners, (time,) [m]."""
        width = self.trajectories.scenario.vehicles.width[self.row, slot]
        heading = as_f32(self.state("heading")[slot]) * np.float32(1e-4)
        sine, cosine = sincos(heading - np.float32(self.road.heading))
        reach = self.length[slot] * HALF * np.abs(sine) + width * HALF * np.abs(cosine)
        return self.overtaking_sign * self.state_in_si("d", slot), reach

    def lateral_speed(self, slot: int) -> F32:
        """Speed to the left: a central difference over 0.2 s, one-sided at gaps of the recording.

        The ego is recorded in every frame.
        """
        d, is_recorded = self.state("d")[slot].tolist(), self.is_recorded[slot]
        is_recorded = [True] * self.num_frames if slot == 0 else is_recorded
        half, speeds = max(1, round(100 / self.interval_ms)), []
        for frame in range(self.num_frames):
            earlier = later = frame
            while later < min(frame + half, self.num_frames - 1) and is_recorded[later + 1]:
                later += 1
            while earlier > max(frame - half, 0) and is_recorded[earlier - 1]:
                earlier -= 1
            shift = np.float32(d[later] - d[earlier])
            elapsed = np.float32(max((later - earlier) * self.interval_ms, 1))
            speeds.append(self.overtaking_sign * (shift / elapsed))
        return np.array(speeds, np.float32)

    def neighbour(self, role: NeighbourRole, frame: int) -> int | None:
        """The nearest vehicle in a role; a leader's centre is not behind the ego's."""
        ego_lane, is_leader = self.lane[0][frame], is_ahead(role)
        lane_of_role = ego_lane + (0, 1, -1)[role // 2]
        nearest: tuple[int, int] | None = None
        for slot in range(1, self.num_slots):
            is_in_lane = self.is_recorded[slot][frame] and self.lane[slot][frame] == lane_of_role
            if not is_in_lane or ego_lane >= self.num_lanes or lane_of_role >= self.num_lanes:
                continue
            lead = self.s[slot][frame] - self.s[0][frame]
            if (lead >= 0) == is_leader and (nearest is None or abs(lead) < nearest[0]):
                nearest = abs(lead), slot
        return None if nearest is None else nearest[1]

    def gap(self, slot: int, frame: int) -> np.float32:
        """Gap between the bumpers of the ego and another vehicle, negative alongside [m]."""
        distance = np.float32(abs(self.s[slot][frame] - self.s[0][frame])) * METRES
        return distance - (self.length[0] * HALF + self.length[slot] * HALF)

    def closing_speed(self, slot: int, frame: int, *, ahead: bool) -> np.float32:
        """Speed at which that gap shrinks [m/s]."""
        ego_excess = self.speed[0][frame] - self.speed[slot][frame]
        return np.float32(ego_excess if ahead else -ego_excess) * METRES


def first_true(values: list[bool]) -> int:
    """Position of the first true value; 0 without a true value."""
    return next((position for position, value in enumerate(values) if value), 0)


def is_ahead(role: int) -> bool:
    """Whether a role is one of the three ahead of the ego, which have even numbers."""
    return role % 2 == 0


def signals_of(run: SingleRun) -> dict[str, SignalArray]:
    """Signals by name, shape (time,) or (neighbour, time)."""
    position, reach = run.lateral_extent(0)
    speed = run.state_in_si("speed", 0)
    sight_lit, sight_unlit = _sight_distances(run, speed)
    return {
        "lane": run.state("lane")[0],
        "s": run.state_in_si("s", 0),
        "lateral_position": position,
        "lateral_speed": run.lateral_speed(0),
        "speed": speed,
        "accel": run.state_in_si("accel_lon", 0),
        "right_edge": position - reach,
        "left_edge": position + reach,
        "friction": _friction(run, speed),
        "sight_lit": sight_lit,
        "sight_unlit": sight_unlit,
        **_neighbour_signals(run, position, reach),
        **_left_lane_occupancy(run),
    }


def _neighbour_signals(run: SingleRun, position: F32, reach: F32) -> dict[str, SignalArray]:
    """Slot, gap, closing speed and lateral gap of the neighbour in each role, (neighbour, time)."""
    shape = (len(NeighbourRole), run.num_frames)
    slots = np.full(shape, NO_VEHICLE)
    gap, closing_speed, lateral_gap = (np.zeros(shape, np.float32) for _ in range(3))
    extents = [run.lateral_extent(slot) for slot in range(run.num_slots)]
    for frame, role in itertools.product(range(run.num_frames), NeighbourRole):
        slot = run.neighbour(role, frame)
        if slot is None:
            continue
        index = role, frame
        slots[index] = slot
        gap[index] = run.gap(slot, frame)
        closing_speed[index] = run.closing_speed(slot, frame, ahead=is_ahead(role))
        other_position, other_reach = extents[slot][0][frame], extents[slot][1][frame]
        distance = np.abs(position[frame] - other_position)
        lateral_gap[index] = distance - (reach[frame] + other_reach)
    return {
        "neighbour_slot": slots,
        "gap": gap,
        "closing_speed": closing_speed,
        "lateral_gap": lateral_gap,
    }


def _left_lane_occupancy(run: SingleRun) -> dict[str, SignalArray]:
    """Share of the lane to the left within 100 m that vehicles cover, and their number.

    Lengths are summed in half-millimetres, so the order of the vehicles does not matter.
    """
    limit, occupancy, count = 200_000, [], []
    for frame in range(run.num_frames):
        total = num_vehicles = 0
        for slot in range(1, run.num_slots):
            lane = run.lane[slot][frame]
            is_on_left = lane == run.lane[0][frame] + 1 and lane < run.num_lanes
            if not (run.is_recorded[slot][frame] and is_on_left):
                continue
            length = int(np.rint(run.length[slot] * np.float32(1000.0)))
            centre = 2 * max(-limit, min(limit, run.s[slot][frame] - run.s[0][frame]))
            total += max(0, min(centre + length, limit) - max(centre - length, -limit))
            num_vehicles += 1
        occupancy.append(np.float32(total) * np.float32(1.0 / (2 * limit)))
        count.append(num_vehicles)
    return {
        "left_occupancy": np.array(occupancy, np.float32),
        "left_count": np.array(count, np.uint8),
    }


def _friction(run: SingleRun, speed: F32) -> F32:
    """Peak friction on the mean film of the ego's lane; off the road, of the nearest lane."""
    constants, inputs, row = model_constants(), visibility_inputs(run.trajectories), run.row
    lane = np.array(run.lane[0])
    nearest_lane = np.where(lane == 255, 0, np.minimum(lane, run.num_lanes - 1))
    film = inputs["film"].reshape(-1, 8)[row, nearest_lane]
    tyres = inputs["tyre_wear"][[row]], inputs["has_truck_tyres"][[row]]
    return friction_at_film(constants, friction_at_speed(constants, speed, *tyres), film)


def _sight_distances(run: SingleRun, speed: F32) -> tuple[F32, F32]:
    """Distances at which a driver sees a lit and an unlit vehicle [m]."""
    inputs, row = visibility_inputs(run.trajectories), run.row
    rain = inputs["rain"][row] * (np.float32(1.0) + speed / model_constants().rain_speed)
    extinction = inputs["fog"][row] + rain
    unlit = minimum(
        inputs["contrast_depth"][row] / maximum(extinction, MIN_EXTINCTION),
        inputs["unlit_limit"][row],
    )
    threshold = weather_effects(run.trajectories.scenario).sight["lamp_threshold"][[row]]
    lamp = lamp_range(extinction, constant("weather.lamps.rear_position"), threshold)
    lit = minimum(maximum(lamp, unlit), constant("model.perception.range"))
    along_road = as_f32(np.array([_sight_along_road(run, s * 1e-3) for s in run.s[0]]))
    return minimum(lit, along_road), minimum(unlit, along_road)


def _sight_along_road(run: SingleRun, station: float) -> float:
    """Sight distance that the course of the road leaves at a station; infinite without one [m]."""
    table = run.road.course.sight if run.road.course else ()
    if not table:
        return math.inf
    for (begin, sight), (end, next_sight) in itertools.pairwise(table):
        if begin <= station < end:
            return (next_sight - sight) / (end - begin) * (station - begin) + sight
    return table[0][1] if station < table[0][0] else table[-1][1]


def target_signals(
    run: SingleRun, signals: dict[str, SignalArray], target: int
) -> dict[str, SignalArray]:
    """A vehicle by the names of `TargetSignals`; any value where it is not recorded, (time,)."""
    distance = np.array(run.s[0]) - np.array(run.s[target])
    ego_lead = as_f32(distance.astype(np.int32)) * METRES
    gap = np.abs(ego_lead) - run.half_length_sum(target)
    valid = np.array(run.is_recorded[target], np.bool_)
    position, reach = run.lateral_extent(target)
    ego_reach = (signals["left_edge"] - signals["right_edge"]) * HALF
    lateral_distance = np.abs(position - signals["lateral_position"])
    return {
        "valid": valid,
        "ego_lead": ego_lead,
        "overlaps": valid & (gap < 0),
        "gap": gap,
        "lateral_position": position,
        "lateral_gap": lateral_distance - (ego_reach + reach),
        "lane": run.state("lane")[target],
        "speed": run.state_in_si("speed", target),
        "accel": run.state_in_si("accel_lon", target),
        "lateral_speed": run.lateral_speed(target),
    }


def encounter(
    run: SingleRun, instants: list[tuple[int, int]], *, ahead: bool
) -> dict[str, SignalArray]:
    """Measures of the gap between the ego and a neighbour, for the one of them that is behind.

    Args:
        run: The simulation.
        instants: Frames, and the slot of the neighbour in each.
        ahead: Whether the neighbours are ahead of the ego.

    Returns:
        Arrays by the names of `Encounter`, shape (instant,).
    """
    gap = np.array([run.gap(slot, frame) for frame, slot in instants], np.float32)
    closing_speed = np.array(
        [run.closing_speed(slot, frame, ahead=ahead) for frame, slot in instants], np.float32
    )
    ego_speed = as_f32(np.array([run.speed[0][frame] for frame, _ in instants], np.int32)) * METRES
    accel = run.state("accel_lon")
    ego_accel = as_f32(np.array([accel[0, frame] for frame, _ in instants], np.int16)) * METRES
    other_accel = (
        as_f32(np.array([accel[slot, frame] for frame, slot in instants], np.int16)) * METRES
    )
    return {
        "gap": gap,
        "closing_speed": closing_speed,
        "time_gap": time_gap(gap, ego_speed if ahead else ego_speed + closing_speed),
        "ttc": ttc(gap, closing_speed),
        "mttc": mttc(
            gap, closing_speed, ego_accel - other_accel if ahead else other_accel - ego_accel
        ),
        "drac": drac(gap, closing_speed),
    }
