"""The side of traffic and the origin of OpenDRIVE roads."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from scenariogeneration import xodr

from overtaking.cli import main
from overtaking.cli.arguments import road as chosen_road
from overtaking.cli.options import RoadChoice
from overtaking.core.errors import ConfigError, ImportFormatError
from overtaking.model.road import DrivingSide, Road, RoadMark
from overtaking.recordings.opendrive import read_opendrive
from overtaking.recordings.roads import load_road

from .opendrive_text import document, lane, road, section


def read(folder: Path, text: str, **options) -> Road:
    path = folder / "map.xodr"
    path.write_text(document(text), encoding="utf-8")
    return read_opendrive(path, **options)


def stated(direction: str) -> str:
    """RoadRunner's user data of a lane."""
    return f'<userData><vectorLane sOffset="0" laneId="x" travelDir="{direction}"/></userData>'


def two_sides(right: dict[str, str], left: dict[str, str]) -> str:
    """Two lanes on the right of the reference line and one on its left."""
    return section(
        left=[lane(1, mark="solid", **left)],
        right=[lane(-1, **right), lane(-2, mark="curb", **right)],
    )


def one_side(right: dict[str, str], left: dict[str, str]) -> str:
    del left
    return section(right=[lane(-1, **right), lane(-2, mark="curb", **right)])


REVERSED = {"attributes": 'direction="reversed"'}
LEFT_HAND = {
    "rule": ('rule="LHT"', {}, {}),
    "RoadRunner": ("", {"more": stated("backward")}, {"more": stated("forward")}),
    "code": (
        "",
        {"more": '<userData code="travelDir" value="backward"/>'},
        {"more": '<userData code="travelDir" value="forward"/>'},
    ),
    "direction": ("", REVERSED, REVERSED),
}


@pytest.mark.parametrize("sections", [two_sides, one_side])
@pytest.mark.parametrize("name", LEFT_HAND)
def test_left_hand_traffic_is_read_from_rule_and_directions(tmp_path, sections, name):
    header, right, left = LEFT_HAND[name]
    found = read(tmp_path, road(header=header, sections=sections(right, left)), lanes="right")
    assert found.driving_side is DrivingSide.LEFT
    # The lanes on the right of the line run against it, the outer one is on the left of travel.
    assert [each.lane_id for each in found.lanes] == [-2, -1]
    assert found.heading == pytest.approx(0.5 - math.pi)
    assert found.lane_boundaries == pytest.approx([7.0, 3.5, 0.0])
    assert found.lanes[0].left_mark is RoadMark.CURB
    assert found.is_two_way == (sections is two_sides)


@pytest.mark.parametrize("rule", ["RHT", "LHT"])
def test_directions_of_lanes_on_both_sides_override_the_rule(tmp_path, rule):
    """RoadRunner states the direction of each lane; `direction` is relative to the rule."""
    header = f'rule="{rule}"'
    right, left = {"more": stated("forward")}, {"more": stated("backward")}
    found = read(tmp_path, road(header=header, sections=two_sides(right, left)))
    assert found.driving_side is DrivingSide.RIGHT
    found = read(tmp_path, road(header=header, sections=two_sides(REVERSED, REVERSED)))
    opposite = {"RHT": DrivingSide.LEFT, "LHT": DrivingSide.RIGHT}
    assert found.driving_side is opposite[rule]


def test_the_countries_of_signals_decide_the_side(tmp_path):
    signals = '<signals><signal id="1" s="5" t="1" country="GB"/></signals>'
    text = road(sections=one_side({}, {})).replace("<objects>", f"{signals}<objects>")
    assert read(tmp_path, text).driving_side is DrivingSide.LEFT
    german = text.replace('"GB"', '"DEU"')
    assert read(tmp_path, german).driving_side is DrivingSide.RIGHT
    ruled = text.replace('length="500"', 'length="500" rule="RHT"', 1)
    assert read(tmp_path, ruled).driving_side is DrivingSide.RIGHT


def test_an_option_sets_the_side(tmp_path):
    text = road(sections=two_sides({}, {}))
    found = read(tmp_path, text, driving_side="left")
    assert found.driving_side is DrivingSide.LEFT
    assert [each.lane_id for each in found.lanes] == [1]  # Lanes along the line are on its left.
    assert found.is_two_way
    path = tmp_path / "map.xodr"
    assert load_road(path, lanes="right", driving_side="left").num_lanes == 2


def test_a_lane_of_oncoming_traffic_may_lie_on_the_same_side(tmp_path):
    lanes = [lane(-1, more=stated("backward"), mark="solid broken")]
    lanes += [lane(-2, more=stated("forward")), lane(-3, more=stated("forward"), mark="solid")]
    found = read(tmp_path, road(sections=section(right=lanes)))
    assert found.driving_side is DrivingSide.RIGHT
    assert [each.lane_id for each in found.lanes] == [-3, -2]
    assert found.is_two_way
    assert found.overtaking_side_neighbour is not None
    assert found.overtaking_side_neighbour.lane_id == -1
    # Of the line between them the broken part is nearer to the driving lanes.
    assert found.lanes[1].left_mark is RoadMark.BROKEN_SOLID
    assert found.lane_boundaries == pytest.approx([-10.5, -7.0, -3.5])


