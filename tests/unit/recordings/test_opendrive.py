"""Straight roads out of OpenDRIVE texts of our own: what is read, and what is refused and why."""

import math
from pathlib import Path

import numpy as np
import pytest

from overtaking.core.errors import ConfigError, ImportFormatError
from overtaking.model.road import DrivingSide, Road, RoadMark
from overtaking.recordings.opendrive import read_opendrive, survey_opendrive

from .opendrive_text import LEFT, LINE, ONE_LANE, RIGHT, document, lane, road, section


def write(folder: Path, *roads: str) -> Path:
    path = folder / "map.xodr"
    path.write_text(document(*roads), encoding="utf-8")
    return path


def read(folder: Path, text: str | None = None, **options) -> Road:
    return read_opendrive(write(folder, road() if text is None else text), 7, **options)


def marks(road: Road) -> list[str]:
    """Marks from the slow to the fast side, each lane's own view of both."""
    return [f"{lane.right_mark.value}|{lane.left_mark.value}" for lane in road.lanes]


def test_the_lanes_along_the_reference_line_are_read_by_default(tmp_path: Path):
    found = read(tmp_path)
    assert (found.name, found.kind, found.driving_side) == (
        "map road 7",
        "motorway",
        DrivingSide.RIGHT,
    )
    assert [(lane.lane_id, lane.width) for lane in found.lanes] == [(-3, 3.5), (-2, 3.75)]
    assert marks(found) == ["Solid|Broken", "Broken|Solid"]
    np.testing.assert_allclose(found.lane_boundaries, [-8.25, -4.75, -1.0], atol=1e-12)
    assert (found.x0, found.y0, found.heading, found.length) == (10.0, -20.0, 0.5, 500.0)
    assert found.speed_limit == pytest.approx(120.0 / 3.6)
    slow, fast = found.kerb_side_neighbour, found.overtaking_side_neighbour
    assert slow is not None
    assert (slow.lane_id, slow.kind, slow.width, slow.direction) == (-4, "shoulder", 2.5, 1)
    assert (slow.right_mark, slow.left_mark) == (RoadMark.NONE, RoadMark.SOLID)
    assert fast is not None
    assert (fast.lane_id, fast.kind, fast.width, fast.direction) == (-1, "shoulder", 1.0, 1)


def test_lanes_against_the_reference_line_turn_the_road_about(tmp_path: Path):
    """Positive ids in right-hand traffic: the road starts at the end of the line."""
    found = read(tmp_path, lanes="left")
    end = (10.0 + 500.0 * math.cos(0.5), -20.0 + 500.0 * math.sin(0.5))
    assert (found.x0, found.y0) == pytest.approx(end, abs=1e-9)
    assert found.heading == pytest.approx(0.5 - math.pi, abs=1e-15)
    assert [lane.lane_id for lane in found.lanes] == [2, 1]
    # d = -t: lane 1 lies at t = 0 ... 3.25 m, right of its own direction of travel.
    np.testing.assert_allclose(found.lane_boundaries, [-6.25, -3.25, 0.0], atol=1e-12)
    # "solid broken" names the line nearer to the reference line first: that is lane 1's side.
    assert marks(found) == ["Solid|BrokenSolid", "SolidBroken|Solid"]
    fast = found.overtaking_side_neighbour
    assert fast is not None
    assert (fast.lane_id, fast.direction) == (-1, -1)
    # World points: 100 m before the end of the line, 1 m left of it, is s = 100, d = -1 here.
    x, y = found.to_world(100.0, -1.0)
    station, t = 400.0, 1.0
    assert float(x) == pytest.approx(10 + station * math.cos(0.5) - t * math.sin(0.5), abs=1e-9)
    assert float(y) == pytest.approx(-20 + station * math.sin(0.5) + t * math.cos(0.5), abs=1e-9)


def test_left_hand_traffic_mirrors_the_sides(tmp_path: Path):
    text = road(header='junction="-1" rule="LHT"')
    along, against = read(tmp_path, text), read(tmp_path, text, lanes="right")
    assert along.driving_side is against.driving_side is DrivingSide.LEFT
    assert [lane.lane_id for lane in along.lanes] == [2, 1]
    np.testing.assert_allclose(along.lane_boundaries, [6.25, 3.25, 0.0], atol=1e-12)
    assert along.heading == 0.5
    assert [lane.lane_id for lane in against.lanes] == [-3, -2]
    np.testing.assert_allclose(against.lane_boundaries, [8.25, 4.75, 1.0], atol=1e-12)
    assert against.heading == pytest.approx(0.5 - math.pi)
    slow = along.lanes[0]
    assert (slow.left_mark, slow.right_mark) == (RoadMark.SOLID, RoadMark.BROKEN_SOLID)


def test_a_one_way_road_needs_no_choice_of_side(tmp_path: Path):
    text = road(sections=section(left=LEFT))
    assert read(tmp_path, text) == read(tmp_path, text, lanes="left")


