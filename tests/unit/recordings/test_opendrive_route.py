"""Stretches of OpenDRIVE roads on which the lanes stay the same, and routes over several roads."""

import math
from pathlib import Path

import numpy as np
import pytest

from overtaking.core.errors import ImportFormatError
from overtaking.model.road import Road, RoadMark
from overtaking.recordings.opendrive import read_opendrive
from overtaking.recordings.opendrive_map import list_opendrive_roads
from overtaking.world.road_parameters import has_two_directions

from .opendrive_text import LEFT, LINE, ONE_LANE, RIGHT, TYPE, document, lane, road, section

ARC = '<geometry s="0" x="0" y="0" hdg="0" length="500"><arc curvature="0.004"/></geometry>'
WIDTH = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'
TAPER = WIDTH + '<width sOffset="60" a="3.5" b="0" c="0.001" d="0"/>'
LATE_OFFSET = '<laneOffset s="100" a="1" b="0" c="0" d="0"/>'
TWO_MARKS = '<roadMark sOffset="30" type="solid"/>'
SLOWER = '<speed sOffset="40" max="20"/>'
INNER = lane(-2, kind="shoulder", width=0.5, mark="solid")
BORDER = [lane(-1, kind="border", width=1.0), INNER, lane(-3)]
WIDER_BORDER = [lane(-1, kind="border", width=1.2), INNER, lane(-3)]
SHIFT = (
    '<laneOffset s="0" a="0" b="0" c="0" d="0"/>'
    '<laneOffset s="100" a="0" b="0" c="0.00105" d="-0.000007"/>'
    '<laneOffset s="200" a="3.5" b="0" c="0" d="0"/>'
)
"""Over 100 m all lanes move 3.5 m to the left, without a kink."""
BANKED = (
    '<superelevation s="0" a="0" b="0" c="0" d="0"/>'
    '<superelevation s="150" a="0" b="0.001" c="0" d="0"/>'
)


def read(folder: Path, *roads: str, road_id: str = "7", **options) -> Road:
    path = folder / "map.xodr"
    path.write_text(document(*roads), encoding="utf-8")
    return read_opendrive(path, road_id, **options)


@pytest.mark.parametrize(
    ("text", "start", "end"),
    [
        (road(offset=LATE_OFFSET), 100, 500),
        (road(sections=section(right=[lane(-1, width=TAPER)])), 0, 60),
        (road(sections=section(right=[lane(-1, more=TWO_MARKS)])), 30, 500),
        (
            road(sections=section(right=[lane(-1, kind="border", more=TWO_MARKS), lane(-2)])),
            30,
            500,
        ),
        (
            road(sections=section(right=ONE_LANE) + section(s=90, right=[lane(-1), lane(-2)])),
            90,
            500,
        ),
        (
            road(
                sections=section(right=ONE_LANE)
                + section(s=410, right=[lane(-1, width=3.6, mark="solid")])
            ),
            0,
            410,
        ),
        (road(sections=section(right=RIGHT[:3]) + section(s=90, right=RIGHT)), 90, 500),
        (road(sections=section(right=BORDER) + section(s=90, right=WIDER_BORDER)), 90, 500),
        (road(kind=TYPE + '<type s="380" type="rural"/>'), 0, 380),
        (road(sections=section(right=[lane(-1, more=SLOWER), lane(-2)])), 0, 40),
        (road(lateral=BANKED), 0, 150),
    ],
)
def test_the_longest_stretch_without_a_change_is_read(
    tmp_path: Path, text: str, start: int, end: int
):
    found = read(tmp_path, text, lanes="right")
    assert found.name == f"map road 7 from {start} to {end} m"
    assert found.length == pytest.approx(end - start)
    # It lies where the reference line of the file does.
    x, y = 10.0 + start * math.cos(0.5), -20.0 + start * math.sin(0.5)
    assert (found.x0, found.y0, found.heading) == pytest.approx((x, y, 0.5))
    (mapped,) = list_opendrive_roads(tmp_path / "map.xodr")
    assert mapped.part is not None
    if "<left></left>" in text:
        assert (mapped.part.start, mapped.part.end) == (start, end)
        assert not mapped.part.is_whole


def limits_of(found: Road) -> list[tuple[float, ...]]:
    """The lower limits of a road, in km/h."""
    assert found.course is not None
    return [
        (one.start, one.stop, round(3.6 * one.speed, 6), one.direction)
        for one in found.course.speed_limit_spans
    ]


SIGNS = "".join(
    f'<type s="{s}" type="motorway"><speed max="{limit}" unit="km/h"/></type>'
    for s, limit in ((0, 120), (80, 100), (200, 100), (300, 60), (380, 120))
)
LANES = [
    lane(k, more='<speed sOffset="0" max="40"/><speed sOffset="60" max="20"/>') for k in (-1, -2)
]


def test_limits_that_change_are_stretches_of_one_road(tmp_path: Path):
    found = read(tmp_path, road(kind=SIGNS))
    assert (found.name, found.length) == ("map road 7", 500.0)
    assert found.speed_limit == pytest.approx(120 / 3.6)
    assert limits_of(found) == [(80, 300, 100, 0), (300, 380, 60, 0)]
    against = read(tmp_path, road(kind=SIGNS, sections=section(left=LEFT)))
    assert limits_of(against) == [(120, 200, 60, 0), (200, 420, 100, 0)]


