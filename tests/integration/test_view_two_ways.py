"""The page of a road with two directions, in a browser. Needs Chromium."""

from __future__ import annotations

import dataclasses
import re
from typing import TYPE_CHECKING

import pytest
from tests.support.browser import chromium, opened, settle
from tests.support.cases import two_way_road
from tests.support.overtakes import meeting, rural

import overtaking as ot
from overtaking.model.road_course import CentreLineSpan, RoadCourse, RoadMark

if TYPE_CHECKING:
    from pathlib import Path

SOLID = (200.0, 400.0)
COURSE = RoadCourse(
    centre_line_spans=(CentreLineSpan(start=SOLID[0], stop=SOLID[1], mark=RoadMark.SOLID),)
)
BRIGHT = """() => {
  const road = document.getElementById("road");
  const copy = Object.assign(document.createElement("canvas"), { width: road.width, height: 1 });
  const c = copy.getContext("2d");
  c.drawImage(road, 0, -Math.floor(road.height / 2));
  const row = c.getImageData(0, 0, road.width, 1).data;
  let many = 0;
  for (let k = 0; k < row.length; k += 4) many += row[k] > 180 && row[k + 2] > 180;
  return many / road.width;
}"""
"""The share of what is painted in the middle of the road, where its two directions meet."""


@pytest.mark.ci
@pytest.mark.parametrize("side", ["right", "left"])
def test_both_directions_are_drawn_and_told(tmp_path: Path, side: str):
    road = dataclasses.replace(two_way_road(), course=COURSE)
    made = rural(meeting(60.0), road=road if side == "right" else road.mirror())
    runs = made.trajectories
    page_of = ot.write_viewer_page(runs, tmp_path / "page.html", simulation_ids="all").path
    s = runs.states.s[0, 0] / 1000.0
    times = {
        is_solid: int(abs(s - place).argmin()) * runs.scenario.frame_interval_ms / 1000.0
        for is_solid, place in ((False, 100.0), (True, 300.0))
    }
    with chromium() as browser, opened(browser, page_of) as page:
        shares = {}
        for is_solid, seconds in times.items():
            page.evaluate(f"location.hash = 'sim=0&t={seconds}&ghosts=0'")
            page.wait_for_function(f"document.getElementById('seconds').value == {seconds}")
            settle(page)
            shares[is_solid] = page.evaluate(BRIGHT)
        assert shares[True] > 0.8
        assert 0.2 < shares[False] < 0.5
        page.keyboard.press("Home")
        comes = re.search(r"oncoming (\w+) is (\d+) m ahead", page.inner_text("#now"))
        assert comes
        lengths = runs.scenario.vehicles.length[0]
        last = runs.scenario.vehicles.length.shape[1] - 1
        away = float(runs.states.s[0, last, 0] - runs.states.s[0, 0, 0]) / 1000.0
        assert int(comes[2]) == pytest.approx(away - (lengths[0] + lengths[last]) / 2, abs=1.0)
        page.click(".numbers summary")
        page.wait_for_selector(".numbers td")  # The table is filled once it is open.
        assert f"{comes[1]} oncoming" in page.inner_text(".numbers")
