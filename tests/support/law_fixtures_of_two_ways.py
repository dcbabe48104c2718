"""What each rule of law should say on roads with oncoming traffic."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
from tests.support.cases import Track, case, ramp, two_way_road
from tests.support.overtakes import (
    CROSSED,
    FRAMES,
    along_course,
    crossing,
    meeting,
    overtake,
    rural,
)

from overtaking.model.known_roads import known_road
from overtaking.model.road import RoadMark
from overtaking.model.road_course import (
    CentreLineSpan,
    RoadCourse,
    RoadZone,
    SpeedLimitSpan,
    ZoneKind,
)
from overtaking.model.verdicts import Verdict

if TYPE_CHECKING:
    from overtaking.model.road import Road
    from overtaking.model.verdicts import Case

LEGAL, BREACH = Verdict.LEGAL, Verdict.ILLEGAL
APART, UNKNOWN = Verdict.NOT_APPLICABLE, Verdict.UNDECIDABLE


def lined(*stretches: tuple[float, float, RoadMark]) -> Case:
    """The overtake from 114 to 502 m, along a broken line with other stretches."""
    lines = tuple(
        CentreLineSpan(start=start, stop=stop, mark=mark) for start, stop, mark in stretches
    )
    return along_course(RoadCourse(centre_line_spans=lines))


def place(kind: ZoneKind, start: float, stop: float, direction: int = 0, **given: Any) -> Case:
    """The overtake along a road with a place."""
    one = RoadZone(kind=kind, start=start, stop=stop, direction=direction)
    return along_course(RoadCourse(zones=(one,)), **given)


def lower(start: float, stop: float, direction: int) -> SpeedLimitSpan:
    """A stretch with a limit of 54 km/h for one direction."""
    return SpeedLimitSpan(start=start, stop=stop, speed=15.0, direction=direction)


def on_motorway(kind: ZoneKind) -> Road:
    """Three lanes in one direction with a place from 300 to 350 m."""
    course = RoadCourse(zones=(RoadZone(kind=kind, start=300.0, stop=350.0),))
    return dataclasses.replace(known_road("motorway"), course=course)


def coming(**given: Any) -> Case:
    """The overtake against a vehicle that is 60 m away when the ego is back."""
    return rural(meeting(60.0, **given))


def slow_truck(s: float, **given: Any) -> Case:
    """A truck at 36 km/h behind a car."""
    ego = {"kind": "T", "speed": 10.0} | given.pop("ego", {})
    given = {"road": two_way_road(), "events": {}} | given
    return case(Track(**ego), Track(s=s, speed=10.0), **given)


def braking(start: int, stop: int, by: float = 3.0) -> np.ndarray:
    """Acceleration of who brakes in some frames."""
    frame = np.arange(FRAMES)
    return np.where((frame >= start) & (frame < stop), -by, 0.0)


EVADES = ramp((11, 1), (12, 1.3), (17, 1.3), (18, 1), frames=FRAMES)
"""Moves right by 1 m before the ego is back."""

OF_TWO_WAYS: list[tuple[str, Verdict, str, Any]] = [
    ("L2", LEGAL, "back before the line is solid", lambda: lined((520, 600, RoadMark.SOLID))),
    ("L2", BREACH, "not back where the line is solid", lambda: lined((450, 600, RoadMark.SOLID))),
    (
        "L2",
        BREACH,
        "out over a line that is solid on this side",
        lambda: lined((0, 200, RoadMark.SOLID_BROKEN)),
    ),
    (
        "L2",
        LEGAL,
        "out and back over a line that is solid for the others alone",
        lambda: lined((0, 510, RoadMark.BROKEN_SOLID), (510, 600, RoadMark.SOLID)),
    ),
    (
        "L15",
        LEGAL,
        "two ways, a straight road",
        lambda: along_course(RoadCourse(sight=((0.0, 800.0),))),
    ),
    (
        "L15",
        BREACH,
        "two ways, too long on the left",
        lambda: along_course(RoadCourse(sight=((0.0, 700.0),))),
    ),
    (
        "L15",
        BREACH,
        "less than 50 m of the road in sight",
        lambda: along_course(
            RoadCourse(sight=((0.0, 1000.0), (300.0, 1000.0), (320.0, 40.0))),
        ),
    ),
    (
        "L15",
        LEGAL,
        "two ways, as long, where those who come may drive 54 km/h",
        lambda: along_course(
            RoadCourse(sight=((0.0, 700.0),), speed_limit_spans=(lower(0.0, 900.0, -1),))
        ),
    ),
    (
        "L15",
        LEGAL,
        "two ways, as long, where they may drive 54 km/h as far as one sees",
        lambda: along_course(
            RoadCourse(sight=((0.0, 700.0),), speed_limit_spans=(lower(0.0, 820.0, -1),))
        ),
    ),
    (
        "L15",
        BREACH,
        "two ways, as long, and they may drive 90 km/h where the sight ends",
        lambda: along_course(
            RoadCourse(sight=((0.0, 700.0),), speed_limit_spans=(lower(0.0, 805.0, -1),))
        ),
    ),
    (
        "L15",
        BREACH,
        "two ways, as long, where 54 km/h are posted for the ego alone",
        lambda: along_course(
            RoadCourse(sight=((0.0, 700.0),), speed_limit_spans=(lower(0.0, 900.0, 1),))
        ),
    ),
    ("L17", LEGAL, "back before a crest", lambda: place(ZoneKind.CREST, 600.0, 700.0)),
    ("L17", BREACH, "over a crest", lambda: place(ZoneKind.CREST, 300.0, 350.0)),
    ("L17", BREACH, "into a bend", lambda: place(ZoneKind.BEND, 450.0, 700.0)),
    ("L17", BREACH, "over a narrow bridge", lambda: place(ZoneKind.NARROW, 300.0, 350.0)),
    ("L17", LEGAL, "60 m before a junction", lambda: place(ZoneKind.JUNCTION, 566.0, 580.0)),
    ("L17", BREACH, "40 m before a junction", lambda: place(ZoneKind.JUNCTION, 544.0, 580.0)),
    (
        "L17",
        LEGAL,
        "over a crest that is one for the others",
        lambda: place(ZoneKind.CREST, 300.0, 350.0, -1),
    ),
    (
        "L17",
        LEGAL,
        "over a crest on lanes of one direction",
        lambda: overtake(road=two_lanes_each_way(ZoneKind.CREST)),
    ),
    (
        "L17",
        BREACH,
        "over a crossing for pedestrians on lanes of one direction",
        lambda: overtake(road=on_motorway(ZoneKind.PEDESTRIAN_CROSSING)),
    ),
    ("L25", LEGAL, "oncoming traffic far off", coming),
    ("L25", BREACH, "oncoming traffic near", lambda: rural(meeting(35.0))),
    (
        "L25",
        BREACH,
        "oncoming traffic that slows down",
        lambda: rural(meeting(35.0, speed=ramp((10, 20.0), (14, 10.0), frames=FRAMES))),
    ),
    ("L25", APART, "no oncoming vehicle", rural),
    ("L25", APART, "lanes of one direction", overtake),
    ("L26", LEGAL, "oncoming traffic drives on", coming),
    ("L26", LEGAL, "who comes brakes far off", lambda: coming(accel=braking(76, 100))),
    ("L26", BREACH, "who comes brakes hard", lambda: coming(accel=braking(250, 260))),
    ("L26", BREACH, "who comes leaves the lane", lambda: coming(lane=EVADES)),
    ("L26", APART, "no oncoming vehicle", rural),
    ("L26", APART, "lanes of one direction", overtake),
    ("L27", LEGAL, "a gap of 60 m", lambda: rural(Track(s=124.4 + 64.4, speed=20.0))),
    ("L27", BREACH, "a gap of 30 m", lambda: rural(Track(s=143.8, speed=24.0))),
    ("L27", APART, "nobody ahead of the target", rural),
    ("L27", APART, "lanes of one direction", overtake),
    (
        "L27",
        UNKNOWN,
        "nothing is known of the weather",
        lambda: rural(Track(s=124.4 + 64.4, speed=20.0), unknown=("weather",)),
    ),
    ("L28", LEGAL, "a slow truck 54 m behind", lambda: slow_truck(60.0)),
    ("L28", BREACH, "a slow truck 34 m behind", lambda: slow_truck(40.0)),
    ("L28", APART, "a truck at 54 km/h", lambda: slow_truck(40.0, ego={"speed": 15.0})),
    ("L28", APART, "a slow car", lambda: slow_truck(40.0, ego={"kind": "M"})),
    ("L28", APART, "about to overtake", lambda: slow_truck(40.0, events=CROSSED)),
    ("L28", APART, "lanes of one direction", lambda: slow_truck(40.0, road=known_road("motorway"))),
    (
        "L28",
        UNKNOWN,
        "nothing is known of the kinds",
        lambda: slow_truck(40.0, unknown=("kinds",)),
    ),
    ("L29", LEGAL, "back before the sign", lambda: place(ZoneKind.NO_OVERTAKING, 600.0, 700.0)),
    ("L29", BREACH, "behind a sign", lambda: place(ZoneKind.NO_OVERTAKING, 300.0, 350.0)),
    (
        "L29",
        BREACH,
        "a truck behind a sign for trucks",
        lambda: place(ZoneKind.NO_OVERTAKING_HEAVY, 300.0, 350.0, ego={"kind": "T"}),
    ),
    (
        "L29",
        APART,
        "a car behind a sign for trucks",
        lambda: place(ZoneKind.NO_OVERTAKING_HEAVY, 300.0, 350.0),
    ),
    (
        "L29",
        APART,
        "past a motorcycle",
        lambda: place(ZoneKind.NO_OVERTAKING, 300.0, 350.0, target={"kind": "MC"}),
    ),
    ("L29", APART, "no line is crossed", lambda: crossing(events={"attempt": 60}, road=SIGNED)),
    ("L29", APART, "no sign", rural),
    (
        "L29",
        UNKNOWN,
        "nothing is known of signs",
        lambda: place(ZoneKind.NO_OVERTAKING, 300.0, 350.0, unknown=("speed_limit",)),
    ),
]
"""Rule, verdict, what happens, and what makes the case."""


def two_lanes_each_way(kind: ZoneKind) -> Road:
    """Three lanes in this direction, oncoming traffic beyond, and a place from 300 to 350 m."""
    road = on_motorway(kind)
    return dataclasses.replace(
        road, overtaking_side_neighbour=two_way_road().overtaking_side_neighbour
    )


SIGNED = dataclasses.replace(
    two_way_road(),
    course=RoadCourse(zones=(RoadZone(kind=ZoneKind.NO_OVERTAKING, start=0.0, stop=900.0),)),
)
