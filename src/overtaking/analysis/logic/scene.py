"""Facts about a recording: its road, its vehicles, who was where and when."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.logic.rounding import down, nearest, up
from overtaking.analysis.logic.runs import changes, runs
from overtaking.analysis.logic.vocabulary import EVENTS, MARK, ROAD, SIDES, UNKNOWN
from overtaking.core.elementary import Mask, as_f32
from overtaking.labels.law.frames import is_two_way
from overtaking.labels.law.others import back_indicator, out_indicator
from overtaking.model.events import NEVER
from overtaking.model.road import DrivingSide, RoadMark
from overtaking.model.signals import Around
from overtaking.model.trajectory import NO_VEHICLE
from overtaking.model.vehicles import Role

if TYPE_CHECKING:
    from overtaking.model.labels import Case
    from overtaking.model.road import Lane, Road

I64 = NDArray[np.int64]
Columns = tuple[NDArray[np.integer], ...]
"""The arguments of the facts of one predicate; constants as their codes."""

REACH_MM = 200_000
"""Positions of vehicles farther from the ego than this are not written [mm]."""


def road_facts(road: Road, unknown: frozenset[str], interval_ms: int) -> dict[str, Columns]:
    """What holds for every simulation of a data set."""
    n = road.num_lanes
    borders = np.array([road.side * d for d in road.boundaries])
    kind = road.kind if road.kind in ROAD.names else "other"
    facts: dict[str, Columns] = {
        "interval": _row(interval_ms),
        "road": _row(ROAD.names.index(kind)),
        "lanes": _row(n),
        "oncoming": (np.full(int(is_two_way(road)), n),),
        "border": (np.arange(n + 1), nearest(borders)),
        "lane_width": _widths(road),
        "mark": _marks(road),
        "unknown": (np.array(sorted(UNKNOWN.names.index(one) for one in unknown), np.int64),),
        "posted_limit": (nearest(np.array([road.speed_limit])),),
    }
    hidden = {"posted_limit": "speed_limit", "mark": "marks", "road": "road_kind"}
    return {name: rows for name, rows in facts.items() if hidden.get(name) not in unknown}


def _row(*values: int) -> Columns:
    return tuple(np.array([value]) for value in values)


def _widths(road: Road) -> Columns:
    lanes = list(road.lanes)
    beyond = road.fast_side_neighbour
    if beyond is not None and beyond.kind == "driving":
        lanes.append(beyond)
    widths = np.array([lane.width for lane in lanes], np.float32)
    return np.arange(len(lanes)), down(widths)


def _marks(road: Road) -> Columns:
    """The lines, from either side, in the order of the borders."""
    found: list[tuple[int, int, RoadMark]] = []
    for lane, one in enumerate(road.lanes):
        slow, fast = _slow_and_fast(road, one)
        found.append((lane, SIDES.index("left"), slow))
        found.append((lane + 1, SIDES.index("right"), fast))
    border, side, marks = zip(*sorted(found, key=lambda each: each[:2]), strict=True)
    codes = [MARK.names.index(mark.name.lower()) for mark in marks]
    return np.array(border), np.array(side), np.array(codes)


def _slow_and_fast(road: Road, lane: Lane) -> tuple[RoadMark, RoadMark]:
    if road.driving_side is DrivingSide.RIGHT:
        return lane.right_mark, lane.left_mark
    return lane.left_mark, lane.right_mark


def cast_facts(case: Case, numbers: I64) -> dict[str, Columns]:
    """Simulations, their weather, and their vehicles."""
    trajectories, weather = case.trajectories, case.trajectories.scenario.weather
    bodies = trajectories.scenario.vehicles
    row, slot = np.nonzero(bodies.valid)
    zero = np.zeros(len(numbers), np.int64)
    facts: dict[str, Columns] = {
        "simulation": (numbers,),
        "ego": (numbers, zero + int(Role.EGO)),
        "vehicle": (
            numbers[row],
            slot,
            bodies.kind[row, slot],
            up(bodies.length[row, slot]),
            up(bodies.width[row, slot]),
        ),
    }
    if "weather" not in trajectories.unknown:
        facts["night"] = (numbers[weather.night],)
        for name in ("rain", "fog", "wind"):
            facts[name] = (numbers, np.rint(getattr(weather, name)).astype(np.int64))
    return facts


def course_facts(case: Case, numbers: I64) -> dict[str, Columns]:
    """Who was in which lane, beside whom, and indicated, from which frame to which."""
    trajectories, states = case.trajectories, case.trajectories.states
    valid = trajectories.state_valid
    facts: dict[str, Columns] = {}
    row, slot, _, first, last = runs(np.zeros_like(states.lane), valid)
    facts["present"] = (numbers[row], slot, first, last)
    # As signed numbers, so that what is beyond the slow edge, 255, is lane -1.
    row, slot, lane, first, last = runs(states.lane.view(np.int8), valid)
    facts["lane"] = (numbers[row], slot, lane, first, last)
    if "indicators" not in trajectories.unknown:
        facts["indicator"] = _indicators(case, numbers, valid)
    seen = case.signals
    there = seen.valid[:, None, :] & (seen.vehicle != NO_VEHICLE)
    row, place, vehicle, first, last = runs(seen.vehicle, there)
    facts["neighbour"] = (numbers[row], place, vehicle, first, last)
    return facts


def _indicators(case: Case, numbers: I64, valid: Mask) -> Columns:
    parts: list[Columns] = []
    bits = (back_indicator(case), out_indicator(case))
    for side, bit in enumerate(bits):
        on = valid & ((case.trajectories.states.lights & np.uint8(bit)) != 0)
        row, slot, _, first, last = runs(np.zeros(on.shape, np.uint8), on)
        parts.append((numbers[row], slot, np.full(len(row), side), first, last))
    return tuple(np.concatenate(each) for each in zip(*parts, strict=True))


def event_facts(case: Case, numbers: I64) -> dict[str, Columns]:
    """What happened when."""
    events = case.events
    frames = np.stack([getattr(events, name) for name in EVENTS], axis=1)
    row, event = np.nonzero(frames != NEVER)
    has_target = events.target != NO_VEHICLE
    return {
        "event": (numbers[row], event, frames[row, event]),
        "target": (numbers[has_target], events.target[has_target]),
        "original_lane": (numbers, events.original_lane.astype(np.uint8).view(np.int8)),
        "contact": _contacts(case, numbers),
    }


def _contacts(case: Case, numbers: I64) -> Columns:
    contacts, last = case.trajectories.contacts, case.trajectories.num_frames - 1
    row, slot = np.nonzero(contacts.partner != NO_VEHICLE)
    interval = case.signals.frame_interval_ms
    frame = -(-contacts.time[row, slot] // interval)
    return numbers[row], slot, contacts.partner[row, slot], np.minimum(frame, last[row])


def motion_facts(case: Case, numbers: I64, every: int) -> dict[str, Columns]:
    """Positions and speeds of all near the ego, in some frames.

    Args:
        case: The recordings.
        numbers: Their numbers.
        every: Every how many frames; those in which something changes are written too.
    """
    states, near = case.trajectories.states, near_ego(case)
    written = written_frames(case, near, every)
    row, frame = np.nonzero(written)
    follows = row[1:] == row[:-1]
    there = near & written[:, None, :]
    sim, slot, when = np.nonzero(there)
    place = (sim, slot, when)
    return {
        "frame": (numbers[row], frame),
        "next": (numbers[row[1:][follows]], frame[:-1][follows], frame[1:][follows]),
        "position": (numbers[sim], slot, when, states.s[place]),
        "speed": (numbers[sim], slot, when, states.speed[place]),
    }


def near_ego(case: Case) -> Mask:
    """Who is within reach of the ego, shape (simulation, vehicle, time)."""
    s = case.trajectories.states.s
    return case.trajectories.state_valid & (np.abs(s - s[:, [Role.EGO]]) <= REACH_MM)


def written_frames(case: Case, near: Mask, every: int) -> Mask:
    """One frame in so many, the last, and all in which lanes, order or events change."""
    states, valid = case.trajectories.states, case.signals.valid
    frame = np.arange(valid.shape[1])
    written = (frame % every == 0) | (frame == case.events.last[:, None])
    if every > 1:
        written = written | changes(states.lane, near).any(axis=1) | _reordered(case, near)
        for name in EVENTS:
            happened = getattr(case.events, name)
            written |= (frame == happened[:, None]) & (happened != NEVER)[:, None]
        sims, _, _, when = _contacts(case, np.arange(len(valid)))
        written[sims, when] = True
    return written & valid


def _reordered(case: Case, near: Mask) -> Mask:
    """Frames in which one of two vehicles comes to be ahead of, beside or behind the other."""
    s, bodies = case.trajectories.states.s, case.trajectories.scenario.vehicles
    length = up(bodies.length).astype(np.int32)
    found = np.zeros((s.shape[0], s.shape[2]), np.bool_)
    for a in range(s.shape[1]):
        for b in range(a):
            apart = np.int32(2) * (s[:, a] - s[:, b])
            lengths = (length[:, a] + length[:, b])[:, None]
            order = (apart >= lengths).astype(np.int8) - (apart <= -lengths)
            found |= changes(order, near[:, a] & near[:, b])
    return found


def speeds_of(integers: NDArray[np.integer]) -> NDArray[np.float32]:
    """Recorded speeds as the signals have them [m/s]."""
    return as_f32(integers) * np.float32(1e-3)


PLACES_AHEAD = (Around.LEADER, Around.LEFT_LEADER, Around.RIGHT_LEADER)
"""The places in which a neighbour is ahead of the ego."""
