"""The files of Popper: read by clingo and by Prolog, and true."""

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


def test_there_are_the_three_files_and_no_other(folder: Path):
    assert sorted(one.name for one in folder.iterdir()) == sorted(FILES)


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


def test_facts_say_where_conditions_hold(folder: Path):
    examples = planted()
    positive = (examples.classes == "Unsuccess_col").to_numpy()
    text = (folder / "bk.pl").read_text("utf-8")
    seen = 0
    for one in conditions_of(examples, positive):
        facts = re.findall(rf"^{predicate(one)}\(s(\d+)\)\.$", text, re.MULTILINE)
        if facts:
            assert [int(n) for n in facts] == examples.simulations[one.holds(examples)].tolist()
            seen += 1
    assert seen >= 3
    said = lines(folder / "exs.pl")
    assert sum(line.startswith("pos") for line in said) == positive.sum()
    assert len(said) == len(examples)


def test_clingo_reads_them(folder: Path):
    control = clingo.Control()
    for name in FILES:
        control.load(str(folder / name))
    control.ground([("base", [])])
    heads = [one.symbol for one in control.symbolic_atoms.by_signature("head_pred", 2)]
    assert [str(one) for one in heads] == ["head_pred(collision,1)"]


@pytest.mark.skipif(shutil.which("swipl") is None, reason="SWI-Prolog is not installed")
def test_prolog_reads_them_without_a_word(folder: Path):
    count = "aggregate_all(count, pos(_), N), format('~w', [N])"
    loads = ", ".join(f"consult('{folder / name}')" for name in FILES)
    done = subprocess.run(
        ["swipl", "-q", "-g", f"{loads}, {count}, halt", "-t", "halt(1)"],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert int(done.stdout) == (planted().classes == "Unsuccess_col").sum()


def test_a_folder_that_is_taken_is_left_alone(tmp_path: Path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(ConfigError):
        write_popper(planted(), TARGETS["collision"], tmp_path)
    assert [one.name for one in tmp_path.iterdir()] == ["mine.txt"]
