"""SUMO for tests: the real one, or a reason why there is none."""

from __future__ import annotations

import platform
import sys

import pytest

HAS_WHEEL = sys.platform in ("darwin", "win32") or platform.machine() == "x86_64"
needs_sumo = pytest.mark.skipif(
    not HAS_WHEEL,  # Where there is one, a missing one is a failure.
    reason="libsumo has wheels for macOS, Windows and x86-64 alone",
)
