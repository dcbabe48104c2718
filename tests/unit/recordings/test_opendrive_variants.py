"""OpenDRIVE as different exporters write it: kinks, empty parts, units, single sides."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest
from scenariogeneration import xodr

from overtaking.core.errors import ImportFormatError
from overtaking.core.units import mps_from_kmh
from overtaking.model.road import Road, RoadMark
from overtaking.recordings.limits import NO_LIMIT
from overtaking.recordings.opendrive import read_opendrive
from overtaking.recordings.opendrive_map import list_opendrive_roads

from .opendrive_text import ONE_LANE, document, lane, road, section

THREE_LANES = (lane(-1), lane(-2), lane(-3, mark="solid"))


def read(folder: Path, text: str, **options) -> Road:
    path = folder / "map.xodr"
    path.write_text(document(text), encoding="utf-8")
    return read_opendrive(path, **options)


def bent_line(kink: float, *, shape: str = "<line/>", gap: float = 0.0) -> str:
    """250 m along x, then 250 m that turn by `kink`, `gap` metres beside the end of the first."""
    return (
        '<geometry s="0" x="0" y="0" hdg="0" length="250"><line/></geometry>'
        f'<geometry s="250" x="250" y="{gap}" hdg="{kink}" length="250">{shape}</geometry>'
    )


SHAPES = ("<line/>", '<arc curvature="0.0001"/>', '<spiral curvStart="0" curvEnd="0.0001"/>')


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("kink", "gap"), [(0.004, 0.0), (-0.009, 0.0), (0.0, 0.03)])
def test_a_small_kink_or_gap_is_a_joint_before_every_shape(tmp_path, shape, kink, gap):
    found = read(tmp_path, road(plan=bent_line(kink, shape=shape, gap=gap)))
    assert found.length == 500.0
    assert found.heading_at([100.0]) == pytest.approx([0.0])
    # Just behind the joint the road lies and points as the second geometry states.
    assert found.heading_at([250.01]) == pytest.approx([kink], abs=1e-4)
    assert found.to_world([250.01], [0.0])[1] == pytest.approx([gap], abs=1e-3)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_large_kink_is_refused_before_every_shape(tmp_path, shape):
    with pytest.raises(ImportFormatError, match=r"does not join: expected .* rad.*0\.2000 rad"):
        read(tmp_path, road(plan=bent_line(0.2, shape=shape)))


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("kink", [0.02, -0.06, 0.0999])
def test_a_corner_is_rounded_before_every_shape(tmp_path, shape, kink):
    found = read(tmp_path, road(plan=bent_line(kink, shape=shape)))
    assert found.length == pytest.approx(500.0, abs=0.02)
    heading = found.heading_at(np.linspace(0.0, 300.0, 30_001))
    assert np.abs(np.diff(heading)).max() < 2e-3  # No corner is left, a centimetre apart.
    assert heading[-1] == pytest.approx(kink, abs=0.01)
    _, beside = found.to_road([250.0], [0.0])
    assert 0.01 < abs(beside[0]) <= 0.101
    # Away from the corner the road lies on the lines of the file.
    assert found.to_road([200.0], [0.0])[1] == pytest.approx([0.0], abs=1e-6)


@pytest.mark.parametrize("length", ["0", "0.0", "1e-12"])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_geometry_of_no_length_is_skipped(tmp_path, length, place):
    pieces = [
        '<geometry s="0" x="0" y="0" hdg="0" length="250"><line/></geometry>',
        '<geometry s="250" x="250" y="0" hdg="0" length="250"><line/></geometry>',
    ]
    station = (0, 250, 500)[place]
    pieces.insert(place, f'<geometry s="{station}" x="{station}" y="0" hdg="2" length="{length}"/>')
    found = read(tmp_path, road(plan="".join(pieces)))
    assert found.length == 500.0
    assert not found.is_curved


def test_a_road_of_nothing_but_empty_geometries_is_refused(tmp_path):
    empty = '<geometry s="0" x="0" y="0" hdg="0" length="0"><line/></geometry>'
    with pytest.raises(ImportFormatError, match="has no geometry"):
        read(tmp_path, road(plan=empty))


NOTHING = '<width sOffset="0" a="0" b="0" c="0" d="0"/>'


@pytest.mark.parametrize(
    ("lanes", "ids"),
    [
        ((lane(-1), lane(-2), lane(-3, width=0.0)), [-2, -1]),
        ((lane(-1), lane(-2, width=NOTHING + NOTHING), lane(-3)), [-3, -1]),
        ((lane(-1, width=1e-4), lane(-2), lane(-3)), [-3, -2]),
        ((lane(-1), lane(-2, kind="none", width=0.0), lane(-3)), [-3, -1]),
    ],
)
def test_a_lane_of_no_width_is_left_out(tmp_path, lanes, ids):
    path = tmp_path / "map.xodr"
    path.write_text(document(road(sections=section(right=lanes))), encoding="utf-8")
    found = read_opendrive(path)
    assert [one.lane_id for one in found.lanes] == ids
    assert [one.width for one in found.lanes] == [3.5, 3.5]
    (mapped,) = list_opendrive_roads(path)
    assert mapped.right == 2


def test_a_lane_that_has_tapered_to_nothing_leaves_its_outer_line(tmp_path):
    """A lane ends within a section: beyond it the road has two lanes up to its solid line."""
    tapering = (
        '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'
        '<width sOffset="100" a="3.5" b="-0.035" c="0" d="0"/>'
        '<width sOffset="200" a="0" b="0" c="0" d="0"/>'
    )
    lanes = (lane(-1), lane(-2), lane(-3, width=tapering, mark="solid"))
    found = read(tmp_path, road(sections=section(right=lanes)))
    assert found.length == pytest.approx(300.0)
    assert [one.lane_id for one in found.lanes] == [-2, -1]
    assert found.lanes[0].right_mark is RoadMark.SOLID
    assert found.lanes[0].left_mark is RoadMark.BROKEN


def test_sections_of_no_length_change_nothing(tmp_path):
    three, two = section(right=THREE_LANES), section(s=250, right=THREE_LANES[:2])
    rest = section(s="250.0000001", right=THREE_LANES)
    assert read(tmp_path, road(sections=three + two + rest)).length == 500.0


def repeated(entry: str, count: int, name: str = "s") -> str:
    """Some entries that state the same, spread over 500 m."""
    return "".join(
        entry.replace(f'{name}="0"', f'{name}="{k * 500 / count}"') for k in range(count)
    )


WIDTH = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'
MARK = '<roadMark sOffset="0" type="broken"/>'
SPEED = '<speed sOffset="0" max="30"/>'
OFFSET = '<laneOffset s="0" a="0.5" b="0" c="0" d="0"/>'
ROLL = '<superelevation s="0" a="0.01" b="0" c="0" d="0"/>'
TYPE = '<type s="0" type="motorway"><speed max="30"/></type>'


def pieces_of_line(count: int) -> str:
    step = 500 / count
    return "".join(
        f'<geometry s="{k * step}" x="{k * step}" y="0" hdg="0" length="{step}">'
        f'<arc curvature="1e-6"/></geometry>'
        for k in range(count)
    )


LONG_ROADS = {
    "width": lambda n: road(
        sections=section(right=[lane(-1, width=repeated(WIDTH, n, "sOffset")), lane(-2)])
    ),
    "roadMark": lambda n: road(
        sections=section(right=[lane(-1, mark="", more=repeated(MARK, n, "sOffset"))])
    ),
    "speed": lambda n: road(sections=section(right=[lane(-1, more=repeated(SPEED, n, "sOffset"))])),
    "type": lambda n: road(kind=repeated(TYPE, n), sections=section(right=ONE_LANE)),
    "laneOffset": lambda n: road(offset=repeated(OFFSET, n), sections=section(right=ONE_LANE)),
    "superelevation": lambda n: road(lateral=repeated(ROLL, n), sections=section(right=ONE_LANE)),
    "elevation": lambda n: road(
        elevation="".join(
            f'<elevation s="{k * 500 / n}" a="{k * 10 / n}" b="0.02" c="0" d="0"/>'
            for k in range(n)
        ),
        sections=section(right=ONE_LANE),
    ),
    "geometry": lambda n: road(
        plan=pieces_of_line(n), offset=repeated(OFFSET, n), sections=section(right=ONE_LANE)
    ),
    "laneSection": lambda n: road(
        offset=repeated(OFFSET, n),
        sections="".join(section(s=k * 500 / n, right=ONE_LANE) for k in range(n)),
    ),
}


def count_calls(path: Path) -> int:
    """Number of Python function calls while a road is read: a cost that no clock disturbs."""
    count = 0

    def counted(frame, event, argument):
        nonlocal count
        del frame, argument
        count += event == "call"

    sys.setprofile(counted)
    try:
        read_opendrive(path)
    except ImportFormatError:
        pass
    finally:
        sys.setprofile(None)
    return count


@pytest.mark.parametrize("name", LONG_ROADS)
def test_the_work_grows_with_the_number_of_entries_and_not_with_its_square(tmp_path, name):
    few, many = tmp_path / "few.xodr", tmp_path / "many.xodr"
    few.write_text(document(LONG_ROADS[name](20)), encoding="utf-8")
    many.write_text(document(LONG_ROADS[name](80)), encoding="utf-8")
    assert count_calls(many) < 5 * count_calls(few)


@pytest.mark.parametrize(
    ("speed", "limit"),
    [
        ('max="no limit"', NO_LIMIT),
        ('max="No Limit" unit="km/h"', NO_LIMIT),
        ('max="undefined"', mps_from_kmh(120.0)),
        ('max="70" unit="mph"', 31.2928),
        ('max="100" unit="km/h"', mps_from_kmh(100.0)),
        ('max="100" unit="KM/H"', mps_from_kmh(100.0)),
        ('max="25"', 25.0),
    ],
)
def test_limits_are_read_in_every_unit_and_where_there_is_none(tmp_path, speed, limit):
    kind = f'<type s="0" type="motorway"><speed {speed}/></type>'
    found = read(tmp_path, road(kind=kind, sections=section(right=THREE_LANES)))
    assert found.speed_limit == pytest.approx(limit)
    of_lanes = [lane(k, more=f"<speed sOffset='0' {speed}/>") for k in (-1, -2)]
    kind = '<type s="0" type="motorway"/>'
    found = read(tmp_path, road(kind=kind, sections=section(right=of_lanes)))
    assert found.speed_limit == pytest.approx(limit)


def test_a_limit_that_no_road_has_is_refused_with_the_option_that_replaces_it(tmp_path):
    kind = '<type s="0" type="motorway"><speed max="130"/></type>'
    text = road(kind=kind, sections=section(right=THREE_LANES))
    with pytest.raises(ImportFormatError, match=r"130 m/s, as no unit is stated.*--speed-limit"):
        read(tmp_path, text)
    assert read(tmp_path, text, speed_limit=36.0).speed_limit == 36.0


LEFT_LANE = (lane(1, mark="solid"),)


def single(text: str) -> str:
    return text.replace("<laneSection", '<laneSection singleSide="true"')


def test_a_section_of_a_single_side_leaves_the_other_side_as_it_was(tmp_path):
    both = section(left=LEFT_LANE, right=THREE_LANES)
    right_again = single(section(s=250, right=THREE_LANES))
    text = road(sections=both + right_again)
    assert read(tmp_path, text).length == 500.0
    assert read(tmp_path, text).is_two_way
    assert read(tmp_path, text, lanes="left").length == 500.0
    fewer = single(section(s=200, right=THREE_LANES[:2]))
    found = read(tmp_path, road(sections=both + fewer))
    assert (found.length, found.num_lanes) == (300.0, 2)
    against = read(tmp_path, road(sections=both + fewer), lanes="left")
    assert (against.length, against.num_lanes) == (500.0, 1)


def test_each_side_may_have_sections_of_its_own_from_the_beginning(tmp_path):
    text = road(sections=single(section(left=LEFT_LANE)) + single(section(right=THREE_LANES)))
    found = read(tmp_path, text)
    assert (found.length, found.num_lanes, found.is_two_way) == (500.0, 3, True)


@pytest.mark.parametrize("header", ['junction=""', 'junction="-1"', 'junction=" "', ""])
def test_a_road_without_a_junction_is_outside_junctions(tmp_path, header):
    path = tmp_path / "map.xodr"
    path.write_text(document(road(header=header)), encoding="utf-8")
    (mapped,) = list_opendrive_roads(path)
    assert not mapped.in_junction
    assert mapped.road is not None


def test_a_polyline_of_scenariogeneration_is_read(tmp_path):
    """Another program joins lines with small kinks; the length is the sum of the lines."""
    plan = xodr.PlanView(0.0, 0.0, 0.0)
    x, y, heading = 0.0, 0.0, 0.0
    for _ in range(10):
        plan.add_fixed_geometry(xodr.Line(40.0), x, y, heading)
        x, y = x + 40.0 * math.cos(heading), y + 40.0 * math.sin(heading)
        heading += 0.006
    plan.adjust_geometries()
    lanes = xodr.LaneSection(0.0, xodr.standard_lane())
    for _ in range(2):
        lanes.add_right_lane(xodr.standard_lane())
    sections = xodr.Lanes()
    sections.add_lanesection(lanes)
    made = xodr.OpenDrive("map")
    made.add_road(xodr.Road(1, plan, sections, road_type=-1))
    path = tmp_path / "map.xodr"
    made.write_xml(str(path))
    found = read_opendrive(path)
    assert found.length == pytest.approx(400.0)
    end_x, end_y = found.to_world([400.0], [0.0])
    assert (end_x[0], end_y[0]) == pytest.approx((x, y), abs=1e-6)


def test_a_missing_offset_is_that_of_the_beginning(tmp_path):
    bare = '<width a="3.5" b="0" c="0" d="0"/>'
    found = read(tmp_path, road(sections=section(right=[lane(-1, width=bare), lane(-2)])))
    assert [each.width for each in found.lanes] == [3.5, 3.5]


def test_a_cubic_by_abscissa_is_followed(tmp_path):
    """The line is 500 m long and its points have the offsets of the polynomial."""
    shape = '<poly3 a="0" b="0" c="2e-4" d="-1e-7"/>'
    plan = f'<geometry s="0" x="5" y="-3" hdg="0" length="500">{shape}</geometry>'
    found = read(tmp_path, road(plan=plan))
    assert found.length == pytest.approx(500.0, abs=0.01)
    x, y = found.to_world(np.linspace(0.0, found.length, 11), 0.0)
    ahead = x - 5.0
    assert y + 3.0 == pytest.approx(2e-4 * ahead**2 - 1e-7 * ahead**3, abs=2e-3)
