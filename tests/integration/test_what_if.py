"""The commands that ask what if, from the outside."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

import overtaking as ot
from overtaking.cli import main

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A few simulations."""
    place = tmp_path_factory.mktemp("what-if") / "data"
    return ot.generate_dataset("pinto2023-physical", num_simulations=6, seed=1, out=place).where


def said(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any]:
    """What a command prints as JSON."""
    assert main([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_twin_is_told_saved_and_read_again(
    data: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    folder = tmp_path / "twins"
    found = said(capsys, "twin", data, "0", "--without", "rain,wind", "--out", str(folder))
    assert found["effect"] == "direct"
    assert found["different"] == "without rain, without wind"
    assert found["interventions"] == [{"frame": 0, "without": ["rain", "wind"]}]
    assert found["files"] == [str(folder)]
    assert main(["show", str(folder), "1"]) == 0
    assert main(["info", str(folder)]) == 0
    capsys.readouterr()
    total = said(capsys, "twin", data, "0", "--without", "rain", "--effect", "total")
    assert total["effect"] == "total"
    assert total["redrawn"] == {"frame": 0, "without": ["rain"]}


def test_a_saved_branch_is_exported(data: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    gone = ot.branch(
        ot.load_dataset(data)[0], interventions=[ot.Intervention(frame=20, slot=1, remove=True)]
    )
    saved = ot.whatif.save_branches(data, {"alone": gone}, tmp_path / "gone")
    for file_format in ("pinto2023", "commonroad", "highd"):
        out = tmp_path / (file_format + (".csv" if file_format == "pinto2023" else ""))
        assert ot.export_dataset(saved, out, file_format=file_format) > 0
    capsys.readouterr()


def test_a_fan_and_what_would_be_enough_are_told(data: str, capsys: pytest.CaptureFixture[str]):
    fan = said(capsys, "fan", data, "0", "--futures", "20", "--interval", "4")
    first = fan["instants"][0]
    assert first["futures"] == 20
    assert sum(one["share"] for one in first["shares"].values()) == pytest.approx(1.0)
    assert all(0 <= one["low"] <= one["share"] <= one["high"] for one in first["shares"].values())
    goal = said(capsys, "enough", data, "0")
    assert goal["class"] == "Success_I"
    assert {one["unit"] for one in goal["quantities"]} >= {"m", "s", "km/h"}
    for words in (
        ["twin", data, "0"],
        ["fan", data, "0", "--interval", "4"],
        ["enough", data, "0"],
    ):
        assert main(words) == 0
        assert "imulation" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["twin", "0", "--without", "snow"], "without: expected wind or rain"),
        (["twin", "0", "--style", "brave"], "driving_style: expected careful or average"),
        (["twin", "0", "--start-time", "1e6"], "time: expected 0.0 to"),
        (["twin", "0", "--effect", "middle"], "effect: expected direct or total"),
        (["twin", "0", "--delay", "-1"], "delay: expected 0.0 to 60.0"),
        (["twin", "99"], "simulation: expected 0 to 5"),
        (["fan", "0", "--condition-on", "hope"], "condition_on: expected truth or belief"),
        (["fan", "0", "--futures", "0"], "futures: expected 1 to"),
        (["enough", "0", "--goal", "fast"], "goal: expected lawful or safe"),
        (["enough", "0", "--policy", "mine"], "policy: expected paper or default"),
    ],
)
def test_what_cannot_be_asked_is_refused_in_one_line(
    data: str, words: list[str], message: str, capsys: pytest.CaptureFixture[str]
):
    command, *rest = words
    assert main([command, data, *rest]) != 0
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert message in line
