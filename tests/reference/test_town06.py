"""The paper's road against the paper, CARLA and the map file; other maps against their text.

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
from overtaking.recordings.opendrive_map import MappedRoad, list_opendrive_roads
from overtaking.recordings.roads import load_road

pytestmark = pytest.mark.ci

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
    s, d = road.to_road(carla[:, 0], -carla[:, 1])
    assert [road.lanes[index].lane_id for index in road.lane_index(d)] == [-7, -7, -7]
    assert s[1] > s[0] > s[2]  # Travel is towards growing x.
    lane, left, right = road.lanes[0], road.lanes[1], road.kerb_side_neighbour
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
    s, _ = road.to_road(np.array([320.0, 450.0]), np.full(2, -245.0))
    assert np.all((s > 0.0) & (s < road.length))
    _, y = road.to_world(s[:, None], road.lane_centres)
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
def test_the_lanes_of_town06_have_the_positions_of_carla(station: float):
    """Waypoints of the Python package carla 0.9.16 on its map Town06; CARLA's y is negated."""
    road = load_road("town06")
    x, y = road.to_world(station, road.lane_centres)
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
def test_roads_against_the_reference_line_have_the_positions_of_carla(
    maps: Path, road_id: int, lane_id: int, x, y, yaw_deg, right: str, left: str
):
    """Lanes with positive ids, at the file's station 2 m: waypoints of carla 0.9.16 as above."""
    road = load_road(maps / "Town06.xodr", road_id)
    index = [lane.lane_id for lane in road.lanes].index(lane_id)
    position = road.to_world(road.length - 2.0, road.lane_centres[index])
    np.testing.assert_allclose(position, (x, -y), rtol=0.0, atol=CENTIMETRE / 10.0)
    heading_error = math.remainder(road.heading + math.radians(yaw_deg), math.tau)
    assert heading_error == pytest.approx(0.0, abs=1e-6)
    lane = road.lanes[index]
    assert (lane.right_mark, lane.left_mark) == (RoadMark(right), RoadMark(left))


# ---- the map file ----


def test_the_map_file_agrees_with_town06(maps: Path):
    """Lanes, widths, marks, handedness, and each lane centre to 1 cm at ten stations."""
    named_road, mapped_road = load_road("town06"), load_road(maps / "Town06.xodr", 40)
    assert mapped_road.lanes == named_road.lanes
    assert [lane.lane_id for lane in mapped_road.lanes] == [-7, -6, -5, -4, -3]
    assert mapped_road.driving_side is named_road.driving_side is DrivingSide.RIGHT
    assert mapped_road.overtaking_sign == named_road.overtaking_sign == 1.0
    for known_shoulder, mapped_shoulder in (
        (named_road.kerb_side_neighbour, mapped_road.kerb_side_neighbour),
        (named_road.overtaking_side_neighbour, mapped_road.overtaking_side_neighbour),
    ):
        assert known_shoulder is not None
        assert mapped_shoulder is not None
        assert (known_shoulder.lane_id, known_shoulder.kind, known_shoulder.width) == (
            mapped_shoulder.lane_id,
            "shoulder",
            mapped_shoulder.width,
        )
        assert (known_shoulder.left_mark, known_shoulder.right_mark) == (
            mapped_shoulder.left_mark,
            mapped_shoulder.right_mark,
        )
    stations = np.linspace(0.0, named_road.length, 10)[:, None]
    x, y = named_road.to_world(stations, named_road.lane_centres)
    mapped_x, mapped_y = mapped_road.to_world(stations, mapped_road.lane_centres)
    assert y.shape == (10, 5)
    np.testing.assert_allclose(mapped_y, y, rtol=0.0, atol=CENTIMETRE)
    np.testing.assert_allclose(mapped_x, x, rtol=0.0, atol=CENTIMETRE)
    # Half a centimetre over the whole length.
    assert mapped_road.heading == pytest.approx(
        named_road.heading, abs=CENTIMETRE / 2.0 / named_road.length
    )
    assert mapped_road.length == pytest.approx(named_road.length, abs=CENTIMETRE)


def test_positive_lateral_offsets_are_on_the_left_in_the_map_file(maps: Path):
    """A step to the left of travel has a larger y in OpenDRIVE where travel is towards +x."""
    for road in (load_road("town06"), load_road(maps / "Town06.xodr", "40")):
        (x0, x1), (y0, y1) = road.to_world(np.array([0.0, 100.0]), np.array([0.0, 0.0]))
        _, left = road.to_world(0.0, 1.0)
        assert x1 > x0
        assert abs(y1 - y0) < 0.1
        assert left > y0


