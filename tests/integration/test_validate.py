"""`overtaking validate`, from the outside."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import overtaking as ot
from overtaking.analysis.validation.targets import targets

pytestmark = pytest.mark.ci

COMMAND = [sys.executable, "-m", "overtaking", "validate", "motorway", "-n", "8"]
US101 = sorted((Path(__file__).parents[3] / "shared/data/commonroad").glob("USA_US101*.xml"))


@pytest.fixture(scope="module")
def found():
    return ot.validate_profile("motorway", num_simulations=8, seed=3)


def test_every_figure_has_a_value_an_interval_and_most_a_verdict(found):
    assert found.simulations == 8
    judged = {figure.name for figure in found.figures if figure.met is not None}
    waiting = {figure.name for figure in found.figures if figure.needs_km}
    unmeasured = {figure.name for figure in found.figures if np.isnan(figure.value)}
    limited = {name for name, one in targets().items() if one.limits}
    assert judged == limited - waiting - unmeasured
    assert {figure.name for figure in found.figures if figure.has_target} == limited
    assert waiting == {name for name, one in targets().items() if one.min_distance}
    assert len({figure.name for figure in found.figures}) == len(found.figures)
    assert sum(sum(one.counts.values()) for one in found.strata) >= 4


def test_the_command_prints_the_same_numbers_as_json(found):
    done = subprocess.run(
        [*COMMAND, "--seed", "3", "--json"], capture_output=True, text=True, check=False
    )
    assert done.stderr == ""
    assert json.loads(done.stdout) == json.loads(json.dumps(found.values()))
    assert done.returncode == (0 if found.is_met else 1)


def printed(values: dict[str, Any]) -> str:
    """The page for people."""
    from rich.console import Console

    from overtaking.cli.validation_page import render

    console = Console(width=200, record=True, file=io.StringIO())
    console.print(render(values))
    return console.export_text()


def test_a_page_for_people_has_every_figure(found):
    page = printed(found.values())
    assert all(figure.title in page for figure in found.figures)
    for figure in found.figures:
        line = next(line for line in page.splitlines() if line.startswith(figure.title))
        assert figure.standing in line
        is_ours = "choice" in (figure.standing, figure.source)
        assert (f"needs {figure.needs_km:,.0f} km" in line) == bool(figure.needs_km)
        assert ("our limits" in line) == (figure.met is not None and is_ours)
        assert ("met" in line or "missed" in line) == (figure.met is not None and not is_ours)


def test_what_was_not_measured_is_neither_met_nor_missed(tmp_path):
    found = ot.validate_profile("rural", num_simulations=3, seed=3)  # Nobody overtakes.
    figure = next(one for one in found.figures if one.name == "time_in_other_lane")
    assert (np.isnan(figure.value), figure.has_target, figure.met) == (True, True, None)
    page = printed(found.values()).splitlines()
    line = next(line for line in page if line.startswith(figure.title))
    assert "not measured" in line
    assert "missed" not in line
    ot.plot(found, out=tmp_path / "figures.png")


def test_a_profile_without_a_flow_is_judged_on_its_open_road():
    found = ot.validate_profile("pinto2023-physical", num_simulations=8)
    names = [figure.name for figure in found.figures]
    assert "own_lane_changes_per_km" not in names
    assert names[0] == "lane_changes_per_km"


@pytest.mark.parametrize("name", ["figures.png", "figures.svg"])
def test_the_picture_is_written_whole(found, tmp_path, name):
    ot.plot(found, out=tmp_path / name)
    content = (tmp_path / name).read_bytes()
    assert content.startswith(b"\x89PNG" if name.endswith("png") else b"<?xml")
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_an_enriched_profile_is_held_against_the_one_that_it_enriches():
    enriched = ot.validate_profile("motorway-risk", num_simulations=96, seed=5)
    rates = {rate.title: rate for rate in enriched.comparison}
    assert {"median time gap of followers", "simulations with an attempt"} <= set(rates)
    assert all(rate.agrees for rate in enriched.comparison)
    values = json.loads(json.dumps(enriched.values()))
    assert len(values["comparison"]) == len(rates)
    # So few simulations cannot have all of five classes in each of seven kinds of weather.
    assert len(values["missing"]) == len(enriched.missing) > 0
    page = printed(values)
    assert all(title in page for title in rates)
    assert "all agree" in page


def test_a_profile_without_a_proposal_is_compared_with_nothing(found):
    assert found.comparison == ()


@pytest.mark.skipif(not US101, reason="the recordings of US-101 are not here")
def test_recordings_are_shown_beside_rings_as_dense():
    found = ot.validate_profile("motorway", num_simulations=8, seed=3, recordings=US101[0])
    compared = found.recordings
    assert compared is not None
    assert compared.files == (US101[0].name,)
    assert 20.0 < compared.densities[0] < 60.0
    gaps = compared.likenesses[0]
    assert min(gaps.recorded, gaps.simulated) > 100
    assert 0.0 < gaps.distance < 1.0
    page = printed(json.loads(json.dumps(found.values())))
    assert all(one.title in page for one in compared.likenesses)
    assert found.is_met == all(figure.met is not False for figure in found.figures)


def test_a_recording_that_cannot_be_used_is_named(tmp_path):
    (tmp_path / "broken.xml").write_text("<commonRoad/>", encoding="utf-8")
    compared = ot.validate_profile("motorway", num_simulations=2, recordings=tmp_path).recordings
    assert compared is not None
    assert compared.files == compared.densities == ()
    assert "broken.xml" in compared.unused[0]
    assert all(one.recorded == one.simulated == 0 for one in compared.likenesses)
