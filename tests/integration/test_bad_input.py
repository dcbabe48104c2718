"""A user's mistake ends with one line that says what to do, and leaves nothing half-written."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import pytest
from tests.support.commands import run

NUM_SIMULATIONS = 8

pytestmark = pytest.mark.usefixtures("parent")


def content(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, but the one that says who holds it."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != ".lock"
    }


def refused(tmp_path: Path, *arguments: object, says: str) -> str:
    """Run a command that has to refuse; returns the line that it says."""
    before, names = content(tmp_path), sorted(tmp_path.rglob("*"))
    process = run(*arguments)
    assert process.returncode == 2, process.stderr
    assert process.stdout == ""
    assert "Traceback" not in process.stderr
    (line,) = process.stderr.splitlines()
    assert line.startswith("error: ")
    assert says in line
    assert content(tmp_path) == before
    assert sorted(tmp_path.rglob("*")) == names
    return line


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """A data set to be damaged, in copies."""
    out = tmp_path_factory.mktemp("made") / "data"
    assert run("generate", "-n", NUM_SIMULATIONS, "--out", out, "--quiet").returncode == 0
    return out


@pytest.fixture
def data(made, tmp_path) -> Path:
    """A copy of the data set."""
    return Path(shutil.copytree(made, tmp_path / "data"))


@pytest.mark.ci
@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["-n", "-5"], "simulations: expected 1 to"),
        (["-n", "0"], "simulations: expected 1 to"),
        (["-n", "many"], "valid integer"),
        (["-n", "2.5"], "valid integer"),
        (["--seed", "-1"], "seed: expected 0 to"),
        (["--seed", str(2**64)], "seed: expected 0 to"),
        (["--threads", "0"], "--threads"),
        (["--set", "traffic.vehicles=-3"], "traffic.vehicles"),
        (["--set", "traffic.vehicles=6..2"], "traffic.vehicles"),
        (["--set", "traffic.speed_kmh=120..50"], "a range from low to high"),
        (["--set", "traffic.speed_kmh=fast"], "traffic.speed_kmh"),
        (["--set", "traffic.speed_kmh=nan..inf"], "traffic.speed_kmh"),
        (["--set", "trafic.vehicles=3"], "traffic"),
        (["--set", "traffic.vehicle=3"], "vehicles"),
        (["--set", "traffic"], "expected KEY=VALUE"),
        (["--frame-interval", "55"], "a multiple of 10"),
        (["--frame-interval", "-50"], "frame_interval_ms"),
        (["--profile", "pinto2032"], "pinto2023"),
        (["--profile", "missing.toml"], "missing.toml"),
        (["--keep", "everything"], "frames or features"),
        (["--road", "town07"], "town06"),
        (["--map", "missing.xodr"], "missing.xodr"),
        (["--bogus"], "no such option: --bogus"),
        (["--profil", "x"], "--profile"),
    ],
    ids=" ".join,
)
def test_a_recipe_that_makes_no_sense(tmp_path, arguments, says):
    out = tmp_path / "data"
    refused(tmp_path, "generate", "--out", out, *arguments, says=says)
    assert not out.exists()


def test_an_unknown_command_comes_with_a_suggestion(tmp_path):
    refused(tmp_path, "generte", "--out", tmp_path / "data", says="'generate'")
    refused(tmp_path, "simulate", says="see overtaking --help")
    refused(tmp_path, "generate", says="--out")


@pytest.mark.parametrize(
    "text",
    [
        "[traffic\nvehicles = 3",
        "[traffic]\nvehicles = '\\q'",
        "\x00\x01",
        "[profile]\nname = 3",
        "a = " + "[" * 5000,
        "a = " + "9" * 5000,
        "a" * 2_000_000,
    ],
)
def test_a_specification_that_is_none(tmp_path, text):
    path = tmp_path / "spec.toml"
    path.write_text(text, encoding="utf-8")
    refused(tmp_path, "generate", "--profile", path, "--out", tmp_path / "data", says="spec.toml")
    assert not (tmp_path / "data").exists()


def test_a_specification_that_is_a_pipe_or_endless(tmp_path):
    path = tmp_path / "spec.toml"
    os.mkfifo(path)
    for file in (path, "/dev/zero"):
        recipe = ("--profile", file, "--out", tmp_path / "data")
        refused(tmp_path, "generate", *recipe, says="got a pipe or a device")


@pytest.mark.parametrize(
    "change",
    [
        "time.horizon_s=" + "9" * 5000,
        "time.horizon_s=" + "[" * 100_000,
        "time" + ".a" * 10_000 + "=1",
        "profile.name=" + "a" * 10_000,
    ],
    ids=lambda text: text[:20],
)
def test_a_change_that_is_endless(tmp_path, change):
    refused(tmp_path, "generate", "--set", change, "--out", tmp_path / "data", says="pinto2023")
    profile = ("--profile", change)
    refused(tmp_path, "generate", *profile, "--out", tmp_path / "data", says="a known profile")


MAPS = {
    "empty": b"",
    "no XML": b"\x89PNG\r\n\x1a\n" + bytes(range(256)),
    "cut short": b'<?xml version="1.0"?><OpenDRIVE><header/><road id="1" length="100">',
    "no road": b'<?xml version="1.0"?><OpenDRIVE><header revMajor="1"/></OpenDRIVE>',
    "billion laughs": b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">'
    b'<!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]><OpenDRIVE>&b;</OpenDRIVE>',
    "reads a file": b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]>'
    b"<OpenDRIVE>&a;</OpenDRIVE>",
    "deep": b'<?xml version="1.0"?>' + b"<OpenDRIVE>" * 100_000,
}


@pytest.mark.parametrize("kind", MAPS)
def test_a_map_that_is_damaged_or_hostile(tmp_path, kind):
    path = tmp_path / "road.xodr"
    path.write_bytes(MAPS[kind])
    line = refused(
        tmp_path, "generate", "--map", path, "--out", tmp_path / "data", says="road.xodr"
    )
    assert "root:" not in line
    assert len(line) < 500
    assert not (tmp_path / "data").exists()


def test_a_real_map_cut_short(tmp_path, shared_data):
    path = tmp_path / "Town06.xodr"
    path.write_bytes((shared_data / "opendrive" / "Town06.xodr").read_bytes()[:200_000])
    recipe = ("--map", path, "--road", 40, "--out", tmp_path / "data")
    refused(tmp_path, "generate", *recipe, says="Town06.xodr")


@pytest.mark.ci
def test_a_road_that_the_map_does_not_have(tmp_path, shared_data):
    path = shared_data / "opendrive" / "Town06.xodr"
    recipe = ("--map", path, "--road", 99999, "--out", tmp_path / "data")
    refused(tmp_path, "generate", *recipe, says="99999")


def test_out_is_a_file(tmp_path):
    (tmp_path / "data").write_text("mine", encoding="utf-8")
    refused(tmp_path, "generate", "-n", 1, "--out", tmp_path / "data", says="got a file")


def test_out_is_a_folder_of_something_else(tmp_path):
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "thesis.tex").write_text("mine", encoding="utf-8")
    refused(tmp_path, "generate", "-n", 1, "--out", tmp_path / "data", says="thesis.tex")


def test_out_cannot_be_made(tmp_path):
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    out = tmp_path / "file" / "data"
    refused(tmp_path, "generate", "-n", 1, "--out", out, says=str(out))


def test_out_cannot_be_written(tmp_path):
    refused(tmp_path, "generate", "-n", 1, "--out", "/proc/overtaking", says="/proc/overtaking")


def test_out_holds_a_data_set_of_another_recipe(data, tmp_path):
    recipe = ("generate", "-n", NUM_SIMULATIONS, "--out", data)
    refused(tmp_path, *recipe, "--seed", 2, says="seed")
    refused(tmp_path, *recipe, "--seed", 2, "--resume", says="seed")
    refused(tmp_path, *recipe, "--set", "traffic.vehicles=2..3", "--resume", says="spec")
    refused(tmp_path, *recipe, says="complete")


NO_ROOM = ("--set", "traffic.spawn_s_m=0..20", "--set", "traffic.vehicles=6..6")


@pytest.mark.ci
@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["generate", "-n", "5", *NO_ROOM], "spawn_s_m"),
        (["generate", "-n", "5", *NO_ROOM, "--balance"], "spawn_s_m"),
        (["generate", "-n", "5", *NO_ROOM, "--executor", "processes"], "spawn_s_m"),
        (["generate", "-n", "5", "--executor", "ray", "--workers", "0"], "workers"),
        (["generate", "-n", "3", "--balance"], "at least 5"),
        (["generate", "-n", str(10**12)], "make several data sets"),
        (["generate", "-n", "2000000", "--keep", "features"], "add --yes"),
        (["sumo", "run", "-n", "2", *NO_ROOM], "spawn_s_m"),
        (["carla", "run", "-n", "2", "--server", "here:99999"], "here:99999"),
        (["import", "commonroad", "/dev/zero"], "/dev/zero"),
        (["import", "pinto2023", "/dev/null"], "/dev/null"),
        (["export", "{data}", "--format", "asp", "--simulations", "99"], "99"),
        (["export", "{data}", "--format", "popper", "--about", "x"], "about"),
        (["report", "{data}", "--policy", "none"], "policy"),
        (["film", "{data}", "--simulations", "1,99"], "99"),
    ],
    ids=lambda value: " ".join(value)[:40] if isinstance(value, list) else value,
)
def test_a_refusal_leaves_nothing_behind(made, tmp_path, arguments, says):
    given = [one.format(data=made) for one in arguments]
    refused(tmp_path, *given, "--out", tmp_path / "some" / "folder", says=says)


@pytest.mark.ci
def test_a_refused_call_does_not_keep_the_right_one_out(tmp_path):
    out = tmp_path / "data"
    refused(tmp_path, "generate", "-n", 2, *NO_ROOM, "--out", out, says="spawn_s_m")
    assert run("generate", "-n", 2, "--out", out, "--quiet").returncode == 0
    out = tmp_path / "mine"
    out.mkdir()
    refused(tmp_path, "generate", "-n", 2, *NO_ROOM, "--out", out, says="spawn_s_m")
    assert run("generate", "-n", 2, "--out", out, "--quiet").returncode == 0


def test_a_figure_that_cannot_be_written_is_refused_before_the_work(tmp_path):
    validate = ("validate", "motorway", "-n", 1_000_000, "--plot")
    refused(tmp_path, *validate, tmp_path / "no" / "figure.png", says="no such folder")
    refused(tmp_path, *validate, tmp_path / "figure.gif", says=".gif")


@pytest.mark.parametrize("command", ["validate motorway", "compare pinto2023"])
def test_a_number_of_simulations_that_nobody_waits_for(tmp_path, command):
    refused(tmp_path, *command.split(), "-n", 10**12, says="expected 1 to 1000000")


def test_ranges_that_are_endless_together(data, tmp_path):
    many = ",".join(["0-999999"] * 10_000)
    film = ("film", data, "--simulations", many, "--out", tmp_path / "out")
    refused(tmp_path, *film, says="more than 1000000 numbers")


def test_resume_where_nothing_was_begun(tmp_path):
    refused(tmp_path, "generate", "--resume", "--out", tmp_path / "data", says="dataset.json")


@pytest.mark.parametrize("number", [NUM_SIMULATIONS, 10**30])
def test_show_a_simulation_that_does_not_exist(data, tmp_path, number):
    refused(tmp_path, "show", data, number, says=f"expected 0 to {NUM_SIMULATIONS - 1}")


def test_show_what_is_no_number_or_no_data_set(data, tmp_path):
    refused(tmp_path, "show", data, "first", says="valid integer")
    refused(tmp_path, "show", tmp_path / "missing", 0, says="missing")
    refused(tmp_path, "show", tmp_path, 0, says="dataset.json")
    refused(tmp_path, "info", data / "dataset.json", says="dataset.json")


@pytest.mark.parametrize("damage", ["cut short", "one byte", "missing", "empty"])
def test_a_damaged_shard(data, tmp_path, damage):
    (part,) = (data / "states").glob("*.parquet")
    whole = bytearray(part.read_bytes())
    if damage == "missing":
        part.unlink()
    else:
        whole[len(whole) // 2] ^= 1
        cut = {"cut short": len(whole) // 2, "one byte": len(whole), "empty": 0}[damage]
        part.write_bytes(whole[:cut])
    refused(tmp_path, "show", data, 0, says=f"--resume --out {data}")


@pytest.mark.parametrize("table", ["labels", "simulations"])
def test_a_pipe_in_the_place_of_a_shard_is_not_waited_for(data, tmp_path, table):
    (part,) = (data / table).glob("*.parquet")
    part.unlink()
    os.mkfifo(part)
    refused(tmp_path, "sql", data, f"select count(*) from {table}", says="a pipe or a device")
    assert run("generate", "--resume", "--out", data, "--quiet").returncode == 0
    assert run("show", data, 0).returncode == 0


def test_a_manifest_that_is_a_pipe_or_endless(data, tmp_path):
    path = data / "dataset.json"
    path.unlink()
    os.mkfifo(path)
    commands = (("info", data), ("generate", "--resume", "--out", data))
    for command in commands:
        refused(tmp_path, *command, says="a pipe or a device")
    path.unlink()
    path.symlink_to("/dev/zero")
    for command in commands:
        process = run(*command)
        assert "a pipe or a device" in process.stderr


@pytest.mark.ci
def test_a_damaged_shard_is_exported_only_when_it_is_repaired(data, tmp_path):
    (part,) = (data / "states").glob("*.parquet")
    part.write_bytes(part.read_bytes()[:-1])
    export = ("export", data, "--out", tmp_path / "table.csv", "--quiet")
    refused(tmp_path, *export, says=part.name)
    assert run("generate", "--resume", "--out", data, "--quiet").returncode == 0
    assert run(*export).returncode == 0


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"version": 99}, "or a newer one"),
        ({"version": "one"}, "dataset.json"),
        ({"format": "other"}, "dataset.json"),
        ({"identity": {}}, "dataset.json"),
        ({"complete": False}, "--resume"),
    ],
)
def test_a_manifest_that_is_newer_or_wrong(data, tmp_path, change, says):
    path = data / "dataset.json"
    given = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps({**given, **change}), encoding="utf-8")
    for command in (("show", data, 0), ("info", data)):
        refused(tmp_path, *command, says=says)


def test_a_manifest_that_is_no_json(data, tmp_path):
    (data / "dataset.json").write_bytes(b"\xff{")
    refused(tmp_path, "show", data, 0, says="dataset.json")


def test_export_to_what_is_no_file_or_in_no_known_format(data, tmp_path):
    refused(tmp_path, "export", data, "--out", tmp_path, says="got a folder")
    refused(tmp_path, "export", data, "--out", "/proc/table.csv", says="/proc/table.csv")
    target = tmp_path / "table.csv"
    refused(tmp_path, "export", data, "--out", target, "--parquet", says="leave the option out")
    refused(tmp_path, "export", data, "--out", target, "--format", "xlsx", says="pinto2023")


def test_a_log_that_cannot_be_written(data, tmp_path):
    refused(tmp_path, "info", data, "--log", tmp_path / "no" / "run.log", says="run.log")


def test_a_disk_that_is_full(made, tmp_path):
    out = tmp_path / "data"
    recipe = ("generate", "-n", NUM_SIMULATIONS, "--out", out)
    process = run(*recipe, largest_file=20_000)
    assert process.returncode == 2
    (line,) = process.stderr.splitlines()
    assert line.startswith(f"error: {out}")
    assert [path for path in content(out) if path.endswith(".parquet")] == []
    assert [path.name for path in out.rglob("*tmp*")] == []
    assert run(*recipe, "--resume", "--quiet").returncode == 0
    complete, whole = (json.loads((one / "dataset.json").read_text()) for one in (out, made))
    assert complete["content_hash"] == whole["content_hash"]


@pytest.mark.parametrize("name", ["table.csv", "table.parquet"])
def test_a_disk_that_is_full_during_an_export(data, tmp_path, name):
    target = tmp_path / name
    process = run("export", data, "--out", target, largest_file=10_000)
    assert process.returncode == 2
    (line,) = process.stderr.splitlines()
    assert line.startswith(f"error: {target}: ")
    assert [path.name for path in tmp_path.iterdir()] == ["data"]
