"""Who is around the ego and how far one sees, one simulation after the other.

Formulas are applied to all frames of a simulation at once; whoever is looked for is looked for
frame by frame. `ego_signals.rs` of `crates/overtaking-labels` computes the same, sixteen frames
at a time.
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
Row = np.ndarray[Any, Any]


class One:
    """One simulation of a batch, with its recorded frames."""

    def __init__(self, run: Trajectories, number: int) -> None:
        """Take a simulation out of a batch."""
        self.run, self.number = run, number
        self.frames = int(run.num_frames[number])
        self.road, self.interval = run.road, run.scenario.frame_interval_ms
        self.slots = run.states.s.shape[1]
        self.length = run.scenario.vehicles.length[number]
        self.s, self.lane = self.state("s").tolist(), self.state("lane").tolist()
        self.speed = self.state("speed").tolist()
        self.recorded = run.state_mask[number, :, : self.frames].tolist()
        self.num_lanes = self.road.num_lanes
        if self.road.is_two_way:
            self._take_other_side()

    def _take_other_side(self) -> None:
        """The lane of oncoming traffic is one more, and who comes is seen by nobody."""
        beyond = self.road.overtaking_side_neighbour
        assert beyond is not None
        edge = 1000.0 * (self.road.overtaking_sign * self.road.lane_boundaries[-1] + beyond.width)
        d, heading = self.state("d").tolist(), self.state("heading").tolist()
        for slot in range(self.slots):
            for frame in range(self.frames):
                if self.lane[slot][frame] == self.num_lanes:
                    self.lane[slot][frame] += self.road.overtaking_sign * d[slot][frame] > edge
            there = [frame for frame in range(self.frames) if self.recorded[slot][frame]]
            first = there[0] if there else 0
            if slot and math.cos(1e-4 * heading[slot][first] - self.road.heading) < 0:
                self.recorded[slot] = [False] * self.frames
        self.num_lanes += 1

    def state(self, name: str) -> Row:
        """A recorded state, shape (vehicle, time)."""
        return getattr(self.run.states, name)[self.number, :, : self.frames]

    def metres(self, name: str, slot: int) -> F32:
        """A recorded state of one vehicle in metres and seconds, shape (time,)."""
        return as_f32(self.state(name)[slot]) * METRES

    def halves(self, slot: int) -> np.float32:
        """Half of the lengths of the ego and a vehicle together [m]."""
        return HALF * (self.length[0] + self.length[slot])

    @cached_property
    def side(self) -> np.float32:
        """+1 where positions across the road grow to the left in the law's sense, else -1."""
        return np.float32(1.0 if self.road.driving_side is DrivingSide.RIGHT else -1.0)

    def across(self, slot: int) -> tuple[F32, F32]:
        """Where the centre of a body is, to the left, and how far its corners reach, (time,)."""
        width = self.run.scenario.vehicles.width[self.number, slot]
        heading = as_f32(self.state("heading")[slot]) * np.float32(1e-4)
        sine, cosine = sincos(heading - np.float32(self.road.heading))
        reach = self.length[slot] * HALF * np.abs(sine) + width * HALF * np.abs(cosine)
        return self.side * self.metres("d", slot), reach

    def lateral_speed(self, slot: int) -> F32:
        """Speed to the left: a central difference over 0.2 s, one-sided where it was not recorded.

        The ego is there in every frame.
        """
        d, there = self.state("d")[slot].tolist(), self.recorded[slot]
        there = [True] * self.frames if slot == 0 else there
        half, speeds = max(1, round(100 / self.interval)), []
        for frame in range(self.frames):
            earlier = later = frame
            while later < min(frame + half, self.frames - 1) and there[later + 1]:
                later += 1
            while earlier > max(frame - half, 0) and there[earlier - 1]:
                earlier -= 1
            moved = np.float32(d[later] - d[earlier])
            elapsed = np.float32(max((later - earlier) * self.interval, 1))
            speeds.append(self.side * (moved / elapsed))
        return np.array(speeds, np.float32)

    def neighbour(self, place: NeighbourRole, frame: int) -> int | None:
        """The nearest vehicle in a place; a leader's centre is not behind the ego's."""
        own, ahead = self.lane[0][frame], place % 2 == 0
        wanted = own + (0, 1, -1)[place // 2]
        lanes, nearest = self.num_lanes, None
        for slot in range(1, self.slots):
            here = self.recorded[slot][frame] and self.lane[slot][frame] == wanted
            if not here or own >= lanes or wanted >= lanes:
                continue
            way = self.s[slot][frame] - self.s[0][frame]
            if (way >= 0) == ahead and (nearest is None or abs(way) < nearest[0]):
                nearest = abs(way), slot
        return None if nearest is None else nearest[1]

    def gap(self, slot: int, frame: int) -> np.float32:
        """Between the bumpers of the ego and another vehicle, negative alongside [m]."""
        way = np.float32(abs(self.s[slot][frame] - self.s[0][frame])) * METRES
        return way - (self.length[0] * HALF + self.length[slot] * HALF)

    def closing(self, slot: int, frame: int, *, ahead: bool) -> np.float32:
        """How fast that gap shrinks [m/s]."""
        slower = self.speed[0][frame] - self.speed[slot][frame]
        return np.float32(slower if ahead else -slower) * METRES


def signals(one: One) -> dict[str, Row]:
    """Signals by name, shape (time,) or (neighbour, time)."""
    across, reach = one.across(0)
    speed = one.metres("speed", 0)
    lit, unlit = _sights(one, speed)
    return {
        "lane": one.state("lane")[0],
        "s": one.metres("s", 0),
        "lateral_position": across,
        "lateral_speed": one.lateral_speed(0),
        "speed": speed,
        "accel": one.metres("accel_lon", 0),
        "right_edge": across - reach,
        "left_edge": across + reach,
        "friction": _friction(one, speed),
        "sight_lit": lit,
        "sight_unlit": unlit,
        **_neighbours(one, across, reach),
        **_left_lane(one),
    }


def _neighbours(one: One, across: F32, reach: F32) -> dict[str, Row]:
    shape = (len(NeighbourRole), one.frames)
    vehicle = np.full(shape, NO_VEHICLE)
    gap, closing, aside = (np.zeros(shape, np.float32) for _ in range(3))
    bodies = [one.across(slot) for slot in range(one.slots)]
    for frame in range(one.frames):
        for place in NeighbourRole:
            slot = one.neighbour(place, frame)
            if slot is None:
                continue
            vehicle[place, frame] = slot
            gap[place, frame] = one.gap(slot, frame)
            closing[place, frame] = one.closing(slot, frame, ahead=place % 2 == 0)
            other, width = bodies[slot][0][frame], bodies[slot][1][frame]
            aside[place, frame] = np.abs(across[frame] - other) - (reach[frame] + width)
    return {"neighbour_slot": vehicle, "gap": gap, "closing_speed": closing, "lateral_gap": aside}


def _left_lane(one: One) -> dict[str, Row]:
    """Lengths within 100 m in the lane to the left, in half-millimetres, over 200 m."""
    limit, occupancy, count = 200_000, [], []
    for frame in range(one.frames):
        total = number = 0
        for slot in range(1, one.slots):
            lane = one.lane[slot][frame]
            left = lane == one.lane[0][frame] + 1 and lane < one.num_lanes
            if not (one.recorded[slot][frame] and left):
                continue
            length = int(np.rint(one.length[slot] * np.float32(1000.0)))
            centre = 2 * max(-limit, min(limit, one.s[slot][frame] - one.s[0][frame]))
            total += max(0, min(centre + length, limit) - max(centre - length, -limit))
            number += 1
        occupancy.append(np.float32(total) * np.float32(1.0 / (2 * limit)))
        count.append(number)
    return {
        "left_occupancy": np.array(occupancy, np.float32),
        "left_count": np.array(count, np.uint8),
    }


def _friction(one: One, speed: F32) -> F32:
    """Peak friction on the mean film of the ego's lane; beside the road that of the nearest one."""
    c, given, k = model_constants(), visibility_inputs(one.run), one.number
    lane = np.array(one.lane[0])
    nearest = np.where(lane == 255, 0, np.minimum(lane, one.num_lanes - 1))
    film = given["film"].reshape(-1, 8)[k, nearest]
    return friction_at_film(
        c, friction_at_speed(c, speed, given["tyre_wear"][[k]], given["has_truck_tyres"][[k]]), film
    )


def _sights(one: One, speed: F32) -> tuple[F32, F32]:
    """Distances at which a lit and an unlit vehicle are seen [m]."""
    given, k = visibility_inputs(one.run), one.number
    rain = given["rain"][k] * (np.float32(1.0) + speed / model_constants().rain_speed)
    air = given["fog"][k] + rain
    unlit = minimum(
        given["contrast_depth"][k] / maximum(air, MIN_EXTINCTION), given["unlit_limit"][k]
    )
    threshold = weather_effects(one.run.scenario).sight["lamp_threshold"][[k]]
    lamp = lamp_range(air, constant("weather.lamps.rear_position"), threshold)
    lit = minimum(maximum(lamp, unlit), constant("model.perception.range"))
    shown = as_f32(np.array([_shown(one, s * 1e-3) for s in one.s[0]]))
    return minimum(lit, shown), minimum(unlit, shown)


def _shown(one: One, s: float) -> float:
    """How far the road lets one see along it from a station [m]."""
    table = one.road.course.sight if one.road.course else ()
    if not table:
        return math.inf
    for (begin, near), (end, far) in itertools.pairwise(table):
        if begin <= s < end:
            return (far - near) / (end - begin) * (s - begin) + near
    return table[0][1] if s < table[0][0] else table[-1][1]


def target_signals(one: One, seen: dict[str, Row], target: int) -> dict[str, Row]:
    """A vehicle by the names of `TargetSignals`; any value where it is not recorded, (time,)."""
    way = np.array(one.s[0]) - np.array(one.s[target])
    lead = as_f32(way.astype(np.int32)) * METRES
    gap = np.abs(lead) - one.halves(target)
    valid = np.array(one.recorded[target], np.bool_)
    across, reach = one.across(target)
    own_reach = (seen["left_edge"] - seen["right_edge"]) * HALF
    return {
        "valid": valid,
        "ego_lead": lead,
        "overlaps": valid & (gap < 0),
        "gap": gap,
        "lateral_position": across,
        "lateral_gap": np.abs(across - seen["lateral_position"]) - (own_reach + reach),
        "lane": one.state("lane")[target],
        "speed": one.metres("speed", target),
        "accel": one.metres("accel_lon", target),
        "lateral_speed": one.lateral_speed(target),
    }


def encounter(one: One, met: list[tuple[int, int]], *, ahead: bool) -> dict[str, Row]:
    """What the gap between the ego and a neighbour means for whoever is behind.

    Args:
        one: The simulation.
        met: Frames, and the slot of the neighbour in each.
        ahead: Whether the neighbours are ahead of the ego.

    Returns:
        Arrays by the names of `Encounter`, shape (instant,).
    """
    gap = np.array([one.gap(slot, t) for t, slot in met], np.float32)
    closing = np.array([one.closing(slot, t, ahead=ahead) for t, slot in met], np.float32)
    speed = as_f32(np.array([one.speed[0][t] for t, _ in met], np.int32)) * METRES
    accels = one.state("accel_lon")
    own = as_f32(np.array([accels[0, t] for t, _ in met], np.int16)) * METRES
    other = as_f32(np.array([accels[slot, t] for t, slot in met], np.int16)) * METRES
    return {
        "gap": gap,
        "closing_speed": closing,
        "time_gap": time_gap(gap, speed if ahead else speed + closing),
        "ttc": ttc(gap, closing),
        "mttc": mttc(gap, closing, own - other if ahead else other - own),
        "drac": drac(gap, closing),
    }
