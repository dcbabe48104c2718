"""What a page is given, and that it holds nothing but that."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import itertools
import json
import re
import zlib
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import overtaking as ot
from overtaking.core.errors import ConfigError
from overtaking.knowledge.glossary import terms
from overtaking.labels.law.judging import STORED_POLICIES, STORED_POLICY_NAMES
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.import_report import ImportFinding
from overtaking.model.known_roads import known_road
from overtaking.model.overtake_events import NEVER
from overtaking.model.reference_line import CurveSegment
from overtaking.model.road_course import RoadCourse
from overtaking.model.safety_measures import MEASURED_MOMENTS
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.model.verdicts import Verdict
from overtaking.show.description import describe
from overtaking.show.paragraphs import paragraphs
from overtaking.show.view import write as writing
from overtaking.show.view.pack import NEAR, course_of, pack
from overtaking.show.view.page import MAX_FINDINGS, THEMES, page, words

if TYPE_CHECKING:
    from pathlib import Path

    from overtaking.labels.labelling import LabelledTrajectories

NUM_SIMULATIONS = 24


@pytest.fixture(scope="module")
def labelled() -> LabelledTrajectories:
    return ot.label(
        ot.simulate(ot.sample("pinto2023-physical", num_simulations=NUM_SIMULATIONS, seed=1))
    )


@pytest.fixture(scope="module")
def packs(labelled: LabelledTrajectories) -> list[dict[str, Any]]:
    return [pack(one(labelled, number), number) for number in range(NUM_SIMULATIONS)]


def one(labelled: LabelledTrajectories, number: int) -> LabelledTrajectories:
    return labelled.select(np.array([number]))


def summed(differences: list[int], order: int = 1) -> np.ndarray:
    """A column from its differences, as the page does it."""
    column = np.array(differences)
    for _ in range(order):
        column = np.cumsum(column)
    return column


def test_columns_are_the_recorded_integers(
    labelled: LabelledTrajectories, packs: list[dict[str, Any]]
):
    states = labelled.trajectories.states
    orders = {"s": ("s", 2), "d": ("d", 2), "speed": ("speed", 1), "lights": ("lights", 1)}
    for number, values in enumerate(packs):
        frames = int(labelled.trajectories.num_frames[number])
        for vehicle in values["vehicles"]:
            for name, (field, order) in orders.items():
                recorded = getattr(states, field)[number, vehicle["slot"], :frames]
                assert (summed(vehicle[name], order) == recorded).all()
        json.dumps(values, allow_nan=False)


def test_a_vehicle_has_the_frames_in_which_it_was_recorded(labelled: LabelledTrajectories):
    runs = one(labelled, 0).trajectories
    present = runs.state_mask.copy()
    present[0, 1, :7] = present[0, 1, 20:22] = present[0, 1, 90:] = False
    values = pack(ot.label(runs.replace(is_recorded=present)), 0)
    (vehicle,) = (one for one in values["vehicles"] if one["slot"] == 1)
    assert (vehicle["first"], len(vehicle["s"]), vehicle["away"]) == (7, 83, [20, 21])


def test_a_page_is_told_what_show_tells(
    labelled: LabelledTrajectories, packs: list[dict[str, Any]]
):
    for number, values in enumerate(packs):
        assert values["values"] == describe(one(labelled, number), number)
        told = values["told"]
        for key in ("vehicles", "events", "broken", "undecidable", "decisions"):
            assert len(told[key]) == len(values["values"][key])


def test_rows_of_the_law_are_what_is_broken_and_what_is_near(
    labelled: LabelledTrajectories, packs: list[dict[str, Any]]
):
    findings, kinds = labelled.findings, set[bool]()
    for number, values in enumerate(packs):
        rows = {row["rule"]: row for row in values["law"]}
        for place, code in enumerate(findings.rule_codes):
            verdict, margin = findings.verdict[number, place], findings.margin[number, place]
            near = verdict == Verdict.LEGAL and margin < NEAR.get(code, -1.0)
            assert (code in rows) == (verdict == Verdict.ILLEGAL or near)
        for row in rows.values():
            kinds.add(row["breach"] is None)
            if row["margins"]:
                there = [each for each in row["margins"] if each is not None]
                assert abs(summed(there).min() / 1000 - row["margin"]) < 1.5e-3
    assert kinds == {True, False}


def test_a_ghost_stands_where_the_gap_was_believed(
    labelled: LabelledTrajectories, packs: list[dict[str, Any]]
):
    runs, seen = labelled.trajectories, 0
    for number, values in enumerate(packs):
        percepts = runs.percepts
        there = percepts.valid[number][:, None] & (
            percepts.is_detected[number] | (percepts.slot[number] != NO_VEHICLE)
        )
        assert len(values["ghosts"]) == there.sum()
        for ghost in values["ghosts"]:
            frame = round(ghost["time_s"] * 1000) // runs.scenario.frame_interval_ms
            ego = runs.states.s[number, 0, frame] / 1000
            gap = ghost["gap_m"] if ghost["seen"] else ghost["true_gap_m"]
            reach = (ghost["length_m"] + runs.scenario.vehicles.length[number, 0]) / 2
            assert abs(abs(ghost["s_m"] - ego) - reach - gap) < 2e-3 or gap < -reach
            seen += ghost["seen"]
    assert seen > 5


def test_times_to_collision_are_those_of_the_measures_of_safety(
    labelled: LabelledTrajectories, packs: list[dict[str, Any]]
):
    safety, seen = labelled.safety, 0
    for number, values in enumerate(packs):
        frames = int(labelled.trajectories.num_frames[number])
        for place, of in (("ahead", safety.leader), ("behind", safety.follower)):
            column = values["inverse_ttc"][place]
            assert len(column) == frames
            there = [k for k, each in enumerate(column) if each is not None]
            inverse = dict(zip(there, summed([column[k] for k in there]) / 1e4, strict=True))
            for moment in range(1, len(MEASURED_MOMENTS)):  # The first has the worst of all frames.
                frame = int(safety.frame[number, moment])
                if frame == NEVER or not of.valid[number, moment]:
                    continue
                time = float(of.ttc[number, moment])
                assert inverse[frame] == pytest.approx(1 / max(time, 0.1), abs=1e-4)
                seen += np.isfinite(time)
    assert seen > 10


def test_a_road_that_bends_or_rises_says_so():
    straight = known_road("town06")
    line = (CurveSegment(0.0, 0.0, 0.0, 200.0), CurveSegment(200.0, 0.0, 0.0, 300.0, 0.004, 0.004))
    road = dataclasses.replace(
        straight,
        x0=0.0,
        y0=0.0,
        heading=0.0,
        length=500.0,
        course=RoadCourse(segments=line, grade=((0.0, 0.0), (500.0, 0.05))),
    )
    found = course_of(road)
    assert found is not None
    curvature, grade = (summed(found[name]) / 1e5 for name in ("curvature", "grade"))
    assert curvature[10] == 0.0
    assert curvature[60] == pytest.approx(0.004)
    assert grade[50] == pytest.approx(0.025)
    assert course_of(straight) is None


def test_little_is_needed_of_a_recording(labelled: LabelledTrajectories):
    unknown = {"weather", "percepts", "stage", "marks", "bodies", "kinds", "lamps", "speed_limit"}
    runs = one(labelled, 3).trajectories.replace(unknown=frozenset(unknown))
    values = pack(ot.label(runs), 3)
    assert values["sight_dm"] is None
    assert values["road"]["lines"] is None
    assert values["ghosts"] == []
    assert all(set(vehicle["lights"]) == {0} for vehicle in values["vehicles"])


def test_each_rule_that_can_be_opened_has_its_paragraph(labelled, packs):
    assert any(one["law"] for one in packs)
    for number, packed in enumerate(packs):
        said = paragraphs(one(labelled, number), number, PORTUGAL, STORED_POLICIES)
        expected = {each["rule"]: each["paragraph"] for each in said}
        for row in packed["law"]:
            assert row["paragraph"] == expected[row["rule"]]
            assert ("was broken" in row["paragraph"]) == (row["breach"] is not None)


def test_words_are_those_of_the_glossary():
    said = words()
    assert {name: one["meaning"] for name, one in said["classes"].items()} == {
        name: one.meaning for name, one in terms("classes").items()
    }
    assert list(said["policies"]) == list(STORED_POLICY_NAMES)


def luminance(colour: str) -> float:
    """Relative luminance (WCAG 2.2)."""
    parts = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    linear = [
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts
    ]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


def contrast(one: str, other: str) -> float:
    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("name", THEMES)
def test_colours_can_be_told_from_their_ground(name: str):
    theme = THEMES[name]
    texts, lines = ("ink", "quiet", "accent", "breach", "kept", "aside"), ("ego", "target", "edge")
    for ground, text in itertools.product(("ground", "panel"), texts):
        assert contrast(theme[text], theme[ground]) >= 4.5, (text, ground)
    for line in lines:
        assert contrast(theme[line], theme["ground"]) >= 3.0, line


def test_a_page_holds_all_that_it_needs_and_lets_nothing_else_run(
    labelled: LabelledTrajectories, tmp_path: Path
):
    name = "</script><b>&amp;<!--<script>"
    runs = labelled.trajectories
    runs = runs.replace(scenario=runs.scenario.replace(profile=name)).select(slice(0, 3))
    made = ot.write_viewer_page(runs, tmp_path / "page.html", simulation_ids=[2, 0])
    assert made.simulations == (0, 2)
    assert made.size_bytes == made.path.stat().st_size
    text = made.path.read_text(encoding="utf-8")
    assert not re.search(
        r"(src|href)=\"(?!data:)|url\((?!#)|https?://(?!www\.w3\.org/)|@import", text
    )
    scripts = re.findall(r"<script([^>]*)>(.*?)</script>", text, re.DOTALL)
    assert [attributes for attributes, _ in scripts] == [
        ' type="application/json" id="data"',
        ' type="module"',
    ]
    data = json.loads(scripts[0][1])
    packed = json.loads(zlib.decompress(base64.b64decode(data["simulations"][1]["data"])))
    assert packed["values"]["simulation"] == 2
    assert packed["values"]["profile"] == name
    (style,) = re.findall(r"<style>(.*?)</style>", text, re.DOTALL)
    for inline in (scripts[1][1], style):
        digest = base64.b64encode(hashlib.sha256(inline.encode()).digest()).decode()
        assert f"'sha256-{digest}'" in text
    assert "default-src 'none'" in text


def test_a_title_is_escaped():
    text = page("</title><script>x</script>", "paper", [])
    assert "<script>x" not in text
    assert "&lt;/title&gt;" in text


def test_the_script_can_lie_in_a_page():
    script = files("overtaking.show.view").joinpath("viewer.js").read_text(encoding="utf-8")
    assert not re.search(r"</script|<!--", script, re.IGNORECASE)
    assert not re.search(r"innerHTML|\beval\(|new Function|XMLHttpRequest", script)
    # A page in a file asks nothing: its content security policy forbids it, should it try.
    assert re.findall(r"fetch\(.{6}", script) == ["fetch(`/api/"]


def test_a_page_that_is_too_large_is_not_written(
    labelled: LabelledTrajectories, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path = tmp_path / "page.html"
    path.write_text("as it was")
    monkeypatch.setattr(writing, "MOST_BYTES", 30_000)
    with pytest.raises(ConfigError, match=r"choose fewer than [2-6] with --simulations"):
        ot.write_viewer_page(labelled, path, simulation_ids="all")
    assert path.read_text() == "as it was"
    assert [one.name for one in tmp_path.iterdir()] == ["page.html"]


def test_a_large_page_is_announced(
    labelled: LabelledTrajectories, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    said: list[int] = []
    made = ot.write_viewer_page(labelled, tmp_path / "a.html", simulation_ids=[0], say=said.append)
    assert said == []
    monkeypatch.setattr(writing, "LARGE", 1000)
    ot.write_viewer_page(labelled, tmp_path / "b.html", simulation_ids=[0], say=said.append)
    assert said == [made.size_bytes]


def test_one_of_each_class_by_default_under_the_policy(
    labelled: LabelledTrajectories, tmp_path: Path
):
    progress: list[int] = []
    made = ot.write_viewer_page(
        labelled,
        tmp_path / "a.html",
        policy="strict",
        progress=lambda done, _: progress.append(done),
    )
    place = labelled.labels.policies.index("strict")
    classes = labelled.labels.classes[:, place]
    assert sorted(classes[list(made.simulations)]) == sorted(set(classes))
    assert progress == list(range(1, len(made.simulations) + 1))


def test_there_must_be_something_to_show(labelled: LabelledTrajectories, tmp_path: Path):
    with pytest.raises(ConfigError, match="expected some of 0 to 23, got none"):
        ot.write_viewer_page(labelled, tmp_path / "a.html", simulation_ids=[])
    with pytest.raises(ConfigError, match="policy"):
        ot.write_viewer_page(labelled, tmp_path / "a.html", policy="moon")


def test_a_page_shows_the_first_findings_of_an_import_report_and_the_number_of_all(
    labelled: LabelledTrajectories, tmp_path: Path
):
    findings = tuple(
        ImportFinding(
            recording="a.csv",
            check="gaps",
            vehicle=str(number),
            first_time_s=0.1 * number,
            rows=1,
            consequence="corrected",
            detail="interpolated",
        )
        for number in range(MAX_FINDINGS + 5)
    )
    runs = labelled.trajectories.replace(import_findings=findings)
    writing.write(runs, tmp_path / "page.html", chosen=[0, 1], policy=None)
    report = page_data(tmp_path / "page.html")["import_report"]
    assert report["num_rows"] == MAX_FINDINGS + 5
    assert report["rows"] == [finding.to_dict() for finding in findings[:MAX_FINDINGS]]
    writing.write(labelled, tmp_path / "simulated.html", chosen=[0], policy=None)
    assert page_data(tmp_path / "simulated.html")["import_report"] == {"rows": [], "num_rows": 0}


def page_data(path: Path) -> dict[str, Any]:
    """The data in the element `data` of a page."""
    text = path.read_text(encoding="utf-8").partition('id="data">')[2].partition("</script>")[0]
    return json.loads(text)