def test_limits_of_lanes_change_by_section_and_within_one(tmp_path: Path):
    sections = section(right=LANES) + section(s=200, right=[LANES[0], LANES[1]])
    found = read(tmp_path, road(sections=sections))
    assert found.speed_limit == 40.0
    assert limits_of(found) == [(60, 200, 72, 0), (260, 500, 72, 0)]


def test_a_limit_of_the_caller_holds_everywhere(tmp_path: Path):
    found = read(tmp_path, road(kind=SIGNS), speed_limit=30.0)
    assert (found.length, found.speed_limit, found.course) == (500.0, 30.0, None)


def test_the_other_direction_has_the_limits_of_its_lane(tmp_path: Path):
    inside = lane(
        1, mark="solid", more='<speed sOffset="0" max="25"/><speed sOffset="90" max="10"/>'
    )
    text = road(
        kind=SIGNS, sections=section(left=[inside], centre="broken", right=[lane(-1, mark="solid")])
    )
    along = read(tmp_path, text, lanes="right")
    assert along.is_two_way
    assert along.speed_limit == pytest.approx(120 / 3.6)
    assert limits_of(along) == [
        (0, 90, 90, -1), (80, 300, 100, 1), (90, 500, 36, -1), (300, 380, 60, 1),
    ]  # fmt: skip
    against = read(tmp_path, text, lanes="left")
    for s in (10.0, 85.0, 250.0, 350.0, 450.0):
        for way in (1, -1):
            assert against.speed_limit_at(500.0 - s, -way) == pytest.approx(
                float(along.speed_limit_at(s, way))
            )


def test_the_limits_of_a_carriageway_do_not_depend_on_the_other_one(tmp_path: Path):
    """Beyond a median there is no oncoming traffic to overtake against."""
    slow = lane(2, more='<speed sOffset="0" max="10"/>')
    text = road(sections=section(left=[lane(1, kind="median"), slow], right=ONE_LANE))
    assert read(tmp_path, text, lanes="right").course is None


def test_a_stretch_against_the_line_begins_at_its_end(tmp_path: Path):
    text = road(sections=section(left=LEFT) + section(s=90, left=LEFT[:1]))
    found = read(tmp_path, text)
    assert found.name == "map road 7 from 90 to 500 m"
    end = (10.0 + 500.0 * math.cos(0.5), -20.0 + 500.0 * math.sin(0.5))
    assert (found.x0, found.y0) == pytest.approx(end)
    (lane,) = found.lanes
    assert lane.lane_id == 1


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize(("plan", "curvature"), [(LINE, 0.0), (ARC, 0.004)])
def test_where_lanes_leave_the_line_the_road_goes_with_them(
    tmp_path: Path, side: str, plan: str, curvature: float
):
    """Lane borders by OpenDRIVE 1.8, 11.4: t is the lane offset and the widths from there."""
    found = read(tmp_path, road(plan=plan, offset=SHIFT), lanes=side)
    assert found.name == "map road 7"
    stations = np.linspace(0.0, 500.0, 51)
    x = np.clip(stations - 100.0, 0.0, 100.0)
    offset = 0.00105 * x**2 - 0.000007 * x**3
    sign = -1.0 if side == "right" else 1.0
    start = (10.0, -20.0, 0.5) if curvature == 0.0 else (0.0, 0.0, 0.0)
    turned = start[2] + curvature * stations
    along, left = stations, np.zeros_like(stations)
    if curvature:
        along, left = np.sin(turned) / curvature, (1.0 - np.cos(turned)) / curvature
    else:
        along, left = stations * math.cos(0.5), stations * math.sin(0.5)
    # The middle of the innermost lane of either side.
    t = offset + sign * (1.0 + 0.5 * 3.75 if side == "right" else 0.5 * 3.25)
    east = start[0] + along - t * np.sin(turned)
    north = start[1] + left + t * np.cos(turned)
    s, d = found.to_road(east, north)
    # Of the middle of the road, 1.9 m away, the angle of 0.05 between both lines takes 2.5 mm.
    np.testing.assert_allclose(d, found.lane_centres[-1], atol=0.003)
    assert (np.diff(s) * -sign > 0.0).all()
    assert found.length == pytest.approx(500.0, abs=15.0)


def test_lanes_that_leave_the_line_at_a_kink_end_there(tmp_path: Path):
    kink = (
        '<laneOffset s="0" a="0" b="0" c="0" d="0"/><laneOffset s="100" a="0" b="0.1" c="0" d="0"/>'
    )
    found = read(tmp_path, road(offset=kink), lanes="right")
    assert found.name == "map road 7 from 100 to 500 m"


