"""CommonRoad scenarios with inexact states, signs of other countries and left-hand traffic."""

from __future__ import annotations

import re

import numpy as np
import pytest
from tests.support.recordings import OVERTAKE, WIDTH, Bend, Mover, commonroad

from overtaking.core.errors import ConfigError, ImportFormatError
from overtaking.core.units import mps_from_kmh
from overtaking.model.road import DrivingSide, RoadMark
from overtaking.recordings.commonroad import read_commonroad
from overtaking.recordings.countries import is_speed_sign, keeps_left, number_on_sign
from overtaking.recordings.limits import NO_LIMIT
from overtaking.recordings.scenes import scenes

AREA = "<rectangle><length>1</length><width>1</width><orientation>0</orientation></rectangle>"


def obstacle_of(text: str, number: int) -> str:
    pattern = rf'<dynamicObstacle id="{number}">.*?</dynamicObstacle>'
    return re.findall(pattern, text, re.DOTALL)[0]


def with_change(number: int, pattern: str, replacement: str, count: int = 0) -> str:
    """The base scene with a change to one of its obstacles."""
    text = commonroad()
    before = obstacle_of(text, number)
    after = re.sub(pattern, replacement, before, count=count)
    assert after != before
    return text.replace(before, after)


def rows_of(recording, number: int) -> slice:
    place = int(np.flatnonzero(recording.tracks.names == str(number))[0])
    return slice(*recording.tracks.start[place : place + 2])


@pytest.mark.parametrize("shift", [0.0, 0.02])
def test_a_trajectory_may_repeat_the_initial_state(write, shift):
    text = commonroad()
    for number in (3, 7):
        obstacle = obstacle_of(text, number)
        state = re.findall("<initialState>(.*?)</initialState>", obstacle)[0]
        state = re.sub("<x>(.*?)</x>", lambda x: f"<x>{float(x[1]) + shift:.4f}</x>", state)
        repeated = obstacle.replace("<trajectory>", f"<trajectory><state>{state}</state>")
        text = text.replace(obstacle, repeated)
    found, plain = read_commonroad(write(text)), read_commonroad(write(commonroad()))
    assert found.tracks.s == pytest.approx(plain.tracks.s)
    assert found.tracks.first.tolist() == plain.tracks.first.tolist()


def test_two_places_at_one_time_are_refused(write):
    text = with_change(3, r"<time><exact>7</exact></time>", "<time><exact>6</exact></time>")
    with pytest.raises(ImportFormatError, match=r"obstacle 3.*<state> does not follow.*step 7"):
        read_commonroad(write(text))


@pytest.mark.parametrize(
    ("pattern", "replacement", "reason"),
    [
        ("<point>.*?</point>", AREA, "a position that is an area: rectangle"),
        ("<point>.*?</point>", '<lanelet ref="11"/>', "a position that is an area: lanelet"),
        (
            "<time><exact>5</exact></time>",
            "<time><intervalStart>5</intervalStart><intervalEnd>6</intervalEnd></time>",
            "an interval of time",
        ),
        ("<shape>.*?</shape>", "", "no shape"),
        ("<shape>.*?</shape>", "<shape/>", "no shape"),
        ("<rectangle>.*?</rectangle>", "<oval/>", "an unknown shape: oval"),
        (
            "<rectangle>.*?</rectangle>",
            "<circle><radius>1</radius></circle><circle><radius>2</radius></circle>",
            "several shapes",
        ),
    ],
)
def test_an_obstacle_without_exact_states_is_left_out_and_named(
    write, pattern, replacement, reason
):
    found = read_commonroad(write(with_change(9, pattern, replacement)))
    assert sorted(found.tracks.names) == ["3", "5", "7"]
    assert found.notes["vehicles_left_out"].startswith("obstacle 9: ")
    assert reason in found.notes["vehicles_left_out"]
    assert found.notes["obstacles_left_out"] == {"car": 1}


