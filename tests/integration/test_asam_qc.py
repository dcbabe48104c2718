"""The checkers of ASAM find no issue in what we export."""

from __future__ import annotations

import dataclasses
import subprocess
from pathlib import Path

import numpy as np
import pytest
from tests.support.bends import BENDS, HILLS, on
from tests.support.two_way import pair
from tests.support.worlds import scenario

import overtaking as ot
from overtaking.model.known_roads import ROAD_NAMES, known_road
from overtaking.model.road_course import RoadCourse, SpeedLimitSpan
from overtaking.recordings.opendrive_writer import write_opendrive
from overtaking.recordings.openscenario_write import write_openscenario

pytestmark = pytest.mark.qc

ROOT = Path(__file__).parents[2]


def issues(folder: Path) -> subprocess.CompletedProcess[str]:
    """What the checkers say of all files of a folder."""
    script = ROOT / "benchmarks" / "oracles" / "asam_qc.py"
    python = ROOT / ".venv-qc" / "bin" / "python"
    command = [python, script, folder]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    "profile", ["pinto2023-physical", "pinto2023", "motorway", "motorway-risk"]
)
def test_scenarios_have_no_issue(profile: str, tmp_path: Path):
    runs = ot.simulate(ot.sample(profile, num_simulations=3, seed=2))
    write_openscenario(runs, np.arange(3), tmp_path, events={1: {"attempt": 2.0}})
    said = issues(tmp_path)
    assert said.returncode == 0, said.stdout + said.stderr
    assert "6 files" in said.stdout


def test_a_scenario_with_vehicles_that_come_and_go_has_no_issue(tmp_path: Path):
    run = ot.simulate(ot.sample("pinto2023-physical", num_simulations=1, seed=2))
    present = run.state_mask.copy()
    present[0, 1:, ::7] = False
    unknown = frozenset(["weather", "kinds", "bodies", "indicators"])
    write_openscenario(run.replace(is_recorded=present, unknown=unknown), np.array([0]), tmp_path)
    said = issues(tmp_path)
    assert said.returncode == 0, said.stdout + said.stderr


def test_every_road_has_no_issue(tmp_path: Path):
    for name in ROAD_NAMES:
        road = known_road(name)
        lanes = tuple(dataclasses.replace(lane, lane_id=-lane.lane_id) for lane in road.lanes)
        turned = {"kerb_side_neighbour": None, "overtaking_side_neighbour": None, "lanes": lanes}
        turned["course"] = None  # Lines and sight of the other way go with its lane.
        for kind, one in {
            "": road,
            "-left": road.mirror(),
            "-turned": dataclasses.replace(road, **turned),
            "-short": dataclasses.replace(road, length=12.0, course=None),
        }.items():
            (tmp_path / f"{name}{kind}.xodr").write_text(write_opendrive(one), encoding="utf-8")
    said = issues(tmp_path)
    assert said.returncode == 0, said.stdout + said.stderr


def test_roads_with_several_limits_have_no_issue(tmp_path: Path):
    lower = (
        SpeedLimitSpan(start=100.0, stop=300.0, speed=20.0),
        SpeedLimitSpan(start=300.0, stop=400.0, speed=9.0),
    )
    against = SpeedLimitSpan(start=400.0, stop=5000.0, speed=15.0, direction=-1)
    for name, limits in (("town06", lower), ("rural", lower[:1]), ("rural", (*lower[1:], against))):
        road = dataclasses.replace(known_road(name), course=RoadCourse(speed_limit_spans=limits))
        for kind, one in (("", road), ("-left", road.mirror())):
            text = write_opendrive(one)
            (tmp_path / f"{name}{len(limits)}{kind}.xodr").write_text(text, encoding="utf-8")
    said = issues(tmp_path)
    assert said.returncode == 0, said.stdout + said.stderr
    assert "6 files" in said.stdout


def test_roads_and_scenarios_with_two_directions_bends_and_slopes_have_no_issue(tmp_path: Path):
    world = scenario(
        pair(420.0, gap_demand_factor=0.0),
        road=on(known_road("rural"), *BENDS, grade=HILLS),
        horizon=9.0,
    )
    write_openscenario(ot.simulate(world), np.arange(1), tmp_path)
    rural = known_road("rural")
    for kind, one in {
        "winding": on(rural, *BENDS, grade=HILLS),
        "left": on(rural, *BENDS, grade=HILLS).mirror(),
        "one-way": on(known_road("town06"), *BENDS),
    }.items():
        (tmp_path / f"{kind}.xodr").write_text(write_opendrive(one), encoding="utf-8")
    said = issues(tmp_path)
    assert said.returncode == 0, said.stdout + said.stderr
    assert "5 files" in said.stdout


def test_an_issue_is_found(tmp_path: Path):
    write_openscenario(
        ot.simulate(ot.sample("pinto2023", num_simulations=1, seed=2)), np.array([0]), tmp_path
    )
    file = tmp_path / "simulation-000000.xosc"
    text = file.read_text(encoding="utf-8")
    wrong = text.replace(
        'Actors selectTriggeringEntities="false"><EntityRef entityRef="ego"',
        'Actors selectTriggeringEntities="false"><EntityRef entityRef="nobody"',
    )
    assert wrong != text
    file.write_text(wrong, encoding="utf-8")
    said = issues(tmp_path)
    assert said.returncode == 1
    assert "nobody" in said.stdout