def test_the_map_file_has_its_own_speed_limit(maps: Path):
    """65 mph and "town"; the paper records 90 km/h, which a caller can set."""
    mapped_road = load_road(maps / "Town06.xodr", 40)
    assert (mapped_road.kind, mapped_road.speed_limit) == ("town", pytest.approx(65 * 0.44704))
    assert load_road(maps / "Town06.xodr", 40, speed_limit=25.0).speed_limit == 25.0


# ---- other maps, against an independent reading of their text ----

MAPS = (
    "Town04.xodr", "Town06.xodr", "esmini_straight_500m.xodr", "esmini_curve_r100.xodr",
    "esmini_e6mini.xodr", "esmini_two_plus_one.xodr", "esmini_crest-curve.xodr",
    "esmini_curves_elevation.xodr",
)  # fmt: skip
CURVATURES = ("curvStart", "curvEnd")
STEP = 0.5  # Distance between the stations at which the tests read the text [m].


@cache
def survey(path: Path) -> dict[str, Road | ImportFormatError]:
    return survey_opendrive(path)


@cache
def mapped_roads_of(path: Path) -> list[MappedRoad]:
    return list_opendrive_roads(path)


@cache
def road_elements(path: Path) -> dict[str, ET.Element]:
    return {road.attrib["id"]: road for road in ET.parse(path).getroot().iter("road")}


def entry_at(entries: list[ET.Element], station: float, name: str = "s") -> ET.Element | None:
    """The last entry at a station or before it."""
    entries_before = [entry for entry in entries if float(entry.get(name, "0")) <= station]
    return entries_before[-1] if entries_before else None


def polynomial(entries: list[ET.Element], station: float, name: str = "s") -> float:
    entry = entry_at(entries, station, name)
    if entry is None:
        return 0.0
    offset = station - float(entry.attrib[name])
    return sum(float(entry.attrib[key]) * offset**power for power, key in enumerate("abcd"))


def mark_at(lane: ET.Element | None, offset: float) -> str:
    entry = None if lane is None else entry_at(lane.findall("roadMark"), offset, "sOffset")
    return "none" if entry is None else entry.attrib["type"]


def lanes_of_side(
    road: ET.Element, station: float, sign: int
) -> list[tuple[str, float, float, str]]:
    """Type, id, middle as t, width, and outer mark of the lanes of one side, from the text."""
    section = entry_at(road.findall("lanes/laneSection"), station)
    assert section is not None
    offset = station - float(section.attrib["s"])
    t = polynomial(road.findall("lanes/laneOffset"), station)
    lanes = []
    side = "right" if sign < 0 else "left"
    for lane in sorted(
        section.findall(f"{side}/lane"), key=lambda lane: abs(int(lane.attrib["id"]))
    ):
        width = polynomial(lane.findall("width"), offset, "sOffset")
        lanes.append((lane.attrib["type"], t + sign * width / 2.0, width, mark_at(lane, offset)))
        t += sign * width
    return lanes


def appearance_at(road: ET.Element, station: float, sign: int) -> tuple[tuple, list[float]] | None:
    """Words that stay the same along a stretch, and widths that may differ by millimetres.

    None where the driving lanes have a width outside the range of the model.
    """
    lanes = lanes_of_side(road, station, sign)
    driving = [k for k, entry in enumerate(lanes) if entry[0] == "driving"]
    if not driving or not all(2.0 <= lanes[k][2] <= 6.0 for k in driving):
        return None
    section = entry_at(road.findall("lanes/laneSection"), station)
    assert section is not None
    offset = station - float(section.attrib["s"])
    centre = mark_at(section.find("center/lane"), offset)
    first, last = driving[0], driving[-1]
    inner_lanes = [entry for entry in lanes[:first] if entry[2] > 0.005]
    outer_lanes = [entry for entry in lanes[last + 1 :] if entry[2] > 0.005]
    lanes_across = [entry for entry in lanes_of_side(road, station, -sign) if entry[2] > 0.005]
    inner_neighbour = (
        inner_lanes[-1][0]
        if inner_lanes
        else f"across {lanes_across[0][0]}"
        if lanes_across
        else "nothing"
    )
    two_way = inner_neighbour == "across driving"
    line = lanes[first - 1][3] if first else centre
    words = (
        len(driving), inner_neighbour, outer_lanes[0][0] if outer_lanes else "",
        None if two_way else line,
        tuple(entry[3] for entry in lanes[first : last + 1]),
    )  # fmt: skip
    numbers = [entry[2] for entry in lanes[first : last + 1]]
    return words, numbers + ([lanes_across[0][2]] if two_way else [])


