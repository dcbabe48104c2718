"""`overtaking glossary` explains every word, or one."""

from __future__ import annotations

import json

import pytest

from overtaking.cli import main
from overtaking.knowledge.glossary import TERM_GROUPS, terms


def test_every_word_is_explained(capsys: pytest.CaptureFixture[str]):
    assert main(["glossary", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["terms"]
    assert [(one["name"], one["meaning"]) for one in found] == [
        (name, term.meaning) for group in TERM_GROUPS for name, term in terms(group).items()
    ]


@pytest.mark.parametrize(
    ("word", "meaning"),
    [
        ("success_l", "breaks no rule"),
        ("WT", "Time before the overtake starts"),
        ("fast side", "Right and left in right-hand traffic"),
    ],
)
def test_one_word_is_explained(word: str, meaning: str, capsys: pytest.CaptureFixture[str]):
    assert main(["glossary", word]) == 0
    assert meaning in " ".join(capsys.readouterr().out.split())


def test_a_word_that_is_not_there_is_one_line(capsys: pytest.CaptureFixture[str]):
    assert main(["glossary", "marign"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("did you mean margin?")