@pytest.mark.parametrize(
    ("centre", "seen"),
    [("solid broken", RoadMark.BROKEN_SOLID), ("broken solid", RoadMark.SOLID_BROKEN)],
)
def test_a_double_centre_line_is_named_from_left_to_right(
    tmp_path: Path, centre: str, seen: RoadMark
):
    """Seen from the lane on its right, the second word is the nearer line."""
    text = road(sections=section(left=LEFT, centre=centre, right=ONE_LANE))
    assert read(tmp_path, text).lanes[-1].left_mark is seen
    assert read(tmp_path, text, lanes="left").lanes[-1].left_mark is seen.reverse
    oncoming = read(tmp_path, text).overtaking_side_neighbour
    assert oncoming is not None
    assert (oncoming.lane_id, oncoming.direction) == (1, -1)
    # Its outer line is "solid broken", and lies left as we drive.
    assert (oncoming.right_mark, oncoming.left_mark) == (seen.reverse, RoadMark.SOLID_BROKEN)


@pytest.mark.parametrize(
    ("name", "mark"),
    [
        ("none", RoadMark.NONE),
        ("solid solid", RoadMark.SOLID_SOLID),
        ("broken broken", RoadMark.BROKEN_BROKEN),
        ("botts dots", RoadMark.BOTTS_DOTS),
        ("curb", RoadMark.CURB),
        ("grass", RoadMark.GRASS),
        ("custom", RoadMark.OTHER),
        ("zebra", RoadMark.OTHER),
        ("", RoadMark.NONE),
    ],
)
def test_marks_are_named_as_carla_names_them(tmp_path: Path, name: str, mark: RoadMark):
    text = road(sections=section(right=[lane(-1, mark=name)]))
    assert read(tmp_path, text).lanes[0].right_mark is mark


def test_a_constant_lane_offset_moves_the_lanes(tmp_path: Path):
    entry = '<laneOffset s="0" a="4.5" b="0" c="0" d="0"/>'
    offset = entry + entry.replace('s="0"', 's="99"')
    shifted = read(tmp_path, road(offset=offset))
    np.testing.assert_allclose(shifted.lane_boundaries, [-3.75, -0.25, 3.5], atol=1e-12)
    turned = read(tmp_path, road(offset=offset), lanes="left")
    np.testing.assert_allclose(turned.lane_boundaries, [-10.75, -7.75, -4.5], atol=1e-12)


def test_a_line_in_several_pieces_is_one_line(tmp_path: Path):
    pieces = "".join(
        f'<geometry s="{s}" x="{10 + s * math.cos(0.5)}" y="{-20 + s * math.sin(0.5)}" '
        f'hdg="{0.5 + turns * math.tau}" length="100">{shape}</geometry>'
        for s, turns, shape in [
            (0, 0, "<line/>"),
            (100, 0, '<arc curvature="1e-10"/>'),
            (200, 1, '<spiral curvStart="0" curvEnd="-1e-10"/>'),
            (300, -1, "<line/>"),
            (400, 0, "<line/>"),
        ]
    )
    assert read(tmp_path, road(plan=pieces)) == read(tmp_path)


def test_lane_sections_that_change_nothing_are_merged(tmp_path: Path):
    parts = "".join(section(s=s, left=LEFT, right=RIGHT) for s in (0, 120.5, 499.9))
    assert read(tmp_path, road(sections=parts)) == read(tmp_path)
    widened = [*RIGHT[:3], lane(-4, kind="shoulder", width=2.5), lane(-5, kind="border", width=9)]
    parts = section(left=LEFT, right=RIGHT) + section(s=200, right=widened)
    found = read(tmp_path, road(sections=parts))  # Beyond the shoulder nothing matters.
    assert found.lanes == read(tmp_path).lanes


def test_what_a_profile_says_beyond_the_end_of_the_road_does_not_matter(tmp_path: Path):
    """A lane that grows by 2.5 mm to the end of the road, and by 25 mm to the next entry."""
    width = (
        '<width sOffset="0" a="3.5" b="5e-6" c="0" d="0"/>'
        '<width sOffset="5000" a="9" b="0" c="0" d="0"/>'
    )
    found = read(tmp_path, road(sections=section(right=[lane(-1, width=width)])))
    assert found.lanes[0].width == 3.5


def test_lanes_of_no_width_are_not_neighbours(tmp_path: Path):
    right = [
        lane(-1, kind="none", width=0.0, mark="curb"),
        lane(-2, mark="solid"),
        lane(-3, kind="none", width=0.0),
        lane(-4, kind="border", width=1.5),
    ]
    found = read(tmp_path, road(sections=section(right=right)))
    assert found.overtaking_side_neighbour is None
    assert found.kerb_side_neighbour is not None
    assert found.kerb_side_neighbour.lane_id == -4
    assert found.lanes[0].left_mark is RoadMark.CURB


