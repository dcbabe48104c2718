"""Columns of NumPy become the Arrow columns that their schema names."""

from __future__ import annotations

import numpy as np
import pytest

from overtaking.data.contents import contents
from overtaking.data.tables.arrow import Masked, to_numpy
from overtaking.data.tables.build import Texts, build
from overtaking.data.tables.schemas import SCHEMAS


@pytest.fixture(scope="module")
def weather(recorder):
    return contents(recorder(seed=6), np.arange(5), ("weather",))["weather"]


@pytest.fixture(scope="module")
def columns(weather):
    numbers = {
        name: to_numpy(weather[name].chunk(0)) for name in weather.schema.names if name != "preset"
    }
    presets = weather["preset"].to_pylist()
    missing = np.array([one is None for one in presets])
    texts = tuple(one or "" for one in presets)
    return {**numbers, "preset": Texts(np.arange(5, dtype=np.int32), texts, missing)}


@pytest.mark.parametrize("name", SCHEMAS)
def test_every_table_is_valid(name: str, recorder):
    table = contents(recorder(seed=6), np.arange(5), (name,))[name]
    table.validate(full=True)
    assert table.schema.equals(SCHEMAS[name], check_metadata=True)


def test_columns_may_come_in_any_order(columns, weather):
    assert build("weather", dict(reversed(columns.items()))).equals(weather)


def test_masked_values_are_null(columns):
    missing = np.array([False, True, False, True, True])
    given = columns | {"preset": Texts(np.zeros(5, np.int32), ("ClearNoon",), missing)}
    masked = given | {"fog_percent": Masked(columns["fog_percent"], missing)}
    table = build("weather", masked)
    assert table["fog_percent"].is_null().to_pylist() == missing.tolist()
    assert table["preset"].to_pylist() == ["ClearNoon", None, "ClearNoon", None, None]


def test_a_column_of_another_type_is_named(columns):
    with pytest.raises(AssertionError, match="fog_percent: float64"):
        build("weather", columns | {"fog_percent": np.zeros(5)})