@pytest.mark.parametrize("quantity", ["velocity", "orientation"])
def test_an_interval_counts_as_not_stated(write, quantity):
    interval = f"<{quantity}><intervalStart>-1</intervalStart><intervalEnd>99</intervalEnd>"
    text = with_change(9, f"<{quantity}>.*?</{quantity}>", f"{interval}</{quantity}>")
    found = read_commonroad(write(text))
    rows = rows_of(found, 9)
    assert found.tracks.speed[rows] == pytest.approx(20.0, abs=1e-3)
    assert found.tracks.heading[rows] == pytest.approx(0.0, abs=1e-5)
    assert quantity in found.notes["derived"]
    assert found.notes["vehicles_left_out"] is None


def test_a_polygon_has_the_size_of_its_extent(write):
    corners = ((-2.5, -1), (2.5, -1), (2.5, 1), (-2.5, 1))
    points = "".join(f"<point><x>{x}</x><y>{y}</y></point>" for x, y in corners)
    polygon = f"<polygon>{points}</polygon>"
    found = read_commonroad(write(with_change(9, "<rectangle>.*?</rectangle>", polygon)))
    place = found.tracks.names.tolist().index("9")
    assert (found.tracks.length[place], found.tracks.width[place]) == (5.0, 2.0)


def test_a_scene_of_nothing_but_areas_is_refused_with_the_reason(write):
    text = re.sub(
        "<point><x>[-0-9.]*</x><y>[-0-9.]*</y></point></position>",
        f"{AREA}</position>",
        commonroad(),
    )
    with pytest.raises(ImportFormatError, match=r"vehicles with a path, got obstacle 7: .* area"):
        read_commonroad(write(text))


@pytest.mark.parametrize(
    ("pattern", "replacement", "message"),
    [
        (
            "<velocity><exact>20</exact>",
            "<velocity><exact>151</exact>",
            r"obstacle 9: line \d+: <velocity> is not that of a vehicle.*got 151",
        ),
        (
            "<velocity><exact>20</exact>",
            "<velocity><exact>1e99</exact>",
            r'obstacle 9: line \d+: <exact> text.*got "1e99"',
        ),
        ("<x>[0-9.]*</x>", "<x>3e9</x>", r'obstacle 9: line \d+: <x> text.*got "3e9"'),
    ],
)
def test_values_out_of_range_are_refused_by_file_element_and_value(
    write, pattern, replacement, message
):
    with pytest.raises(ImportFormatError, match=message) as caught:
        read_commonroad(write(with_change(9, pattern, replacement, count=1)))
    assert str(caught.value).startswith("scene.xml: ")
    assert "\n" not in str(caught.value)


def posted(code: str, value: str | None, country: str = "ZAM") -> str:
    """The base scene with a sign on each lanelet."""
    more = "" if value is None else f"<additionalValue>{value}</additionalValue>"
    sign = (
        f'<trafficSign id="900"><trafficSignElement><trafficSignID>{code}</trafficSignID>{more}'
        "</trafficSignElement></trafficSign>"
    )
    text = commonroad(more=sign).replace("ZAM_Hand", f"{country}_Hand")
    return text.replace("<laneletType>", '<trafficSignRef ref="900"/><laneletType>')


@pytest.mark.parametrize(
    ("country", "code"),
    [
        ("ZAM", "274"),
        ("DEU", "274-120"),
        ("DEU", "274.1"),
        ("USA", "R2-1"),
        ("PRI", "R2-1"),
        ("CHN", "274"),
        ("ESP", "r301"),
        ("ESP", "R301"),
        ("RUS", "3.24"),
        ("ARG", "R15"),
        ("BEL", "C43"),
        ("FRA", "B14"),
        ("GRC", "Ρ-32"),  # The letter is a Greek rho.
        ("HRV", "B31"),
        ("ITA", "274"),
    ],
)
def test_the_speed_signs_of_each_country_post_a_limit_in_metres_per_second(write, country, code):
    found = read_commonroad(write(posted(code, "25.0", country)))
    assert found.road.speed_limit == 25.0
    assert "speed_limit" not in found.unknown


