"""Names end in their unit, and nothing else is accepted."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest

from overtaking.data.tables.columns import (
    STEPS,
    SUFFIXES,
    Enumeration,
    codes,
    column,
    flags_of,
    names_of,
    short_codes,
    si_name,
    unit_of,
)


def test_a_column_knows_its_unit_and_meaning():
    field = column("gap_mm", pa.int32(), "mm", "Bumper gap", nullable=True)
    assert unit_of(field) == "mm"
    assert field.metadata[b"description"] == b"Bumper gap"
    assert field.type == pa.int32()
    assert field.nullable


def test_a_name_without_its_unit_is_refused():
    with pytest.raises(ValueError, match="column gap: expected an ending '_mm' for unit 'mm'"):
        column("gap", pa.int32(), "mm", "Bumper gap")


def test_an_unknown_unit_is_refused():
    with pytest.raises(KeyError, match="furlong"):
        column("gap", pa.int32(), "furlong", "Bumper gap")


def test_an_enumeration_lists_its_names_in_order():
    field = column("kind", Enumeration(names=("b", "a")), "1", "Kind")
    assert names_of(field) == ("b", "a")
    assert flags_of(field) == ()
    assert field.type == pa.dictionary(pa.int32(), pa.string())


def test_flags_are_listed_from_the_lowest_bit():
    assert flags_of(column("lights", pa.uint8(), "1", "Lights", flags=("a", "b"))) == ("a", "b")


@pytest.mark.parametrize(
    ("name", "unit", "expected"),
    [
        ("x_mm", "mm", "x_m"),
        ("time_ms", "ms", "time_s"),
        ("speed_mmps", "mm/s", "speed_mps"),
        ("accel_mmps2", "mm/s^2", "accel_mps2"),
        ("heading_100urad", "0.1 mrad", "heading_rad"),
        ("yaw_rate_100uradps", "0.1 mrad/s", "yaw_rate_radps"),
        ("length_m", "m", "length_m"),
        ("frame", "1", "frame"),
    ],
)
def test_the_name_in_si_ends_in_the_si_unit(name: str, unit: str, expected: str):
    assert si_name(column(name, pa.int32(), unit, "Something")) == expected


def test_every_step_has_an_ending_and_so_has_its_si_unit():
    assert set(STEPS) <= set(SUFFIXES)
    assert {unit for unit, _ in STEPS.values()} <= set(SUFFIXES)
    assert len(set(SUFFIXES.values())) == len(SUFFIXES)


@pytest.mark.parametrize("dictionary", [["b", "a", "c"], ["a", "c"], ["c", "a", "b"]])
@pytest.mark.parametrize("picked", [[0, 1, 1], [1, None, 0], [None], []])
def test_short_codes_are_those_of_the_schema(dictionary, picked):
    indices = pa.array([0, *picked], pa.int32())
    chunk = pa.DictionaryArray.from_arrays(indices, dictionary).slice(1)
    found = short_codes(chunk, ("b", "a", "c"))
    assert found.dtype == np.int8
    expected = [-1 if text is None else "bac".index(text) for text in chunk.to_pylist()]
    assert found.tolist() == codes(chunk, ("b", "a", "c")).tolist() == expected
