"""The page shows the values of the tables, for the right vehicle and time. Needs Chromium."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.support.browser import expect, opened, settle
from tests.support.recordings import OVERTAKE, Mover, commonroad
from tests.support.serving import serving
from tests.support.viewing import ROWS, at, enter

import overtaking as ot
from overtaking.cli import main
from overtaking.labels.law.judging import STORED_POLICIES
from overtaking.model.trajectories import NO_VEHICLE, ManoeuvreKind
from overtaking.model.verdicts import OvertakeClass, Verdict
from overtaking.show.wording import symbol

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from playwright.sync_api import Browser, Page

    from overtaking.data.load import Dataset

pytestmark = pytest.mark.ci

PROFILES = ("pinto2023-physical", "motorway", "rural")
NUM_SIMULATIONS = 24
NUM_OPENED = 4
WIDTHS_PX = (390, 768, 1280, 1440)
COLLISIONS = (73, 138, 365)
"""Simulations of `pinto2023-physical` that end in a collision. In 365 policy `paper` counts no
broken rule."""

WIDER_THAN_CONTAINER = """() => [...document.querySelectorAll("body *")].filter(element => {
  const style = getComputedStyle(element);
  const isScrolled = ["auto", "scroll"].includes(style.overflowX);
  const isHidden = !element.checkVisibility() || style.clipPath !== "none";
  if (isHidden || style.display === "inline") return false;
  if (element.closest("svg, select, .unseen, .cursor")) return false;
  if (!isScrolled && element.scrollWidth > element.clientWidth + 1) return true;
  const outer = element.closest(".wide, .choices, .runs");
  return !outer && element.getBoundingClientRect().right > innerWidth + 1;
}).map(element => `${element.tagName} ${element.className} ${element.id}`)"""

SCROLLED_TABLES = """() => [...document.querySelectorAll(".wide")]
  .filter(element => element.checkVisibility() && element.scrollWidth > element.clientWidth + 1)
  .map(element => element.getAttribute("aria-label"))"""


@pytest.fixture(scope="module", params=PROFILES)
def dataset(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    folder = tmp_path_factory.mktemp("values") / "data"
    return ot.generate_dataset(request.param, num_simulations=NUM_SIMULATIONS, seed=1, out=folder)


@pytest.fixture(scope="module")
def url(dataset: Dataset) -> Iterator[str]:
    with serving(dataset) as address:
        yield address


@pytest.fixture(scope="module")
def key(browser: Browser, url: str) -> Any:
    return enter(browser, url, f"{NUM_SIMULATIONS} of {NUM_SIMULATIONS} simulations")


@pytest.fixture(scope="module")
def collisions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of simulations that end in a collision."""
    batch = ot.simulate(
        ot.sample("pinto2023-physical", num_simulations=max(COLLISIONS) + 1, seed=1)
    )
    page_file = tmp_path_factory.mktemp("collisions") / "page.html"
    return ot.write_viewer_page(batch, page_file, simulation_ids=COLLISIONS).path