def test_the_line_between_the_directions_may_change(tmp_path: Path):
    centre = '<roadMark sOffset="{}" type="{}"/>'
    changed = section(left=[lane(1, mark="solid")], centre="broken", right=ONE_LANE).replace(
        '<roadMark sOffset="0" type="broken"/></lane></center>',
        centre.format(0, "broken") + centre.format(120, "solid") + centre.format(200, "broken")
        + "</lane></center>",
    )  # fmt: skip
    for lanes, stretch in (("right", (120.0, 200.0)), ("left", (300.0, 380.0))):
        found = read(tmp_path, road(sections=changed.replace("3.5", "3.5")), lanes=lanes)
        assert found.name == "map road 7"
        assert found.course is not None
        (line,) = found.course.centre_line_spans
        assert (line.start, line.stop) == pytest.approx(stretch)
        assert line.mark is RoadMark.SOLID
        assert found.is_two_way
        assert has_two_directions(found)


def linked(road_id: str, x: float, links: str, **options) -> str:
    """A straight road of 100 m along x that names its neighbours."""
    plan = f'<geometry s="0" x="{x}" y="0" hdg="0" length="100"><line/></geometry>'
    text = road(road_id=road_id, plan=plan, length="100", **options)
    return text.replace("><link/><type", f"><link>{links}</link><type", 1)


def link(name: str, road_id: int, contact: str) -> str:
    return f'<{name} elementType="road" elementId="{road_id}" contactPoint="{contact}"/>'


CHAIN = (
    linked("1", 0.0, link("successor", 2, "start")),
    linked("2", 100.0, link("predecessor", 1, "end") + link("successor", 3, "start"),
           offset='<laneOffset s="0" a="0" b="0" c="0" d="0"/>'),
    linked("3", 200.0, link("predecessor", 2, "end")),
)  # fmt: skip


def test_roads_with_other_limits_join(tmp_path: Path):
    slower = linked("2", 100.0, link("predecessor", 1, "end")).replace("120", "80")
    found = read(tmp_path, CHAIN[0], slower, road_id="1,2")
    assert found.length == pytest.approx(200.0)
    assert limits_of(found) == [(100, 200, 80, 0)]


def test_a_route_over_linked_roads_is_one_road(tmp_path: Path):
    found = read(tmp_path, *CHAIN, road_id="1,2, 3")
    assert found.name == "map roads 1, 2, 3"
    assert found.length == pytest.approx(300.0)
    assert [lane.lane_id for lane in found.lanes] == [-3, -2]
    x, y = found.to_world([0.0, 150.0, 300.0], 0.0)
    np.testing.assert_allclose(x, [0.0, 150.0, 300.0], atol=1e-9)
    np.testing.assert_allclose(y, 0.0, atol=1e-9)
    # The other way, from the lanes on the left.
    back = read(tmp_path, *CHAIN, road_id="3,2,1")
    assert back.name == "map roads 3, 2, 1"
    assert (back.x0, abs(back.heading)) == pytest.approx((300.0, math.pi))
    assert [lane.lane_id for lane in back.lanes] == [2, 1]
    leads = [one.leads_to for one in list_opendrive_roads(tmp_path / "map.xodr")]
    assert leads == ["2", "3", None]


def test_a_road_that_is_turned_about_joins_too(tmp_path: Path):
    """Road 2 is drawn from its end to its beginning: its contact is its end."""
    plan = f'<geometry s="0" x="200" y="0" hdg="{math.pi}" length="100"><line/></geometry>'
    mirrored = (
        lane(1, kind="shoulder", width=1.0, mark="solid"),
        lane(2, width=3.75),
        lane(3, width=3.5, mark="solid"),
        lane(4, kind="shoulder", width=2.5, mark="none"),
    )
    second = road(road_id="2", plan=plan, length="100", sections=section(left=mirrored))
    first = linked("1", 0.0, link("successor", 2, "end"), sections=section(right=RIGHT))
    found = read(tmp_path, first, second, road_id="1,2")
    assert found.length == pytest.approx(200.0)
    x, y = found.to_world([50.0, 150.0], found.lane_centres[0])
    np.testing.assert_allclose(x, [50.0, 150.0], atol=1e-9)
    np.testing.assert_allclose(y, -6.5, atol=1e-9)


@pytest.mark.parametrize(
    ("ids", "reason"),
    [
        ("1,3", "expected a link to road 3 without a junction, got one to road 2"),
        ("3,1", "expected a link to road 1 without a junction, got none"),
        ("1,9", "road 9: expected exactly one"),
        ("1,4", "only 1"),
    ],
)
def test_a_route_that_is_none_is_refused(tmp_path: Path, ids: str, reason: str):
    chain = CHAIN
    if ids == "1,4":
        fourth = linked("4", 100.0, "", sections=section(right=ONE_LANE))
        chain = (linked("1", 0.0, link("successor", 4, "start")), *CHAIN[1:], fourth)
    with pytest.raises(ImportFormatError, match=reason):
        read(tmp_path, *chain, road_id=ids)


def test_roads_that_do_not_meet_are_no_route(tmp_path: Path):
    apart = linked("2", 101.0, "")
    with pytest.raises(ImportFormatError, match=r"does not join: expected at most 0\.05 m"):
        read(tmp_path, CHAIN[0], apart, road_id="1,2")
