"""What each rule of law should say: of manners of overtaking, L1 to L11, and all together."""

from __future__ import annotations

from typing import Any

from tests.support.cases import LEFT, Track, case, ramp, two_way_road
from tests.support.law_fixtures_of_driving import OF_DRIVING
from tests.support.law_fixtures_of_two_ways import OF_TWO_WAYS
from tests.support.overtakes import (
    BACK,
    BESIDE,
    STAYS,
    alone,
    crossing,
    mixed_road,
    overtake,
    passing,
    queue,
)
from tests.support.worlds import wide_road

from overtaking.model.road import RoadMark
from overtaking.model.verdicts import Verdict

LEGAL, BREACH = Verdict.LEGAL, Verdict.ILLEGAL
APART, UNKNOWN = Verdict.NOT_APPLICABLE, Verdict.UNDECIDABLE


Fixture = tuple[str, Verdict, str, Any]

OF_OVERTAKING: list[Fixture] = [
    ("L1", LEGAL, "past on the left", overtake),
    (
        "L1",
        LEGAL,
        "the target makes room to the right",
        lambda: passing(
            2,
            target={"lane": ramp((0, 1), (2, 0), frames=200)},
            events=BESIDE | {"original_lane": 1},
        ),
    ),
    (
        "L1",
        APART,
        "past a queue on the right",
        lambda: passing(
            0, *queue(3), ego={"speed": 8.0}, target={"lane": 1, "speed": 3.0, "s": 23.0}
        ),
    ),
    ("L1", BREACH, "past on the right", lambda: passing(0, target={"lane": 1})),
    (
        "L1",
        BREACH,
        "two lanes to the left",
        lambda: passing(2, events=BESIDE | {"original_lane": 0}),
    ),
    (
        "L1",
        BREACH,
        "past two slow ones on the right",
        lambda: passing(
            0, *queue(2), ego={"speed": 9.0}, target={"lane": 1, "speed": 9.0, "s": 3.0}
        ),
    ),
    (
        "L1",
        BREACH,
        "past a queue on the right in a hurry",
        lambda: passing(0, *queue(3), target={"lane": 1}),
    ),
    ("L1", APART, "never alongside", crossing),
    ("L2", LEGAL, "over a broken line", overtake),
    (
        "L2",
        LEGAL,
        "over a mixed line that is broken on this side",
        lambda: overtake(road=mixed_road(RoadMark.BROKEN_SOLID), ego={"lane": STAYS}),
    ),
    ("L2", LEGAL, "3 cm over the edge line", lambda: alone(ego={"lane": -1.005 / 3.75})),
    ("L2", BREACH, "8 cm over the edge line", lambda: alone(ego={"lane": -1.055 / 3.75})),
    (
        "L2",
        BREACH,
        "over a mixed line that is continuous on this side",
        lambda: overtake(road=mixed_road(RoadMark.SOLID_BROKEN), ego={"lane": STAYS}),
    ),
    (
        "L2",
        BREACH,
        "back over a mixed line that is continuous from there",
        lambda: overtake(road=mixed_road(RoadMark.BROKEN_SOLID)),
    ),
    (
        "L2",
        BREACH,
        "over the line between the directions",
        lambda: overtake(road=two_way_road(RoadMark.SOLID)),
    ),
    ("L2", APART, "a road without continuous lines", lambda: overtake(road=wide_road())),
    ("L2", UNKNOWN, "nothing is known of the lines", lambda: overtake(unknown=("marks",))),
    ("L3", LEGAL, "far enough behind", overtake),
    (
        "L3",
        LEGAL,
        "a vehicle has just cut in",
        lambda: crossing(
            Track(s=25.0, speed=30.0, lane=ramp((8, 1), (9, 0), frames=200)),
            target={"s": 30.0, "speed": 36.0},
        ),
    ),
    ("L3", BREACH, "too near when pulling out", lambda: overtake(target={"s": 100.0})),
    (
        "L3",
        BREACH,
        "a vehicle has cut in long ago",
        lambda: crossing(Track(s=25.0, speed=30.0, lane=ramp((2, 1), (3, 0), frames=200))),
    ),
    (
        "L3",
        BREACH,
        "too near without an attempt",
        lambda: case(Track(speed=30.0), Track(s=25.0, speed=30.0), events={}),
    ),
    ("L3", APART, "nobody ahead", alone),
    ("L3", UNKNOWN, "nothing is known of the weather", lambda: overtake(unknown=("weather",))),
    (
        "L4",
        LEGAL,
        "a fast one far ahead on the left",
        lambda: crossing(Track(s=80.0, lane=1, speed=32.0)),
    ),
    ("L4", BREACH, "a slow one on the left", lambda: crossing(Track(s=110.0, lane=1, speed=20.0))),
    ("L4", BREACH, "alongside on the left", lambda: crossing(Track(s=3.0, lane=1, speed=30.0))),
    ("L4", APART, "nobody on the left", crossing),
    (
        "L4",
        APART,
        "given up before the line",
        lambda: crossing(Track(s=30.0, lane=1), events={"attempt": 60}),
    ),
    (
        "L4",
        UNKNOWN,
        "nothing is known of the weather",
        lambda: crossing(Track(s=80.0, lane=1), unknown=("weather",)),
    ),
    (
        "L5",
        LEGAL,
        "a slow one behind on the left",
        lambda: crossing(Track(s=-30.0, lane=1, speed=28.0)),
    ),
    (
        "L5",
        BREACH,
        "a fast one behind on the left",
        lambda: crossing(Track(s=-90.0, lane=1, speed=40.0)),
    ),
    (
        "L5",
        BREACH,
        "one at the same speed just behind on the left",
        lambda: crossing(Track(s=-20.0, lane=1, speed=30.0)),
    ),
    ("L5", APART, "nobody behind on the left", crossing),
    (
        "L5",
        UNKNOWN,
        "nothing is known of the weather",
        lambda: crossing(Track(s=-30.0, lane=1), unknown=("weather",)),
    ),
    (
        "L6",
        LEGAL,
        "one behind on the left falls back",
        lambda: crossing(Track(s=-40.0, lane=1, speed=28.0)),
    ),
    ("L6", LEGAL, "a follower stays behind", lambda: crossing(Track(s=-40.0, speed=30.0))),
    (
        "L6",
        BREACH,
        "one on the left arrives in 3 s",
        lambda: crossing(Track(s=-4.4 - 30.0 - 30.0, lane=1, speed=40.0)),
    ),
    (
        "L6",
        BREACH,
        "a follower signals left",
        lambda: crossing(Track(s=-40.0, speed=30.0, lights=LEFT)),
    ),
    (
        "L6",
        BREACH,
        "a follower moves left",
        lambda: crossing(Track(s=-40.0, speed=30.0, lane=ramp((2, 0), (6, 0.5), frames=200))),
    ),
    ("L6", APART, "nobody behind", crossing),
    (
        "L6",
        APART,
        "an empty slot behind",
        lambda: crossing(Track(s=-40.0, lights=LEFT, body={"valid": 0.0})),
    ),
    (
        "L6",
        UNKNOWN,
        "nothing is known of a follower's indicator",
        lambda: crossing(Track(s=-40.0, speed=30.0), unknown=("indicators",)),
    ),
    ("L7", LEGAL, "the target holds its lane", overtake),
    ("L7", BREACH, "the target signals left", lambda: crossing(target={"lights": LEFT})),
    (
        "L7",
        BREACH,
        "the target moves left",
        lambda: crossing(target={"lane": ramp((1, 0), (5, 0.5), frames=200)}),
    ),
    ("L7", APART, "no attempt", lambda: crossing(events={})),
    ("L7", UNKNOWN, "nothing is known of its indicator", lambda: crossing(unknown=("indicators",))),
    ("L8", LEGAL, "back far ahead", lambda: crossing(target={"s": -60.0}, events=BACK)),
    (
        "L8",
        BREACH,
        "back just ahead of a faster one",
        lambda: crossing(target={"s": -20.0, "speed": 31.0}, events=BACK),
    ),
    (
        "L8",
        BREACH,
        "back just behind another",
        lambda: crossing(Track(s=20.0, speed=30.0), target={"s": -60.0}, events=BACK),
    ),
    ("L8", APART, "never back", crossing),
    (
        "L8",
        UNKNOWN,
        "nothing is known of the weather",
        lambda: crossing(target={"s": -60.0}, events=BACK, unknown=("weather",)),
    ),
    ("L9", LEGAL, "back at once", overtake),
    (
        "L9",
        LEGAL,
        "another is to be overtaken next",
        lambda: overtake(Track(s=280.0, speed=20.0), ego={"lane": STAYS}),
    ),
    (
        "L9",
        BREACH,
        "stays on the left",
        lambda: overtake(
            ego={"lane": STAYS},
            target={"s": 60.0},
            events={"attempt": 60, "line_crossed": 76, "overlap_begin": 112, "overlap_end": 129},
        ),
    ),
    ("L9", APART, "not past the target", crossing),
    ("L9", UNKNOWN, "nothing is known of the weather", lambda: overtake(unknown=("weather",))),
    ("L10", LEGAL, "a lane apart", overtake),
    ("L10", BREACH, "0.7 m apart", lambda: passing(2.5 / 3.75)),
    ("L10", APART, "past a bicycle", lambda: passing(1, target={"kind": "B", "speed": 20.0})),
    ("L10", APART, "never alongside", crossing),
    ("L10", UNKNOWN, "nothing is known of the kinds", lambda: overtake(unknown=("kinds",))),
    (
        "L11",
        LEGAL,
        "slower and 2.5 m apart",
        lambda: passing(
            1, ego={"speed": ramp((3, 30.0), (4, 29.0), frames=200)}, target={"kind": "B"}
        ),
    ),
    ("L11", BREACH, "1.2 m apart", lambda: passing(2.4 / 3.75, target={"kind": "B"})),
    (
        "L11",
        BREACH,
        "faster than at the start",
        lambda: passing(
            1,
            ego={"speed": ramp((3, 29.0), (4, 30.0), frames=200)},
            target={"kind": "B", "s": 48.0},
        ),
    ),
    ("L11", APART, "past a car", lambda: passing(1)),
    ("L11", UNKNOWN, "nothing is known of the kinds", lambda: passing(1, unknown=("kinds",))),
]

FIXTURES: list[Fixture] = [*OF_OVERTAKING, *OF_DRIVING, *OF_TWO_WAYS]
"""Rule, verdict, what happens, and what makes the case."""
