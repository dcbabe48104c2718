"""The paper's road against the paper, CARLA and the map file; other maps against their own text.

`town06` is stated as facts. Here they meet frame 70 of the paper (its only printed row), the
positions that `carla.Map` 0.9.16 gives for Town06, road 40, and, where the maps of others lie
beside the checkout, the map file itself as our reader and as the standard library's XML parser
see it.
"""

import math
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.integrate import simpson

from overtaking.core.errors import ConfigError, ImportFormatError
from overtaking.core.units import kmh_from_mps
from overtaking.model.road import DrivingSide, Road, RoadMark
from overtaking.recordings.opendrive import survey_opendrive
from overtaking.recordings.roads import load_road

CENTIMETRE = 0.01


@pytest.fixture(scope="module")
def maps(shared_data: Path) -> Path:
    return shared_data / "opendrive"


# ---- the paper ----


def test_town06_is_the_road_of_the_papers_frame_70():
    """Frame 70: ego at (351.35, 251.58) in lane -7, RT Solid, LT Broken, 3.5, 0.5, 3.5 m, 90 km/h.

    CARLA's y is the negative of OpenDRIVE's.
    """
    road = load_road("town06")
    carla = np.array([(351.35, 251.58), (355.82, 251.68), (318.8, 251.61)])
    s, d = road.road_coordinates(carla[:, 0], -carla[:, 1])
    assert [road.lanes[index].lane_id for index in road.lane_index(d)] == [-7, -7, -7]
    assert s[1] > s[0] > s[2]  # Travel is towards growing x.
    lane, left, right = road.lanes[0], road.lanes[1], road.slow_side_neighbour
    assert (lane.right_mark, lane.left_mark) == (RoadMark.SOLID, RoadMark.BROKEN)
    assert right is not None
    assert (lane.width, right.width, left.width) == (3.5, 0.5, 3.5)
    assert kmh_from_mps(road.speed_limit) == pytest.approx(90.0)


def test_town06_covers_the_stretch_on_which_the_paper_starts_its_vehicles():
    """Starts at x 320 to 450 m; lanes described as 4 m bins of y from 238 to 258 m.

    The five lanes of 3.5 m fill the first four bins and one before them; the fifth bin of the
    paper, where the ego never starts, lies on the shoulder.
    """
    road = load_road("town06")
    s, _ = road.road_coordinates(np.array([320.0, 450.0]), np.full(2, -245.0))
    assert np.all((s > 0.0) & (s < road.length))
    _, y = road.world(s[:, None], road.centres)
    bins = (-y - 238.0) // 4.0
    assert bins.tolist() == [[3.0, 2.0, 1.0, 0.0, -1.0]] * 2


# ---- CARLA ----

WAYPOINTS = {  # Station: x and y of the lanes -7 to -3, from carla.Map.get_waypoint_xodr(40, ...).
    0.01: (
        [128.5258, 128.5270, 128.5282, 128.5294, 128.5306],
        [251.5695, 248.0695, 244.5695, 241.0695, 237.5695],
    ),
    222.49: (
        [351.0058, 351.0070, 351.0082, 351.0094, 351.0106],
        [251.6454, 248.1454, 244.6454, 241.1454, 237.6454],
    ),
    470.5: (
        [599.0158, 599.0170, 599.0182, 599.0193, 599.0206],
        [251.7300, 248.2300, 244.7300, 241.2300, 237.7300],
    ),
}


@pytest.mark.parametrize("station", WAYPOINTS)
def test_town06_lies_where_carla_puts_it(station: float):
    """Waypoints of the Python package carla 0.9.16 on its map Town06; CARLA's y is negated."""
    road = load_road("town06")
    x, y = road.world(station, road.centres)
    carla_x, carla_y = WAYPOINTS[station]
    np.testing.assert_allclose(x, carla_x, rtol=0.0, atol=CENTIMETRE / 10.0)
    np.testing.assert_allclose(-y, carla_y, rtol=0.0, atol=CENTIMETRE / 10.0)
    # carla's yaw is clockwise and in degrees.
    assert -math.degrees(road.heading) == pytest.approx(0.019545903429389, abs=1e-5)


@pytest.mark.parametrize(
    ("road_id", "lane_id", "x", "y", "yaw_deg", "right", "left"),
    [
        (6, 3, 657.777222, 170.502609, 270.62139892578125, "Broken", "Solid"),
        (23, 5, -25.901253, 135.579056, 180.13438415527344, "Solid", "Broken"),
    ],
)
def test_roads_against_the_reference_line_lie_where_carla_puts_them(
    maps: Path, road_id: int, lane_id: int, x, y, yaw_deg, right: str, left: str
):
    """Lanes with positive ids, at the file's station 2 m: waypoints of carla 0.9.16 as above."""
    road = load_road(maps / "Town06.xodr", road_id)
    index = [lane.lane_id for lane in road.lanes].index(lane_id)
    found = road.world(road.length - 2.0, road.centres[index])
    np.testing.assert_allclose(found, (x, -y), rtol=0.0, atol=CENTIMETRE / 10.0)
    turn = math.remainder(road.heading + math.radians(yaw_deg), math.tau)
    assert turn == pytest.approx(0.0, abs=1e-6)
    lane = road.lanes[index]
    assert (lane.right_mark, lane.left_mark) == (RoadMark(right), RoadMark(left))