def values_of_show(
    dataset: Dataset, number: int, capsys: pytest.CaptureFixture[str]
) -> dict[str, Any]:
    """The values of `overtaking show --json`."""
    assert main(["show", dataset.where, str(number), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def with_decisions(dataset: Dataset, kind: str) -> list[int]:
    """The first simulations whose ego takes a decision of a kind."""
    percepts = dataset.percepts()
    numbers = percepts[percepts["kind"] == kind]["simulation"].unique()
    return [int(number) for number in numbers[:NUM_OPENED]]


def seek(page: Page, frame: int) -> str:
    """Show a frame; returns its description."""
    page.fill("#frame", str(frame))
    page.press("#frame", "Enter")
    expect(page.locator("#now")).to_contain_text(f"frame {frame};")
    return page.inner_text("#now")


def gap_cell(detected: bool, gap: int, true_gap: int) -> str:
    """A cell of believed and true gap, from recorded millimetres."""
    believed = f"{gap / 1000:.1f}" if detected else "not seen"
    return f"{believed} ({true_gap / 1000:.1f})".replace("-", "−")


def assert_same_gaps(text: str, expected: str) -> None:
    """Both cells have the same words, and gaps that differ by rounding alone."""
    number = r"−?\d+\.\d"
    assert re.sub(number, "#", text) == re.sub(number, "#", expected), (text, expected)
    gaps, expected_gaps = (
        [float(gap.replace("−", "-")) for gap in re.findall(number, cell)]
        for cell in (text, expected)
    )
    assert gaps == pytest.approx(expected_gaps, abs=0.11)


def test_beliefs_of_decisions_stand_beside_the_recorded_vehicle(
    browser: Browser, url: str, key: Any, dataset: Dataset
):
    num_compared = 0
    with at(browser, url, key, "#sim=0") as page:
        for number in with_decisions(dataset, ManoeuvreKind.PULL_OUT.name):
            page.evaluate(f"location.hash = 'sim={number}'")
            expect(page).to_have_title(re.compile(f"^Simulation {number},"))
            expect(page.locator(".key.belief")).to_have_count(1)
            settle(page)
            if not page.evaluate("document.querySelector('.numbers').open"):
                page.click(".numbers summary")
            trajectories = dataset.trajectory(number)
            percepts = trajectories.percepts
            for row in np.flatnonzero(percepts.valid[0]):
                frame = int(percepts.time[0, row]) // trajectories.scenario.frame_interval_ms
                if frame >= trajectories.num_frames[0]:
                    continue
                seek(page, frame)
                expect(page.locator(".numbers caption")).to_contain_text(
                    f"{percepts.time[0, row] / 1000:.2f} s"
                )
                cells = {
                    str(vehicle.locator("b").text_content()).split()[0]: vehicle.locator("td")
                    for vehicle in page.locator(".numbers tbody tr").all()
                }
                for place in range(percepts.slot.shape[2]):
                    vehicle = int(percepts.slot[0, row, place])
                    if vehicle == NO_VEHICLE:
                        continue
                    expected = gap_cell(
                        bool(percepts.is_detected[0, row, place]),
                        int(percepts.gap[0, row, place]),
                        int(percepts.true_gap[0, row, place]),
                    )
                    text = cells[symbol(vehicle)].nth(5).inner_text()
                    assert_same_gaps(text, expected)
                    num_compared += 1
    assert num_compared >= 2


def test_a_belief_in_words_and_legend_is_about_the_named_vehicle(
    browser: Browser, url: str, key: Any, dataset: Dataset
):
    """Also after the decision, when another vehicle is the leader in the driver's mind."""
    num_beliefs = num_changed = 0
    with at(browser, url, key, "#sim=0") as page:
        for number in with_decisions(dataset, ManoeuvreKind.PULL_OUT.name):
            page.evaluate(f"location.hash = 'sim={number}'")
            expect(page).to_have_title(re.compile(f"^Simulation {number},"))
            expect(page.locator(".key.belief")).to_have_count(1)
            settle(page)
            trajectories = dataset.trajectory(number)
            signals = ot.label(trajectories).signals
            percepts, interval = trajectories.percepts, trajectories.scenario.frame_interval_ms
            is_pull_out = percepts.valid[0] & (percepts.kind[0] == ManoeuvreKind.PULL_OUT)
            decision = int(percepts.time[0, is_pull_out][0]) // interval
            for frame in range(decision, min(decision + 80, int(trajectories.num_frames[0])), 8):
                text = seek(page, frame)
                for name, gap, belief in re.findall(
                    r"(?:target|next ahead in its lane is) (\w)(?: is|,) ([\d.]+) m \w+, "
                    r"believed ([\d.]+) m",
                    text,
                ):
                    # Drivers misjudge gaps by some per cent; the next vehicle is much farther away.
                    assert abs(float(belief) - float(gap)) < 3.0 + 0.35 * float(gap), (name, text)
                    num_beliefs += 1
                leader = int(signals.neighbour_slot[0, 0, frame])
                legend = page.inner_text(".key.belief")
                if leader == NO_VEHICLE:
                    assert re.fullmatch(r"\s*believed –", legend), legend
                else:
                    assert legend.split()[0] == symbol(leader)
                    next_ahead = page.locator(".row.chart", has_text="Gap").locator(".key.ego")
                    name, gap = next_ahead.inner_text().replace("−", "-").split()[-2:]
                    assert name == symbol(leader)
                    assert float(gap) == pytest.approx(float(signals.gap[0, 0, frame]), abs=0.051)
                num_changed += leader != int(signals.neighbour_slot[0, 0, decision])
    assert num_changed > 0
    assert num_beliefs > 5


def test_the_chart_of_gaps_holds_every_gap(browser: Browser, url: str, key: Any, dataset: Dataset):
    with at(browser, url, key, "#sim=0") as page:
        for number in range(NUM_OPENED):
            page.evaluate(f"location.hash = 'sim={number}'")
            expect(page).to_have_title(re.compile(f"^Simulation {number},"))
            settle(page)
            trajectories = dataset.trajectory(number)
            signals, num_frames = ot.label(trajectories).signals, int(trajectories.num_frames[0])
            has_leader = signals.neighbour_slot[0, 0, :num_frames] != NO_VEHICLE
            chart = page.locator(".row.chart", has_text="Gap")
            curve = str(chart.locator("path.curve.ego").get_attribute("d"))
            assert curve.count("L") == has_leader.sum()
            places = [float(y) for y in re.findall(r"[ML][\d.]+ (-?[\d.]+)", curve)]
            height = float(str(chart.locator("svg").first.get_attribute("height")))
            assert all(0 < y < height for y in places)
            if not has_leader.any():
                continue
            highest = float(signals.gap[0, 0, :num_frames][has_leader].max())
            texts = chart.locator(".tick-text").all_text_contents()
            ticks = [float(text) for text in texts if re.fullmatch(r"-?\d+", text)]
            arrows = [float(text[2:].replace("−", "-")) for text in texts if text[0] == "▲"]
            assert highest <= 1.05 * max(ticks) or max(arrows) >= round(highest)


def test_margins_and_marks_are_those_of_the_verdict(
    browser: Browser, url: str, key: Any, dataset: Dataset, capsys: pytest.CaptureFixture[str]
):
    """The mark stands beside the margin of the whole simulation, also where `now` is positive."""
    num_positive = 0
    with at(browser, url, key, "#sim=0") as page:
        for number in range(NUM_OPENED):
            values = values_of_show(dataset, number, capsys)
            page.evaluate(f"location.hash = 'sim={number}'")
            expect(page).to_have_title(re.compile(f"^Simulation {number},"))
            settle(page)
            broken = {breach["rule"]: breach for breach in values["broken"]}
            paper = values["policies"]["paper"]
            frames = np.linspace(0, values["num_frames"] - 1, 7).astype(int).tolist()
            for frame in frames:
                text = seek(page, frame)
                shown_as_broken = re.findall(r"L\d+s? [A-Z]", text.partition("Broken before")[0])
                for row in page.locator("button.law").all():
                    code = str(row.get_attribute("data-rule"))
                    mark = row.inner_text().split()[0]
                    least = row.locator(".least").inner_text().removeprefix("least ")
                    now = row.locator(".now").inner_text().removeprefix("now ")
                    expected_mark = "✓"
                    if code in broken:
                        margin = broken[code]["margin"]
                        expected_mark = "✗" if code in paper["broken"] else "(✗)"
                        assert least.startswith("−")
                        assert float(least.split()[0].replace("−", "-")) == pytest.approx(
                            margin, abs=0.0051
                        )
                        span = range(broken[code]["first_frame"], broken[code]["last_frame"] + 1)
                        if now.startswith("−"):
                            assert frame in span
                    else:
                        assert least.startswith("+")
                        assert not now.startswith("−")
                    assert mark == expected_mark
                    is_broken_now = now == "broken" or now.startswith("−")
                    assert is_broken_now == any(rule.split()[0] == code for rule in shown_as_broken)
                    num_positive += mark == "✗" and now.startswith("+")
                chips = page.locator(".alerts li").all_inner_texts()
                assert {chip.split()[1] for chip in chips} <= set(paper["broken"])
    assert num_positive > 0 or dataset.profile != PROFILES[0]


def test_only_rules_that_the_policy_counts_are_red(
    browser: Browser, url: str, key: Any, dataset: Dataset, capsys: pytest.CaptureFixture[str]
):
    for policy in (policy.name for policy in STORED_POLICIES):
        with at(browser, url, key, f"#policy={policy}") as page:
            for number in range(NUM_OPENED):
                values = values_of_show(dataset, number, capsys)
                codes = page.locator(ROWS).nth(number).locator(".codes")
                counted = codes.locator(".counted-rule").all_inner_texts()
                others = codes.locator(".other-rule").all_inner_texts()
                assert set(counted) == set(values["policies"][policy]["broken"])
                broken = {breach["rule"] for breach in values["broken"]}
                assert {code.strip("()") for code in others} == broken - set(counted)
                assert all(code[0] == "(" for code in others)
                colours = codes.evaluate(
                    "cell => [cell, ...cell.children].map(one => getComputedStyle(one).color)"
                )
                red = page.evaluate(
                    "getComputedStyle(document.documentElement).getPropertyValue('--breach')"
                )
                parts = [int(red.strip()[k : k + 2], 16) for k in (1, 3, 5)]
                assert colours.count(f"rgb({', '.join(map(str, parts))})") == len(counted)


def test_the_law_at_a_collision_names_what_was_broken_before(browser: Browser, collisions: Path):
    with opened(browser, collisions, f"#sim={COLLISIONS[0]}") as page:
        for number in COLLISIONS:
            page.evaluate(f"location.hash = 'sim={number}'")
            expect(page).to_have_title(re.compile(f"^Simulation {number},"))
            settle(page)
            trajectories = ot.simulate(
                ot.sample("pinto2023-physical", num_simulations=number + 1, seed=1)
            )
            labelled = ot.label(trajectories).select(np.array([number]))
            findings, frame = labelled.findings, int(labelled.events.collision[0])
            seconds = trajectories.scenario.frame_interval_ms / 1000
            text = seek(page, frame)
            assert "No rule is broken in this simulation" not in text
            for place, code in enumerate(findings.rule_codes):
                last = int(findings.last_frame[0, place])
                if findings.verdict[0, place] == Verdict.ILLEGAL and last < frame:
                    earlier = text.partition("before:")[2]
                    assert re.search(rf"\b{code} (until|at) {last * seconds:.2f} s", earlier)


def test_a_simulation_without_breaches_says_so(browser: Browser, tmp_path: Path):
    labelled = ot.label(ot.simulate(ot.sample("pinto2023-physical", num_simulations=200, seed=1)))
    is_broken = (labelled.findings.verdict == Verdict.ILLEGAL).any(axis=1)
    number = int(np.flatnonzero(~is_broken)[0])
    page_file = ot.write_viewer_page(labelled, tmp_path / "page.html", simulation_ids=[number]).path
    with opened(browser, page_file) as page:
        assert "No rule is broken in this simulation." in seek(page, 3)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set of a recording: an overtake, then vehicles that follow, one for three frames."""
    folder = tmp_path_factory.mktemp("recording")
    short = [
        Mover(number=1, s=500.0, lane=2, last=2),
        Mover(number=2, s=530.0, lane=2, speed=24.0, last=2),
    ]
    scene, data = folder / "scene.xml", folder / "data"
    scene.write_text(commonroad([*short, *OVERTAKE]), encoding="utf-8")
    assert main(["import", "commonroad", str(scene), "--out", str(data), "-q"]) == 0
    return data


def test_a_recording_opens_on_a_long_simulation_and_marks_short_ones(
    browser: Browser, recording: Path
):
    dataset = ot.load_dataset(recording)
    num_frames = dataset.simulations()["num_frames"].tolist()
    short = num_frames.index(3)
    page_file = recording.parent / "page.html"
    numbers = f"{short}-{len(dataset) - 1}"
    export = ["view", str(recording), "--export", str(page_file), "--simulations", numbers, "-q"]
    assert main(export) == 0
    with opened(browser, page_file) as page:
        link = page.evaluate("location.hash")
        number = int(re.findall(r"sim=(\d+)", link)[0])
        assert num_frames[number] > 100
        rows = page.locator(".runs a")
        assert "very short: 3 frames" in rows.first.inner_text()
        assert "very short" not in page.locator(f".runs a[data-sim='{number}']").inner_text()
        assert "very short" not in page.inner_text(".facts")
        rows.first.click()
        expect(page.locator(".facts")).to_contain_text("3 frames, very short")
    assert main(["view", str(recording), "--export", str(page_file), "-q"]) == 0
    with opened(browser, page_file) as page:  # The first of each class that lasts long enough.
        numbers = [int(str(row.get_attribute("data-sim"))) for row in page.locator(".runs a").all()]
        assert len(numbers) == 2
        assert min(num_frames[number] for number in numbers) > 100
    with serving(dataset) as url:
        key = enter(browser, url, f"{len(dataset)} of {len(dataset)} simulations")
        with at(browser, url, key) as page:
            assert "very short: 3 frames" in page.locator(ROWS).nth(short).inner_text()


def test_a_page_opens_on_the_first_attempt(browser: Browser, tmp_path: Path):
    labelled = ot.label(ot.simulate(ot.sample("pinto2023-physical", num_simulations=8, seed=1)))
    classes = labelled.labels.classes[:, 0]
    numbers = [*np.flatnonzero(classes == OvertakeClass.NO_ATTEMPT)[:1].tolist(), 7]
    assert classes[7] != OvertakeClass.NO_ATTEMPT
    page_file = ot.write_viewer_page(labelled, tmp_path / "page.html", simulation_ids=numbers).path
    with opened(browser, page_file) as page:
        expect(page).to_have_title(re.compile(r"^Simulation 7,"))


def test_no_element_is_wider_than_its_container(browser: Browser, url: str, key: Any):
    for link in ("", "#sim=3&t=3", "#sim=2&t=1&against=strict&if=STAY@1&vs=1"):
        with at(browser, url, key, link) as page:
            if link:
                page.click(".numbers summary")
                page.wait_for_selector(".numbers td")
            for width in WIDTHS_PX:
                page.set_viewport_size({"width": width, "height": 900})
                settle(page)
                assert page.evaluate(WIDER_THAN_CONTAINER) == [], (link, width)
                assert page.evaluate("document.documentElement.scrollWidth") <= width
                if width >= 1280:
                    assert page.evaluate(SCROLLED_TABLES) == [], (link, width)


def test_nothing_lies_over_the_road_on_a_phone(browser: Browser, collisions: Path):
    phone = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}
    with opened(browser, collisions, f"#sim={COLLISIONS[0]}&t=4", **phone) as page:
        assert page.locator(".alerts li").count() > 0
        road = page.locator("#road").bounding_box()
        assert road is not None
        covering = page.evaluate(
            """() => {
              const road = document.getElementById("road");
              const box = road.getBoundingClientRect();
              const names = new Set();
              for (let x = box.left + 2; x < box.right - 2; x += 8) {
                for (let y = box.top + 2; y < box.bottom - 2; y += 8) {
                  const top = document.elementsFromPoint(x, y).filter(one => !one.contains(road));
                  for (const one of top) names.add(one.className);
                }
              }
              return [...names];
            }"""
        )
        overlaps = page.evaluate(
            """() => {
              const road = document.getElementById("road").getBoundingClientRect();
              return [...document.querySelectorAll(".sky, .alerts, .alerts li")]
                .map(one => one.getBoundingClientRect())
                .filter(box => box.top < road.bottom && box.bottom > road.top).length;
            }"""
        )
    assert covering == []
    assert overlaps == 0
