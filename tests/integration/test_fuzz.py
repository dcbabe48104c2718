"""Damaged input of any kind ends in our own errors, and takes little memory."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
CASES = 300


def targets() -> list[str]:
    """The names in the table of targets."""
    code = "from fuzzed import TARGETS; print(*(one.name for one in TARGETS))"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=BENCHMARKS)
    return done.stdout.split()


@pytest.mark.parametrize("target", targets())
def test_damaged_input_ends_in_our_own_errors(target: str):
    command = [sys.executable, "fuzz.py", "--target", target, "-n", str(CASES)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=BENCHMARKS)
    assert done.returncode == 0, done.stdout + done.stderr
