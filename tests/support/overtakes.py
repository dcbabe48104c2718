"""Overtakes written by hand, for and against each rule of law."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
from tests.support.cases import LEFT, RIGHT, Track, case, ramp, two_way_road

from overtaking.model.known_roads import known_road
from overtaking.model.road import Road, RoadMark
from overtaking.model.road_course import RoadCourse, SpeedLimitSpan

if TYPE_CHECKING:
    from overtaking.model.verdicts import Case

FRAMES = 420
OUT_AND_BACK = ramp((3, 0), (6, 1), (14.5, 1), (17.5, 0), frames=FRAMES)
"""Crosses the line in frame 76, passes in 241 to 258, is back in frame 335."""

SIGNALS = np.zeros(FRAMES, np.int64)
SIGNALS[30:110], SIGNALS[260:350] = LEFT, RIGHT

CROSSED = {"attempt": 60, "line_crossed": 100}
BACK = CROSSED | {"overlap_begin": 110, "overlap_end": 120, "return_begin": 130, "return_end": 150}
BESIDE = {"attempt": 60, "overlap_begin": 92, "overlap_end": 109}
"""The frames in which 30 m/s pass 20 m/s from 50 m behind."""


def overtake(*others: Track, ego: dict[str, Any] | None = None, **given: Any) -> Case:
    """A lawful overtake at 30 m/s of a car at 20 m/s, with whatever differs."""
    target = {"s": 124.4, "speed": 20.0} | given.pop("target", {})
    own = {"speed": 30.0, "lane": OUT_AND_BACK, "lights": SIGNALS} | (ego or {})
    return case(Track(**own), Track(**target), *others, frames=FRAMES, **given)


def passing(lane: float, *others: Track, **given: Any) -> Case:
    """Past a slower target in lane 0 or another, in a lane of one's own."""
    ego = {"speed": 30.0, "lane": lane} | given.pop("ego", {})
    target = {"s": 50.0, "speed": 20.0} | given.pop("target", {})
    events = given.pop("events", BESIDE)
    return case(Track(**ego), Track(**target), *others, events=events, **given)


def crossing(*others: Track, **given: Any) -> Case:
    """At 30 m/s over the line in frame 100, the target far ahead; others as told."""
    ego = Track(**({"speed": 30.0} | given.pop("ego", {})))
    target = Track(**({"s": 400.0, "speed": 28.0} | given.pop("target", {})))
    return case(ego, target, *others, events=given.pop("events", CROSSED), **given)


def queue(num: int) -> list[Track]:
    """Vehicles at walking pace around the ego."""
    return [Track(s=20.0 + 12.0 * k, lane=2, speed=2.0) for k in range(num)]


def alone(**given: Any) -> Case:
    """Nobody to overtake."""
    events = {"target_slot": 255} | given.pop("events", {})
    ego = {"speed": 30.0} | given.pop("ego", {})
    return case(Track(**ego), events=events, **given)


def limited(*stretches: tuple[float, float, float], road: Road | None = None) -> Road:
    """The motorway for 120 km/h, or another road, with lower limits from one station to another.

    Args:
        stretches: Where each begins and ends [m], and its limit [km/h]; along the road alone.
        road: Another road.
    """
    lower = tuple(
        SpeedLimitSpan(start=start, stop=stop, speed=kmh / 3.6, direction=1)
        for start, stop, kmh in stretches
    )
    return dataclasses.replace(
        road or known_road("motorway"), course=RoadCourse(speed_limit_spans=lower)
    )


def lower_for_oncoming(speed: float) -> Road:
    """A two-way road for 90 km/h with a lower limit for those who come against it [m/s]."""
    road = two_way_road()
    lower = SpeedLimitSpan(start=0.0, stop=road.length, speed=speed, direction=-1)
    return dataclasses.replace(road, course=RoadCourse(speed_limit_spans=(lower,)))


def mixed_road(near: RoadMark) -> Road:
    """Two lanes, the line between them as seen from the slower one."""
    road = known_road("motorway")
    slow, fast = road.lanes[:2]
    lanes = (
        dataclasses.replace(slow, left_mark=near),
        dataclasses.replace(fast, right_mark=near.reverse, left_mark=RoadMark.SOLID),
    )
    return dataclasses.replace(road, lanes=lanes)


def against(gap: float, **given: Any) -> Case:
    """Back at frame 150 on a two-way road, a vehicle at 20 m/s so far ahead then."""
    meeting = 150 * 0.05 * (20.0 + 20.0)
    oncoming = Track(s=meeting + gap + 4.4, lane=1, speed=20.0, oncoming=True)
    given = {"road": two_way_road(), "events": BACK} | given
    return case(Track(speed=20.0), Track(s=-60.0, speed=15.0), oncoming, **given)


def closing_and_opening() -> Case:
    """At 30 m/s, a gap that shrinks to 26.61 m at 0.4 m/s, and grows again."""
    frames = 600
    leader_speed = np.where(np.arange(frames) < 300, 29.6, 30.4)
    leader = Track(s=4.4 + 26.61 + 0.4 * 15.0, speed=leader_speed)
    return case(Track(speed=30.0), leader, frames=frames, events={})


def rural(*others: Track, **given: Any) -> Case:
    """The lawful overtake on a two-way road for 110 km/h, past a car at 20 m/s."""
    given = {"road": two_way_road()} | given
    return overtake(*others, **given)


def meeting(gap: float, **given: Any) -> Track:
    """A vehicle at 20 m/s that would be `gap` ahead of the ego when that is back on its side.

    The ego crosses the line in frame 76, at 30 m/s, and is back in frame 335 of `overtake`.
    """
    s = 4.4 + 30.0 * 335 * 0.05 + 20.0 * 335 * 0.05 + gap
    return Track(**({"s": s, "lane": 1, "speed": 20.0, "oncoming": True} | given))


def along_course(course: RoadCourse, **given: Any) -> Case:
    """The overtake on a two-way road along which something changes."""
    road = dataclasses.replace(two_way_road(), course=course)
    return rural(road=road, **given)


def oncoming_target(lane: float, **given: Any) -> Case:
    """About to overtake on a two-way road a vehicle that is `lane` lanes to the left."""
    given = {"road": two_way_road()} | given
    return crossing(target={"s": 60.0, "lane": lane}, **given)


STAYS = ramp((3, 0), (6, 1), frames=FRAMES)
"""Goes to the left lane and stays there."""
