"""Learning on the command line, from data that the package made."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

import overtaking
from overtaking.cli import main
from overtaking.show.report.learned import Learned, sections
from overtaking.show.report.write import Writer

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.ci

SIMULATIONS = 400


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("data") / "pinto"
    overtaking.generate_dataset(
        "pinto2023-physical", num_simulations=SIMULATIONS, seed=5, out=path, keep="features"
    )
    return path


@pytest.fixture(scope="module")
def rules(folder: Path) -> Any:
    return overtaking.learning.learn_rules(folder, "start")


@pytest.fixture(scope="module")
def factors(folder: Path) -> Any:
    return overtaking.learning.learn_factors(folder, features=["waiting time", "leader_ttc_s"])


def test_rules_come_as_json(folder: Path, rules: Any, capsys: pytest.CaptureFixture[str]):
    assert main(["learn", "rules", str(folder), "--about", "start", "--json"]) == 0
    said = capsys.readouterr()
    assert said.err == ""
    assert json.loads(said.out) == json.loads(json.dumps(rules.values()))
    assert 1 <= len(rules.rules) <= 12
    assert all(len(one.rule.conditions) <= 3 for one in rules.rules)


def test_rules_beat_the_limit_alone(rules: Any):
    made, baseline, _ = rules.comparison
    assert made.accuracy > baseline.accuracy + 0.1


def test_a_counterexample_can_be_shown_and_is_one(
    folder: Path, rules: Any, capsys: pytest.CaptureFixture[str]
):
    number = next(one.counterexamples[0] for one in rules.rules if one.counterexamples)
    assert main(["show", str(folder), str(number), "--json"]) == 0
    capsys.readouterr()
    name = overtaking.load_dataset(folder).features().loc[number, "CLASS"]
    assert (name in ("Success_L", "Success_I")) != rules.is_negated


def test_tables_are_shown_in_a_terminal(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("COLUMNS", "140")
    assert main(["learn", "rules", str(folder), "--about", "start", "--max-rules", "2"]) == 0
    text = capsys.readouterr().out
    assert "do not start now" in text
    assert "speed over the limit alone" in text
    features = ["--features", "waiting time, leader_ttc_s"]
    assert main(["learn", "factors", str(folder), *features, "--show-leakage"]) == 0
    text = capsys.readouterr().out
    assert "sequential backward selection" in text
    assert "max|a|" in text


def test_a_leak_is_refused_in_one_line(folder: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["learn", "factors", str(folder), "--features", "sight,OT"]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert "how long the overtake took is known when it is over" in said.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["rules", "--about", "weather"], "--about"),
        (["rules", "--about", "legal"], "make a larger data set"),
        (["rules", "--policy", "mine"], "policy"),
        (["rules", "--max-rules", "0"], "--max-rules"),
        (["factors", "--about", "weather"], "outcome or legal or collision or start"),
        (["factors", "--repeats", "0"], "--repeats"),
    ],
)
def test_a_mistake_costs_one_line(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    few = tmp_path / "few"
    overtaking.generate_dataset(
        "pinto2023-physical", num_simulations=20, seed=5, out=few, keep="features"
    )
    assert main(["learn", arguments[0], str(few), *arguments[1:]]) == 2
    said = capsys.readouterr().err
    assert said.startswith("error: ")
    assert message in said
    assert said.count("\n") == 1


def test_popper_is_an_export_with_options_of_its_own(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    out = tmp_path / "popper"
    named = ["export", str(folder), "--format", "popper", "--out", str(out)]
    assert main([*named, "--about", "start"]) == 0
    assert sorted(one.name for one in out.iterdir()) == ["bias.pl", "bk.pl", "exs.pl"]
    assert "head_pred(do_not_start_now,1)." in (out / "bias.pl").read_text("utf-8")
    capsys.readouterr()
    assert main([*named, "--frame-step", "3"]) == 2
    assert "frame_step" in capsys.readouterr().err


def test_what_was_learned_is_on_the_page(folder: Path, rules: Any, factors: Any, tmp_path: Path):
    made = Writer(tmp_path, overtaking.dataset_statistics(folder), None)
    learned = Learned(rules=(rules,), factors=factors, remarks=("No rules about this.",))
    text = "".join(block for one in sections(made, learned) for block in one.blocks)
    assert rules.rules[0].rule.text in text
    assert "No rules about this." in made.remarks
    for name in ("learning-confusion", "learning-calibration", "learning-ranking"):
        assert name in made.figures
        assert (tmp_path / "figures" / f"{name}.svg").exists()
    for name in ("rules-start", "rules-start-compared", "learning-models", "learning-ranking"):
        assert name in made.tables
