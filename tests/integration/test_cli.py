"""The command line as its users run it: processes, streams, exit statuses, files."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.support.commands import run

import overtaking as ot
from overtaking.knowledge.glossary import terms
from overtaking.recordings.pinto2023 import COLUMNS, read_table

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = [pytest.mark.usefixtures("parent"), pytest.mark.ci]

NUM_SIMULATIONS = 12
COMMAND = [sys.executable, "-m", "overtaking"]


def overtaking(*arguments: object, **settings) -> subprocess.CompletedProcess[str]:
    """Run a command as a user starts it, without a terminal."""
    environment = {**os.environ, "PYTHONIOENCODING": "utf-8"}
    environment.pop("COLUMNS", None)
    streams: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **settings}
    return subprocess.run(
        [*COMMAND, *map(str, arguments)], text=True, env=environment, check=False, **streams
    )


def done(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run a command that has to succeed and to complain about nothing."""
    process = run(*arguments)
    assert (process.returncode, process.stderr) == (0, "")
    return process


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A small data set, made by the command itself."""
    out = tmp_path_factory.mktemp("data") / "pinto"
    process = overtaking("generate", "-n", NUM_SIMULATIONS, "--seed", 3, "--out", out)
    assert (process.returncode, process.stderr) == (0, "")
    assert f"{NUM_SIMULATIONS} simulations of pinto2023-physical" in process.stdout
    assert f"next: overtaking show {out} 0" in process.stdout
    return out


@pytest.fixture(scope="module")
def data(folder):
    return ot.load_dataset(folder)


def test_help_is_quick_because_it_loads_nothing_heavy():
    program = (
        "import sys; from overtaking.cli import main; main(['generate', '--help'])\n"
        "heavy = {'numpy', 'pandas', 'pyarrow', 'rich', 'overtaking._core'}\n"
        "print(*heavy & set(sys.modules), file=sys.stderr)"
    )
    process = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert process.stdout.startswith("Usage: overtaking generate")
    assert process.stderr.strip() == ""


@pytest.mark.parametrize("arguments", [[], ["-h"], ["--help"]])
def test_help_lists_the_commands(arguments):
    text = done(*arguments).stdout
    for name in ("generate", "show", "info", "export", "doctor"):
        assert f"  {name} " in text


@pytest.mark.parametrize("name", ["generate", "show", "info", "export", "doctor"])
def test_every_command_has_help_with_an_example_and_the_common_options(name):
    text = done(name, "--help").stdout
    assert f"Example:\n    overtaking {name}" in text
    for option in ("--quiet", "--json", "--log"):
        assert option in text
    assert max(len(line) for line in text.splitlines()) <= 80


def test_version_is_that_of_the_package():
    from importlib.metadata import version

    assert overtaking("--version").stdout.strip() == version("overtaking")


def test_json_of_generate_says_what_was_made(folder, tmp_path, data):
    out = tmp_path / "again"
    process = done("generate", "-n", NUM_SIMULATIONS, "--seed", 3, "--out", out, "--json")
    values = json.loads(process.stdout)
    assert values["simulations"] == NUM_SIMULATIONS
    assert values["content_hash"] == data.content_hash
    assert values["tables"]["simulations"]["rows"] == NUM_SIMULATIONS
    assert values["duration_s"] > 0


def test_threads_and_frame_interval_and_changes_arrive(tmp_path):
    out = tmp_path / "changed"
    changes = ("--set", "traffic.vehicles=3..3", "--frame-interval", 100, "--threads", 1)
    done("generate", "-n", 4, "--out", out, *changes, "--quiet")
    made = ot.load_dataset(out)
    assert made.simulations()["num_vehicles"].tolist() == [3] * 4
    assert set(np.diff(made.frames(0)["time_s"]).round(6)) == {0.1}


def test_quiet_says_nothing_of_what_was_written_and_prints_results(folder, tmp_path):
    process = done("generate", "-n", 2, "--out", tmp_path / "data", "--quiet")
    assert process.stdout == ""
    assert done("stats", folder, "-q").stdout == done("stats", folder).stdout != ""


def test_resume_of_a_complete_data_set_changes_nothing(folder, data):
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    process = done("generate", "--resume", "--out", folder, "--json")
    assert json.loads(process.stdout)["content_hash"] == data.content_hash
    assert before == {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_map_of_ones_own_can_be_used(tmp_path, shared_data):
    town06 = shared_data / "opendrive" / "Town06.xodr"
    out = tmp_path / "town06"
    road = ("--map", town06, "--road", 40)
    done("generate", "-n", 2, "--out", out, *road, "--set", "time.horizon_s=8", "--quiet")
    assert ot.load_dataset(out).road.num_lanes == 5


def test_show_draws_the_simulation_that_was_asked_for(folder, data):
    for number in (0, NUM_SIMULATIONS - 1):
        text = done("show", folder, number).stdout
        assert text.startswith(f"Simulation {number} ")
        assert "\x1b" not in text
        assert not [line for line in text.splitlines() if line != line.rstrip()]
        for rule in ("paper", "default", "strict"):  # A pipe gets each sentence on one line.
            assert terms("policies")[rule].meaning in text
        values = json.loads(done("show", folder, number, "--json").stdout)
        assert values["simulation"] == number
        assert len(values["vehicles"]) == data.simulations()["num_vehicles"][number]
        assert values["trace_hash"] in text


def test_show_of_a_summary_is_simulated_again(tmp_path, folder):
    out = tmp_path / "summary"
    done("generate", "-n", 3, "--seed", 3, "--out", out, "--keep", "features", "--quiet")
    assert not (out / "states").exists()
    assert done("show", out, 2).stdout == done("show", folder, 2).stdout


def test_info_tells_what_the_folder_holds(folder, data):
    text = done("info", folder).stdout
    assert data.content_hash in text.replace("\n", "").replace(" ", "")
    values = json.loads(done("info", folder, "--json").stdout)
    assert (values["profile"], values["seed"], values["keep"]) == (
        "pinto2023-physical",
        3,
        "frames",
    )
    rows = values["tables"]["states"]["rows"]
    assert rows == sum(len(data.states(n)) for n in range(NUM_SIMULATIONS))


def test_export_is_the_papers_table_of_the_same_simulations(folder, data, tmp_path):
    done("export", folder, "--format", "pinto2023", "--out", tmp_path / "table")
    done("export", folder, "--out", tmp_path / "table", "--parquet")
    table = read_table(tmp_path / "table.csv")
    assert table.equals(read_table(tmp_path / "table.parquet"))
    with (tmp_path / "table.csv").open(encoding="utf-8", newline="") as file:
        assert tuple(next(csv.reader(file))) == COLUMNS
    assert len(list(tmp_path.iterdir())) == 2
    rows = table.to_pandas()
    for number in range(NUM_SIMULATIONS):
        same_rows(rows[rows["S"] == number].reset_index(drop=True), data.frames(number))


def same_rows(ours, frames) -> None:
    """The paper's units and frame against SI and OpenDRIVE's, read along another path."""
    assert ours["F"].tolist() == frames["frame"].tolist()
    assert ours["TS"].tolist() == pytest.approx(frames["time_s"].tolist())
    assert ours["OV"].tolist() == frames["lane_change_begins"].astype(int).tolist()
    assert ours["MV"].tolist() == pytest.approx((frames["speed_limit_mps"].dropna() * 3.6).tolist())
    for row in (0, len(frames) // 2, len(frames) - 1):
        speeds = [one["speed_kmh"] for one in ours["V"][row]]
        assert speeds == pytest.approx([v * 3.6 for v in frames["speeds_mps"][row]], abs=0.51)
        for place, (x, y, _lane) in zip(ours["L"][row], frames["positions_m"][row], strict=True):
            assert (place["x_m"], place["y_m"]) == pytest.approx((x, -y), abs=0.0051)


def test_doctor_finds_nothing_wrong_and_says_so_to_machines():
    text = done("doctor").stdout
    assert "SIMD level" in text
    values = json.loads(done("doctor", "--json").stdout)
    assert values["findings"] == []
    assert values["engine"]["simd"] in values["engine"]["simd_available"]


def test_doctor_exits_with_1_when_it_finds_something(tmp_path):
    program = (
        "import sys, shutil; from overtaking.cli import main\n"
        "usage = shutil.disk_usage('.')._replace(free=1)\n"
        "shutil.disk_usage = lambda _: usage\n"
        "sys.exit(main(['doctor']))"
    )
    process = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False)
    assert process.returncode == 1


def test_log_is_json_lines(folder, tmp_path):
    log = tmp_path / "run.log"
    done("info", folder, "--log", log, "--quiet")
    assert overtaking("show", folder, 999, "--log", log).returncode == 2
    lines = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]
    events = ["command started", "command done", "command started", "command failed"]
    assert [line["event"] for line in lines] == events
    assert "999" in lines[-1]["error"]


def test_a_reader_that_has_seen_enough_is_no_error(folder):
    reader, writer = os.pipe()
    os.close(reader)
    process = overtaking("show", folder, 0, stdout=writer)
    os.close(writer)
    assert (process.returncode, process.stderr) == (0, "")


def first_shard(out: Path, process: subprocess.Popen[str]) -> None:
    """Wait until the first shard is complete."""
    limit = time.monotonic() + 600  # Only a process that hangs takes this long.
    while not list((out / "simulations").glob("part-*.parquet")):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < limit
        time.sleep(0.02)


def files(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def test_ctrl_c_leaves_a_data_set_that_resume_completes_to_the_same_content(tmp_path):
    simulations = 8 * 4096  # Eight shards.
    recipe = ("-n", simulations, "--keep", "features", "--executor", "threads", "--out")
    process = subprocess.Popen(
        # Nice: on a busy machine the work must not be done before this process sees a shard.
        # Quiet: there it would also print that the estimate is more than a minute.
        [
            "nice",
            "-n",
            "19",
            *COMMAND,
            "generate",
            "-q",
            *map(str, recipe),
            str(tmp_path / "stopped"),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    first_shard(tmp_path / "stopped", process)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (130, "")
    (line,) = err.splitlines()
    assert line.startswith("interrupted: ")
    assert "--resume" in line
    assert overtaking("show", tmp_path / "stopped", 0).returncode == 2  # Not complete yet.
    # Quiet, as above: a busy machine would say before how long it takes.
    resumed = done("generate", "--resume", "--out", tmp_path / "stopped", "--json", "-q")
    whole = done("generate", *recipe, tmp_path / "whole", "--json", "-q")
    hashes = {json.loads(one.stdout)["content_hash"] for one in (resumed, whole)}
    assert len(hashes) == 1
    assert files(tmp_path / "stopped") == files(tmp_path / "whole")
