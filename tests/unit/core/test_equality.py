"""Results compare by content, and NaN equals NaN."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Any

import numpy as np
import pandas as pd
import pytest

from overtaking.core.equality import ContentEquality, is_same_content
from overtaking.core.representation import CompactRepr


@dataclass(frozen=True, slots=True, kw_only=True)
class Result(ContentEquality):
    value: Any


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultWithNote(Result):
    note: str


@dataclass(frozen=True)
class SummarizedResult(CompactRepr, ContentEquality):
    value: Any


@dataclass(frozen=True)
class Plain:
    value: Any


def nan() -> float:
    """A NaN that is not `math.nan` itself."""
    return float("nan")


PAIRS: dict[str, tuple[Any, Any, Any]] = {
    # Two equal values and a different one.
    "float": (nan(), nan(), 1.0),
    "array scalar": (np.float32("nan"), np.float32("nan"), np.float32(0)),
    "complex": (complex(nan(), 0), complex(nan(), 0), 1j),
    "decimal": (Decimal("nan"), Decimal("nan"), Decimal(1)),
    "missing value of pandas": (pd.NA, pd.NA, 1),
    "missing time": (np.datetime64("NaT"), np.datetime64("NaT"), np.datetime64("2020-01-01")),
    "floats": (np.array([1.0, nan()]), np.array([1.0, nan()]), np.array([nan(), 1.0])),
    "integers": (np.arange(3), np.arange(3), np.arange(4)),
    "dtype": (np.zeros(2), np.zeros(2), np.zeros(2, np.float32)),
    "shape": (np.zeros((2, 1)), np.zeros((2, 1)), np.zeros((1, 2))),
    "texts": (np.array(["a", "b"]), np.array(["a", "b"]), np.array(["a", "c"])),
    "objects": (
        np.array([nan(), "a", None], object),
        np.array([nan(), "a", None], object),
        np.array([nan(), "b", None], object),
    ),
    "records": (
        np.array([(1, nan())], "i4,f8"),
        np.array([(1, nan())], "i4,f8"),
        np.array([(2, nan())], "i4,f8"),
    ),
    "table": (
        pd.DataFrame({"a": [1.0, nan()]}),
        pd.DataFrame({"a": [1.0, nan()]}),
        pd.DataFrame({"b": [1.0, nan()]}),
    ),
    "column": (pd.Series([nan()]), pd.Series([nan()]), pd.Series([1.0])),
    "mapping": ({"a": nan()}, {"a": nan()}, {"b": nan()}),
    "order of keys": ({"a": 1, "b": 2}, {"b": 2, "a": 1}, {"a": 1}),
    "list": ([nan(), [1]], [nan(), [1]], [nan(), [1, 2]]),
    "tuple": ((1, nan()), (1, nan()), [1, nan()]),
    "nested": (
        Result(value={"a": [np.array([nan()])]}),
        Result(value={"a": [np.array([nan()])]}),
        Result(value={"a": [np.array([0.0])]}),
    ),
    "dataclass of another kind": (Plain(np.arange(2)), Plain(np.arange(2)), Plain(np.arange(3))),
    "array beside a number": (1, 1, np.array([1, 1])),
    "table beside a number": (1, 1, pd.DataFrame({"a": [1]})),
    "nothing": (None, None, np.array([])),
}


@pytest.mark.parametrize("kind", PAIRS)
@pytest.mark.parametrize("make", [lambda value: Result(value=value), SummarizedResult])
def test_equal_content_makes_equal_results(kind, make):
    first, second, different = map(make, PAIRS[kind])
    assert (first == second) is True
    assert (first != second) is False
    assert (first == different) is False
    assert (different == first) is False
    assert (first != different) is True


def test_results_of_different_classes_differ():
    assert Result(value=1) != SummarizedResult(1)
    assert Result(value=1) != ResultWithNote(value=1, note="")
    assert (Result(value=1) == 1) is False
    assert not is_same_content(Result(value=1), 1)
    assert not is_same_content(1, Result(value=1))


def test_fields_of_a_subclass_count():
    result = ResultWithNote(value=nan(), note="a")
    assert result == replace(result, value=nan())
    assert result != replace(result, note="b")


@pytest.mark.parametrize(
    "value", [1, nan(), np.float64("nan"), "a", None, (1, nan(), (nan(),)), Plain(nan())]
)
def test_equal_results_have_the_same_hash(value):
    pair = {Result(value=value), Result(value=value)}
    assert len(pair) == 1
    assert hash(Result(value=(nan(),))) == hash(Result(value=(nan(),)))


def test_numbers_of_two_types_that_are_equal_have_the_same_hash():
    assert Result(value=1) == Result(value=np.float64(1))
    assert hash(Result(value=1)) == hash(Result(value=np.float64(1)))


@pytest.mark.parametrize("value", [np.zeros(2), [1], {"a": 1}, pd.DataFrame(), (np.zeros(1),)])
def test_a_result_with_a_value_that_can_change_is_not_hashable(value):
    with pytest.raises(TypeError, match="unhashable"):
        hash(Result(value=value))


def test_a_result_is_equal_after_a_round_trip_of_nan():
    assert Result(value=math.nan) == Result(value=np.array([np.nan])[0])