# ---- the map file ----


def test_the_map_file_agrees_with_town06(maps: Path):
    """Lanes, widths, marks, handedness, and each lane centre to 1 cm at ten stations."""
    facts, read = load_road("town06"), load_road(maps / "Town06.xodr", 40)
    assert read.lanes == facts.lanes
    assert [lane.lane_id for lane in read.lanes] == [-7, -6, -5, -4, -3]
    assert read.driving_side is facts.driving_side is DrivingSide.RIGHT
    assert read.side == facts.side == 1.0
    for mine, theirs in (
        (facts.slow_side_neighbour, read.slow_side_neighbour),
        (facts.fast_side_neighbour, read.fast_side_neighbour),
    ):
        assert mine is not None
        assert theirs is not None
        assert (mine.lane_id, mine.kind, mine.width) == (theirs.lane_id, "shoulder", theirs.width)
        assert (mine.left_mark, mine.right_mark) == (theirs.left_mark, theirs.right_mark)
    stations = np.linspace(0.0, facts.length, 10)[:, None]
    x, y = facts.world(stations, facts.centres)
    read_x, read_y = read.world(stations, read.centres)
    assert y.shape == (10, 5)
    np.testing.assert_allclose(read_y, y, rtol=0.0, atol=CENTIMETRE)
    np.testing.assert_allclose(read_x, x, rtol=0.0, atol=CENTIMETRE)
    # Half a centimetre over the whole length.
    assert read.heading == pytest.approx(facts.heading, abs=CENTIMETRE / 2.0 / facts.length)
    assert read.length == pytest.approx(facts.length, abs=CENTIMETRE)


def test_left_is_left_in_the_map_file_too(maps: Path):
    """A step to the left of travel has a larger y in OpenDRIVE where travel is towards +x."""
    for road in (load_road("town06"), load_road(maps / "Town06.xodr", "40")):
        (x0, x1), (y0, y1) = road.world(np.array([0.0, 100.0]), np.array([0.0, 0.0]))
        _, left = road.world(0.0, 1.0)
        assert x1 > x0
        assert abs(y1 - y0) < 0.1
        assert left > y0


def test_the_map_file_posts_its_own_limit(maps: Path):
    """65 mph and "town", where the paper records 90 km/h: a caller can say so."""
    read = load_road(maps / "Town06.xodr", 40)
    assert (read.kind, read.speed_limit) == ("town", pytest.approx(65 * 0.44704))
    assert load_road(maps / "Town06.xodr", 40, speed_limit=25.0).speed_limit == 25.0


# ---- other maps, against an independent reading of their text ----

ACCEPTED = {
    "Town04.xodr": [0, 1, *range(5, 11), 12, 13, 14, 16, 17, 18, *range(20, 23), *range(26, 35),
                    *range(38, 42), *range(44, 48), *range(50, 53)],
    "Town06.xodr": [*range(7), *range(8, 13), *range(16, 21), *range(23, 28), *range(30, 48), 49,
                    51, 53, 54, *range(56, 72)],
    "esmini_straight_500m.xodr": [1],
    "esmini_curve_r100.xodr": [0],
    "esmini_e6mini.xodr": [0],
    "esmini_two_plus_one.xodr": [],
}  # fmt: skip


@cache
def survey(path: Path) -> dict[str, Road | ImportFormatError]:
    return survey_opendrive(path)


@cache
def texts(path: Path) -> dict[str, ET.Element]:
    return {road.attrib["id"]: road for road in ET.parse(path).getroot().iter("road")}


@pytest.mark.parametrize("name", ACCEPTED)
def test_the_roads_of_each_map_load_or_are_refused_as_stated(maps: Path, name: str):
    verdicts = survey(maps / name)
    assert list(verdicts) == list(texts(maps / name))
    loaded = [int(key) for key, verdict in verdicts.items() if isinstance(verdict, Road)]
    assert sorted(loaded) == ACCEPTED[name]


def expected_reasons(road: ET.Element) -> tuple[str, ...]:
    """What the text of a road allows a refusal to say."""
    if road.attrib["junction"] != "-1":
        return ("belongs to a junction",)
    offsets = {entry.attrib["a"] for entry in road.iterfind("lanes/laneOffset")}
    coefficients = {
        float(entry.attrib[key]) for entry in road.iterfind("lanes/laneOffset") for key in "bcd"
    }
    if len(offsets) > 1 or coefficients - {0.0}:
        return ("<laneOffset> varies after",)
    return ("<roadMark> of lane",)


