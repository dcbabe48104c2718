"""The page of `overtaking view` in a browser: from disk, without a network. Needs Chromium."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.support.browser import PATIENCE_MS, axe_finds, expect, opened, settle

import overtaking as ot
from overtaking.cli import main
from overtaking.knowledge.glossary import terms
from overtaking.show import wording
from overtaking.show.report.page import Section, view_block
from overtaking.show.report.page import page as page_of_report
from overtaking.show.wording import breach_words, sentence

if TYPE_CHECKING:
    from pathlib import Path

    from playwright.sync_api import Browser, Locator, Page

pytestmark = pytest.mark.ci

PHONE = {"width": 360, "height": 740}
FRAME = "Number(document.getElementById('frame').value)"


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Forty simulations; among them is every ending."""
    folder = tmp_path_factory.mktemp("view") / "data"
    ot.generate_dataset("pinto2023-physical", num_simulations=40, seed=1, out=folder)
    return folder


@pytest.fixture(scope="module")
def path(data: Path) -> Path:
    """The page of the first twelve."""
    target = data.parent / "page.html"
    assert main(["view", str(data), "--export", str(target), "--simulations", "0-11", "-q"]) == 0
    return target


def shows(page: Page, number: int | str) -> None:
    """Wait until the page shows a simulation."""
    expect(page).to_have_title(re.compile(f"^Simulation {number},"))


def moment(page: Page) -> dict[str, Any]:
    """What the page shows, once its address says so."""
    settle(page)
    return {
        "title": page.title(),
        "frame": page.evaluate(FRAME),
        "link": page.evaluate("location.hash"),
        "controls": page.evaluate("[...document.querySelectorAll('select')].map(one => one.value)"),
        "beliefs": page.is_checked("#ghosts"),
        "now": page.inner_text("#now"),
    }


def test_a_link_brings_back_what_was_found_by_mouse(browser: Browser, path: Path):
    with opened(browser, path) as page:
        page.select_option("#filter", "Success_I")
        settle(page)
        rows = page.locator(".runs a")
        assert rows.count() == int(page.inner_text(".runs + *, [role=status]").split()[0])
        number = str(rows.nth(1).get_attribute("data-sim"))
        rows.nth(1).click()
        shows(page, number)
        settle(page)
        page.click("#play")
        expect(page.locator("#frame")).to_have_value(re.compile(r"^([5-9]|\d\d+)$"))
        page.click("#play")
        page.get_by_label("One frame on").click()
        page.select_option("select[aria-label=Camera]", "all")
        page.uncheck("#ghosts")
        rule = page.locator("button.law").first
        rule.click()
        assert rule.get_attribute("aria-pressed") == "true"
        article = re.search(r"Articles? \d+", page.inner_text("#rule"))
        assert article
        assert article[0] in str(rule.text_content())
        before = moment(page)
        page.reload()
        page.wait_for_selector(".board")
        assert moment(page) == before
        link = before["link"]
    with opened(browser, path, link) as page:
        assert moment(page) == before


def test_everything_can_be_done_with_the_keyboard(browser: Browser, path: Path):
    with opened(browser, path) as page:
        assert page.evaluate(FRAME) == 0
        press = page.keyboard.press
        press("ArrowRight")
        press("ArrowRight")
        press("ArrowLeft")
        assert page.evaluate(FRAME) == 1
        press("Shift+ArrowRight")
        assert page.evaluate(FRAME) == 21
        press("Home")
        press("]")
        assert page.inner_text("#now").count("E ") == 1
        press("End")
        last = page.evaluate(FRAME)
        assert last == int(str(page.get_attribute("#slider", "max")))
        press("[")
        assert page.evaluate(FRAME) < last
        press("Home")
        press(" ")
        expect(page.locator("#play")).to_have_attribute("aria-label", "Pause")
        press(" ")
        expect(page.locator("#play")).to_have_attribute("aria-label", "Play")
        press("j")
        shows(page, 1)
        press("k")
        shows(page, 0)
        for key, label, value in (
            ("c", "Camera", "target"),
            ("s", "Stretch across the road", "2"),
            (".", "Speed", "2"),
            ("p", "Policy: which rules count", "default"),
            ("t", "Theme", "light"),
        ):
            press(key)
            assert page.get_by_label(label, exact=True).input_value() == value
        press("g")
        assert not page.is_checked("#ghosts")
        press("l")
        assert page.evaluate("document.activeElement.dataset.rule") in page.inner_text("#rule")
        press("/")
        assert page.evaluate("document.activeElement.id") == "filter"
        page.focus("#play")
        press("?")
        expect(page.locator("#help")).to_be_visible()
        press("Escape")
        expect(page.locator("#help")).to_be_hidden()


