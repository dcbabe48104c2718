"""Names end in their unit, and nothing else is accepted."""

from __future__ import annotations

import pyarrow as pa
import pytest

from overtaking.core.units import NAME_SUFFIXES
from overtaking.data.tables.columns import (
    BYTE,
    INT,
    INTEGER_UNITS,
    attributes,
    codes,
    column,
    declared,
    flags_of,
    names_of,
    si_name,
    unit_of,
)
from overtaking.model.overtake_features import LeaderState


def test_a_column_knows_its_unit_and_meaning_and_ends_in_its_unit():
    field = column("gap", INT, "Bumper gap", "mm", nullable=True).field
    assert field.name == "gap_mm"
    assert unit_of(field) == "mm"
    assert field.metadata[b"description"] == b"Bumper gap"
    assert field.type == pa.int32()
    assert field.nullable


def test_an_unknown_unit_is_refused():
    with pytest.raises(KeyError, match="furlong"):
        column("gap", INT, "Bumper gap", "furlong")


def test_an_enumeration_lists_its_names_in_order():
    field = column("kind", ("b", "a"), "Kind").field
    assert names_of(field) == ("b", "a")
    assert flags_of(field) == ()
    assert field.type == pa.dictionary(pa.int32(), pa.string())


def test_flags_are_listed_from_the_lowest_bit():
    assert flags_of(column("lights", BYTE, "Lights", flags=("a", "b")).field) == ("a", "b")


def test_columns_of_a_part_of_a_batch_have_its_path():
    given = column("gap", INT, "Gap", "mm"), column("age", INT, "Age", "ms", needs=["stage"])
    gap, age = attributes("a.b", *given, prefix="x_", nullable=True, needs=("lamps",))
    assert (gap.name, gap.path, gap.needs) == ("x_gap_mm", "a.b.gap", ("lamps",))
    assert (age.name, age.path, age.needs) == ("x_age_ms", "a.b.age", ("stage",))
    assert gap.field.nullable
    assert gap.is_silent({"lamps"})
    assert not age.is_silent({"lamps"})


def test_columns_follow_from_what_the_fields_of_a_batch_declare():
    found = {one.name: one for one in declared("leader", LeaderState, nullable=True)}
    assert found["leader_ttc_s"].path == "leader.encounter.ttc"
    assert found["leader_ttc_s"].present == "leader.encounter.valid"
    assert found["leader_kind"].needs == ("kinds",)
    assert names_of(found["leader_kind"].field)[0] == "S"
    assert found["return_gap_m"].present == "leader.has_next_leader"
    assert "leader_has_next_leader" not in found


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
    field = column(name.removesuffix(NAME_SUFFIXES[unit]), INT, "Something", unit).field
    assert field.name == name
    assert si_name(field) == expected


def test_every_step_has_an_ending_and_so_has_its_si_unit():
    assert set(INTEGER_UNITS) <= set(NAME_SUFFIXES)
    assert {unit for unit, _ in INTEGER_UNITS.values()} <= set(NAME_SUFFIXES)
    assert len(set(NAME_SUFFIXES.values())) == len(NAME_SUFFIXES)


@pytest.mark.parametrize("dictionary", [["b", "a", "c"], ["a", "c"], ["c", "a", "b"]])
@pytest.mark.parametrize("picked", [[0, 1, 1], [1, None, 0], [None], []])
def test_codes_are_those_of_the_schema(dictionary, picked):
    indices = pa.array([0, *picked], pa.int32())
    chunk = pa.DictionaryArray.from_arrays(indices, dictionary).slice(1)
    expected = [-1 if text is None else "bac".index(text) for text in chunk.to_pylist()]
    assert codes(chunk, ("b", "a", "c")).tolist() == expected