@cache
def longest_stretch(path: Path, road_id: str) -> tuple[int, float, float]:
    """Side as a sign, first and last station of the longest stretch of equal appearance."""
    road = road_elements(path)[road_id]
    length = float(road.attrib["length"])
    stations = np.append(np.arange(0.001, length, STEP), length - 0.001)
    sign = -1 if road.find("lanes/laneSection/right/lane[@type='driving']") is not None else 1
    best, start, previous = (0.0, 0.0), stations[0], None
    for k, station in enumerate(stations):
        appearance = appearance_at(road, station, sign)
        is_same = (
            appearance is not None
            and previous is not None
            and appearance[0] == previous[0]
            and np.allclose(appearance[1], previous[1], rtol=0.0, atol=0.006)
        )
        if not is_same:
            start, previous = station, appearance
        if appearance is not None and station - start > best[1] - best[0]:
            best = (start, stations[k])
    return sign, best[0], best[1]


REFUSED = {
    ("Town04.xodr", "25"): "expected bends of at least 10 m radius, got 9.56 m",
    ("Town06.xodr", "7"): "<width> of lane -3 varies after s = 0.0 m",
    ("Town06.xodr", "15"): "<width> of lane -3 varies after s = 0.0 m",
}
"""Roads outside junctions that the reader refuses: a too sharp bend, and tapers all along."""


@pytest.mark.parametrize("name", MAPS)
def test_every_road_is_read_or_refused_with_the_reason(maps: Path, name: str):
    verdicts = survey(maps / name)
    assert list(verdicts) == list(road_elements(maps / name))
    for road_id, verdict in verdicts.items():
        in_junction = road_elements(maps / name)[road_id].attrib["junction"] != "-1"
        reason = "belongs to a junction" if in_junction else REFUSED.get((name, road_id))
        assert isinstance(verdict, Road) == (reason is None), str(verdict)
        if reason is not None:
            assert str(verdict).startswith(f"{name}: road {road_id}: line ")
            assert reason in str(verdict)


def test_the_numbers_of_roads_that_the_reader_accepts(maps: Path):
    """Roads in all, those outside junctions, those that are read, and those read from end to end.

    Before parts of roads were read, 37 of Town04 were, 60 of Town06, and none of `two_plus_one`.
    """
    counts = {}
    for name in MAPS:
        mapped_roads = mapped_roads_of(maps / name)
        parts = [road.part for road in mapped_roads if road.part is not None]
        num_outside = sum(not road.in_junction for road in mapped_roads)
        counts[name] = (
            len(mapped_roads),
            num_outside,
            len(parts),
            sum(part.is_whole for part in parts),
        )
    single_roads = dict.fromkeys(MAPS, (1, 1, 1, 1))
    assert counts == single_roads | {
        "Town04.xodr": (276, 53, 52, 41),
        "Town06.xodr": (200, 72, 70, 60),
        "esmini_two_plus_one.xodr": (1, 1, 1, 0),
    }


@pytest.mark.parametrize("name", MAPS)
def test_the_reader_takes_the_longest_stretch_of_equal_appearance_of_each_road(
    maps: Path, name: str
):
    for road in mapped_roads_of(maps / name):
        if road.in_junction or REFUSED.get((name, road.road_id), "").startswith("expected"):
            continue
        _, start, end = longest_stretch(maps / name, road.road_id)
        if road.part is None:
            # Where a taper begins or ends, the width changes by millimetres only.
            assert end - start < 10.0, road.road_id
            continue
        expected_length = end - start
        part_length = road.part.end - road.part.start
        # The appearance may change between two stations of the text.
        assert part_length == pytest.approx(expected_length, abs=2.0 * STEP), road.road_id
        assert road.part.is_whole == (part_length > road.length - 0.01)


