"""Damaged input of any kind ends in our own errors, and takes little memory."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
CASES = 50


@pytest.mark.ci
def test_damaged_input_ends_in_our_own_errors():
    command = [sys.executable, "fuzz.py", "-n", str(CASES)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=BENCHMARKS)
    assert done.returncode == 0, done.stdout + done.stderr
