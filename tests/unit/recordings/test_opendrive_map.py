"""The roads of a map: their course against scenariogeneration's, and what is said of each."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from scenariogeneration import xodr

from overtaking.cli import main
from overtaking.core.errors import ImportFormatError
from overtaking.recordings.opendrive_map import list_opendrive_roads

from .opendrive_text import document, road

GEOMETRIES = {
    "arc": [xodr.Arc(0.01, length=180.0)],
    "clothoid": [xodr.Spiral(0.0, -0.02, 90.0)],
    "all": [
        xodr.Line(100.0),
        xodr.Spiral(0.0, 0.008, 60.0),
        xodr.Arc(0.008, angle=1.2),
        xodr.Spiral(0.008, -0.004, 80.0),
        xodr.Line(30.0),
    ],
}


def drawn(path: Path, geometries: list, heading: float = 0.4) -> xodr.PlanView:
    """A file of one road with a course, and scenariogeneration's idea of the course."""
    plan = xodr.PlanView()
    plan.set_start_point(20.0, -7.0, heading)
    for one in geometries:
        plan.add_geometry(one)
    lanes = xodr.Lanes()
    section = xodr.LaneSection(0, xodr.Lane(a=0))
    section.add_right_lane(xodr.Lane(a=3.5))
    lanes.add_lanesection(section)
    map_file = xodr.OpenDrive("map")
    map_file.add_road(xodr.Road(1, plan, lanes))
    map_file.adjust_roads_and_lanes()
    map_file.write_xml(str(path))
    return plan


@pytest.mark.parametrize("name", GEOMETRIES)
def test_a_course_ends_where_another_program_ends_it(tmp_path: Path, name: str) -> None:
    plan = drawn(tmp_path / "map.xodr", GEOMETRIES[name])
    (found,) = list_opendrive_roads(tmp_path / "map.xodr")
    assert found.line is not None
    end = found.line.pose_at(found.line.length)
    x, y, heading = plan.get_end_point()
    assert heading is not None
    assert found.line.length == pytest.approx(plan.get_total_length(), abs=1e-9)
    assert (float(end.x), float(end.y)) == pytest.approx((x, y), abs=1e-6)
    assert math.remainder(float(end.heading) - heading, math.tau) == pytest.approx(0.0, abs=1e-9)


def test_a_parametric_cubic_is_followed_within_a_millimetre(tmp_path: Path) -> None:
    # u = 100 p + 4 p^2, v = 30 p^2 - 18 p^3, its length by Simpson's rule.
    u, v = np.polynomial.Polynomial([0.0, 100.0, 4.0]), np.polynomial.Polynomial([0, 0, 30, -18])
    p = np.linspace(0.0, 1.0, 20_001)
    steps = np.hypot(np.diff(u(p)), np.diff(v(p)))
    length = float(steps.sum())
    cubic = (
        f'<geometry s="0" x="5" y="6" hdg="0" length="{length}"><paramPoly3 pRange="normalized" '
        'aU="0" bU="100" cU="4" dU="0" aV="0" bV="0" cV="30" dV="-18"/></geometry>'
    )
    path = tmp_path / "map.xodr"
    path.write_text(document(road(plan=cubic, length=f"{length}")))
    (found,) = list_opendrive_roads(path)
    assert found.line is not None
    pose = found.line.pose_at(np.concatenate([[0.0], np.cumsum(steps)]))
    assert np.abs(pose.x - 5.0 - u(p)).max() < 0.001
    assert np.abs(pose.y - 6.0 - v(p)).max() < 0.001


