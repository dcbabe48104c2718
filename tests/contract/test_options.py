"""The command line: an option means the same everywhere, and every command has an example."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

import pytest
from tests.contract.test_docs import faults

from overtaking.cli import main

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs"))
PAGE: Any = importlib.import_module("generators.commands")
COMMANDS = dict(PAGE.commands())


def test_an_option_means_the_same_in_every_command():
    meanings: dict[str, set[str]] = {}
    for command in COMMANDS.values():
        for option, text in PAGE.options(command).items():
            for word in option.split(", "):
                meanings.setdefault(word, set()).add(f"{option}: {PAGE.meaning(text)}")
    different = {word: of for word, of in meanings.items() if len(of) > 1}
    # A driver controls the ego, or is one of ours or of CARLA's.
    drivers = ("Driver of the ego", "our drivers")
    assert all(any(text in one for text in drivers) for one in different.pop("--driver"))
    assert different == {}


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_every_command_has_a_summary_and_an_example_that_can_be_typed(command: Any):
    assert command.help[0].isupper()
    assert command.help.partition("\n")[0].endswith(".")
    assert faults(PAGE.example(command)) == []
    assert all(text and text[-1] in ".]" for text in PAGE.options(command).values())


@pytest.mark.parametrize("group", ["", "carla", "law", "learn", "literature", "sumo"])
def test_no_summary_is_cut_off_in_the_list_of_commands(
    group: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("COLUMNS", "80")
    assert main([*group.split(), "--help"]) == 0
    listed = capsys.readouterr().out.partition("Commands:")[2]
    assert listed
    assert "..." not in listed
