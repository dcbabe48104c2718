"""Results go to stdout, talk to stderr, and the log is one JSON object per line."""

from __future__ import annotations

import json
import logging
import re
import sys
import time

import pytest
import typer
from rich import box
from rich.console import Group
from rich.table import Table
from rich.text import Text
from typer.testing import CliRunner

from overtaking.cli.options import command
from overtaking.cli.output import Output
from overtaking.core.errors import ConfigError


def output(**settings) -> Output:
    return Output("test", **{"quiet": False, "json": False, "log": None, **settings})


def render(_):
    return Text("for people")


def test_a_person_reads_the_drawing_on_stdout_and_the_talk_on_stderr(capsys):
    with output() as out:
        out.say("working")
        out.result({"value_m": 1.5}, render)
    written = capsys.readouterr()
    assert written.out == "for people\n"
    assert written.err == "working\n"


def test_a_machine_reads_json_and_nothing_is_drawn(capsys):
    def never(_):
        raise AssertionError("drawn although JSON was asked for")

    with output(json=True) as out:
        out.result({"value_m": 1.5, "name": "Évora"}, never)
    assert json.loads(capsys.readouterr().out) == {"value_m": 1.5, "name": "Évora"}


def test_quiet_prints_the_result_and_nothing_else(capsys):
    with output(quiet=True) as out:
        out.say("working")
        out.wrote({}, render)
        out.result({}, render)
        out.text({}, "text\n")
    written = capsys.readouterr()
    assert (written.out, written.err) == ("for people\ntext\n", "")


def test_a_pipe_gets_each_row_whole_and_on_a_line_of_its_own(capsys, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    cells = ("a cell that is far longer than forty columns are wide", "x" * 60)

    def drawing(_):
        table = Table(box=box.SIMPLE_HEAD)
        table.add_column("first", max_width=10)
        table.add_column("second", overflow="fold")
        table.add_row(*cells)
        return Group(Text("y" * 90), table)

    with output() as out:
        out.result({}, drawing)
    lines = capsys.readouterr().out.splitlines()
    assert lines == ["y" * 90, f"{'first':<53}  second", f"{cells[0]}  {cells[1]}"]


@pytest.mark.parametrize("is_terminal", [True, False])
def test_lines_fit_the_columns_of_the_environment(capsys, monkeypatch, is_terminal):
    monkeypatch.setenv("COLUMNS", "40")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: is_terminal)
    with output() as out:
        out.result({}, lambda _: Text("word " * 30))
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 40


def test_quiet_still_prints_the_json_that_was_asked_for(capsys):
    with output(quiet=True, json=True) as out:
        out.result({"value": 1}, render)
    assert json.loads(capsys.readouterr().out) == {"value": 1}


def test_json_refuses_what_is_no_json():
    with pytest.raises(ValueError, match="JSON"), output(json=True) as out:
        out.result({"value": float("nan")}, render)


def test_log_holds_one_json_object_for_each_event(tmp_path):
    path = tmp_path / "run.log"
    with output(log=path, quiet=True) as out:
        out.say("two\nlines")
        out.log("shard written", rows=12)
    with pytest.raises(ConfigError), output(log=path, quiet=True):
        raise ConfigError("n: expected more than 0")
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    assert [line["event"] for line in lines] == [
        *("command started", "two\nlines", "shard written", "command done"),
        *("command started", "command failed"),
    ]
    assert lines[2]["rows"] == 12
    assert lines[-1]["exit_status"] == 2
    assert lines[-1]["level"] == "error"
    assert all(line["time"].endswith("+00:00") for line in lines)


def test_log_is_closed_when_the_command_is_over(tmp_path):
    with output(log=tmp_path / "run.log"):
        assert len(logging.getLogger("overtaking").handlers) == 1
    assert logging.getLogger("overtaking").handlers == []


def test_a_log_that_cannot_be_written_is_known_before_the_work(tmp_path):
    with pytest.raises(FileNotFoundError):
        output(log=tmp_path / "missing" / "run.log")


