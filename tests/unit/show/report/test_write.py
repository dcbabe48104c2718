"""The report: whole, offline, and honest about what it lacks."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from tests.support.features import synthetic_features

from overtaking import label, sample, simulate
from overtaking.analysis.stats.table import Style, Table
from overtaking.core.errors import DatasetError, SchemaError
from overtaking.knowledge.glossary import TERM_GROUPS, terms
from overtaking.labels.law.judging import STORED_POLICIES
from overtaking.model.import_report import ImportFinding
from overtaking.model.verdicts import Verdict
from overtaking.show.report import files
from overtaking.show.report.page import page, paragraph, remarks, table_block
from overtaking.show.report.write import Report, write_report

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.ci


def hide_matplotlib(patch: pytest.MonkeyPatch) -> None:
    """Let Matplotlib look as if it were not installed, where figures would only take time."""
    for name in [
        one for one in sys.modules if one.startswith(("overtaking.show.plots", "matplotlib"))
    ]:
        patch.delitem(sys.modules, name)
    patch.setattr("importlib.util.find_spec", lambda _: None)


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    hide_matplotlib(monkeypatch)


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Report:
    """A report without figures; what it is with them is said in tests/integration."""
    out = tmp_path_factory.mktemp("report")
    with pytest.MonkeyPatch.context() as patch:
        hide_matplotlib(patch)
        return write_report(
            synthetic_features(),
            out,
            title="A <title> & more",
            facts=[("seed", "1")],
            policy="paper",
        )


def test_the_page_explains_its_classes_features_and_policies(report: Report):
    text = report.path.read_text(encoding="utf-8")
    for group in TERM_GROUPS:
        for name, term in terms(group).items():
            is_expected = group != "classes" or name in report.statistics.sample.classes
            assert (escape(term.meaning) in text) == is_expected, name


def test_what_comes_from_outside_is_escaped(report: Report):
    text = report.path.read_text(encoding="utf-8")
    assert "A &lt;title&gt; &amp; more" in text
    assert "<title> &" not in text
    bad = '<img src=x onerror="x">'
    everything = page(bad, bad, [(bad, bad)], [], bad) + paragraph(bad) + remarks([bad], [bad])
    assert "<img" not in everything
    table = Table(
        name="t",
        title=bad,
        note=bad,
        rows=pd.DataFrame({bad: [bad], "n": [1.0]}),
        styles=(Style.TEXT, Style.COUNT),
        num_texts=1,
        by_column=True,
    )
    assert "<img" not in table_block(table, {})


def test_the_page_warns_of_leaks_and_reads_p_values_with_care(report: Report):
    text = report.path.read_text(encoding="utf-8")
    assert "No Success_L among the" in text
    assert "not the probability that there is none" in text
    assert "Benjamini" in text


def test_without_simulations_it_says_so(report: Report):
    said = "These data have no simulations to draw, only features."
    assert said in report.remarks
    assert said in report.path.read_text(encoding="utf-8")


def test_the_same_features_make_the_same_report(undrawn: None, tmp_path: Path):
    report = [
        write_report(synthetic_features(30), tmp_path / name, title="x", policy="paper")
        for name in ("one", "two")
    ]
    assert report[0].path.read_bytes() == report[1].path.read_bytes()


def test_an_earlier_report_leaves_nothing_behind(tmp_path: Path):
    folder = files.ReportFolder(tmp_path)
    stale = [tmp_path / "figures" / "example-success-l.svg", tmp_path / "tables" / "old.tex"]
    foreign = tmp_path / "figures" / "mine.txt"
    for path in (*stale, foreign):
        path.write_text("x", encoding="utf-8")
    folder.finish("<p>anew</p>")
    assert not any(path.exists() for path in stale)
    assert foreign.exists()


def test_a_file_that_cannot_be_finished_leaves_the_old_one(tmp_path: Path):
    target = tmp_path / "index.html"
    files.write_atomically(target, b"old")
    with pytest.raises(TypeError):
        files.write_atomically(target, None)  # type: ignore[arg-type]
    assert target.read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["index.html"]


def test_a_simulation_that_cannot_be_had_is_named(undrawn: None, tmp_path: Path):
    def example(simulation: int) -> Any:
        raise DatasetError("the simulator has changed")

    frame = synthetic_features(12)
    report = write_report(frame, tmp_path, title="x", example=example, policy="paper")
    assert any("the simulator has changed" in remark for remark in report.remarks)
    assert not any(name.startswith("example") for name in report.figures)


def test_an_example_is_told_by_the_rules_that_it_breaks(undrawn: None, tmp_path: Path):
    labelled = label(simulate(sample("motorway", num_simulations=12, seed=1)))
    illegal = int(np.flatnonzero(labelled.findings.verdict[:, 2] == Verdict.ILLEGAL)[0])
    one = labelled.select(np.array([illegal]))
    report = write_report(
        synthetic_features(12), tmp_path, title="x", example=lambda _: one, policy="paper"
    )
    text = report.path.read_text(encoding="utf-8")
    (quoted, *_) = re.findall(r'<blockquote class="verdicts">(.*?)</blockquote>', text)
    broken = {
        rule
        for rule in STORED_POLICIES[0].required
        if one.findings.verdict[0, one.findings.rule_codes.index(rule)] == Verdict.ILLEGAL
    }
    assert {*re.findall(r"the rule (\w+) was broken", quoted)} == broken


def test_examples_run_in_a_page_beside_the_report(undrawn: None, tmp_path: Path):
    one = label(simulate(sample("pinto2023-physical", num_simulations=1, seed=1)))
    frame = synthetic_features(12)
    text = write_report(
        frame, tmp_path, title="x", example=lambda _: one, policy="paper"
    ).path.read_text()
    assert '<iframe src="view.html#theme=light"' in text
    (data,) = re.findall(r'id="data">(.*?)</script>', (tmp_path / files.VIEW).read_text())
    told = json.loads(data)
    assert len(told["simulations"]) == frame["CLASS"].nunique()
    assert told["policy"] == "paper"
    text = write_report(frame, tmp_path, title="x", policy="paper").path.read_text()
    assert "<iframe" not in text
    assert not (tmp_path / files.VIEW).exists()


def test_progress_ends_at_its_end(undrawn: None, tmp_path: Path):
    seen: list[tuple[int, int]] = []
    write_report(
        synthetic_features(5),
        tmp_path,
        title="x",
        progress=lambda *one: seen.append(one),
        policy="paper",
    )
    assert seen[-1][0] == seen[-1][1]
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)


@pytest.mark.parametrize("kind", ["one", "constant", "drawn"])
def test_a_poor_data_set_has_a_report_that_says_so(undrawn: None, tmp_path: Path, kind: str):
    frames = {
        "one": synthetic_features(1),
        "constant": synthetic_features(9).assign(CLASS="No_attempt", FOG=2.0, SP=np.nan, HL="No"),
        "drawn": synthetic_features(9),
    }
    reading = "matched" if kind == "drawn" else None
    report = write_report(frames[kind], tmp_path, title="x", reading=reading, policy="paper")
    text = report.path.read_text(encoding="utf-8")
    said = {
        "one": "fewer than two simulations",
        "constant": "The same in all simulations, or missing in all: SP",
        "drawn": "no curve of waiting times can be estimated",
    }
    assert said[kind] in text
    assert ("1 simulation, classified" if kind == "one" else "9 simulations, classified") in text


def test_features_that_cannot_be_used_leave_no_folder(tmp_path: Path):
    with pytest.raises(SchemaError):
        write_report(
            synthetic_features().drop(columns="SE"), tmp_path / "new", title="x", policy="paper"
        )
    assert not (tmp_path / "new").exists()


WITHOUT = """
import sys
from importlib import util
from pathlib import Path
sys.modules["scipy"] = sys.modules["scipy.stats"] = None
found = util.find_spec
util.find_spec = lambda name, *rest: None if name == "matplotlib" else found(name, *rest)
from overtaking.model.import_report import ImportFinding
from overtaking.show.report.write import write_report
from tests.support.features import synthetic_features
report = write_report(synthetic_features(30), Path(sys.argv[1]), title="x", policy="paper")
print(len(report.figures), len(report.tables), *report.remarks, sep="|")
"""


def test_without_the_extras_the_tables_are_there_and_it_says_what_to_install(
    tmp_path: Path, repository: Path
):
    command = [sys.executable, "-c", WITHOUT, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=repository)
    figures, tables, *told = done.stdout.strip().split("|")
    assert (int(figures), int(tables)) == (0, 3)
    text = (tmp_path / "index.html").read_text(encoding="utf-8")
    for extra, package in (("plots", "matplotlib"), ("stats", "scipy")):
        hint = f"expected the extra [{extra}], got none; run: "
        assert any(hint in one and f"pip install '{package}>=" in one for one in told)
        assert f"pip install &#x27;{package}&gt;=" in text


@pytest.mark.usefixtures("undrawn")
def test_findings_of_a_recording_are_among_the_warnings(tmp_path):
    finding = ImportFinding(
        recording="a.csv",
        check="gaps",
        vehicle="<7>",
        first_time_s=3.0,
        rows=2,
        consequence="corrected",
        detail="interpolated.",
    )
    report = write_report(
        synthetic_features(30), tmp_path, title="x", policy="paper", findings=[finding]
    )
    text = report.path.read_text(encoding="utf-8")
    line = "Import report: a.csv: gaps: corrected, 2 rows: vehicle &lt;7&gt; at 3 s: interpolated."
    assert f'<li class="warning">{line}</li>' in text
