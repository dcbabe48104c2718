"""Commands in terminals and scripts: closed streams, full disks, other encodings, widths."""

from __future__ import annotations

import contextlib
import json
import os
import shlex
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = [
    pytest.mark.ci,
    pytest.mark.skipif(os.name == "nt", reason="uses the shell and the terminals of POSIX"),
]

OVERTAKING = shlex.join([sys.executable, "-m", "overtaking"])
PRINTING = ("show {data} 2", "info {data} --json", "--help")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("data") / "set"
    process = run_in_shell(f"generate -n 3 --seed 3 --out {out} --quiet")
    assert (process.returncode, process.stderr) == (0, b"")
    return out


def run_in_shell(
    arguments: str, redirection: str = "", **variables: str
) -> subprocess.CompletedProcess[bytes]:
    """Run `overtaking` in a shell; with a pipe, the status comes from `overtaking` (`pipefail`).

    Args:
        arguments: Arguments of `overtaking`.
        redirection: Text after them, such as `>&-` or a pipe.
        variables: Environment variables to set.
    """
    environment = {key: value for key, value in os.environ.items() if key != "COLUMNS"} | variables
    line = f"set -o pipefail; {OVERTAKING} {arguments} {redirection}"
    return subprocess.run(["bash", "-c", line], capture_output=True, env=environment, check=False)


@pytest.mark.parametrize("arguments", PRINTING)
@pytest.mark.parametrize("redirection", [">&-", ">&- 2>&- <&-", "2>/dev/full", "| head -1"])
def test_a_stream_that_is_closed_changes_no_exit_status(folder, arguments, redirection):
    process = run_in_shell(arguments.format(data=folder), redirection)
    assert (process.returncode, process.stderr) == (0, b"")


@pytest.mark.parametrize("arguments", PRINTING)
def test_a_result_that_cannot_be_written_is_an_error_of_one_line(folder, arguments):
    process = run_in_shell(arguments.format(data=folder), ">/dev/full")
    assert process.returncode == 2
    assert process.stderr == b"error: standard output: No space left on device\n"


def test_the_status_of_findings_survives_a_closed_pipe():
    program = (
        "import sys; from overtaking.cli import doctor, main\n"
        "diagnose = doctor.diagnose\n"
        "doctor.diagnose = lambda folder: {**diagnose(folder), 'findings': ['a finding']}\n"
        "sys.exit(main(['doctor']))"
    )
    line = f"set -o pipefail; {shlex.join([sys.executable, '-c', program])} | true"
    process = subprocess.run(["bash", "-c", line], capture_output=True, check=False)
    assert (process.returncode, process.stderr) == (1, b"")


def test_a_data_set_is_complete_although_its_summary_cannot_be_printed(tmp_path):
    process = run_in_shell(f"generate -n 2 --out {tmp_path / 'set'}", ">/dev/full")
    assert process.returncode == 0
    assert process.stderr.startswith(b"warning: standard output: No space left on device")
    assert process.stderr.count(b"\n") == 1
    assert run_in_shell(f"info {tmp_path / 'set'}").returncode == 0


@pytest.mark.parametrize("redirection", ["2>&-", "2>/dev/full"])
def test_an_error_that_cannot_be_printed_keeps_its_status(folder, redirection):
    process = run_in_shell(f"show {folder} 99", redirection)
    assert (process.returncode, process.stdout) == (2, b"")


@pytest.mark.parametrize("arguments", ["stats {data}", "show {data} 2", "glossary"])
@pytest.mark.parametrize("encoding", ["ascii", "cp1252"])
def test_every_encoding_prints_readable_text(folder, arguments, encoding):
    process = run_in_shell(arguments.format(data=folder), PYTHONIOENCODING=encoding)
    assert (process.returncode, process.stderr) == (0, b"")
    assert "?" not in process.stdout.decode(encoding)


def test_the_c_locale_writes_the_files_that_any_other_writes(folder, tmp_path):
    c_locale = {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    for name, variables in (("utf-8", {"PYTHONUTF8": "1"}), ("c", c_locale)):
        process = run_in_shell(f"export {folder} --format asp --out {tmp_path / name}", **variables)
        assert (process.returncode, process.stderr) == (0, b"")
    for file in (tmp_path / "utf-8").rglob("*.lp"):
        twin = tmp_path / "c" / file.relative_to(tmp_path / "utf-8")
        assert twin.read_bytes() == file.read_bytes()


def test_a_name_that_is_not_utf_8_is_an_error_of_one_line(tmp_path):
    process = run_in_shell(f"generate -n 1 --quiet --out {tmp_path}/$'a\\xff'")
    assert process.returncode == 2
    assert b"expected a name in UTF-8" in process.stderr
    assert process.stderr.count(b"\n") == 1


def test_json_holds_the_same_values_in_every_encoding(folder):
    values, others = (
        json.loads(run_in_shell("glossary --json", PYTHONIOENCODING=encoding).stdout)
        for encoding in ("utf-8", "ascii")
    )
    assert others == values
    assert not json.dumps(values, ensure_ascii=False).isascii()


def in_terminal(arguments: str, width: int) -> list[str]:
    """The lines that a command prints in a terminal of some width, without styles."""
    import fcntl
    import pty
    import re
    import struct
    import termios

    reader, terminal = pty.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, width, 0, 0))
    environment = {key: value for key, value in os.environ.items() if key != "COLUMNS"}
    command = ["bash", "-c", f"{OVERTAKING} {arguments}"]
    environment["TERM"] = "xterm"
    with subprocess.Popen(command, stdin=terminal, stdout=terminal, env=environment) as process:
        os.close(terminal)
        printed = b""
        # Linux answers a read with EIO when the last writer has closed the terminal.
        with contextlib.suppress(OSError):
            while block := os.read(reader, 1 << 16):
                printed += block
    os.close(reader)
    assert process.returncode == 0
    return re.sub(r"\x1b\[[0-9;]*m", "", printed.decode()).replace("\r", "").splitlines()


@pytest.mark.parametrize("width", [40, 80])
@pytest.mark.parametrize(
    "arguments",
    ["stats {data}", "show {data} 2", "ask {data} --predicates", "drive --help", "--help"],
)
def test_a_terminal_gets_lines_that_fit(folder, arguments, width):
    lines = in_terminal(arguments.format(data=folder), width)
    assert len(lines) > 10
    assert max(map(len, lines)) <= width
    assert not any(line.endswith("…") for line in lines)


@pytest.mark.parametrize("width", [40, 200])
def test_the_next_command_runs_as_it_is_printed(tmp_path, width):
    out = tmp_path / "a folder" / "set"
    lines = in_terminal(f"generate -n 1 --out {shlex.quote(str(out))}", width)
    command = "\n".join(lines).partition("next: ")[2].partition(" ")[2]
    assert f"'{out}'" in command
    assert run_in_shell(command).stdout.startswith(b"Simulation 0")