def test_every_control_is_reached_by_tab(browser: Browser, path: Path):
    reach = "button, select, input, a[href], summary"
    with opened(browser, path) as page:
        shown = f"[...document.querySelectorAll('{reach}')].filter(one => one.checkVisibility())"
        wanted = page.evaluate(f"(window.wanted = {shown}).length")
        page.evaluate("window.seen = new Set()")
        for _ in range(wanted + 12):  # And the regions that scroll.
            page.keyboard.press("Tab")
            page.evaluate("seen.add(document.activeElement)")
        missed = "wanted.filter(one => !seen.has(one)).map(one => one.outerHTML)"
        assert page.evaluate(missed) == []


def test_the_page_says_what_show_says(
    browser: Browser, path: Path, data: Path, capsys: pytest.CaptureFixture[str]
):
    with opened(browser, path, "#sim=11") as page:
        for number in range(12):
            assert main(["show", str(data), str(number), "--json"]) == 0
            values = json.loads(capsys.readouterr().out)
            page.evaluate(f"location.hash = 'sim={number}'")
            shows(page, number)
            settle(page)
            says(page, values)


def says(page: Page, values: dict[str, Any]) -> None:
    """The page tells what `show --json` told of a simulation."""
    events = [re.split(r"\s*\n\s*", one) for one in page.locator(".events li").all_inner_texts()]
    assert [one[1:] for one in events] == [
        [f"{one['time_s']:.2f} s", sentence(one["event"], values)] for one in values["events"]
    ]
    for name, one in values["policies"].items():
        text = page.inner_text(f"[data-policy={name}]")
        assert one["class"] in text
        assert terms("classes")[one["class"]].meaning in text
        assert all(code in text for code in one["broken"] + one["undecidable"])
    assert page.locator("article.rule").count() == len(values["broken"])
    for one in values["broken"]:
        text = page.inner_text(f"article[data-rule={one['rule']}]")
        told = breach_words(one, values, "–")
        assert all(part in text for part in (told.rule, told.grade, told.facts, *told.remedies))
        assert f"margin {wording.margin_words(one['margin'], one['unit'])}" in text
    law = page.inner_text("#law")
    kept = ("kept", "not_applicable", "text_not_read")
    assert all(", ".join(values[key]) in law for key in kept if values[key])
    assert all(wording.doubt_words(one) in law for one in values["undecidable"])
    facts = page.inner_text(".facts")
    about = (wording.weather_words(values["weather"]), wording.road_words(values["road"]))
    length = f"{values['duration_s']:.2f} s, {values['num_frames']} frames"
    origin = f"profile {values['profile']}, seed {values['seed']}", values["trace_hash"]
    assert all(one in facts for one in (*about, wording.outcome_words(values), length, *origin))
    assert page.locator(".ending").all_inner_texts() == wording.ending_words(values)
    tells_beliefs(page.locator("#beliefs tbody tr"), values)
    rows = page.locator("#vehicles tbody tr").all_inner_texts()
    assert len(rows) == len(values["vehicles"])
    for row, one in zip(rows, values["vehicles"], strict=True):
        speeds = [
            "?" if mps is None else f"{3.6 * mps:.0f}"
            for mps in (one["start_speed_mps"], one["desired_speed_mps"])
        ]
        size = f"{one['length_m']:.1f}×{one['width_m']:.1f}"
        told = (wording.symbol(one["vehicle"]), wording.vehicle_words(one), size, *speeds)
        assert set(told) <= set(cells(row))


def tells_beliefs(rows: Locator, values: dict[str, Any]) -> None:
    """The table of beliefs has the neighbours of every decision."""
    wanted: list[str] = []
    for one in values["decisions"]:
        near = [(place, of) for place, of in one["neighbours"].items() if of is not None]
        told = [wording.percept_words(*each) for each in near] or [("no vehicle near", "", "", "")]
        first = f"{one['time_s']:.2f} s", wording.words(one["kind"])
        wanted += [
            "\t".join((*(("", "") if place else first), *row)) for place, row in enumerate(told)
        ]
    assert [cells(row) for row in rows.all_inner_texts()] == [cells(row) for row in wanted]


def cells(row: str) -> list[str]:
    """The texts of a row of a table."""
    return [one.strip() for one in row.split("\t")]


def test_the_road_is_drawn_and_changes_with_time(browser: Browser, path: Path):
    with opened(browser, path) as page:
        picture = "document.getElementById('road').toDataURL()"
        colours = (
            "(c => new Set(new Uint32Array(c.getContext('2d').getImageData(0, 0, c.width, c.height)"
            ".data.buffer)).size)(document.getElementById('road'))"
        )
        first = page.evaluate(picture)
        assert page.evaluate(colours) > 50
        page.keyboard.press("End")
        assert page.evaluate(picture) != first


