"""Results become what JSON has."""

import json
from dataclasses import dataclass
from datetime import date

import numpy as np

from overtaking.core.representation import json_values


@dataclass
class Point:
    x: float
    tags: tuple[str, ...]


def test_everything_has_a_form_in_json() -> None:
    value = {
        1: Point(x=np.float32(0.5), tags=("a", "b")),
        "array": np.array([1.0, np.nan, np.inf]),
        "counts": np.array([[1, 2]]),
        "bytes": b"\x01\xff",
        "day": date(2024, 2, 29),
        "plain": [None, True, 3, "text"],
    }
    found = json_values(value)
    assert found == {
        "1": {"x": 0.5, "tags": ["a", "b"]},
        "array": [1.0, None, None],
        "counts": [[1, 2]],
        "bytes": "01ff",
        "day": "2024-02-29",
        "plain": [None, True, 3, "text"],
    }
    assert json.loads(json.dumps(found, allow_nan=False)) == found