def world_position(road: ET.Element, station: float, t: float) -> tuple[float, float]:
    """The point at a station and t to the left of the reference line, from the text alone.

    OpenDRIVE 1.8, 9: the curvature of a line is 0, of an arc constant; the position is the
    integral of the direction, here by Simpson's rule. A paramPoly3 is evaluated as it is written.
    """
    pieces = road.findall("planView/geometry")
    piece = [entry for entry in pieces if float(entry.attrib["s"]) <= station][-1]
    attributes = {key: float(value) for key, value in piece.attrib.items()}
    shape, offset = piece[0], station - attributes["s"]
    if shape.tag == "paramPoly3":
        assert shape.attrib["pRange"] == "arcLength"
        u, v = (Polynomial([float(shape.attrib[key + axis]) for key in "abcd"]) for axis in "UV")
        along, left = float(u(offset)), float(v(offset))
        heading = math.atan2(v.deriv()(offset), u.deriv()(offset))
    else:
        begin, end = (float(shape.get(key, shape.get("curvature", "0"))) for key in CURVATURES)
        distances = np.linspace(0.0, offset, 2001)
        directions = begin * distances + 0.5 * (end - begin) / attributes["length"] * distances**2
        step = offset / 2000
        along, left = (
            float(simpson(np.cos(directions), dx=step)),
            float(simpson(np.sin(directions), dx=step)),
        )
        heading = float(directions[-1])
    east, north = math.cos(attributes["hdg"]), math.sin(attributes["hdg"])
    heading += attributes["hdg"]
    return (
        attributes["x"] + along * east - left * north - t * math.sin(heading),
        attributes["y"] + along * north + left * east + t * math.cos(heading),
    )


@pytest.mark.parametrize("name", MAPS)
def test_every_lane_lies_at_the_position_that_its_text_gives(maps: Path, name: str):
    """Ten stations of every lane that is read, bends and lane offsets and all."""
    for road in mapped_roads_of(maps / name):
        if road.road is None or road.part is None:
            continue
        text, read_road = road_elements(maps / name)[road.road_id], road.road
        stations = np.linspace(road.part.start, road.part.end, 12)[1:-1]
        sign = 1 if read_road.lanes[0].lane_id > 0 else -1
        middles, points = [world_position(text, float(station), 0.0) for station in stations], []
        for station in stations:
            # The model counts lanes from the slow side, which is the outer one.
            lanes = [lane for lane in lanes_of_side(text, station, sign) if lane[0] == "driving"][
                ::-1
            ]
            for read_lane, (_, t, width, _) in zip(read_road.lanes, lanes, strict=True):
                assert read_lane.width == pytest.approx(width, abs=0.006)
                points.append(world_position(text, float(station), t))
        s, d = read_road.to_road(*np.transpose(points))
        expected_d = np.tile(read_road.lane_centres, len(stations))
        np.testing.assert_allclose(d, expected_d, rtol=0.0, atol=CENTIMETRE, err_msg=road.road_id)
        assert ((s >= 0.0) & (s <= read_road.length)).all()
        stations_on_road, _ = read_road.to_road(*np.transpose(middles))
        progress = np.diff(stations_on_road) * -sign * read_road.overtaking_sign
        assert (progress > 0.0).all()


@pytest.mark.parametrize(
    ("name", "ids"), [("Town04.xodr", ("41", "6", "45")), ("Town06.xodr", ("40", "71", "6"))]
)
def test_a_route_is_as_long_as_its_roads_and_lies_on_them(maps: Path, name: str, ids: tuple):
    """Roads that continue each other without a junction; some have the opposite direction."""
    road = load_road(maps / name, ",".join(ids))
    assert road.name == f"{name.removesuffix('.xodr')} roads {', '.join(ids)}"
    roads = [road_elements(maps / name)[entry] for entry in ids]
    lengths = [float(entry.attrib["length"]) for entry in roads]
    assert road.length == pytest.approx(sum(lengths), abs=0.1)
    length_so_far = 0.0
    for text, length in zip(roads, lengths, strict=True):
        sign = -1 if text.find("lanes/laneSection/right/lane[@type='driving']") is not None else 1
        stations = np.linspace(0.0, length, 7)[1:-1]
        route_stations = []
        for station in stations:
            lanes = [entry for entry in lanes_of_side(text, station, sign) if entry[0] == "driving"]
            for centre, (_, t, _, _) in zip(road.lane_centres, reversed(lanes), strict=True):
                _, d = road.to_road(*world_position(text, float(station), t))
                assert d == pytest.approx(centre, abs=CENTIMETRE)
            route_stations.append(
                float(road.to_road(*world_position(text, float(station), 0.0))[0])
            )
        expected = length_so_far + (stations if sign < 0 else length - stations)
        np.testing.assert_allclose(route_stations, expected, atol=0.1)
        length_so_far += length


MPS = {"mph": 0.44704, "km/h": 1.0 / 3.6, "m/s": 1.0}


