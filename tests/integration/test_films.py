"""`overtaking film` as its users run it: processes, streams, exit statuses, files."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from tests.support.commands import run

import overtaking as ot

pytestmark = pytest.mark.usefixtures("parent")


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    spec = {"time.horizon_s": 3, "time.attempt_deadline_s": 3}
    return ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=6,
        seed=1,
        out=tmp_path_factory.mktemp("data") / "six",
        overrides=spec,
    )


def test_films_are_listed_for_machines(data):
    done = run("film", data.path, "--simulations", "1,3", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    films = json.loads(done.stdout)["films"]
    assert [film["simulation"] for film in films] == [1, 3]
    for film in films:
        path = data.path / "films" / f"{film['simulation']:06d}.mp4"
        assert film["file"] == str(path)
        assert film["size_bytes"] == path.stat().st_size > 1000
        assert film["duration_s"] == film["frames"] / 20
    assert {path.suffix for path in (data.path / "films").iterdir()} == {".mp4"}


def test_films_are_listed_for_people(data, tmp_path):
    done = run("film", data.path, "--out", tmp_path / "films")
    assert (done.returncode, done.stderr) == (0, "")
    made = sorted((tmp_path / "films").glob("*.mp4"))
    assert made
    assert f"{len(made)} film" in done.stdout


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--simulations", "9"), "expected some of 0 to 5, got 9"),
        (("--simulations", "one"), "expected numbers and ranges"),
        (("--all", "--one-per-class"), "leave out the others"),
    ],
)
def test_a_mistake_costs_one_line(data, words, message):
    done = run("film", data.path, *words)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert message in done.stderr


def test_a_missing_extra_costs_one_line(data, tmp_path):
    words = ["film", str(data.path), "--out", str(tmp_path / "none")]
    program = f"""
import sys
sys.modules["av"] = None
from overtaking.cli import main
sys.exit(main({words!r}))
"""
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "pip install 'av>=" in done.stderr
    assert not (tmp_path / "none").exists()
