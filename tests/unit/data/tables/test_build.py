"""Columns of NumPy become the Arrow columns that their schema names."""

from __future__ import annotations

import numpy as np
import pytest

from overtaking.data.tables.arrow import Masked, to_numpy
from overtaking.data.tables.build import Texts, build
from overtaking.data.tables.encode import encode


@pytest.fixture(scope="module")
def recorded(recorder):
    return recorder(seed=6)


@pytest.fixture(scope="module")
def weather(recorded):
    return encode(recorded, np.arange(5), ["weather"])["weather"]


@pytest.fixture(scope="module")
def columns(weather):
    numbers = {
        name: to_numpy(weather[name].chunk(0)) for name in weather.schema.names if name != "preset"
    }
    presets = weather["preset"].to_pylist()
    missing = np.array([one is None for one in presets])
    texts = tuple(one or "" for one in presets)
    return {**numbers, "preset": Texts(np.arange(5, dtype=np.int32), texts, missing)}


def made(recorded, columns):
    return build("weather", recorded, lambda values: values, columns)


def test_columns_may_come_in_any_order_and_attributes_are_read(recorded, columns, weather):
    assert made(recorded, dict(reversed(columns.items()))).equals(weather)
    del (left := dict(columns))["fog_percent"]
    assert made(recorded, left).equals(weather)


def test_masked_values_are_null(recorded, columns):
    missing = np.array([False, True, False, True, True])
    given = columns | {"preset": Texts(np.zeros(5, np.int32), ("ClearNoon",), missing)}
    masked = given | {"fog_percent": Masked(columns["fog_percent"], missing)}
    table = made(recorded, masked)
    assert table["fog_percent"].is_null().to_pylist() == missing.tolist()
    assert table["preset"].to_pylist() == ["ClearNoon", None, "ClearNoon", None, None]


def test_a_column_of_another_type_is_named(recorded, columns):
    with pytest.raises(AssertionError, match="fog_percent: float64"):
        made(recorded, columns | {"fog_percent": np.zeros(5)})