@pytest.mark.parametrize(
    ("country", "code", "value", "limit"),
    [
        ("USA", "R2-1", "65", 65 * 0.44704),
        ("USA", "R2-1", "29.0576", 29.0576),
        ("DEU", "274", "120", mps_from_kmh(120.0)),
        ("DEU", "274-80", None, mps_from_kmh(80.0)),
        ("FRA", "B14", "110", mps_from_kmh(110.0)),
        ("DEU", "274", "inf", NO_LIMIT),
        ("CHN", "274", "30kmh", mps_from_kmh(30.0)),
        ("DEU", "274", "130 km/h", mps_from_kmh(130.0)),
        ("ZAM", "274", "25mph", 25 * 0.44704),
    ],
)
def test_a_number_that_is_no_limit_in_metres_per_second_is_the_number_on_the_sign(
    write, country, code, value, limit
):
    assert read_commonroad(write(posted(code, value, country))).road.speed_limit == limit


@pytest.mark.parametrize(
    ("code", "number"),
    [("274-30", 30.0), ("274-5", 5.0), ("274-53", None), ("274-55", None), ("R2-1-65", 65.0)],
)
def test_the_variant_of_a_sign_is_a_speed_unless_old_catalogues_number_it(code, number):
    assert number_on_sign(code) == number


@pytest.mark.parametrize("code", ["274.2", "278", "275", "205", "R1-1", "B1", ""])
def test_other_signs_post_no_limit(write, code):
    assert not is_speed_sign(code)
    assert "speed_limit" in read_commonroad(write(posted(code, "25.0"))).unknown


def mirrored(text: str) -> str:
    """A scene in a world where left and right are swapped."""
    text = re.sub("<y>(.*?)</y>", lambda y: f"<y>{-float(y[1]):.6f}</y>", text)
    text = re.sub(
        "<orientation><exact>(.*?)</exact>",
        lambda angle: f"<orientation><exact>{-float(angle[1]):.6f}</exact>",
        text,
    )
    for left, right in (("leftBound", "rightBound"), ("adjacentLeft", "adjacentRight")):
        text = text.replace(left, "@").replace(right, left).replace("@", right)
    return text


def two_way(*, adjacent: bool = True) -> str:
    """Two lanes and an oncoming one; vehicle 7 overtakes, 21 comes the other way."""
    bend = Bend(lanes=2)

    def backwards(left: float) -> str:
        points = re.findall(r"<point>.*?</point>", bend.points(0.0, bend.length, left))
        return "".join(points[::-1])

    beside = '<adjacentLeft ref="{}" drivingDir="opposite"/>' if adjacent else ""
    oncoming = (
        f'<lanelet id="99"><leftBound>{backwards(2 * WIDTH)}</leftBound>'
        f"<rightBound>{backwards(3 * WIDTH)}</rightBound>{beside.format(12)}</lanelet>"
    )
    movers = (*OVERTAKE, Mover(number=21, s=900.0, speed=-28.0, lane=2))
    first, second, rest = commonroad(movers, bend, more=oncoming).split("<laneletType>", 2)
    return f"{first}<laneletType>{second}{beside.format(99)}<laneletType>{rest}"


def assert_is_mirror_image(found, plain) -> None:
    assert found.road.driving_side is DrivingSide.LEFT
    assert plain.road.driving_side is DrivingSide.RIGHT
    assert found.road.is_two_way == plain.road.is_two_way
    assert found.tracks.names.tolist() == plain.tracks.names.tolist()
    for name in ("s", "x", "speed", "lane", "accel_lon"):
        assert getattr(found.tracks, name) == pytest.approx(getattr(plain.tracks, name), abs=1e-4)
    for name in ("y", "d", "heading", "accel_lat", "yaw_rate"):
        assert getattr(found.tracks, name) == pytest.approx(-getattr(plain.tracks, name), abs=1e-4)
    assert found.notes["oncoming"] == plain.notes["oncoming"]
    assert scenes(found).counts == scenes(plain).counts