@pytest.mark.parametrize("name", ACCEPTED)
def test_each_refusal_names_the_road_and_the_reason(maps: Path, name: str):
    for road_id, verdict in survey(maps / name).items():
        if isinstance(verdict, Road):
            continue
        message = str(verdict)
        assert message.startswith(f"{name}: road {road_id}: line ")
        reasons = expected_reasons(texts(maps / name)[road_id])
        assert any(reason in message for reason in reasons), message


def test_refusals_of_the_two_towns_are_counted(maps: Path):
    """Most roads of a town are pieces of junctions; a few change their marks on the way."""
    counts = {}
    for name in ("Town04.xodr", "Town06.xodr"):
        messages = [str(one) for one in survey(maps / name).values() if not isinstance(one, Road)]
        counts[name] = [
            sum(reason in message for message in messages)
            for reason in ("a junction", "laneOffset", "roadMark")
        ]
    assert counts == {"Town04.xodr": [223, 0, 16], "Town06.xodr": [128, 6, 6]}


def lane_centres(road: ET.Element) -> dict[int, tuple[float, float]]:
    """t and width of each lane of the first section, from the text alone."""
    offset = road.find("lanes/laneOffset")
    section = road.find("lanes/laneSection")
    assert section is not None
    centres = {}
    for side, sign in (("right", -1), ("left", 1)):
        t = 0.0 if offset is None else float(offset.attrib["a"])
        lanes = section.findall(f"{side}/lane")
        for lane in sorted(lanes, key=lambda lane: abs(int(lane.attrib["id"]))):
            width = lane.find("width")
            assert width is not None
            size = float(width.attrib["a"])
            centres[int(lane.attrib["id"])] = (t + sign * size / 2.0, size)
            t += sign * size
    return centres


def placed(road: ET.Element, station: float, t: float) -> tuple[float, float]:
    """The point at a station and t to the left of the reference line, from the text alone.

    OpenDRIVE 1.8, 9: the curvature of a line is 0, of an arc constant; the place is the integral
    of the direction, here by Simpson's rule. A paramPoly3 is evaluated as it is written.
    """
    pieces = road.findall("planView/geometry")
    piece = [one for one in pieces if float(one.attrib["s"]) <= station][-1]
    at = {key: float(value) for key, value in piece.attrib.items()}
    shape, ahead = piece[0], station - at["s"]
    if shape.tag == "paramPoly3":
        assert shape.attrib["pRange"] == "arcLength"
        u, v = (Polynomial([float(shape.attrib[key + axis]) for key in "abcd"]) for axis in "UV")
        along, left = float(u(ahead)), float(v(ahead))
        heading = math.atan2(v.deriv()(ahead), u.deriv()(ahead))
    else:
        assert shape.tag in {"line", "arc"}
        turned = float(shape.get("curvature", "0")) * np.linspace(0.0, ahead, 2001)
        step = ahead / 2000
        along, left = (
            float(simpson(np.cos(turned), dx=step)),
            float(simpson(np.sin(turned), dx=step)),
        )
        heading = float(turned[-1])
    east, north = math.cos(at["hdg"]), math.sin(at["hdg"])
    heading += at["hdg"]
    return (
        at["x"] + along * east - left * north - t * math.sin(heading),
        at["y"] + along * north + left * east + t * math.cos(heading),
    )


@pytest.mark.parametrize(
    ("name", "road_id"),
    [(name, str(road_id)) for name, ids in ACCEPTED.items() for road_id in ids],
)
def test_every_accepted_road_lies_where_its_text_says(maps: Path, name: str, road_id: str):
    """Ten stations of every lane, also where the road bends and where traffic runs backwards."""
    road, text = survey(maps / name)[road_id], texts(maps / name)[road_id]
    assert isinstance(road, Road)
    by_text = lane_centres(text)
    length = float(text.attrib["length"])
    for lane, centre in zip(road.lanes, road.centres, strict=True):
        t, width = by_text[lane.lane_id]
        assert lane.width == pytest.approx(width, abs=1e-9)
        for station in np.linspace(0.0, length, 10):
            s = length - station if lane.lane_id > 0 else station
            found = np.array(road.world(s, centre)).ravel()
            np.testing.assert_allclose(found, placed(text, station, t), rtol=0.0, atol=CENTIMETRE)


# ---- by name or by file ----


def test_a_road_is_loaded_by_name_or_by_file(maps: Path):
    assert load_road("motorway").name == "motorway"
    assert load_road(str(maps / "esmini_straight_500m.xodr")).name == "esmini_straight_500m road 1"
    with pytest.raises(ImportFormatError, match=r"Town06\.xodr: road 4000: expected exactly one"):
        load_road(maps / "Town06.xodr", 4000)


def test_what_is_neither_a_name_nor_a_file_is_refused():
    with pytest.raises(
        ConfigError, match="expected town06 or motorway or rural or an OpenDRIVE file"
    ):
        load_road("town6")
    with pytest.raises(ConfigError, match="expected its name alone"):
        load_road("town06", 40)
    with pytest.raises(ImportFormatError, match="No such file"):
        load_road("missing.xodr", 40)
