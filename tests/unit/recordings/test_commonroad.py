"""CommonRoad scenarios: real ones, and small ones in which every number is known."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from tests.support.recordings import OVERTAKE, WIDTH, Bend, Mover, commonroad

from overtaking.core.errors import ConfigError, ImportFormatError
from overtaking.model.road import RoadMark
from overtaking.recordings.candidates import lane_changes, overtakes
from overtaking.recordings.commonroad import read_commonroad
from overtaking.recordings.commonroad_lanes import Lanelet, contains
from overtaking.recordings.neighbours import Surroundings
from overtaking.recordings.scenes import scenes
from overtaking.recordings.xml import Element

ANY_LANELET = Lanelet(
    number=1,
    element=Element(file="", line=1, name="lanelet", attributes={}),
    left=np.zeros((2, 2)),
    right=np.zeros((2, 2)),
    length=0.0,
    narrowest=0.0,
    left_mark=None,
    right_mark=None,
    left_neighbour=None,
    right_neighbour=None,
    oncoming_left=None,
    oncoming_right=None,
    before=(),
    after=(),
    types=(),
    kind="driving",
    signs=(),
    speed_limit=None,
)
BENDS = (0.0, 1.0 / 1500.0, -1.0 / 200.0)


@pytest.mark.ci
@pytest.mark.parametrize("curvature", BENDS)
@pytest.mark.parametrize("version", ["2018b", "2020a"])
def test_positions_come_back_along_and_across_a_straight_or_bent_road(write, curvature, version):
    road = Bend(curvature=curvature, length=600.0)
    movers = [Mover(number=1, s=30.0, speed=25.0, lane=1, last=200), Mover(number=2, s=60.0)]
    found = read_commonroad(write(commonroad(movers, road, version=version)))
    tracks = found.tracks
    assert tracks.names.tolist() == ["1", "2"]
    lane = found.road.lane_centres[1]
    first = slice(0, tracks.start[1])
    assert np.abs(tracks.d[first] - lane).max() < 0.01
    assert (tracks.lane[first] == 1).all()
    # Along the right edge 2.5 m in a tenth of a second; the reference line is the middle lane.
    along = 2.5 * (1.0 - curvature * 1.5 * WIDTH)
    assert np.abs(np.diff(tracks.s[first]) - along).max() < 0.01
    # The body stands along its lane, wherever the lane points.
    relative = tracks.heading[first] - found.road.heading_at(tracks.s[first])
    assert np.abs(relative).max() < 1e-3
    assert np.allclose(np.diff(found.road.lane_boundaries), WIDTH, atol=1e-3)


def test_the_outer_lane_of_a_bend_is_longer_by_as_much_as_is_said(write):
    road = Bend(curvature=1.0 / 400.0, length=150.0)
    movers = [Mover(number=1, s=5.0, speed=10.0, lane=0, last=100)]
    found = read_commonroad(write(commonroad(movers, road)))
    half = 1.5 * WIDTH  # From the right edge, where `s` is counted, to the reference line.
    advance = np.diff(found.tracks.s)
    expected = 1.0 * (1.0 - half / 400.0)
    assert np.median(advance) == pytest.approx(expected, abs=1e-3)
    assert found.notes["longest_way"] == pytest.approx(WIDTH / (400.0 - half), abs=1e-3)


def test_an_overtake_is_found_with_its_target_and_its_window(write):
    found = read_commonroad(write(commonroad()))
    changes = lane_changes(found)
    windows = overtakes(found, changes, Surroundings.of(found))
    names = found.tracks.names
    assert changes.old.tolist() == [0, 1]
    assert changes.new.tolist() == [1, 0]
    (window,) = windows
    assert (names[window.ego], names[window.leader]) == ("7", "3")
    # The ramp runs from 2 s to 6 s, its speed exceeds 0.15 m/s after 0.3 s.
    assert window.moves == pytest.approx(23, abs=1)
    assert window.first == 0
    assert window.returns == pytest.approx(141, abs=3)
    # The movement back ends at 15.7 s; five seconds more.
    assert window.last == pytest.approx(207, abs=2)


@pytest.mark.ci
def test_lanelets_that_follow_each_other_are_one_road(write):
    whole = read_commonroad(write(commonroad(road=Bend())))
    cut = read_commonroad(write(commonroad(road=Bend(cuts=(300.0, 650.0)))))
    assert cut.notes["lanelets_by_lane"] == [[11, 21, 31], [12, 22, 32], [13, 23, 33]]
    assert np.allclose(cut.tracks.s, whole.tracks.s)
    assert np.allclose(cut.tracks.d, whole.tracks.d)


@pytest.mark.ci
def test_what_the_file_says_of_the_road_is_kept_and_the_rest_is_unknown(write):
    sign = (
        '<trafficSign id="500"><trafficSignElement><trafficSignID>274</trafficSignID>'
        "<additionalValue>33.25</additionalValue></trafficSignElement></trafficSign>"
    )
    text = commonroad(more=sign)
    found = read_commonroad(write(text))
    assert "speed_limit" in found.unknown
    with_sign = text.replace("</laneletType>", '</laneletType><trafficSignRef ref="500"/>')
    found = read_commonroad(write(with_sign))
    assert found.road.speed_limit == 33.25
    assert not {"speed_limit", "marks", "road_kind"} & found.unknown
    assert {"drivers", "weather", "wheel_angle", "yaw_rate", "percepts"} <= found.unknown
    assert found.road.kind == "motorway"
    assert found.road.lanes[0].right_mark is RoadMark.SOLID
    assert found.road.lanes[0].left_mark is RoadMark.BROKEN
    assert found.road.lanes[2].left_mark is RoadMark.SOLID
    bare = text.replace("<lineMarking>dashed</lineMarking>", "")
    assert "marks" in read_commonroad(write(bare)).unknown


@pytest.mark.ci
def test_limits_from_lanelet_to_lanelet_are_those_of_the_road(write):
    signs = "".join(
        f'<trafficSign id="{number}"><trafficSignElement><trafficSignID>274</trafficSignID>'
        f"<additionalValue>{limit}</additionalValue></trafficSignElement></trafficSign>"
        for number, limit in ((500, 20.0), (501, 33.25))
    )
    text = commonroad(more=signs, road=Bend(cuts=(300.0, 650.0)))

    def posted(*numbers: int) -> str:
        """The scene with one sign for the lanelets 1x, 2x and 3x."""

        def with_sign(match: re.Match[str]) -> str:
            ref = f'<trafficSignRef ref="{numbers[int(match[1][0]) - 1]}"/>'
            return match[0].replace("</laneletType>", f"</laneletType>{ref}")

        return re.sub(r'<lanelet id="(\d+)">.*?</lanelet>', with_sign, text, flags=re.DOTALL)

    found = read_commonroad(write(posted(501, 500, 501)))
    assert "speed_limit" not in found.unknown
    assert found.road.speed_limit == 33.25
    assert found.road.course is not None
    (lower,) = found.road.course.speed_limit_spans
    assert (lower.start, lower.stop, lower.speed) == (pytest.approx(300), pytest.approx(650), 20.0)
    same = read_commonroad(write(posted(500, 500, 500)))
    assert (same.road.speed_limit, same.road.course) == (20.0, None)
    # One lanelet without a sign, or beside one with another: nothing is known.
    for old, new in (('<trafficSignRef ref="500"/>', ""), ('ref="500"', 'ref="501"')):
        partly = posted(501, 500, 501).replace(old, new, 1)
        unknown = read_commonroad(write(partly))
        assert "speed_limit" in unknown.unknown
        assert unknown.road.course is None


def test_a_lane_that_joins_lies_beside_the_lanes_that_run_through(write):
    """As on the US-101: an entry runs apart from the road first, then beside it."""
    main = Bend(lanes=3, cuts=(300.0,))
    entry = "".join(
        f'<lanelet id="{number}"><leftBound>{main.points(*span, 0.0)}</leftBound>'
        f"<rightBound>{main.points(*span, -4.0)}</rightBound>{links}</lanelet>"
        for number, span, links in (
            (91, (0.0, 300.0), '<successor ref="92"/>'),
            (
                92,
                (300.0, 1000.0),
                '<predecessor ref="91"/><adjacentLeft ref="21" drivingDir="same"/>',
            ),
        )
    )
    movers = [Mover(number=1, s=20.0, lane=1), Mover(number=2, s=250.0, lane=-1)]
    text = commonroad(movers, main, more=entry)
    beside = '<adjacentRight ref="92" drivingDir="same"/>'
    head, tail = text.split('<lanelet id="21">')
    text = head + '<lanelet id="21">' + tail.replace("<laneletType>", beside + "<laneletType>", 1)
    found = read_commonroad(write(text))
    assert found.notes["lanelets_by_lane"] == [[11, 21], [12, 22], [13, 23]]
    neighbour = found.road.kerb_side_neighbour
    assert neighbour is not None
    assert (neighbour.kind, neighbour.lane_id) == ("entry", -4)
    assert neighbour.width == pytest.approx(4.0)
    assert (found.tracks.lane[found.tracks.start[1] :] == 255).all()


def typed(text: str, number: int, kind: str, more: str = "") -> str:
    """A scenario in which one lanelet is of another type."""
    head, tail = text.split(f'<lanelet id="{number}">')
    new = f"<laneletType>{kind}</laneletType>{more}"
    return f'{head}<lanelet id="{number}">' + re.sub(
        "<laneletType>.*?</laneletType>", new, tail, count=1
    )


@pytest.mark.ci
@pytest.mark.parametrize(
    ("kind", "more", "expected"),
    [
        ("shoulder", "", "shoulder"),
        ("busLane", "", "bus"),
        ("exitRamp", "", "exit"),
        ("urban", "<userOneWay>bicycle</userOneWay><userOneWay>bus</userOneWay>", "restricted"),
    ],
)
def test_a_shoulder_beside_the_lanes_is_none_of_them(write, kind, more, expected):
    """A hard shoulder on the left became the fast lane, and one on the right the slow lane."""
    left = read_commonroad(write(typed(commonroad(), 13, kind, more)))
    assert left.notes["lanelets_by_lane"] == [[11], [12]]
    assert left.road.overtaking_side_neighbour is not None
    assert (
        left.road.overtaking_side_neighbour.kind,
        left.road.overtaking_side_neighbour.direction,
    ) == (
        expected,
        1,
    )
    movers = [replace(one, lane=one.lane + 1, moves=()) for one in OVERTAKE]
    right = read_commonroad(write(typed(commonroad(movers), 11, kind, more)))
    assert right.notes["lanelets_by_lane"] == [[12], [13]]
    assert right.road.kerb_side_neighbour is not None
    assert right.road.kerb_side_neighbour.kind == expected


@pytest.mark.ci
def test_lanes_on_either_side_of_a_bus_lane_are_two_roads(write):
    text = typed(commonroad(road=Bend(lanes=4)), 13, "busLane", "<userOneWay>bus</userOneWay>")
    assert read_commonroad(write(text)).notes["lanelets_by_lane"] == [[11], [12]]
    found = read_commonroad(write(text), lanelet_id=14)
    assert found.notes["lanelets_by_lane"] == [[14]]


@pytest.mark.ci
def test_a_lanelet_that_nobody_drives_on_is_no_road(write):
    text = typed(commonroad(), 13, "shoulder")
    with pytest.raises(ImportFormatError, match="expected a lane to drive on, got shoulder"):
        read_commonroad(write(text), lanelet_id=13)


def test_where_lanes_part_the_road_ends(write):
    text = commonroad([Mover(number=1, s=20.0, lane=1, last=50)], Bend(cuts=(500.0,)))
    text = text.replace('<successor ref="22"/>', '<successor ref="22"/><successor ref="99"/>')
    found = read_commonroad(write(text))
    assert found.notes["lanelets_by_lane"] in ([[11], [12], [13]], [[21], [22], [23]])
    assert found.road.length == pytest.approx(500.0, abs=0.1)


@pytest.mark.parametrize(
    ("road", "message"),
    [
        (Bend(curvature=1.0 / 20.0, length=40.0), "bend"),
        (Bend(curvature=1.0 / 60.0, length=8.0), "lanes"),
        (Bend(lanes=9), "driving lanes"),
    ],
)
def test_a_road_that_the_model_has_no_place_for_is_refused(write, road, message):
    movers = [Mover(number=1, s=5.0, speed=3.0, last=60)]
    with pytest.raises(ImportFormatError, match=message):
        read_commonroad(write(commonroad(movers, road)))


def test_a_lane_that_tapers_is_refused_and_named(write):
    text = commonroad()
    # The line between lanelets 12 and 13 runs to the right, by 1.45 m at the end.
    middle = Bend().points(0.0, 1000.0, 2 * WIDTH)
    bent = "".join(
        f"<point><x>{a:.6f}</x><y>{2 * WIDTH - 1.45 * a / 1000.0:.6f}</y></point>"
        for a in np.linspace(0.0, 1000.0, 50)
    )
    assert text.count(middle) == 2
    with pytest.raises(ImportFormatError, match=r"lane 2 from the right: expected a width"):
        read_commonroad(write(text.replace(middle, bent)))


@pytest.mark.ci
def test_the_road_can_be_chosen_by_a_lanelet(write):
    second = Bend().lanelets().replace('id="1', 'id="5').replace('ref="1', 'ref="5')
    second = second.replace("<y>", "<y>1000").replace("<y>10000.", "<y>1000.")
    text = commonroad(more=second)
    assert read_commonroad(write(text)).notes["lanelets_by_lane"] == [[11], [12], [13]]
    with pytest.raises(ConfigError, match="lanelet 77: expected one of 11, 12, 13"):
        read_commonroad(write(text), lanelet_id=77)


MAIN = Bend(lanes=2, cuts=(200.0, 400.0, 600.0, 800.0))
RAMP = Bend(lanes=1, curvature=1.0 / 5000.0)


def with_ramp(movers, ramp: Bend = RAMP, on_ramp: int = 3) -> str:
    """A road of short lanelets, and 500 m beside it a ramp of one long lanelet, 911, with queue."""
    queue = [Mover(number=80 + k, s=20.0 * k, speed=1.0) for k in range(on_ramp)]
    text = commonroad(queue, ramp, more="").replace('id="11"', 'id="911"')
    beside = re.sub("<y>(.*?)</y>", lambda found: f"<y>{float(found[1]) - 500.0:.4f}</y>", text)
    return commonroad(movers, MAIN, more="".join(beside.splitlines(keepends=True)[2:-1]))


@pytest.mark.ci
def test_the_busiest_road_is_read_and_not_the_busiest_lanelet(write):
    found = read_commonroad(write(with_ramp(OVERTAKE)))
    assert found.notes["lanelets_by_lane"] == [[11, 21, 31, 41, 51], [12, 22, 32, 42, 52]]
    assert found.notes["other_roads"] == "911 (1 lane, 43% of the states)"
    ramp = read_commonroad(write(with_ramp(OVERTAKE)), lanelet_id=911)
    assert ramp.notes["lanelets_by_lane"] == [[911]]
    assert ramp.notes["other_roads"].startswith("41 (2 lanes")


@pytest.mark.ci
def test_a_road_that_bends_too_much_is_passed_over(write):
    hairpin = Bend(lanes=1, curvature=1.0 / 9.0, length=20.0)
    text = with_ramp(OVERTAKE[:2], hairpin, on_ramp=5)
    found = read_commonroad(write(text))
    assert found.notes["lanelets_by_lane"][0][0] == 11
    with pytest.raises(ImportFormatError, match=r"911 .*bend.*, --lanelet \d1 \(2 lanes, \d+% of"):
        read_commonroad(write(text), lanelet_id=911)


def test_where_there_is_nothing_to_import_the_other_roads_are_named(write):
    text = with_ramp([Mover(number=1, s=100.0)], on_ramp=1)
    with pytest.raises(ImportFormatError, match=r"choose another road, --lanelet 911 \(1 lane"):
        scenes(read_commonroad(write(text)))


def test_positions_far_from_the_origin_are_shifted_into_reach(write):
    movers = [Mover(number=1, s=30.0, speed=25.0, lane=1, last=100)]
    text = commonroad(movers, Bend(length=400.0))
    east = 5_300_000.0
    shifted = text
    for value in sorted(set(_texts(text, "x")), key=len, reverse=True):
        shifted = shifted.replace(f"<x>{value}</x>", f"<x>{float(value) + east:.6f}</x>")
    near, found = read_commonroad(write(text)), read_commonroad(write(shifted))
    assert found.notes["world_shift_m"] == [east, 0.0]
    assert np.allclose(found.tracks.x, near.tracks.x, atol=1e-5)
    assert np.allclose(found.tracks.s, near.tracks.s, atol=1e-5)
    assert found.road.x0 == pytest.approx(near.road.x0, abs=1e-5)


def _texts(text: str, name: str) -> list[str]:
    return [part.split(f"</{name}>")[0] for part in text.split(f"<{name}>")[1:]]


@pytest.mark.ci
@pytest.mark.parametrize("tiny", [0.0, 5e-324, 1e-308, -1e-308])
def test_a_border_with_edges_of_no_length_contains_what_it_did(write, tiny):
    text = commonroad(road=Bend(length=600.0))
    first = "<rightBound><point><x>0.000000</x><y>0.000000</y></point>"
    assert first in text
    extra = f"<point><x>{tiny!r}</x><y>{tiny!r}</y></point>"
    with np.errstate(all="raise", under="ignore"):
        found = read_commonroad(write(text.replace(first, first + extra)))
    assert found.tracks.names.tolist() == ["3", "5", "7", "9"]


@given(
    radii=st.lists(st.sampled_from([1.0, 2.0, 4.0]), min_size=4, max_size=9),
    points=st.lists(st.tuples(*[st.floats(-5.0, 5.0)] * 2), min_size=1, max_size=9),
)
def test_what_a_lanelet_contains_is_what_shapely_says(radii, points):
    turn = np.arange(len(radii)) * 2.0 * np.pi / len(radii)
    ring = np.stack([radii * np.cos(turn), radii * np.sin(turn)], axis=1)
    polygon = shapely.Polygon(ring)
    one = replace(ANY_LANELET, left=ring[:2], right=ring[2:][::-1])
    x, y = np.array(points).T
    inside, clear = (test(polygon, x, y) for test in (shapely.contains_xy, _clear_of_edges))
    assert (contains(one, x, y) == inside)[clear].all()


def _clear_of_edges(polygon, x, y):
    return shapely.distance(polygon.exterior, shapely.points(x, y)) > 1e-9


# --- real recordings ---


@pytest.mark.parametrize(
    ("name", "vehicles", "passes", "lanes"),
    [("USA_US101-15_1_T-1", 37, 83, 5), ("USA_US101-5_1_T-1", 25, 40, 5)],
)
def test_real_motorway_traffic_is_read_as_others_read_it(
    shared_data, name, vehicles, passes, lanes
):
    """CommonRoad's own library finds that no vehicle changes lanes in these two scenes."""
    recording = read_commonroad(shared_data / "commonroad" / f"{name}.xml")
    found = scenes(recording)
    assert recording.road.num_lanes == lanes
    assert found.counts["vehicles"] == vehicles
    assert found.counts["lane_changes_left"] == found.counts["lane_changes_right"] == 0
    assert found.counts["passes"] == passes
    assert found.counts["neighbours_with_a_slot"] == 1.0
    # Measured once; a metre or two over 130 m and 180 m, and at most 1.4 % of the way.
    assert recording.notes["straightening_m"] < 2.2
    assert recording.notes["longest_way"] < 0.014
    assert recording.notes["widening"] < 0.13