@pytest.mark.parametrize("adjacent", [True, False])
@pytest.mark.parametrize("country", ["ZAM", "DEU", "C-GBR"])
def test_oncoming_lanelets_show_the_side_of_traffic(write, adjacent, country):
    """Lanelets decide also where the country says something else."""
    text = two_way(adjacent=adjacent).replace("ZAM_Hand", f"{country}_Hand")
    plain = read_commonroad(write(text))
    found = read_commonroad(write(mirrored(text)))
    assert_is_mirror_image(found, plain)
    assert scenes(found).counts["candidate_overtakes"] == 1
    assert found.road.lanes[0].left_mark is RoadMark.SOLID
    assert "oncoming" in found.notes["driving_side"]


@pytest.mark.parametrize("country", ["GBR", "C-AUS", "JPN", "IND", "ZAF", "HKG", "nzl"])
def test_without_oncoming_lanelets_the_country_decides_the_side(write, country):
    text = mirrored(commonroad()).replace("ZAM_Hand", f"{country}_Hand")
    found = read_commonroad(write(text))
    assert_is_mirror_image(found, read_commonroad(write(commonroad())))
    assert found.notes["driving_side"] == "left, by the country"


def test_the_location_may_name_the_country(write):
    text = mirrored(commonroad(more="<location><country>GBR</country></location>"))
    assert read_commonroad(write(text)).road.driving_side is DrivingSide.LEFT


@pytest.mark.parametrize("country", ["DEU", "USA", "ZAM", "CHN"])
def test_other_countries_drive_on_the_right(write, country):
    assert not keeps_left(country)
    text = commonroad().replace("ZAM_Hand", f"{country}_Hand")
    assert read_commonroad(write(text)).road.driving_side is DrivingSide.RIGHT


def test_an_option_sets_the_side_of_traffic(write):
    path = write(mirrored(commonroad()))
    found = read_commonroad(path, driving_side="left")
    assert scenes(found).counts["candidate_overtakes"] == 1
    assert found.road.driving_side is DrivingSide.LEFT
    assert found.notes["driving_side"] == "left, by the option"
    path = write(commonroad().replace("ZAM_Hand", "GBR_Hand"))
    right = read_commonroad(path, driving_side="right")
    assert right.road.driving_side is DrivingSide.RIGHT
    with pytest.raises(ConfigError, match="driving_side"):
        read_commonroad(path, driving_side="both")


def test_a_road_far_from_the_origin_keeps_its_coordinates(write):
    """The road and its traffic lie where the file has them, once the origin is added again."""
    far = np.array([691_607.5, 5_335_221.25])
    text = re.sub(
        "<x>(.*?)</x><y>(.*?)</y>",
        lambda m: f"<x>{float(m[1]) + far[0]:.6f}</x><y>{float(m[2]) + far[1]:.6f}</y>",
        commonroad(),
    )
    for scene in (text, mirrored(text).replace("ZAM_Hand", "GBR_Hand")):
        found = read_commonroad(write(scene))
        rows = rows_of(found, 9)
        x, y = found.road.to_source(found.tracks.x[rows], found.tracks.y[rows])
        assert x[0] == pytest.approx(300.0 + far[0], abs=1e-3)
        assert abs(y[0]) == pytest.approx(0.5 * WIDTH + far[1], abs=1e-3)
        start = found.road.to_source(*found.road.to_world(0.0, 0.0))
        assert abs(start[0] - far[0]) < 20.0


def test_a_length_that_contradicts_the_type_makes_the_type_unknown(write):
    """A "car" of 7.07 m is neither a car nor a truck for sure; one of 4.5 m is a car."""
    movers = [Mover(number=1, length=7.07), Mover(number=2, s=60.0, length=4.5)]
    tracks = read_commonroad(write(commonroad(movers))).tracks
    assert tracks.is_kind_known.tolist() == [False, True]