def test_each_road_comes_with_its_lanes_slope_and_refusal(tmp_path: Path) -> None:
    bend = '<geometry s="0" x="0" y="0" hdg="0" length="500"><arc curvature="0.005"/></geometry>'
    hill = '<elevation s="0" a="0" b="0.02" c="0" d="0"/>'
    path = tmp_path / "map.xodr"
    path.write_text(
        document(
            road(),
            road(road_id="8", plan=bend, elevation=hill),
            road(road_id="9", header='junction="3"'),
            road(road_id="10", length="rubbish"),
        )
    )
    straight, bent, crossing, damaged = list_opendrive_roads(path)
    assert (straight.right, straight.left, straight.radius, straight.refusal) == (2, 2, None, None)
    assert straight.road is not None
    assert straight.road.length == 500.0
    assert bent.radius == pytest.approx(200.0)
    assert bent.steepest == pytest.approx(0.02)
    assert bent.road is not None
    assert bent.road.curvature_at(250.0) == pytest.approx(0.005)
    assert bent.road.grade_at(250.0) == pytest.approx(0.02)
    assert crossing.in_junction
    assert damaged.line is None
    assert "attribute length" in (damaged.refusal or "")


@pytest.mark.parametrize(
    ("plan", "reason"),
    [
        ("", "no geometry"),
        (
            '<geometry s="0" x="0" y="0" hdg="0" length="5"><line/></geometry>'
            '<geometry s="5" x="5" y="1" hdg="0" length="5"><line/></geometry>',
            r"at most 0.05 m and 0.1 rad .* got 1.000 m and 0.0000 rad",
        ),
        (
            '<geometry s="0" x="0" y="0" hdg="0" length="5"><bezier/></geometry>',
            "expected line or arc or spiral or paramPoly3",
        ),
        (
            '<geometry s="0" x="0" y="0" hdg="0" length="5"><arc curvature="4"/></geometry>',
            "at most 1 /m, got 4 /m",
        ),
        (
            '<geometry s="0" x="0" y="0" hdg="0" length="100"><paramPoly3 pRange="normalized" '
            'aU="0" bU="0" cU="100" dU="0" aV="0" bV="0" cV="0" dV="1"/></geometry>',
            "a sharper bend or a cusp",
        ),
        (
            '<geometry s="0" x="0" y="0" hdg="0" length="50"><paramPoly3 pRange="normalized" '
            'aU="0" bU="100" cU="0" dU="0" aV="0" bV="0" cV="1" dV="0"/></geometry>',
            "a way of 50 m",
        ),
    ],
)
def test_a_course_that_is_none_is_refused_with_the_reason(
    tmp_path: Path, plan: str, reason: str
) -> None:
    path = tmp_path / "map.xodr"
    path.write_text(document(road(plan=plan)))
    (found,) = list_opendrive_roads(path)
    assert found.line is None
    with pytest.raises(ImportFormatError, match=reason):
        raise ImportFormatError(found.refusal)


@pytest.mark.parametrize("length", ["0.0", "-3"])
def test_a_road_without_length_is_refused_with_the_reason(tmp_path: Path, length: str) -> None:
    path = tmp_path / "map.xodr"
    path.write_text(document(road(length=length)))
    (found,) = list_opendrive_roads(path)
    with pytest.raises(ImportFormatError, match=r"attribute length.*more than 0 m"):
        raise ImportFormatError(found.refusal)


def test_the_command_lists_and_draws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, picture = tmp_path / "map.xodr", tmp_path / "map.svg"
    path.write_text(document(road(), road(road_id="9", header='junction="3"')))
    assert main(["roads", str(path), "--plot", str(picture)]) == 0
    shown = capsys.readouterr().out
    assert "--road 7" in shown
    assert "1 way across a junction left out" in shown
    assert picture.read_bytes().startswith(b"<?xml")
    assert main(["roads", str(path), "--junctions", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)["roads"]
    assert [one["can_be_simulated"] for one in listed] == [True, False]
    assert listed[1]["refusal"].startswith("map.xodr: road 9: line 4: <road> belongs to a junction")


@pytest.mark.ci
def test_every_road_of_known_maps_is_read(shared_data: Path) -> None:
    for path in sorted((shared_data / "opendrive").glob("*.xodr")):
        found = list_opendrive_roads(path)
        assert found
        assert all(one.line is not None and one.steepest is not None for one in found), path.name
        assert all((one.road is None) != (one.refusal is None) for one in found)
