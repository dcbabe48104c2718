"""What each rule of law should say: of speed, sight, places, lamps and others, L12 to L24."""

from __future__ import annotations

from typing import Any

import numpy as np
from tests.support.cases import FOG, HIGH, LEFT, LOW, NIGHT, Track, case, ramp, two_way_road
from tests.support.overtakes import (
    CROSSED,
    FRAMES,
    SIGNALS,
    against,
    alone,
    crossing,
    limited,
    lower_for_oncoming,
    mixed_road,
    oncoming_target,
    overtake,
    passing,
    queue,
)
from tests.support.worlds import wide_road

from overtaking.model.known_roads import known_road
from overtaking.model.road import RoadMark
from overtaking.model.verdicts import Verdict

LEGAL, BREACH = Verdict.LEGAL, Verdict.ILLEGAL
APART, UNKNOWN = Verdict.NOT_APPLICABLE, Verdict.UNDECIDABLE

THICK = {"fog": 90.0}
TRUCK = {"kind": "T", "speed": 24.0}
SLOWER = ramp((2, 30.0), (4, 20.0), (6, 20.0), (8, 30.0), frames=200)
"""At 30 m/s up to 60 m, at 20 m/s from 110 to 150 m, and as fast as before from 200 m on."""
LATE = ramp((4.9, 0), (5.5, 1), frames=200)

