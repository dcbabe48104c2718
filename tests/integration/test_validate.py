"""`overtaking validate`, from the outside."""

from __future__ import annotations

import io
import json
import subprocess
import sys

import pytest

import overtaking as ot

COMMAND = [sys.executable, "-m", "overtaking.cli", "validate", "motorway", "-n", "8"]
TARGETS = 13


@pytest.fixture(scope="module")
def found():
    return ot.validate("motorway", 8, seed=3)


def test_every_figure_has_a_value_an_interval_and_most_a_verdict(found):
    assert found.simulations == 8
    assert sum(figure.met is not None for figure in found.figures) == TARGETS
    assert len({figure.name for figure in found.figures}) == len(found.figures)
    assert sum(sum(one.counts.values()) for one in found.strata) >= 4


def test_the_command_prints_the_same_numbers_as_json(found):
    done = subprocess.run(
        [*COMMAND, "--seed", "3", "--json"], capture_output=True, text=True, check=False
    )
    assert done.stderr == ""
    assert json.loads(done.stdout) == json.loads(json.dumps(found.values()))
    assert done.returncode == (0 if found.is_met else 1)


def test_a_page_for_people_has_every_figure(found):
    from rich.console import Console

    from overtaking.cli.validation_page import render

    console = Console(width=200, record=True, file=io.StringIO())
    console.print(render(found.values()))
    page = console.export_text()
    assert all(figure.title in page for figure in found.figures)
    for figure in found.figures:
        line = next(line for line in page.splitlines() if line.startswith(figure.title))
        assert figure.standing in line
        is_ours = "choice" in (figure.standing, figure.source)
        assert ("our limits" in line) == (figure.met is not None and is_ours)
        assert ("met" in line or "missed" in line) == (figure.met is not None and not is_ours)


def test_a_profile_without_a_flow_is_judged_on_its_open_road():
    found = ot.validate("pinto2023-physical", 8)
    names = [figure.name for figure in found.figures]
    assert "own_lane_changes_per_km" not in names
    assert names[0] == "lane_changes_per_km"


@pytest.mark.parametrize("name", ["figures.png", "figures.svg"])
def test_the_picture_is_written_whole(found, tmp_path, name):
    ot.plot_validation(found, tmp_path / name)
    content = (tmp_path / name).read_bytes()
    assert content.startswith(b"\x89PNG" if name.endswith("png") else b"<?xml")
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_an_enriched_profile_is_held_against_the_one_that_it_enriches():
    from rich.console import Console

    from overtaking.cli.validation_page import render

    enriched = ot.validate("motorway-risk", 96, seed=5)
    rates = {rate.title: rate for rate in enriched.comparison}
    assert {"median time gap of followers", "simulations with an attempt"} <= set(rates)
    assert all(rate.agrees for rate in enriched.comparison)
    values = json.loads(json.dumps(enriched.values()))
    assert len(values["comparison"]) == len(rates)
    # So few simulations cannot have all of five classes in each of seven kinds of weather.
    assert len(values["missing"]) == len(enriched.missing) > 0
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(render(values))
    page = console.export_text()
    assert all(title in page for title in rates)
    assert "all agree" in page


def test_a_profile_without_a_proposal_is_compared_with_nothing(found):
    assert found.comparison == ()