@pytest.mark.parametrize(
    ("speed", "limit"),
    [
        ('<speed max="33"/>', 33.0),
        ('<speed max="33" unit="m/s"/>', 33.0),
        ('<speed max="90" unit="km/h"/>', 25.0),
        ('<speed max="65" unit="mph"/>', 65 * 1609.344 / 3600),
        ('<speed max="undefined"/>', 120 / 3.6),
        ("", 120 / 3.6),
    ],
)
def test_the_speed_limit_is_the_files_or_the_general_one(tmp_path: Path, speed: str, limit: float):
    found = read(tmp_path, road(kind=f'<type s="0" type="motorway">{speed}</type>'))
    assert found.speed_limit == pytest.approx(limit)


@pytest.mark.parametrize(
    ("kind", "limit_kmh"),
    [("town", 50), ("townArterial", 50), ("lowSpeed", 50), ("rural", 90), ("motorway", 120)],
)
def test_without_a_sign_the_general_limit_of_the_kind_holds(
    tmp_path: Path, kind: str, limit_kmh: float
):
    found = read(tmp_path, road(kind=f'<type s="0" type="{kind}"/>'))
    assert (found.kind, found.speed_limit) == (kind, pytest.approx(limit_kmh / 3.6))
    untyped = read(tmp_path, road(kind=""))
    assert (untyped.kind, untyped.speed_limit) == ("unknown", pytest.approx(25.0))


def test_the_limit_of_the_lanes_and_of_the_caller_come_first(tmp_path: Path):
    speed = '<speed sOffset="0" max="20" unit="m/s"/>'
    right = [lane(-1, more=speed), lane(-2, more=speed), lane(-3, kind="shoulder")]
    text = road(sections=section(right=right))
    assert read(tmp_path, text).speed_limit == 20.0
    assert read(tmp_path, text, speed_limit=11.0).speed_limit == 11.0
    unlimited = road(kind='<type s="0" type="motorway"><speed max="no limit"/></type>')
    assert read(tmp_path, unlimited, speed_limit=40.0).speed_limit == 40.0


def test_a_road_is_found_among_others(tmp_path: Path):
    path = write(tmp_path, road(road_id="6", header='junction="1"'), road(), road(road_id="8 b"))
    assert read_opendrive(path, 7) == read_opendrive(path, "7") == read(tmp_path)
    path = write(tmp_path, road(road_id="6", header='junction="1"'), road(), road(road_id="8 b"))
    assert read_opendrive(path, "8 b").name == "map road 8 b"
    with pytest.raises(
        ImportFormatError, match=r"map\.xodr: road 9: expected exactly one, got the"
    ):
        read_opendrive(path, 9)
    with pytest.raises(ImportFormatError, match="got the roads 6, 7, 8 b; choose one"):
        read_opendrive(path)
    with pytest.raises(ImportFormatError, match="got no road at all"):
        read_opendrive(write(tmp_path))
    with pytest.raises(ImportFormatError, match="got the roads 7, 7; choose"):
        read_opendrive(write(tmp_path, road(), road()), 7)


def test_the_roads_that_can_be_driven_are_named_where_another_was_asked_for(tmp_path: Path):
    arc = LINE.replace("<line/>", '<arc curvature="0.01"/>')
    bend, lane_only = (
        road(road_id="5", plan=arc),
        road(road_id="6", sections=section(right=ONE_LANE)),
    )
    short = LINE.replace('length="500"', 'length="90"')
    roads = [bend, lane_only, road(road_id="8", plan=short, length="90"), road()]
    path = write(tmp_path, *roads)
    named = r": --road 5 \(2 lanes, 500 m\), 7 \(2 lanes, 500 m\), 8 \(2 lanes, 90 m\)$"
    for wanted in (None, 99):
        with pytest.raises(ImportFormatError, match=named):
            read_opendrive(path, wanted)
    with pytest.raises(ImportFormatError, match="no road of the file can be driven and has two"):
        read_opendrive(write(tmp_path, lane_only, road(road_id="9", header='junction="1"')), 9)


def test_the_only_road_needs_no_id(tmp_path: Path):
    assert read_opendrive(write(tmp_path, road())) == read(tmp_path)


def test_a_survey_gives_every_road_or_its_reason(tmp_path: Path):
    path = write(tmp_path, road(), road(road_id="8", header='junction="1"'))
    verdicts = survey_opendrive(path)
    assert verdicts["7"] == read_opendrive(path, 7)
    assert isinstance(verdicts["8"], ImportFormatError)
    assert str(verdicts["8"]).startswith("map.xodr: road 8: line 4: <road> belongs to a junction")


def test_choices_that_make_no_sense_are_refused(tmp_path: Path):
    path = write(tmp_path, road())
    with pytest.raises(ConfigError, match="expected right or left, got 'middle'"):
        read_opendrive(path, lanes="middle")
    for limit in (0.0, -1.0, math.nan, math.inf, 101.0):
        with pytest.raises(ConfigError, match="speed_limit"):
            read_opendrive(path, speed_limit=limit)