def test_who_wants_no_motion_sees_rain_that_stands_still(browser: Browser, tmp_path: Path):
    runs = ot.simulate(ot.sample("pinto2023-physical", num_simulations=40, seed=1))
    rainy = int(np.argmax(runs.scenario.weather.rain))
    made = ot.write_viewer_page(runs, tmp_path / "page.html", simulation_ids=[rainy])
    picture = "document.getElementById('road').toDataURL()"
    drawn: dict[str, list[str]] = {}
    for motion in ("no-preference", "reduce"):
        with opened(browser, made.path, reduced_motion=motion) as page:
            assert page.get_attribute("#play", "aria-label") == "Play"  # It begins at rest.
            drawn[motion] = [page.evaluate(picture)]
            page.keyboard.press("ArrowRight")
            settle(page)
            drawn[motion].append(page.evaluate(picture))
    first, later = zip(*drawn.values(), strict=True)
    assert first[0] == first[1]  # At the beginning all is the same.
    assert later[0] != later[1]


def test_on_a_phone_nothing_scrolls_sideways(browser: Browser, path: Path):
    with opened(browser, path, viewport=PHONE, has_touch=True, is_mobile=True) as page:
        assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
        small = "[...document.querySelectorAll('button, select, summary, input')]"
        sizes = page.evaluate(
            f"{small}.filter(one => one.checkVisibility()).map(one => one.getBoundingClientRect())"
            ".map(box => Math.min(box.width, box.height))"
        )
        assert min(sizes) >= 18  # Check boxes; their labels are larger.


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("viewport", [{"width": 1280, "height": 900}, PHONE], ids=["desk", "phone"])
def test_axe_finds_nothing(browser: Browser, path: Path, scheme: str, viewport: dict[str, int]):
    settings = {"color_scheme": scheme, "viewport": viewport, "bypass_csp": True}
    for number in (0, 2, 8):
        with opened(browser, path, f"#sim={number}&t=3", **settings) as page:
            page.click(".numbers summary")
            assert axe_finds(page) == []
            page.keyboard.press("?")
            assert axe_finds(page) == []


def test_a_report_runs_its_examples_in_a_frame(browser: Browser, path: Path, tmp_path: Path):
    (tmp_path / "view.html").write_bytes(path.read_bytes())
    frame = view_block("view.html", "Examples")
    report = tmp_path / "index.html"
    report.write_text(page_of_report("A report", "", [], [Section("a", "A", [frame])], ""))
    context = browser.new_context(color_scheme="dark")
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    complaints: list[str] = []
    page.on("console", lambda said: complaints.append(said.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(report.as_uri())
    inside = page.frame_locator("iframe")
    expect(inside.locator(".board")).to_be_visible()
    inside.locator("#play").click()
    expect(inside.locator("#frame")).to_have_value(re.compile(r"^([5-9]|\d\d+)$"))
    # The report is light, whatever the system is.
    expect(inside.locator("html")).to_have_attribute("data-theme", "light")
    context.close()
    assert complaints == []


def test_names_of_strangers_are_text(browser: Browser, tmp_path: Path):
    name = "</script><b id=evil>&amp;<!--"
    runs = ot.simulate(ot.sample("pinto2023-physical", num_simulations=2, seed=1))
    runs = runs.replace(scenario=runs.scenario.replace(profile=name))
    made = ot.write_viewer_page(runs, tmp_path / "page.html", simulation_ids="all")
    with opened(browser, made.path) as page:
        assert page.locator("#evil").count() == 0
        assert name in page.inner_text(".facts")


def test_a_recording_that_knows_little_is_shown_too(browser: Browser, tmp_path: Path):
    runs = ot.simulate(ot.sample("pinto2023-physical", num_simulations=1, seed=1))
    unknown = {"stage", "percepts", "weather", "drivers", "bodies", "indicators", "lamps", "marks"}
    present = runs.state_mask.copy()
    present[0, 1:, : runs.num_frames[0] // 2] = False
    present[0, 1, -5:] = False
    runs = runs.replace(unknown=frozenset(unknown), is_recorded=present)
    made = ot.write_viewer_page(runs, tmp_path / "page.html", simulation_ids="all")
    with opened(browser, made.path) as page:
        assert "not recorded" in page.inner_text("#board")
        assert "indicators" in page.inner_text(".facts")
        page.keyboard.press("End")
        assert np.isfinite(page.evaluate(FRAME))
