"""The page shows the import report of a recording. Needs Chromium."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.support.browser import axe_finds, expect, opened, settle
from tests.support.recordings import OVERTAKE, commonroad
from tests.support.serving import serving
from tests.support.viewing import ROWS, enter

import overtaking as ot
from overtaking.model.import_report import ImportFinding
from overtaking.recordings.scenes import Parts

if TYPE_CHECKING:
    from pathlib import Path

    from playwright.sync_api import Browser

    from overtaking.data.load import Dataset

pytestmark = pytest.mark.ci

ROW = ["a.xml", "motion", "7 (2)", "3.2 s", "2", "left out", "<b>15 m</b> from the line."]


@pytest.fixture
def recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Dataset:
    """A data set of a recording with a finding."""
    finding = ImportFinding(
        recording="a.xml",
        check="motion",
        vehicle="7 (2)",
        first_time_s=3.2,
        rows=2,
        consequence="left out",
        detail="<b>15 m</b> from the line.",
    )
    monkeypatch.setattr(Parts, "import_findings", property(lambda _: (finding,)))
    scene = tmp_path / "a.xml"
    scene.write_text(commonroad(OVERTAKE), encoding="utf-8")
    with pytest.warns(ot.RecordingWarning):
        return ot.import_recording("commonroad", scene, tmp_path / "data")


def test_an_exported_page_has_a_row_for_each_finding(
    browser: Browser, recorded: Dataset, tmp_path: Path
):
    page_file = tmp_path / "page.html"
    ot.write_viewer_page(recorded, page_file, simulation_ids=[0])
    with opened(browser, page_file, bypass_csp=True) as page:  # Else axe may not run in it.
        report = page.locator("main details.report").first
        expect(report.locator("summary")).to_have_text("Import report: 1 finding in the recording")
        report.locator("summary").click()
        assert report.locator("tbody td").all_inner_texts() == ROW
        settle(page)
        assert axe_finds(page) == []


def test_the_page_of_a_server_shows_the_report_beside_all_simulations(
    browser: Browser, recorded: Dataset
):
    with serving(recorded, "default") as url:
        count = len(recorded)
        key = enter(browser, url, f"{count} of {count} simulations")
        context = browser.new_context(storage_state=key)
        page = context.new_page()
        page.goto(url.partition("#")[0])
        page.wait_for_selector(ROWS)
        report = page.locator(".overview details.report")
        report.locator("summary").click()
        assert report.locator("tbody td").all_inner_texts() == ROW
        context.close()


def test_a_page_of_simulations_has_no_report(browser: Browser, tmp_path: Path):
    runs = ot.simulate(ot.sample("motorway", num_simulations=2, seed=1))
    ot.write_viewer_page(runs, tmp_path / "page.html", simulation_ids=[0])
    with opened(browser, tmp_path / "page.html") as page:
        expect(page.locator("details.report")).to_have_count(0)