def test_an_oncoming_lane_on_the_same_side_has_a_limit_of_its_own(tmp_path):
    lanes = [
        lane(-1, more=f'<speed sOffset="0" max="30"/>{stated("backward")}'),
        lane(-2, more=f'<speed sOffset="0" max="20"/>{stated("forward")}'),
    ]
    kind = '<type s="0" type="motorway"/>'
    two_way = read(tmp_path, road(kind=kind, sections=section(right=lanes)))
    assert two_way.speed_limit == 30.0


def test_left_hand_roads_of_scenariogeneration_are_read(tmp_path):
    line = xodr.Line(300.0)
    made_road = xodr.create_road(line, 1, left_lanes=2, right_lanes=1)
    made_road.rule = xodr.TrafficRule.LHT
    made = xodr.OpenDrive("map")
    made.add_road(made_road)
    made.adjust_roads_and_lanes()
    path = tmp_path / "map.xodr"
    made.write_xml(str(path))
    found = read_opendrive(path)
    assert found.driving_side is DrivingSide.LEFT
    assert [each.lane_id for each in found.lanes] == [2, 1]
    assert found.is_two_way


FAR_X, FAR_Y = 690_833.9538376454, 5_334_888.022672083
SHAPES = ("<line/>", '<arc curvature="0.001"/>', '<spiral curvStart="0" curvEnd="0.001"/>')


@pytest.mark.parametrize("lanes", ["right", "left"])
@pytest.mark.parametrize("shape", SHAPES)
def test_a_road_in_absolute_coordinates_keeps_its_origin(tmp_path, shape, lanes):
    def at(x: float, y: float) -> Road:
        plan = f'<geometry s="0" x="{x!r}" y="{y!r}" hdg="0.6" length="500">{shape}</geometry>'
        return read(tmp_path, road(plan=plan), lanes=lanes)

    far, near = at(FAR_X, FAR_Y), at(0.0, 0.0)
    s, d = np.linspace(0.0, far.length, 7), np.linspace(-3.0, 3.0, 7)
    x, y = far.to_world(s, d)
    assert max(np.abs(x).max(), np.abs(y).max()) < 2000.0
    expected_x, expected_y = near.to_world(s, d)
    source_x, source_y = far.to_source(x, y)
    assert source_x == pytest.approx(expected_x + FAR_X, abs=1e-5, rel=0.0)
    assert source_y == pytest.approx(expected_y + FAR_Y, abs=1e-5, rel=0.0)
    assert (near.origin_x, near.origin_y) == (0.0, 0.0)
    assert (far.origin_x % 1000.0, far.origin_y % 1000.0) == (0.0, 0.0)


def test_coordinates_near_the_origin_stay_those_of_the_file(tmp_path):
    found = read(tmp_path, road())
    assert (found.origin_x, found.origin_y) == (0.0, 0.0)
    assert (found.x0, found.y0) == (10.0, -20.0)


@pytest.mark.parametrize(("name", "value"), [("x", "3e9"), ("y", "-1e12"), ("hdg", "1e20")])
def test_coordinates_that_no_place_has_are_refused_by_file_element_and_value(tmp_path, name, value):
    values = {"x": "0", "y": "0", "hdg": "0", name: value}
    attributes = " ".join(f'{each}="{text}"' for each, text in values.items())
    plan = f'<geometry s="0" {attributes} length="500"><line/></geometry>'
    with pytest.raises(ImportFormatError) as caught:
        read(tmp_path, road(plan=plan))
    message = str(caught.value)
    assert message.startswith("map.xodr: road 7: line 3: <geometry> attribute " + name)
    assert f'got "{value}"' in message
    assert "\n" not in message


def listed(folder: Path, capsys, *words: str) -> dict:
    """The only road of `map.xodr` as `overtaking roads` lists it."""
    main(["roads", str(folder / "map.xodr"), "--json", *words])
    (found,) = json.loads(capsys.readouterr().out)["roads"]
    return found


@pytest.mark.parametrize(("words", "limit"), [("130", 130.0), ("none", 360.0), ("90.5", 90.5)])
def test_an_option_replaces_the_limits_of_a_map(tmp_path, capsys, words, limit):
    kind = '<type s="0" type="motorway"><speed max="500" unit="km/h"/></type>'
    (tmp_path / "map.xodr").write_text(document(road(kind=kind)), encoding="utf-8")
    assert "--speed-limit" in listed(tmp_path, capsys)["refusal"]
    assert listed(tmp_path, capsys, "--speed-limit", words)["limits_kmh"] == [limit]


def test_the_options_of_roads_choose_the_road_of_a_command(tmp_path):
    path = tmp_path / "map.xodr"
    path.write_text(document(road()), encoding="utf-8")
    choice = RoadChoice(map_file=str(path), speed_limit="90", driving_side="left")
    found = chosen_road(choice)
    assert found is not None
    assert found.driving_side is DrivingSide.LEFT
    assert found.speed_limit == 25.0


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"speed_limit": "90"}, "expected a map"),
        ({"driving_side": "left"}, "expected a map"),
        ({"speed_limit": "fast", "road": "motorway"}, "expected a number of km/h"),
        ({"speed_limit": "0", "road": "motorway"}, "expected a number of km/h"),
        ({"speed_limit": "90", "road": "motorway"}, "expected its name alone"),
    ],
)
def test_options_for_maps_need_a_map(choice, message):
    with pytest.raises(ConfigError, match=message):
        chosen_road(RoadChoice(**choice))