def limit_in_text(road: ET.Element, station: float, sign: int) -> float:
    """The limit of the driving lanes of a side, from the text [m/s]."""
    section = entry_at(road.findall("lanes/laneSection"), station)
    assert section is not None
    offset = station - float(section.attrib["s"])
    side = "right" if sign < 0 else "left"
    lanes = section.findall(f"{side}/lane[@type='driving']")
    of_lanes = [entry_at(lane.findall("speed"), offset, "sOffset") for lane in lanes]
    kind = entry_at(road.findall("type"), station)
    speed = of_lanes[0] if of_lanes and of_lanes[0] is not None else None
    if speed is None and kind is not None:
        speed = kind.find("speed")
    if speed is None:  # Portuguese law, outside localities.
        return 120 / 3.6 if kind is not None and kind.attrib["type"] == "motorway" else 25.0
    return float(speed.attrib["max"]) * MPS[speed.get("unit", "m/s")]


@pytest.mark.parametrize("name", MAPS)
def test_every_speed_limit_equals_the_text_at_every_half_metre(maps: Path, name: str):
    for road in mapped_roads_of(maps / name):
        if road.road is None or road.part is None:
            continue
        text, read_road = road_elements(maps / name)[road.road_id], road.road
        sign = 1 if read_road.lanes[0].lane_id > 0 else -1
        stations = np.arange(road.part.start + 0.1, road.part.end - 0.1, STEP)
        is_along = (sign < 0) == (read_road.driving_side is DrivingSide.RIGHT)
        part_length = road.part.end - road.part.start
        distances = stations - road.part.start if is_along else road.part.end - stations
        for direction in (1, -1) if read_road.is_two_way else (1,):
            limits = [limit_in_text(text, float(station), direction * sign) for station in stations]
            limits_on_road = read_road.speed_limit_at(
                distances * read_road.length / part_length, direction
            )
            np.testing.assert_allclose(limits_on_road, limits, rtol=1e-12, err_msg=road.road_id)


@pytest.mark.parametrize(("ids", "mph"), [(("8", "2"), (30, 65)), (("46", "10"), (50, 55))])
def test_a_route_over_roads_with_different_limits_has_the_limits_of_the_text(
    maps: Path, ids: tuple[str, str], mph: tuple[int, int]
):
    """Two pairs of roads of Town06 with different limits."""
    road = load_road(maps / "Town06.xodr", ",".join(ids))
    assert road.speed_limit == pytest.approx(0.44704 * max(mph))
    samples = [
        (text, float(station), sign)
        for text in (road_elements(maps / "Town06.xodr")[entry] for entry in ids)
        for station in np.arange(0.3, float(text.attrib["length"]), STEP)
        for sign in (-1, 1)
    ]
    lanes = [
        [entry[1] for entry in lanes_of_side(*sample) if entry[0] == "driving"]
        for sample in samples
    ]
    points = [
        world_position(*sample[:2], t)
        for sample, middles in zip(samples, lanes, strict=True)
        for t in middles
    ]
    s, d = road.to_road(*np.array(points).T)
    is_on_lane = np.abs(road.lane_centres - d[:, None]).min(axis=1) < CENTIMETRE
    is_on_route = (s >= 0.0) & (s <= road.length) & is_on_lane
    compared_limits = []
    first = 0
    for sample, middles in zip(samples, lanes, strict=True):
        rows = slice(first, first := first + len(middles))
        if middles and is_on_route[rows].all():
            limit = limit_in_text(*sample)
            assert road.speed_limit_at(s[rows][0]) == pytest.approx(limit, rel=1e-12)
            compared_limits.append(round(limit / 0.44704))
    assert set(compared_limits) == set(mph)
    assert len(compared_limits) > 0.9 * road.length / STEP


# ---- by name or by file ----


def test_a_road_is_loaded_by_name_or_by_file(maps: Path):
    assert load_road("motorway").name == "motorway"
    assert load_road(str(maps / "esmini_straight_500m.xodr")).name == "esmini_straight_500m road 1"
    with pytest.raises(ImportFormatError, match=r"Town06\.xodr: road 4000: expected exactly one"):
        load_road(maps / "Town06.xodr", 4000)


def test_an_unknown_road_name_and_a_missing_file_are_refused():
    with pytest.raises(
        ConfigError, match="expected town06 or motorway or rural or an OpenDRIVE file"
    ):
        load_road("town6")
    with pytest.raises(ConfigError, match="expected its name alone"):
        load_road("town06", 40)
    with pytest.raises(ImportFormatError, match="No such file"):
        load_road("missing.xodr", 40)
