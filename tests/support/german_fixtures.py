"""What each German rule should say."""

from __future__ import annotations

from typing import Any

from tests.support.cases import FOG, HIGH, LEFT, LOW, NIGHT, Track, case, ramp, two_way_road
from tests.support.law_fixtures_of_two_ways import (
    EVADES,
    SIGNED,
    braking,
    coming,
    lined,
    lower,
    place,
    slow_truck,
)
from tests.support.overtakes import (
    BACK,
    BESIDE,
    CROSSED,
    STAYS,
    against,
    alone,
    along_course,
    crossing,
    limited,
    meeting,
    overtake,
    passing,
    queue,
    rural,
)
from tests.support.worlds import wide_road

from overtaking.model.road import RoadMark
from overtaking.model.road_course import RoadCourse, ZoneKind
from overtaking.model.verdicts import Verdict

LEGAL, BREACH = Verdict.LEGAL, Verdict.ILLEGAL
APART, UNKNOWN = Verdict.NOT_APPLICABLE, Verdict.UNDECIDABLE

DENSE = {"fog": 100.0, "rain": 100.0}
TRUCK = {"kind": "T", "speed": 20.0}


def behind(gap: float, speed: float = 30.0, **given: Any) -> Any:
    """A car, or another vehicle, that follows another at its own speed for 10 s."""
    ego = {"speed": speed} | given.pop("ego", {})
    length = 4.4 if ego.get("kind") != "T" else (4.4 + 8.0) / 2
    leader = Track(s=gap + length, speed=speed)
    return case(Track(**ego), leader, events={}, **given)


def truck(gap: float, **given: Any) -> Any:
    """A truck, or another vehicle, that follows a car at 72 km/h on a two-way road."""
    given = {"road": two_way_road(), "ego": TRUCK} | given
    return behind(gap, 20.0, **given)


