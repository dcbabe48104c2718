"""Names end in their unit, and nothing else is accepted."""

import dataclasses
from typing import Annotated

import numpy as np
import pyarrow as pa
import pytest

from overtaking.core.arrays import F32, I32, U8
from overtaking.core.units import NAME_SUFFIXES
from overtaking.data.tables.columns import (
    INTEGER_UNITS,
    codes,
    columns_of,
    computed_column,
    flags_of,
    names_of,
    si_name,
    unit_of,
)
from overtaking.model.batch import Batch, ColumnName, FieldSpec
from overtaking.model.overtake_features import LeaderState


@dataclasses.dataclass(frozen=True, kw_only=True)
class Meeting(Batch):
    """A batch of the tests."""

    slot: Annotated[U8, FieldSpec("Slot", missing=255, column=ColumnName("vehicle"))]
    gap: Annotated[I32, FieldSpec("Gap", "mm", null_unless=".slot")]
    age: Annotated[I32, FieldSpec("Age", "ms", needs=["stage"])]
    inner: Annotated[F32, FieldSpec("Not written", column=None)]


def test_a_column_knows_its_unit_and_meaning_and_ends_in_its_unit():
    one = computed_column("gap", np.int32, FieldSpec("Bumper gap", "mm"), is_nullable=True)
    field = one.arrow_field
    assert one.name == field.name == "gap_mm"
    assert unit_of(field) == "mm"
    assert field.metadata[b"description"] == b"Bumper gap"
    assert field.type == pa.int32()
    assert field.nullable


def test_an_unknown_unit_is_refused():
    with pytest.raises(KeyError, match="furlong"):
        computed_column("gap", np.int32, FieldSpec("Bumper gap", "furlong"))


def test_an_enumeration_lists_its_names_in_order():
    field = computed_column("kind", np.uint8, FieldSpec("Kind", names=("b", "a"))).arrow_field
    assert names_of(field) == ("b", "a")
    assert flags_of(field) == ()
    assert field.type == pa.dictionary(pa.int32(), pa.string())


def test_flags_are_listed_from_the_lowest_bit():
    lights = computed_column("lights", np.uint8, FieldSpec("Lights", flags=("a", "b")))
    assert flags_of(lights.arrow_field) == ("a", "b")


def test_columns_of_a_part_of_a_batch_have_its_path():
    vehicle, gap, age = columns_of(
        Meeting, "a.b", prefix="x_", about="the leader", index=1, needs=("lamps",)
    )
    assert (vehicle.name, vehicle.path, vehicle.index) == ("x_vehicle", "a.b.slot", 1)
    assert (gap.name, gap.path, gap.spec.needs) == ("x_gap_mm", "a.b.gap", ("lamps",))
    assert (age.name, age.path, age.spec.needs) == ("x_age_ms", "a.b.age", ("lamps", "stage"))
    assert gap.spec.meaning == "Gap; the leader"
    assert gap.is_silent({"lamps"})
    assert age.is_silent({"stage"})
    assert not gap.is_silent({"stage"})


def test_a_column_is_null_where_its_field_or_the_one_it_depends_on_has_no_value():
    vehicle, gap, age = columns_of(Meeting, "a")
    assert [(one.spec.null_unless, one.null_value) for one in (vehicle, gap)] == [
        ("a.slot", 255)
    ] * 2
    assert age.spec.null_unless == ""
    assert [one.is_nullable for one in (vehicle, gap, age)] == [True, True, True]
    (age,) = columns_of(Meeting, only=("age",), nullable=False)
    assert not age.is_nullable


def test_columns_follow_from_what_the_fields_of_a_batch_declare():
    found = {one.name: one for one in columns_of(LeaderState, "leader", nullable=True)}
    assert found["leader_ttc_s"].path == "leader.encounter.ttc"
    assert found["leader_ttc_s"].spec.null_unless == "leader.encounter.valid"
    assert found["leader_kind"].spec.needs == ("kinds",)
    assert found["leader_kind"].spec.names[0] == "S"
    assert found["return_gap_m"].spec.null_unless == "leader.has_next_leader"
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
    bare_name = name.removesuffix(NAME_SUFFIXES[unit])
    field = computed_column(bare_name, np.int32, FieldSpec("Something", unit)).arrow_field
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