def test_progress_is_silent_where_nobody_watches(capsys):
    with output() as out, out.progress("simulations") as meter:
        for done in range(100):
            meter(done, 100)
    written = capsys.readouterr()
    assert (written.out, written.err) == ("", "")


def greeting() -> tuple[typer.Typer, list[object]]:
    """An application with one command, and what that command was called with."""
    app, seen = typer.Typer(), []

    def greet(output: Output, name: str = "you") -> int:
        """Greet."""
        seen.extend((name, output.quiet))
        if name == "nobody":
            raise ConfigError("name: expected somebody, got nobody; greet somebody")
        if name == "ctrl-c":
            raise KeyboardInterrupt
        return 1

    command(app, greet, "greet --name me")
    return app, seen


def test_progress_shows_rate_and_time_left_where_somebody_watches(monkeypatch, capsys):
    monkeypatch.setattr("overtaking.cli.output._PATIENCE", 0.0)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with output() as out, out.progress("simulations") as meter:
        for done in (100, 200, 300):
            meter(done, 400)
            time.sleep(0.15)
    written = capsys.readouterr()
    assert "simulations" in written.err
    assert "/400" in written.err
    assert "left" in written.err
    assert re.search(r"[0-9,]+/s", written.err)
    assert written.out == ""


def test_the_share_of_a_recording_that_is_read_has_a_bar_of_its_own(monkeypatch, capsys):
    monkeypatch.setattr("overtaking.cli.output._PATIENCE", 0.0)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with output() as out, out.progress("simulations") as meter:
        for done in (1_000_000, 2_500_000, 10_000_000):
            meter.show_read_bytes(done, 10_000_000)
            time.sleep(0.15)
        meter(1, 4)
        time.sleep(0.15)
    lines = re.sub(r"\x1b\[[0-9;]*[A-Za-z]", "", capsys.readouterr().err).split("\r")
    assert any(re.match(r"recording read .* 25%", line) for line in lines)
    assert any(re.match(r"recording read .* 100%", line) for line in lines)
    assert any(re.search(r"simulations .* 1/4", line) for line in lines)
    assert not any(re.search(r"recording read.*[0-9]/s", line) for line in lines)


@pytest.mark.parametrize(("seconds", "has_bar"), [(0.6, True), (0.0, False)])
def test_a_bar_shows_the_last_report_of_long_work_without_a_further_one(
    monkeypatch, capsys, seconds, has_bar
):
    monkeypatch.setattr("overtaking.cli.output._PATIENCE", 0.1)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with output() as out, out.progress("simulations") as meter:
        meter.show_read_bytes(90, 100)
        time.sleep(seconds)
    assert ("recording read" in capsys.readouterr().err) is has_bar
    time.sleep(0.2)
    assert capsys.readouterr().err == ""


def test_a_fault_of_the_program_is_in_the_log_with_its_traceback(tmp_path):
    path = tmp_path / "run.log"
    with pytest.raises(ZeroDivisionError), output(log=path, quiet=True):
        _ = 1 / 0
    last = json.loads(path.read_text(encoding="utf-8").splitlines()[-1])
    assert last["exit_status"] == 70
    assert "ZeroDivisionError" in last["traceback"]


def test_every_command_takes_the_options_that_all_have():
    app, seen = greeting()
    result = CliRunner().invoke(app, ["--name", "me", "--quiet"], standalone_mode=False)
    assert (result.return_value, seen) == (1, ["me", True])
    help_text = CliRunner().invoke(app, ["--help"]).output
    assert all(option in help_text for option in ("--quiet", "--json", "--log", "greet --name me"))


@pytest.mark.parametrize(("name", "code"), [("nobody", 2), ("ctrl-c", 130)])
def test_a_command_that_fails_tells_so_in_one_line(name, code):
    app, _ = greeting()
    result = CliRunner().invoke(app, ["--name", name], standalone_mode=False)
    assert result.return_value == code
    assert len(result.stderr.splitlines()) == 1