FIXTURES: list[tuple[str, Verdict, str, Any]] = [
    ("A1", LEGAL, "46 m at 108 km/h", lambda: behind(46.0)),
    ("A1", BREACH, "44 m at 108 km/h", lambda: behind(44.0)),
    ("A1", APART, "nobody ahead", alone),
    ("A2", LEGAL, "28 m at 108 km/h", lambda: behind(28.0)),
    ("A2", BREACH, "26 m at 108 km/h for 7 s", lambda: behind(26.0)),
    (
        "A2",
        LEGAL,
        "26 m for 2 s before it grows",
        lambda: case(Track(speed=30.0), Track(s=24.0 + 4.4, speed=30.6), events={}),
    ),
    ("A2", APART, "10 m at 79 km/h", lambda: behind(10.0, 22.0)),
    ("A3", LEGAL, "a truck at 72 km/h, 51 m behind", lambda: behind(51.0, 20.0, ego=TRUCK)),
    ("A3", BREACH, "a truck at 72 km/h, 45 m behind", lambda: behind(45.0, 20.0, ego=TRUCK)),
    ("A3", APART, "a truck at 47 km/h", lambda: behind(30.0, 13.0, ego=TRUCK | {"speed": 13.0})),
    ("A3", APART, "a car", lambda: behind(30.0)),
    ("A3", UNKNOWN, "no kinds", lambda: behind(30.0, unknown=("kinds",))),
    ("A4", LEGAL, "a truck at 72 km/h, 66 m behind", lambda: truck(66.0)),
    ("A4", BREACH, "a truck at 72 km/h, 63 m behind", lambda: truck(63.0)),
    ("A4", APART, "a car", lambda: truck(63.0, ego={})),
    ("A4", APART, "about to overtake", lambda: slow_truck(40.0, events=CROSSED)),
    ("A4", APART, "lanes of one direction", lambda: truck(63.0, road=wide_road())),
    ("A4", APART, "where sign 276 holds", lambda: truck(63.0, road=SIGNED)),
    ("A4", UNKNOWN, "no kinds", lambda: truck(63.0, unknown=("kinds",))),
    ("O1", LEGAL, "past on the left", overtake),
    ("O1", LEGAL, "two lanes to the left", lambda: passing(2, events=BESIDE)),
    ("O1", BREACH, "past on the right", lambda: passing(0, target={"lane": 1})),
    (
        "O1",
        APART,
        "past a queue on the right",
        lambda: passing(
            0, *queue(3), ego={"speed": 8.0}, target={"lane": 1, "speed": 3.0, "s": 23.0}
        ),
    ),
    ("O2", LEGAL, "36 km/h faster", lambda: passing(1)),
    (
        "O2",
        BREACH,
        "7 km/h faster",
        lambda: passing(1, ego={"speed": 22.0}, target={"s": 9.4, "speed": 20.0}),
    ),
    ("O2", APART, "never alongside", crossing),
    ("O3", LEGAL, "the oncoming is far", lambda: against(80.0)),
    ("O3", BREACH, "the oncoming is near", lambda: against(20.0)),
    ("O3", APART, "a motorway", overtake),
    ("O4", LEGAL, "the target holds its lane", overtake),
    ("O4", BREACH, "the target signals left", lambda: crossing(target={"lights": LEFT})),
    ("O4", APART, "no attempt", lambda: crossing(events={})),
    ("O4", UNKNOWN, "no indicators", lambda: crossing(unknown=("indicators",))),
    ("O5", LEGAL, "a truck in clear air", lambda: crossing(ego={"kind": "T", "speed": 24.0})),
    (
        "O5",
        BREACH,
        "a truck in dense fog",
        lambda: crossing(ego={"kind": "T", "speed": 24.0}, weather=DENSE),
    ),
    ("O5", APART, "a car in dense fog", lambda: crossing(weather=DENSE)),
    ("O5", UNKNOWN, "no kinds", lambda: crossing(unknown=("kinds",))),
    ("O6", LEGAL, "a slower one behind", lambda: crossing(Track(s=-20.0, lane=1, speed=28.0))),
    ("O6", BREACH, "a fast one behind", lambda: crossing(Track(s=-70.0, lane=1, speed=40.0))),
    ("O6", APART, "nobody behind", crossing),
    ("O7", LEGAL, "a lane apart", overtake),
    ("O7", BREACH, "0.9 m apart", lambda: passing(2.7 / 3.75)),
    ("O7", APART, "past a bicycle", lambda: passing(1, target={"kind": "B"})),
    ("O7", UNKNOWN, "no kinds", lambda: overtake(unknown=("kinds",))),
    ("O8", LEGAL, "as one should", overtake),
    ("O8", BREACH, "no indicator", lambda: overtake(ego={"lights": 0})),
    ("O8", APART, "no attempt", alone),
    ("O8", UNKNOWN, "no indicators", lambda: overtake(unknown=("indicators",))),
    ("O9", LEGAL, "back before sign 276", lambda: place(ZoneKind.NO_OVERTAKING, 600.0, 700.0)),
    ("O9", BREACH, "behind sign 276", lambda: place(ZoneKind.NO_OVERTAKING, 300.0, 350.0)),
    (
        "O9",
        BREACH,
        "a truck behind sign 277",
        lambda: place(ZoneKind.NO_OVERTAKING_HEAVY, 300.0, 350.0, ego={"kind": "T"}),
    ),
    (
        "O9",
        APART,
        "a truck past a motorcycle behind sign 277",
        lambda: place(
            ZoneKind.NO_OVERTAKING_HEAVY,
            300.0,
            350.0,
            ego={"kind": "T"},
            target={"kind": "MC"},
        ),
    ),
    (
        "O9",
        APART,
        "past a motorcycle",
        lambda: place(ZoneKind.NO_OVERTAKING, 300.0, 350.0, target={"kind": "MC"}),
    ),
    ("O9", APART, "no line is crossed", lambda: crossing(events={"attempt": 60}, road=SIGNED)),
    ("O9", APART, "a road whose signs are known", overtake),
    ("O9", UNKNOWN, "no signs recorded", lambda: overtake(unknown=("speed_limit",))),
    (
        "O9",
        UNKNOWN,
        "no kinds",
        lambda: place(ZoneKind.NO_OVERTAKING, 300.0, 350.0, unknown=("kinds",)),
    ),
    ("O10", LEGAL, "2.5 m beside a bicycle", lambda: passing(1, target={"kind": "B"})),
    ("O10", BREACH, "1.8 m beside it", lambda: passing(3.0 / 3.75, target={"kind": "B"})),
    ("O10", APART, "past a car", lambda: passing(1)),
    ("O10", UNKNOWN, "no kinds", lambda: passing(1, unknown=("kinds",))),
    ("O11", LEGAL, "back at once", overtake),
    (
        "O11",
        BREACH,
        "stays on the left",
        lambda: overtake(
            ego={"lane": STAYS},
            target={"s": 60.0},
            events={"attempt": 60, "line_crossed": 76, "overlap_begin": 112, "overlap_end": 129},
        ),
    ),
    ("O11", APART, "not past the target", crossing),
    ("O11", UNKNOWN, "no weather", lambda: overtake(unknown=("weather",))),
    ("O12", LEGAL, "back far ahead", lambda: crossing(target={"s": -60.0}, events=BACK)),
    (
        "O12",
        BREACH,
        "back just ahead of a faster one",
        lambda: crossing(target={"s": -44.0, "speed": 35.0}, events=BACK),
    ),
    ("O12", APART, "never back", crossing),
    ("O13", LEGAL, "the target keeps its speed", lambda: passing(1)),
    ("O13", BREACH, "the target accelerates", lambda: passing(1, target={"accel": 0.6})),
    ("O13", APART, "never alongside", crossing),
    ("O14", LEGAL, "oncoming traffic far off", coming),
    ("O14", BREACH, "oncoming traffic near", lambda: rural(meeting(35.0))),
    ("O14", APART, "no oncoming vehicle", rural),
    ("O14", APART, "lanes of one direction", overtake),
    ("O15", LEGAL, "oncoming traffic drives on", coming),
    ("O15", BREACH, "who comes brakes hard", lambda: coming(accel=braking(250, 260))),
    ("O15", BREACH, "who comes leaves the lane", lambda: coming(lane=EVADES)),
    ("O15", APART, "no oncoming vehicle", rural),
    ("O16", LEGAL, "800 m in sight", lambda: along_course(RoadCourse(sight=((0.0, 800.0),)))),
    ("O16", BREACH, "700 m in sight", lambda: along_course(RoadCourse(sight=((0.0, 700.0),)))),
    (
        "O16",
        LEGAL,
        "700 m in sight, where those who come may drive 54 km/h",
        lambda: along_course(
            RoadCourse(sight=((0.0, 700.0),), speed_limit_spans=(lower(0.0, 900.0, -1),))
        ),
    ),
    ("O16", APART, "lanes of one direction", overtake),
    ("O16", UNKNOWN, "no weather", lambda: rural(unknown=("weather",))),
    (
        "O17",
        LEGAL,
        "60 m before a crossing of pedestrians",
        lambda: place(ZoneKind.PEDESTRIAN_CROSSING, 566.0, 570.0),
    ),
    (
        "O17",
        BREACH,
        "at a crossing of pedestrians",
        lambda: place(ZoneKind.PEDESTRIAN_CROSSING, 300.0, 304.0),
    ),
    (
        "O17",
        BREACH,
        "a bicycle at a crossing of pedestrians",
        lambda: place(ZoneKind.PEDESTRIAN_CROSSING, 300.0, 304.0, target={"kind": "B"}),
    ),
    (
        "O17",
        LEGAL,
        "250 m before a level crossing",
        lambda: place(ZoneKind.LEVEL_CROSSING, 760.0, 770.0),
    ),
    (
        "O17",
        BREACH,
        "200 m before a level crossing",
        lambda: place(ZoneKind.LEVEL_CROSSING, 700.0, 710.0),
    ),
    (
        "O17",
        APART,
        "a bicycle before a level crossing",
        lambda: place(ZoneKind.LEVEL_CROSSING, 700.0, 710.0, target={"kind": "B"}),
    ),
    ("O17", APART, "no crossing", overtake),
    (
        "O17",
        UNKNOWN,
        "no kinds",
        lambda: place(ZoneKind.LEVEL_CROSSING, 700.0, 710.0, unknown=("kinds",)),
    ),
    ("V1", LEGAL, "in clear air", overtake),
    ("V1", BREACH, "at 108 km/h in dense fog", lambda: overtake(weather=DENSE)),
    ("V1", APART, "nothing was driven", lambda: alone(events={"collision": 0})),
    ("V1", UNKNOWN, "no weather", lambda: overtake(unknown=("weather",))),
    ("V1s", LEGAL, "by day", overtake),
    ("V1s", BREACH, "at 108 km/h by night", lambda: overtake(weather=NIGHT)),
    ("V1s", APART, "nothing was driven", lambda: alone(events={"collision": 0})),
    ("V1s", UNKNOWN, "no lamps", lambda: overtake(unknown=("lamps",))),
    ("V2", LEGAL, "a car at 108 km/h where 120 is posted", alone),
    ("V2", LEGAL, "a van at 115 km/h", lambda: alone(ego={"kind": "V", "speed": 32.0})),
    ("V2", BREACH, "a truck at 82 km/h", lambda: alone(ego={"kind": "T", "speed": 22.8})),
    ("V2", BREACH, "a car at 122 km/h where 120 is posted", lambda: alone(ego={"speed": 34.0})),
    (
        "V2",
        BREACH,
        "a car at 108 km/h into a stretch for 100",
        lambda: alone(road=limited((290.0, 600.0, 100.0))),
    ),
    (
        "V2",
        LEGAL,
        "a car at 108 km/h up to a stretch for 100",
        lambda: alone(road=limited((299.0, 600.0, 100.0))),
    ),
    ("V2", APART, "nothing was driven", lambda: alone(events={"collision": 0})),
    ("V2", UNKNOWN, "no sign is known", lambda: alone(unknown=("speed_limit",))),
    ("V3", LEGAL, "50 km/h in dense fog", lambda: alone(ego={"speed": 13.8}, weather=DENSE)),
    ("V3", BREACH, "54 km/h in dense fog", lambda: alone(ego={"speed": 15.0}, weather=DENSE)),
    ("V3", APART, "clear air", alone),
    ("V3", UNKNOWN, "no weather", lambda: alone(unknown=("weather",))),
    (
        "V3",
        LEGAL,
        "slow, whatever the weather",
        lambda: alone(ego={"speed": 13.0}, unknown=("weather",)),
    ),
    (
        "F1",
        LEGAL,
        "in the slow lane's stead, which is taken",
        lambda: case(Track(speed=30.0, lane=1), Track(s=10.0, speed=28.0), events={}),
    ),
    ("F1", BREACH, "in the middle of an empty road", lambda: alone(ego={"lane": 1})),
    ("F1", APART, "in the slow lane", alone),
    (
        "F1",
        UNKNOWN,
        "no weather",
        lambda: alone(ego={"lane": 1}, unknown=("weather",)),
    ),
    ("F2", APART, "never back", crossing),
    ("F2", UNKNOWN, "its text was not read", overtake),
    ("G1", APART, "nobody behind", alone),
    (
        "G1",
        UNKNOWN,
        "its text was not read",
        lambda: crossing(
            Track(s=-140.0, lane=1, speed=44.0), ego={"lane": ramp((4.9, 0), (5.5, 1), frames=200)}
        ),
    ),
    ("B1", LEGAL, "low beam by night", lambda: alone(ego={"lights": LOW}, weather=NIGHT)),
    (
        "B1",
        LEGAL,
        "no rear fog lamps in dense fog",
        lambda: alone(ego={"lights": LOW}, weather=DENSE),
    ),
    ("B1", BREACH, "dark by night", lambda: alone(weather=NIGHT)),
    ("B1", BREACH, "rear fog lamps in clear air", lambda: alone(ego={"lights": FOG})),
    (
        "B1",
        BREACH,
        "high beam behind another",
        lambda: behind(40.0, ego={"lights": HIGH}, weather=NIGHT),
    ),
    ("B1", APART, "nothing was driven", lambda: alone(events={"collision": 0})),
    ("B1", UNKNOWN, "no lamps", lambda: alone(unknown=("lamps",))),
    ("S1", LEGAL, "over a broken line", overtake),
    ("S1", BREACH, "8 cm over the edge line", lambda: alone(ego={"lane": -1.055 / 3.75})),
    (
        "S1",
        BREACH,
        "out over a line that is solid on this side",
        lambda: lined((0, 200, RoadMark.SOLID_BROKEN)),
    ),
    (
        "S1",
        LEGAL,
        "out and back over a line that is solid for the others alone",
        lambda: lined((0, 510, RoadMark.BROKEN_SOLID), (510, 600, RoadMark.SOLID)),
    ),
    ("S1", APART, "a road without continuous lines", lambda: overtake(road=wide_road())),
    ("S1", UNKNOWN, "no lines", lambda: overtake(unknown=("marks",))),
]
"""Rule, verdict, what happens, and what makes the case."""
