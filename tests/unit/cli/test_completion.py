"""The shell completes commands and options."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.ci

COMMAND = [sys.executable, "-m", "overtaking"]


def run(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1", **variables}
    return subprocess.run(
        [*COMMAND, *arguments], capture_output=True, text=True, env=environment, check=False
    )


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_of_a_shell_calls_the_command(shell: str):
    done = run("--show-completion", shell)
    assert (done.returncode, done.stderr) == (0, "")
    assert "_OVERTAKING_COMPLETE" in done.stdout


@pytest.mark.parametrize(
    ("line", "completed"),
    [
        ("overtaking gen", ["generate"]),
        ("overtaking carla ", ["serve", "run", "replay", "limits"]),
        ("overtaking stats --re", ["--reading"]),
    ],
)
def test_a_line_is_completed(line: str, completed: list[str]):
    count = str(len(line.split(" ")) - 1)
    done = run(_OVERTAKING_COMPLETE="complete_bash", COMP_WORDS=line, COMP_CWORD=count)
    assert done.stdout.split() == completed


def test_the_script_is_installed(tmp_path):
    done = run("--install-completion", "bash", HOME=str(tmp_path))
    assert done.returncode == 0
    assert "_overtaking_completion" in next(tmp_path.rglob("overtaking.sh")).read_text()
    assert "overtaking.sh" in (tmp_path / ".bashrc").read_text()
