"""The figures of a report show the numbers that are written down: data, not pixels."""

from __future__ import annotations

import json
from typing import Any

import pytest

from .figure_numbers import PINNED, features, figure_numbers

HOW_TO = "if it was changed on purpose: python -m tests.golden.stats.figure_numbers, and review"
EXPECTED: dict[str, Any] = json.loads(PINNED.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def found() -> dict[str, Any]:
    return figure_numbers(features())


def flat(value: Any, path: str = "") -> dict[str, Any]:
    """Every number with the way to it."""
    if isinstance(value, dict):
        pairs = value.items()
    elif isinstance(value, list):
        pairs = enumerate(value)
    else:
        return {path: value}
    return {key: one for name, part in pairs for key, one in flat(part, f"{path}/{name}").items()}


@pytest.mark.parametrize("figure", EXPECTED)
def test_a_figure_shows_the_pinned_numbers(found: dict[str, Any], figure: str):
    ours, pinned = flat(found[figure]), flat(EXPECTED[figure])
    assert list(ours) == list(pinned), HOW_TO
    for path, value in pinned.items():
        expected = pytest.approx(value, rel=1e-7, abs=1e-12) if isinstance(value, float) else value
        assert ours[path] == expected, f"{path}: {HOW_TO}"


def test_every_figure_is_pinned(found: dict[str, Any]):
    assert set(found) == set(EXPECTED)
