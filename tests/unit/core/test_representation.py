"""Objects as JSON values; counts in words."""

import json
from dataclasses import dataclass
from datetime import date

import numpy as np
import pytest

from overtaking.core.representation import format_count, json_values


@dataclass
class Point:
    x: float
    tags: tuple[str, ...]


def test_values_of_every_supported_type_become_json_values() -> None:
    value = {
        1: Point(x=np.float32(0.5), tags=("a", "b")),
        "array": np.array([1.0, np.nan, np.inf]),
        "counts": np.array([[1, 2]]),
        "bytes": b"\x01\xff",
        "day": date(2024, 2, 29),
        "plain": [None, True, 3, "text"],
    }
    plain = json_values(value)
    assert plain == {
        "1": {"x": 0.5, "tags": ["a", "b"]},
        "array": [1.0, None, None],
        "counts": [[1, 2]],
        "bytes": "01ff",
        "day": "2024-02-29",
        "plain": [None, True, 3, "text"],
    }
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (0, "0 simulations"),
        (1, "1 simulation"),
        (2, "2 simulations"),
        (1_000_000, "1,000,000 simulations"),
    ],
)
def test_only_a_count_of_one_has_a_singular_noun(number: int, text: str) -> None:
    assert format_count(number, "simulation") == text
