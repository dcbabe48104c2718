"""Statistics on the command line, of data that the package made."""

from __future__ import annotations

import csv
import io
import json
from typing import TYPE_CHECKING, Any

import pytest

import overtaking
from overtaking.cli import main

if TYPE_CHECKING:
    from pathlib import Path

SIMULATIONS = 40


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("data") / "pinto"
    overtaking.generate_dataset(
        "pinto2023-physical", num_simulations=SIMULATIONS, seed=5, out=path, keep="features"
    )
    return path


def run(capsys: pytest.CaptureFixture[str], *arguments: Any) -> str:
    """What a command prints that ends well."""
    assert main([str(one) for one in arguments]) == 0
    said = capsys.readouterr()
    assert said.err == ""
    return said.out


def test_text_keeps_its_columns_where_there_is_no_terminal(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.delenv("COLUMNS", raising=False)
    lines = run(capsys, "stats", folder).splitlines()
    header = next(line for line in lines if line.startswith("feature"))
    assert header.endswith("Unsuccess_ncol    All")


def test_json_agrees_with_the_features(folder: Path, capsys: pytest.CaptureFixture[str]):
    values = json.loads(run(capsys, "stats", folder, "--json"))
    frame = overtaking.load_dataset(folder).features()
    counts = {one["class"]: one["count"] for one in values["classes"]}
    assert {name: count for name, count in counts.items() if count} == (
        frame["CLASS"].value_counts().to_dict()
    )
    mean = next(
        one
        for one in values["dynamic_features"]
        if (one["feature"], one["statistic"]) == ("SE", "mean")
    )
    assert mean["All"] == pytest.approx(frame["SE"].mean())
    assert json.loads(run(capsys, "stats", folder, "--format", "json")) == values


def test_csv_and_latex_are_printed_as_they_are(folder: Path, capsys: pytest.CaptureFixture[str]):
    rows = list(csv.DictReader(io.StringIO(run(capsys, "stats", folder, "--format", "csv"))))
    assert {"classes", "static-features", "dynamic-features"} <= {one["table"] for one in rows}
    assert run(capsys, "stats", folder, "--format", "latex").count(r"\end{table}") == 3


def test_another_policy_and_weights_are_taken(folder: Path, capsys: pytest.CaptureFixture[str]):
    values = json.loads(run(capsys, "stats", folder, "--policy", "strict", "--weighted", "--json"))
    assert (values["policy"], values["reading"], values["weighted"]) == ("strict", "matched", True)
    assert values["waiting_time"] is None
    mixed = json.loads(
        run(capsys, "stats", folder, "--policy", "strict", "--reading", "paper", "--json")
    )
    assert mixed["waiting_time"] is not None


@pytest.mark.parametrize(
    "wrong",
    [("--format", "xml"), ("--policy", "mine"), ("--reading", "fast")],
)
def test_a_wrong_word_is_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str], wrong: tuple[str, str]
):
    assert main(["stats", str(folder), *wrong]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert wrong[1] in said.err