OF_DRIVING: list[tuple[str, Verdict, str, Any]] = [
    ("L12", LEGAL, "below the limit", overtake),
    ("L12", LEGAL, "a truck at 90 km/h", lambda: alone(ego={"kind": "T", "speed": 24.999})),
    ("L12", BREACH, "a car at 122 km/h", lambda: alone(ego={"speed": 34.0})),
    ("L12", BREACH, "a van at 115 km/h", lambda: alone(ego={"kind": "V", "speed": 32.0})),
    ("L12", BREACH, "a truck at 91 km/h", lambda: alone(ego={"kind": "T", "speed": 25.3})),
    (
        "L12",
        BREACH,
        "a car at 95 km/h where 90 is posted",
        lambda: alone(ego={"speed": 26.4}, road=known_road("town06")),
    ),
    (
        "L12",
        BREACH,
        "at 108 km/h into a stretch for 80",
        lambda: alone(road=limited((290.0, 600.0, 80.0))),
    ),
    (
        "L12",
        LEGAL,
        "at 108 km/h up to a stretch for 80",
        lambda: alone(road=limited((298.501, 600.0, 80.0))),
    ),
    (
        "L12",
        LEGAL,
        "at 108 km/h from the end of a stretch for 80 on",
        lambda: alone(ego={"s": 600.0}, road=limited((290.0, 600.0, 80.0))),
    ),
    (
        "L12",
        BREACH,
        "at 108 km/h in the last millimetre of a stretch for 80",
        lambda: alone(ego={"s": 599.999}, road=limited((290.0, 600.0, 80.0))),
    ),
    (
        "L12",
        LEGAL,
        "slower where less is posted, as fast as before behind it",
        lambda: alone(
            ego={"speed": SLOWER}, road=limited((90.0, 110.0, 90.0), (110.0, 150.0, 72.0))
        ),
    ),
    (
        "L12",
        BREACH,
        "slower where less is posted, but not from its beginning on",
        lambda: alone(ego={"speed": SLOWER}, road=limited((70.0, 150.0, 90.0))),
    ),
    (
        "L12",
        BREACH,
        "a truck at 85 km/h, where trucks may drive 90 and 80 are posted",
        lambda: alone(ego={"kind": "T", "speed": 23.6}, road=limited((100.0, 600.0, 80.0))),
    ),
    (
        "L12",
        LEGAL,
        "a truck at 85 km/h, where trucks may drive 90 and 100 are posted",
        lambda: alone(ego={"kind": "T", "speed": 23.6}, road=limited((100.0, 600.0, 100.0))),
    ),
    (
        "L12",
        LEGAL,
        "at 72 km/h where 60 are posted for those who come",
        lambda: alone(ego={"speed": 20.0}, road=lower_for_oncoming(16.0)),
    ),
    (
        "L12",
        BREACH,
        "at 108 km/h where 80 are posted, the ego of any kind",
        lambda: alone(road=limited((290.0, 600.0, 80.0)), unknown=("kinds",)),
    ),
    (
        "L12",
        UNKNOWN,
        "nothing is known of signs, nor of lower ones",
        lambda: alone(road=limited((290.0, 600.0, 80.0)), unknown=("speed_limit",)),
    ),
    ("L12", APART, "nothing was driven", lambda: alone(events={"collision": 0})),
    ("L12", UNKNOWN, "nothing is known of the sign", lambda: alone(unknown=("speed_limit",))),
    (
        "L12",
        UNKNOWN,
        "nothing is known of the kind of an ego at 115 km/h",
        lambda: alone(ego={"speed": 32.0}, unknown=("kinds",)),
    ),
    (
        "L12",
        BREACH,
        "over every limit, whatever the sign says",
        lambda: alone(ego={"speed": 34.0}, unknown=("speed_limit", "kinds", "road_kind")),
    ),
    ("L13", LEGAL, "fast enough", overtake),
    (
        "L13",
        APART,
        "slow in congestion",
        lambda: case(Track(speed=5.0), *queue(3), events={"target_slot": 255}),
    ),
    (
        "L13",
        BREACH,
        "slow among two slow ones",
        lambda: case(Track(speed=5.0), *queue(2), events={"target_slot": 255}),
    ),
    (
        "L13",
        APART,
        "standing in a queue",
        lambda: case(Track(speed=0.0), Track(s=8.0, speed=0.0), events={"target_slot": 255}),
    ),
    (
        "L13",
        APART,
        "in a queue at 36 km/h",
        lambda: case(Track(speed=10.0), Track(s=25.0, speed=11.0), events={"target_slot": 255}),
    ),
    (
        "L13",
        BREACH,
        "slow with a slow one far ahead",
        lambda: case(Track(speed=10.0), Track(s=60.0, speed=10.0), events={"target_slot": 255}),
    ),
    (
        "L13",
        BREACH,
        "slow behind one that is fast enough",
        lambda: case(Track(speed=10.0), Track(s=25.0, speed=15.0), events={"target_slot": 255}),
    ),
    ("L13", BREACH, "43 km/h", lambda: alone(ego={"speed": 12.0})),
    ("L13", APART, "no motorway", lambda: overtake(road=two_way_road())),
    (
        "L13",
        UNKNOWN,
        "slow on a road of unknown kind",
        lambda: alone(ego={"speed": 12.0}, unknown=("road_kind",)),
    ),
    ("L13", LEGAL, "fast on a road of unknown kind", lambda: alone(unknown=("road_kind",))),
    ("L14", LEGAL, "a clear day", overtake),
    ("L14", LEGAL, "a clear night", lambda: overtake(weather=NIGHT)),
    ("L14", BREACH, "thick fog", lambda: alone(weather=THICK)),
    ("L14", APART, "nothing was driven", lambda: alone(events={"collision": 0})),
    ("L14", UNKNOWN, "nothing is known of the weather", lambda: overtake(unknown=("weather",))),
    ("L14s", LEGAL, "a clear day", overtake),
    ("L14s", BREACH, "a clear night", lambda: overtake(weather=NIGHT)),
    ("L14s", APART, "nothing was driven", lambda: alone(events={"collision": 0})),
    ("L14s", UNKNOWN, "nothing is known of the lamps", lambda: overtake(unknown=("lamps",))),
    ("L15", LEGAL, "a clear day", overtake),
    ("L15", LEGAL, "fog in which one sees 51 m", lambda: overtake(weather={"fog": 99.6})),
    ("L15", LEGAL, "a clear night", lambda: overtake(weather=NIGHT)),
    (
        "L15",
        BREACH,
        "fog and rain in which one sees 47 m",
        lambda: overtake(weather={"fog": 100.0, "rain": 100.0}),
    ),
    ("L15", APART, "no attempt", alone),
    ("L15", UNKNOWN, "nothing is known of the weather", lambda: overtake(unknown=("weather",))),
    (
        "L15",
        LEGAL,
        "two ways, seen as far as needed",
        lambda: overtake(
            road=two_way_road(), ego={"speed": 20.0}, events=CROSSED | {"abort_end": 140}
        ),
    ),
    ("L15s", LEGAL, "a clear night", lambda: overtake(weather=NIGHT)),
    ("L15s", BREACH, "a wet night", lambda: overtake(weather=NIGHT | {"rain": 50.0})),
    ("L15s", APART, "no attempt", alone),
    ("L15s", UNKNOWN, "nothing is known of the lamps", lambda: overtake(unknown=("lamps",))),
    ("L16", LEGAL, "a car on 3.75 m", overtake),
    (
        "L16",
        BREACH,
        "a truck on 2.8 m",
        lambda: crossing(ego={"kind": "T"}, road=wide_road(width=2.8)),
    ),
    (
        "L16",
        BREACH,
        "no lane on the left",
        lambda: crossing(ego={"lane": 2}, events=CROSSED | {"original_lane": 2}),
    ),
    ("L16", APART, "no attempt", alone),
    ("L17", LEGAL, "two ways, the target in its lane", lambda: oncoming_target(0)),
    ("L17", BREACH, "two ways, the target overtakes a third", lambda: oncoming_target(0.5)),
    ("L17", APART, "lanes of one direction", overtake),
    ("L17", UNKNOWN, "nothing is known of the road", lambda: overtake(unknown=("road_kind",))),
    ("L18", LEGAL, "indicated both ways", overtake),
    ("L18", BREACH, "never indicated", lambda: overtake(ego={"lights": 0})),
    (
        "L18",
        BREACH,
        "indicated a second too late",
        lambda: overtake(ego={"lights": np.where(np.arange(FRAMES) < 56, 0, SIGNALS)}),
    ),
    (
        "L18",
        BREACH,
        "back with the wrong indicator",
        lambda: overtake(ego={"lights": np.where(np.arange(FRAMES) > 200, LEFT, SIGNALS)}),
    ),
    ("L18", APART, "no line crossed", alone),
    (
        "L18",
        UNKNOWN,
        "nothing is known of the indicators",
        lambda: overtake(unknown=("indicators",)),
    ),
    ("L19", LEGAL, "no lamps by day", alone),
    ("L19", LEGAL, "low beam by night", lambda: alone(ego={"lights": LOW}, weather=NIGHT)),
    ("L19", LEGAL, "fog lamps in fog", lambda: alone(ego={"lights": LOW | FOG}, weather=THICK)),
    (
        "L19",
        LEGAL,
        "high beam with nobody there",
        lambda: alone(ego={"lights": HIGH}, weather=NIGHT),
    ),
    ("L19", BREACH, "no lamps by night", lambda: alone(weather=NIGHT)),
    ("L19", BREACH, "no lamps in fog", lambda: alone(weather=THICK)),
    ("L19", BREACH, "fog lamps in clear air", lambda: alone(ego={"lights": LOW | FOG})),
    ("L19", BREACH, "no fog lamps in fog", lambda: alone(ego={"lights": LOW}, weather=THICK)),
    (
        "L19",
        BREACH,
        "high beam behind another",
        lambda: case(
            Track(speed=30.0, lights=LOW | HIGH),
            Track(s=80.0, speed=30.0),
            weather=NIGHT,
            events={},
        ),
    ),
    (
        "L19",
        BREACH,
        "high beam when meeting",
        lambda: case(
            Track(lights=HIGH),
            Track(s=-50.0),
            Track(s=400.0, lane=1, speed=20.0, oncoming=True),
            road=two_way_road(),
            weather=NIGHT,
            events={},
        ),
    ),
    ("L19", APART, "nothing was driven", lambda: alone(events={"collision": 0})),
    ("L19", UNKNOWN, "nothing is known of the lamps", lambda: alone(unknown=("lamps",))),
    ("L20", LEGAL, "a truck in the second lane", lambda: alone(ego=TRUCK | {"lane": 1})),
    ("L20", BREACH, "a truck in the third lane", lambda: alone(ego=TRUCK | {"lane": 2})),
    ("L20", APART, "a car in the third lane", lambda: alone(ego={"lane": 2})),
    (
        "L20",
        APART,
        "a truck where there are two lanes",
        lambda: alone(ego=TRUCK | {"lane": 1}, road=mixed_road(RoadMark.BROKEN)),
    ),
    (
        "L20",
        UNKNOWN,
        "nothing is known of the kinds",
        lambda: alone(ego={"lane": 2}, unknown=("kinds",)),
    ),
    (
        "L21",
        LEGAL,
        "a slower one to the right",
        lambda: case(Track(speed=30.0, lane=1), Track(s=60.0, speed=22.0), events={}),
    ),
    ("L21", BREACH, "a free lane to the right", lambda: alone(ego={"lane": 1})),
    ("L21", APART, "in the slowest lane", alone),
    (
        "L21",
        UNKNOWN,
        "nothing is known of the weather",
        lambda: alone(ego={"lane": 1}, unknown=("weather",)),
    ),
    ("L22", LEGAL, "the target holds its speed", overtake),
    ("L22", BREACH, "the target accelerates", lambda: passing(1, target={"accel": 0.5})),
    ("L22", APART, "never alongside", crossing),
    ("L23", LEGAL, "nobody has to brake", overtake),
    (
        "L23",
        BREACH,
        "a fast one behind on the left must brake",
        lambda: crossing(Track(s=-100.0, lane=1, speed=44.0), ego={"lane": LATE}),
    ),
    (
        "L23",
        APART,
        "into the way of a fast one long before",
        lambda: crossing(
            Track(s=-60.0, lane=1, speed=44.0),
            ego={"lane": ramp((1, 0), (1.5, 1), frames=200)},
            events={"attempt": 150, "original_lane": 1},
        ),
    ),
    ("L23", APART, "nobody behind", lambda: crossing(ego={"lane": LATE})),
    ("L24", LEGAL, "oncoming traffic far off", lambda: against(60.0)),
    ("L24", BREACH, "oncoming traffic near", lambda: against(35.0)),
    ("L24", APART, "no oncoming vehicle", lambda: overtake(road=two_way_road())),
    ("L24", APART, "lanes of one direction", overtake),
]
"""Rule, verdict, what happens, and what makes the case."""
