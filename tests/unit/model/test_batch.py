"""A batch works out what is asked for, once, and is believed where somebody changes it."""

from __future__ import annotations

import pickle
from dataclasses import dataclass

import numpy as np
import pytest

from overtaking.model.batch import Delayed


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair(Delayed):
    one: np.ndarray
    two: np.ndarray
    three: np.ndarray


@pytest.fixture
def asked() -> list[str]:
    return []


@pytest.fixture
def pair(asked: list[str]) -> Pair:
    def both() -> dict[str, np.ndarray]:
        asked.append("two and three")
        return {"two": np.arange(4), "three": np.arange(4) * 3}

    return Pair.partly({"two": both, "three": both}, one=np.ones(4))


def test_a_field_is_worked_out_when_it_is_asked_for_and_once(pair, asked):
    assert pair.one.sum() == 4
    assert asked == []
    assert (pair.two.sum(), pair.three.sum(), pair.two.sum()) == (6, 18, 6)
    assert asked == ["two and three"]


def test_a_copy_with_a_change_has_all_fields(pair):
    changed = pair.replace(two=np.zeros(4))
    assert (changed.two.sum(), changed.three.sum()) == (0, 18)


def test_a_part_and_a_stored_one_have_all_fields(pair):
    assert pair.select(np.array([3])).three.tolist() == [9]
    assert pickle.loads(pickle.dumps(pair)).two.tolist() == [0, 1, 2, 3]


def test_what_is_no_field_is_none(pair):
    with pytest.raises(AttributeError, match="four"):
        _ = pair.four
