"""Input files of the rule learner Popper: clingo and Prolog read them, and their facts hold."""

from __future__ import annotations

import re
import shutil
import subprocess
from typing import TYPE_CHECKING

import clingo
import pytest
from tests.support.learning import planted

from overtaking.analysis.learning.conditions import conditions_of
from overtaking.analysis.learning.popper import predicate, write_popper
from overtaking.analysis.learning.targets import TARGETS
from overtaking.core.errors import ConfigError

if TYPE_CHECKING:
    from pathlib import Path

FILES = ("bias.pl", "bk.pl", "exs.pl")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("popper") / "collision"
    write_popper(planted(), TARGETS["collision"], path)
    return path


def lines(path: Path) -> list[str]:
    return [line for line in path.read_text("utf-8").splitlines() if not line.startswith("%")]


def test_a_popper_folder_contains_exactly_three_files(folder: Path):
    assert sorted(path.name for path in folder.iterdir()) == sorted(FILES)


def test_every_line_is_a_fact(folder: Path):
    atom = r"[a-z][a-z0-9_]*"
    patterns = {
        "bias.pl": rf"(max_(vars|body|clauses)\(\d+\)|(head|body)_pred\({atom},1\))\.",
        "bk.pl": rf"{atom}\(s\d+\)\.",
        "exs.pl": r"(pos|neg)\(collision\(s\d+\)\)\.",
    }
    for name, pattern in patterns.items():
        assert all(re.fullmatch(pattern, line) for line in lines(folder / name)), name


def test_every_declared_predicate_has_facts_and_every_fact_is_declared(folder: Path):
    declared = set(re.findall(r"body_pred\((\w+),1\)", (folder / "bias.pl").read_text("utf-8")))
    used = {line.partition("(")[0] for line in lines(folder / "bk.pl")}
    assert declared == used


def test_facts_name_the_simulations_in_which_a_condition_holds(folder: Path):
    examples = planted()
    positive = (examples.classes == "Unsuccess_col").to_numpy()
    text = (folder / "bk.pl").read_text("utf-8")
    num_conditions = 0
    for condition in conditions_of(examples, positive):
        facts = re.findall(rf"^{predicate(condition)}\(s(\d+)\)\.$", text, re.MULTILINE)
        if facts:
            assert [int(number) for number in facts] == examples.simulations[
                condition.holds(examples)
            ].tolist()
            num_conditions += 1
    assert num_conditions >= 3
    examples_lines = lines(folder / "exs.pl")
    assert sum(line.startswith("pos") for line in examples_lines) == positive.sum()
    assert len(examples_lines) == len(examples)


def test_clingo_reads_the_files(folder: Path):
    control = clingo.Control()
    for name in FILES:
        control.load(str(folder / name))
    control.ground([("base", [])])
    heads = [atom.symbol for atom in control.symbolic_atoms.by_signature("head_pred", 2)]
    assert [str(atom) for atom in heads] == ["head_pred(collision,1)"]


@pytest.mark.skipif(shutil.which("swipl") is None, reason="SWI-Prolog is not installed")
def test_prolog_reads_the_files_without_warnings(folder: Path):
    count = "aggregate_all(count, pos(_), N), format('~w', [N])"
    loads = ", ".join(f"consult('{folder / name}')" for name in FILES)
    process = subprocess.run(
        ["swipl", "-q", "-g", f"{loads}, {count}, halt", "-t", "halt(1)"],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (process.returncode, process.stderr) == (0, "")
    assert int(process.stdout) == (planted().classes == "Unsuccess_col").sum()


def test_a_folder_with_other_files_is_left_unchanged(tmp_path: Path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(ConfigError):
        write_popper(planted(), TARGETS["collision"], tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
