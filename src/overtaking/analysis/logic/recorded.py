"""The columns of every fact, measured in recordings."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.logic import vocabulary as words
from overtaking.analysis.logic.integers import beside, changes, down, nearest, runs, up
from overtaking.labels.law.oncoming_traffic import distance_over_outer_edge
from overtaking.labels.law.safe_distance import decel_for_safe_distance, lawful_gap
from overtaking.labels.law.zones import target_left_edge
from overtaking.labels.snapshots import (
    indicator_to_kerb_side,
    indicator_to_overtaking_side,
    is_oncoming,
    other_vehicles_at,
)
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.overtake_events import NEVER
from overtaking.model.road import DrivingSide, RoadMark
from overtaking.model.road_course import MAX_LENGTH
from overtaking.model.trajectories import NO_VEHICLE, POSITION_RESOLUTION
from overtaking.model.vehicles import EGO_SLOT
from overtaking.world.sight_distance import all_zones_for
from overtaking.world.surrogate_safety import drac

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from overtaking.analysis.logic.source import Group
    from overtaking.core.arrays import F32, IndexArray, Mask
    from overtaking.model.road import Lane, Road
    from overtaking.model.trajectories import Trajectories

Columns = tuple[NDArray[np.integer], ...]
"""The arguments of the facts of one predicate; constants as their codes."""

REACH_MM = 200_000
"""Positions of vehicles farther than this from the ego are not written [mm]."""

ONCOMING_REACH_MM = 1_000_000
"""The same of vehicles that come against the road [mm]."""

_SLOW = 10_000
"""Vehicles below this speed are written as slow ones [mm/s]."""

_MOST_BRAKING = np.float32(words.BRAKING.high * 1e-3)
"""Forced braking where there is no room left to brake in [m/s^2]."""

_WEATHER = ("night", "rain", "fog", "wind")

_AHEAD = (NeighbourRole.LEADER, NeighbourRole.LEFT_LEADER, NeighbourRole.RIGHT_LEADER)
"""The neighbours that are ahead of the ego."""


def road_columns(recorded: Trajectories) -> dict[str, Columns]:
    """The facts about the road, by predicate; those that a recording does not tell are missing."""
    road, unknown = recorded.road, recorded.unknown
    n = road.num_lanes
    kind = road.kind if road.kind in words.ROAD.names else "other"
    facts: dict[str, Columns] = {
        "interval": (np.array([recorded.scenario.frame_interval_ms]),),
        "road": (np.array([words.ROAD.names.index(kind)]),),
        "lanes": (np.array([n]),),
        "oncoming": (np.full(int(road.is_two_way), n),),
        "border": (
            np.arange(n + 1),
            nearest(road.overtaking_sign * np.array(road.lane_boundaries)),
        ),
        "lane_width": _widths(road),
        "mark": _marks(road),
        "unknown": (np.array(sorted(map(words.UNKNOWN.names.index, unknown)), np.int64),),
        "line": _lines_along(road),
        "place": _places(road),
        "posted_limit": (nearest(np.array([road.speed_limit])),),
        "lower_limit": _lower_limits(road),
    }
    hidden = {
        "posted_limit": "speed_limit",
        "lower_limit": "speed_limit",
        "mark": "marks",
        "line": "marks",
        "road": "road_kind",
    }
    return {name: columns for name, columns in facts.items() if hidden.get(name) not in unknown}


def _widths(road: Road) -> Columns:
    lanes, beyond = list(road.lanes), road.overtaking_side_neighbour
    if beyond is not None and beyond.kind == "driving":
        lanes.append(beyond)
    return np.arange(len(lanes)), down(np.array([lane.width for lane in lanes], np.float32))


def _marks(road: Road) -> Columns:
    """The lines, from either side, in the order of the borders."""
    found: list[tuple[int, int, int]] = []
    for lane, one in enumerate(road.lanes):
        slow, fast = (words.MARK.names.index(mark.name.lower()) for mark in _lines(road, one))
        found.append((lane, words.SIDES.index("left"), slow))
        if lane + 1 < road.num_lanes or not _changes(road):
            found.append((lane + 1, words.SIDES.index("right"), fast))
    border, side, marks = zip(*sorted(found), strict=True)
    return np.array(border), np.array(side), np.array(marks)


def _changes(road: Road) -> bool:
    """Whether the line on the fast side of the fastest lane changes along the road."""
    return len(road.overtaking_edge_marks) > 1


def _lines_along(road: Road) -> Columns:
    """The stretches of that line, where it changes."""
    if not _changes(road):
        return _none(3)
    begins, marks = zip(*road.overtaking_edge_marks, strict=True)
    ends = np.clip([*begins, np.inf], -MAX_LENGTH, 2.0 * MAX_LENGTH)
    codes = [words.MARK.names.index(mark.name.lower()) for mark in marks]
    return nearest(ends[:-1]), nearest(ends[1:]), np.array(codes)


def _lower_limits(road: Road) -> Columns:
    limits = road.course.speed_limits_for(1) if road.course else ()
    table = np.array([(one.start, one.stop, one.speed) for one in limits]).reshape(-1, 3)
    return _first_behind(table[:, 0]), _first_behind(table[:, 1]), nearest(table[:, 2])


def _first_behind(stations: NDArray[np.float64]) -> NDArray[np.int64]:
    """The first recorded positions that are not before some stations [mm]."""
    first = np.ceil(stations / POSITION_RESOLUTION).astype(np.int64)
    # A quotient may be a whole number and the station not, or the other way round.
    first -= (first - 1) * POSITION_RESOLUTION >= stations
    return first + (first * POSITION_RESOLUTION < stations)


def _places(road: Road) -> Columns:
    places = all_zones_for(road, 1)
    codes = [words.PLACE_KIND.names.index(one.kind.name.lower()) for one in places]
    ends = np.array([(one.start, one.stop) for one in places]).reshape(-1, 2)
    return np.array(codes, np.int64), nearest(ends[:, 0]), nearest(ends[:, 1])


def _lines(road: Road, lane: Lane) -> tuple[RoadMark, RoadMark]:
    """The lines on the slow and on the fast side of a lane."""
    if road.driving_side is DrivingSide.RIGHT:
        return lane.right_mark, lane.left_mark
    return lane.left_mark, lane.right_mark


def group_columns(
    group: Group, names: Collection[str], *, every: int, neighbours: Collection[str]
) -> dict[str, Columns]:
    """The facts about a group of simulations, by predicate.

    Args:
        group: The simulations.
        names: Predicates of `vocabulary.RECORDED` and `vocabulary.MEASURED`.
        every: Positions are written every so many frames, and wherever something changes.
        neighbours: The neighbours of the ego that `spacing` and `forced_braking` are asked for.

    Returns:
        The columns of the arguments; those that a recording does not tell are missing.
    """
    hidden = {"indicator": "indicators"} | dict.fromkeys(_WEATHER, "weather")
    known = [name for name in names if hidden.get(name) not in group.case.trajectories.unknown]
    recorded = _Recorded(group, every, neighbours)
    return {name: getattr(recorded, name.replace("class", "class_"))() for name in known}


class _Recorded:
    """A method for each predicate, with its name: the columns of its arguments in order."""

    def __init__(self, group: Group, every: int, neighbours: Collection[str]) -> None:
        self._group, self._every, self._neighbours = group, every, neighbours
        self._case, self._numbers = group.case, group.numbers
        self._run, self._seen = group.case.trajectories, group.case.signals
        self._states = self._run.states

    def simulation(self) -> Columns:
        return (self._numbers,)

    def rain(self) -> Columns:
        return self._percent(self._run.scenario.weather.rain)

    def fog(self) -> Columns:
        return self._percent(self._run.scenario.weather.fog)

    def wind(self) -> Columns:
        return self._percent(self._run.scenario.weather.wind)

    def _percent(self, values: F32) -> Columns:
        return self._numbers, np.rint(values).astype(np.int64)

    def night(self) -> Columns:
        return (self._numbers[self._run.scenario.weather.night],)

    def class_(self) -> Columns:
        if self._group.classes is None:
            return _none(3)
        count, policies = self._group.classes.shape
        codes = np.tile(np.arange(policies), count)
        return np.repeat(self._numbers, policies), codes, self._group.classes.reshape(-1)

    def outcome(self) -> Columns:
        return _none(2) if self._group.outcome is None else (self._numbers, self._group.outcome)

    def ego(self) -> Columns:
        return self._numbers, np.full(len(self._numbers), EGO_SLOT)

    def vehicle(self) -> Columns:
        bodies = self._run.scenario.vehicles
        at = row, slot = np.nonzero(bodies.valid)
        return (
            self._numbers[row],
            slot,
            bodies.kind[at],
            up(bodies.length[at]),
            up(bodies.width[at]),
        )

    def kind_unknown(self) -> Columns:
        row, slot = np.nonzero(self._run.scenario.vehicles.valid & ~self._run.known_kinds)
        return self._numbers[row], slot

    def against(self) -> Columns:
        row, slot = np.nonzero(is_oncoming(self._run))
        return self._numbers[row], slot

    def present(self) -> Columns:
        row, slot, _, first, last = runs(np.zeros_like(self._states.lane), self._run.state_mask)
        return self._numbers[row], slot, first, last

    def lane(self) -> Columns:
        # As signed numbers, so that what is beyond the slow edge, 255, is lane -1.
        lanes = self._states.lane.view(np.int8)
        row, slot, lane, first, last = runs(lanes, self._run.state_mask)
        return self._numbers[row], slot, lane, first, last

    def indicator(self) -> Columns:
        parts: list[Columns] = []
        for side, bit in enumerate(
            (
                indicator_to_kerb_side(self._case.trajectories.road),
                indicator_to_overtaking_side(self._case.trajectories.road),
            )
        ):
            on = self._run.state_mask & ((self._states.lights & np.uint8(bit)) != 0)
            row, slot, _, first, last = runs(np.zeros(on.shape, np.uint8), on)
            parts.append((self._numbers[row], slot, np.full(len(row), side), first, last))
        return _joined(parts, 5)

    def neighbour(self) -> Columns:
        seen = self._seen
        there = seen.valid[:, None, :] & (seen.neighbour_slot != NO_VEHICLE)
        row, neighbour, vehicle, first, last = runs(seen.neighbour_slot, there)
        return self._numbers[row], neighbour, vehicle, first, last

    def contact(self) -> Columns:
        row, *others = self._contacts()
        return self._numbers[row], *others

    def _contacts(self) -> tuple[IndexArray, IndexArray, NDArray[np.integer], NDArray[np.integer]]:
        """Row, vehicle, partner and first frame of each contact."""
        contacts, last = self._run.contacts, self._run.num_frames - 1
        row, slot = np.nonzero(contacts.partner != NO_VEHICLE)
        frame = -(-contacts.time[row, slot] // self._seen.frame_interval_ms)
        return row, slot, contacts.partner[row, slot], np.minimum(frame, last[row])

    def event(self) -> Columns:
        frames = np.stack([getattr(self._case.events, name) for name in words.EVENTS], axis=1)
        row, event = np.nonzero(frames != NEVER)
        return self._numbers[row], event, frames[row, event]

    def target(self) -> Columns:
        target = self._case.events.target_slot
        return self._numbers[target != NO_VEHICLE], target[target != NO_VEHICLE]

    def original_lane(self) -> Columns:
        return self._numbers, self._case.events.original_lane.astype(np.uint8).view(np.int8)

    def frame(self) -> Columns:
        row, frame = np.nonzero(self._written)
        return self._numbers[row], frame

    def next(self) -> Columns:
        row, frame = np.nonzero(self._written)
        follows = row[1:] == row[:-1]
        return self._numbers[row[1:][follows]], frame[:-1][follows], frame[1:][follows]

    def position(self) -> Columns:
        return self._of_near(self._states.s)

    def speed(self) -> Columns:
        return self._of_near(self._states.speed)

    def _of_near(self, values: NDArray[np.integer]) -> Columns:
        """A quantity of the vehicles near the ego in the written frames."""
        at = row, slot, frame = np.nonzero(self._near & self._written[:, None, :])
        return self._numbers[row], slot, frame, values[at]

    @cached_property
    def _near(self) -> Mask:
        """Which vehicles are near the ego, shape (simulation, vehicle, time)."""
        s, reach = self._states.s, REACH_MM
        if self._run.road.is_two_way:
            reach = np.where(is_oncoming(self._run), ONCOMING_REACH_MM, REACH_MM)[:, :, None]
        return self._run.state_mask & (np.abs(s - s[:, [EGO_SLOT]]) <= reach)

    @cached_property
    def _written(self) -> Mask:
        """One frame in `every`, the last, and all in which lanes, order or events change."""
        events, valid = self._case.events, self._seen.valid
        frame = np.arange(valid.shape[1])
        written = (frame % self._every == 0) | (frame == events.last[:, None])
        if self._every > 1:
            written = written | changes(self._states.lane, self._near).any(axis=1)
            written |= self._reordered()
            for name in words.EVENTS:
                happened = getattr(events, name)[:, None]
                written |= (frame == happened) & (happened != NEVER)
            row, _, _, when = self._contacts()
            written[row, when] = True
        return written & valid

    def _reordered(self) -> Mask:
        """Frames in which one of two vehicles comes to be ahead of, beside or behind the other."""
        s, near = self._states.s, self._near
        length = up(self._run.scenario.vehicles.length).astype(np.int32)
        found = np.zeros((s.shape[0], s.shape[2]), np.bool_)
        for a in range(s.shape[1]):
            for b in range(a):
                apart = np.int32(2) * (s[:, a] - s[:, b])
                lengths = (length[:, a] + length[:, b])[:, None]
                order = (apart >= lengths).astype(np.int8) - (apart <= -lengths)
                found |= changes(order, near[:, a] & near[:, b])
        return found

    def ego_speed(self) -> Columns:
        row, frame = np.nonzero(self._seen.valid)
        return self._numbers[row], frame, self._states.speed[row, EGO_SLOT, frame]

    def reach(self) -> Columns:
        at = row, frame = np.nonzero(self._seen.valid)
        right, left = down(self._seen.right_edge[at]), up(self._seen.left_edge[at])
        return self._numbers[row], frame, right, left

    def spacing(self) -> Columns:
        neighbours = sorted(self._neighbours, key=words.PLACE.names.index)
        return _joined([self._spacing(words.PLACE.names.index(one)) for one in neighbours], 6)

    def _spacing(self, code: int) -> Columns:
        """Lawful gaps at one position; the follower, ego or neighbour, must keep the gap."""
        seen, target = self._seen, self._case.target
        is_target, is_ahead = code == len(NeighbourRole), code in _AHEAD
        cells = row, frame = self._frames_with_vehicle(code)
        here = (row, code, frame)
        gap = target.gap[cells] if is_target else seen.gap[here]
        if is_target:
            rear = target.speed[cells]
            closing = rear - seen.speed[cells]
        else:
            closing = seen.closing_speed[here]
            rear = seen.speed[cells] if is_ahead else seen.speed[cells] + closing
        lawful = lawful_gap(rear, closing, decel_for_safe_distance(seen.friction[cells]))
        other = target.slot[row] if is_target else seen.neighbour_slot[here]
        speed = self._states.speed
        own, others = speed[row, EGO_SLOT, frame], speed[row, other.astype(np.intp), frame]
        exact = own - others if is_ahead else others - own
        neighbour = np.full(len(row), code)
        return self._numbers[row], neighbour, frame, down(gap), exact, beside(lawful, gap)

    def _frames_with_vehicle(self, code: int) -> tuple[IndexArray, IndexArray]:
        """Simulations and frames with a vehicle at a position around the ego."""
        if code == len(NeighbourRole):
            row, frame = np.nonzero(self._case.target.valid)
        else:
            row, frame = np.nonzero(
                self._seen.valid & (self._seen.neighbour_slot[:, code] != NO_VEHICLE)
            )
        return row, frame

    def forced_braking(self) -> Columns:
        behind = [
            one
            for one in NeighbourRole
            if one not in _AHEAD and one.name.lower() in self._neighbours
        ]
        return _joined([self._forced(one) for one in behind], 4)

    def _forced(self, neighbour: NeighbourRole) -> Columns:
        row, frame = self._frames_with_vehicle(neighbour)
        closing = self._seen.closing_speed[row, neighbour, frame]
        closes = closing > 0
        row, frame, closing = row[closes], frame[closes], closing[closes]
        forced = np.minimum(drac(self._seen.gap[row, neighbour, frame], closing), _MOST_BRAKING)
        return self._numbers[row], np.full(len(row), int(neighbour)), frame, up(forced)

    def target_lead(self) -> Columns:
        row, slot, frame = self._at_target()
        s = self._states.s
        return self._numbers[row], frame, s[row, EGO_SLOT, frame] - s[row, slot, frame]

    def target_speed(self) -> Columns:
        row, slot, frame = self._at_target()
        return self._numbers[row], frame, self._states.speed[row, slot, frame]

    def _at_target(self) -> tuple[IndexArray, IndexArray, IndexArray]:
        row, frame = np.nonzero(self._case.target.valid)
        return row, self._case.target.slot[row].astype(np.intp), frame

    def ego_place(self) -> Columns:
        road = self._run.road
        if not (road.is_two_way or road.course):
            return _none(3)
        row, frame = np.nonzero(self._seen.valid)
        return self._numbers[row], frame, self._states.s[row, EGO_SLOT, frame]

    @cached_property
    def _coming(self) -> tuple[IndexArray, IndexArray, IndexArray, F32]:
        """Row, frame and slot of who comes towards the ego, and the gap between the two."""
        if not self._run.road.is_two_way:
            nothing = np.zeros(0, np.intp)
            return nothing, nothing, nothing, np.zeros(0, np.float32)
        row, frame = np.nonzero(self._seen.valid)
        others = other_vehicles_at(self._case.trajectories, frame.astype(np.int32), row)
        at = index, slot = np.nonzero(others.is_approaching)
        return row[index], frame[index], slot, others.gap[at]

    def oncomer(self) -> Columns:
        row, frame, slot, gap = self._coming
        return self._numbers[row], frame, slot, down(gap), self._states.speed[row, slot, frame]

    def oncomer_brakes(self) -> Columns:
        row, frame, slot, _ = self._coming
        braking = -self._states.accel_lon[row, slot, frame].astype(np.int64)
        brakes = braking > 0
        return self._numbers[row[brakes]], frame[brakes], slot[brakes], braking[brakes]

    def oncomer_leaves(self) -> Columns:
        row, frame, slot, _ = self._coming
        if not row.size:
            return _none(4)
        over = up(distance_over_outer_edge(self._case, row, frame, slot))
        leaves = over > 0
        return self._numbers[row[leaves]], frame[leaves], slot[leaves], over[leaves]

    def target_reach(self) -> Columns:
        events, target = self._case.events, self._case.target.slot
        row = np.flatnonzero((events.attempt != NEVER) & (target != NO_VEHICLE))
        return self._numbers[row], up(target_left_edge(self._case)[row])

    def slow_vehicle(self) -> Columns:
        s, speed = self._states.s, self._states.speed
        slow = self._run.state_mask & (speed < _SLOW)
        slow[:, EGO_SLOT] = False
        at = row, slot, frame = np.nonzero(slow)
        away = np.abs(s[at] - s[row, EGO_SLOT, frame])
        return self._numbers[row], frame, slot, speed[at], away


def _none(width: int) -> Columns:
    """Columns without a fact."""
    return (np.zeros(0, np.int64),) * width


def _joined(parts: Sequence[Columns], width: int) -> Columns:
    if not parts:
        return _none(width)
    return tuple(np.concatenate(each) for each in zip(*parts, strict=True))
