"""SUMO for tests: the real one, or a reason why there is none."""

from __future__ import annotations

import importlib.util

import pytest

needs_sumo = pytest.mark.skipif(
    importlib.util.find_spec("libsumo") is None,
    reason="libsumo is not installed (extra [sumo]); it has no wheel for every platform",
)
