"""`overtaking sumo run` and `overtaking compare`, as their users type them."""

from __future__ import annotations

import json
import re
import shlex

import pytest
from tests.support.sumo import needs_sumo

import overtaking as ot
from overtaking.cli import main

pytestmark = needs_sumo

SHORT = ["--set", "time.horizon_s=6", "--set", "time.attempt_deadline_s=4"]
FEW = ["-n", "5", "--seed", "2", *SHORT]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("sumo") / "data"
    assert main(["sumo", "run", "pinto2023-physical", *FEW, "--out", str(out), "--quiet"]) == 0
    return out


def test_it_writes_an_ordinary_data_set(folder, capsys):
    assert main(["info", str(folder), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["simulations"] == 5
    assert re.fullmatch(r"sumo 1\+libsumo[\d.]+", told["simulator"])
    data = ot.load_dataset(folder)
    data.verify()
    assert data.simulations()["num_frames"].max() == 121
    assert data.trajectory(3).unknown == {
        "lamps", "wheel_angle", "yaw_rate", "impulse", "percepts",
    }  # fmt: skip


def test_what_sumo_cannot_say_is_null(folder):
    data = ot.load_dataset(folder)
    states = data.table("states")
    for name in ("wheel_angle_100urad", "yaw_rate_100uradps", "lights"):
        assert states[name].null_count == states.num_rows > 0
    assert states["indicator"].null_count == 0
    assert (
        data.table("vehicles")["contact_impulse_newton_s"].null_count
        == data.table("vehicles").num_rows
    )
    assert data.table("percepts").num_rows == 0


def test_the_same_command_gives_the_same_content(folder, tmp_path):
    out = tmp_path / "again"
    assert main(["sumo", "run", *FEW, "--out", str(out), "--quiet"]) == 0
    assert ot.load_dataset(out).content_hash == ot.load_dataset(folder).content_hash


def test_frames_that_were_not_kept_are_simulated_again_on_sumo(folder, tmp_path):
    out = tmp_path / "small"
    given = ["sumo", "run", *FEW, "--out", str(out), "--keep", "features", "--quiet"]
    assert main(given) == 0
    assert ot.load_dataset(out).states(4).equals(ot.load_dataset(folder).states(4))


def test_what_was_begun_is_completed_on_sumo(folder, tmp_path, capsys):
    for part in folder.glob("states/*.parquet"):
        part.unlink()
    assert main(["sumo", "run", "--resume", "--out", str(folder), "--quiet"]) == 0
    ot.load_dataset(folder).verify()


def test_one_simulation_can_be_shown(folder, capsys):
    assert main(["show", str(folder), "0"]) == 0
    assert "What the ego did" in capsys.readouterr().out


def test_a_branch_of_a_sumo_simulation_is_refused():
    scenarios = ot.sample("pinto2023-physical", num_simulations=1, seed=1)
    with pytest.raises(ValueError, match="expected engine or reference, got sumo"):
        ot.branch(scenarios, 3, simulator="sumo")


def test_a_comparison_counts_every_simulation_once(capsys):
    assert main(["compare", *FEW, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["simulators"] == ["engine", "sumo"]
    (other,) = told["others"]
    assert sum(map(sum, other["class_counts"])) == 5
    assert sum(other["partings"].values()) + other["never_part"] == 5
    for groups in (told["by_weather"], told["by_class"]):
        assert sum(one["simulations"] for one in groups) == 5
    assert [row["index"] for row in told["rows"]] == list(range(5))


@pytest.mark.ci
def test_a_comparison_of_the_engine_with_its_twin_finds_no_difference(capsys):
    assert main(["compare", *FEW, "--with", "reference,sumo", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    twin, sumo = told["others"]
    assert twin["same_class"] == twin["never_part"] == 5
    assert sumo["simulator"] == "sumo"
    assert sumo["never_part"] < 5
    assert told["same_class"] == sumo["same_class"]


def test_a_comparison_is_a_page_for_people(capsys):
    assert main(["compare", *FEW]) == 0
    page = capsys.readouterr().out
    assert "5 scenarios on engine and sumo" in page
    assert "first 2 m apart" in page


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["compare", "--with", "carma"], "got carma"),
        (["compare", "--with", "sumo,sumo"], "two or more different ones, got engine, sumo, sumo"),
        (["compare", "--with", "engine"], "two or more different ones, got engine, engine"),
        (["compare", "-n", "0"], "simulations: expected 1 to 1000000, got 0"),
        (["compare", "nothing-like-it"], "nothing-like-it"),
        (["sumo"], "missing command"),
        (["sumo", "fly"], "fly"),
        (["sumo", "run", "-n", "5"], "--out"),
    ],
)
def test_a_mistake_is_one_line(given, message, capsys):
    assert main(given) == 2
    error = capsys.readouterr().err
    assert message in error
    assert len(error.splitlines()) == 1


def test_without_libsumo_one_line_says_what_to_install(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(__import__("sys").modules, "libsumo", None)
    assert main(["sumo", "run", *FEW, "--out", str(tmp_path / "x")]) == 2
    error = capsys.readouterr().err
    assert "pip install 'libsumo>=" in error
    assert len(error.splitlines()) == 1


@pytest.mark.ci
def test_what_the_how_to_page_says_works(repository, workdir, capsys):
    text = (repository / "docs" / "how-to" / "run-on-sumo.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```console\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    lines = [line for block in blocks for line in block.splitlines()]
    assert len(lines) >= 2
    for line in lines:
        program, *arguments = shlex.split(line)
        assert (program, main(arguments)) == ("overtaking", 0), line
