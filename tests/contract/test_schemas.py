"""Every column of every table says what it is and in which unit, as the nouns in memory do."""

from __future__ import annotations

import dataclasses
import inspect
import re

import pyarrow as pa
import pytest

from overtaking.core.units import INTEGER_UNITS, NAME_SUFFIXES
from overtaking.data.tables.columns import names_of, si_name, unit_of
from overtaking.data.tables.schemas import COLUMNS, KEYS, SCHEMAS, VERSION
from overtaking.model.trajectories import Contacts, Percepts, States
from overtaking.model.vehicles import DriverTraits, VehicleSpecs
from overtaking.model.weather import Weather


def units_in_docstring(cls: type) -> dict[str, str]:
    """The unit that the docstring of a batch gives for each attribute, `1` where it gives none."""
    text = inspect.getdoc(cls) or ""
    entries = re.findall(r"^    (\w+): (.*(?:\n {6,}.*)*)", text, re.MULTILINE)
    found = {name: re.findall(r"\[([^]]+)\]", words) for name, words in entries}
    return {name: units[-1] if units else "1" for name, units in found.items()}


def test_a_schema_says_its_name_and_version():
    for table, schema in SCHEMAS.items():
        name = f"overtaking.{table}".encode()
        assert schema.metadata == {b"schema": name, b"version": str(VERSION).encode()}


def test_a_column_has_a_unit_its_ending_and_a_description():
    endings = tuple(ending for unit, ending in NAME_SUFFIXES.items() if unit != "1")
    for where, field in every_column():
        assert unit_of(field) in NAME_SUFFIXES, where
        assert field.name.endswith(NAME_SUFFIXES[unit_of(field)]), where
        # A column without a unit does not look as if it had one.
        assert unit_of(field) != "1" or not field.name.endswith(endings), where
        description = field.metadata[b"description"].decode()
        assert description, where
        assert not description.endswith("."), where


def test_an_integer_with_a_unit_counts_steps_and_a_float_does_not():
    for where, field in every_column():
        if unit_of(field) not in ("1", "N s"):
            assert pa.types.is_integer(field.type) == (unit_of(field) in INTEGER_UNITS), where


def test_the_keys_come_first_and_are_never_null():
    for table, schema in SCHEMAS.items():
        assert tuple(schema.names[: len(KEYS[table])]) == KEYS[table]
        assert not any(schema.field(key).nullable for key in KEYS[table]), table


def test_no_two_columns_have_the_same_name_in_si():
    for table, schema in SCHEMAS.items():
        names = [si_name(field) for field in schema]
        assert len(set(names)) == len(names), table


def every_column() -> list[tuple[str, pa.Field]]:
    """Every column of every table, with its name for messages."""
    return [
        (f"{table}.{field.name}", field) for table, schema in SCHEMAS.items() for field in schema
    ]


def test_a_column_of_the_same_name_means_the_same_in_every_table():
    seen: dict[str, set[tuple[str, str]]] = {}
    for field in (field for schema in SCHEMAS.values() for field in schema):
        # `kind` is what a vehicle is and what a decision is about.
        if field.name != "kind":
            seen.setdefault(field.name, set()).add((str(field.type), unit_of(field)))
    assert {name for name, kinds in seen.items() if len(kinds) > 1} == set()


@pytest.mark.parametrize(
    ("cls", "table", "path", "elsewhere"),
    [
        (VehicleSpecs, "vehicles", "scenario.vehicles", {"valid"}),
        (DriverTraits, "vehicles", "scenario.drivers", set()),
        (Contacts, "vehicles", "contacts", set()),
        (Weather, "weather", "scenario.weather", {"preset"}),
        (States, "states", "states", {"lane", "lights"}),
        (Percepts, "percepts", "percepts", {"valid"}),
    ],
)
def test_every_attribute_has_a_column_in_its_unit(cls, table, path, elsewhere):
    attributes = {field.name for field in dataclasses.fields(cls)}
    columns = [one for one in COLUMNS[table] if one.path.rpartition(".")[0] == path]
    assert {one.path.rpartition(".")[2] for one in columns} | elsewhere == attributes
    documented = units_in_docstring(cls)
    for one in columns:
        assert one.spec.unit == documented[one.path.rpartition(".")[2]], one.name


def test_the_docstrings_are_read():
    """The test above would pass if no unit were found."""
    assert units_in_docstring(Contacts) == {
        "partner": "1",
        "time": "ms",
        "impulse": "N s",
        "closing_speed": "mm/s",
    }
    assert units_in_docstring(VehicleSpecs)["yaw_inertia"] == "kg m^2"


def test_names_of_line_types_are_those_of_carla():
    """`carla.LaneMarkingType` of CARLA 0.9.16."""
    assert set(names_of(SCHEMAS["frames"].field("left_line"))) == {
        *("NONE", "Other", "Broken", "Solid", "SolidSolid", "SolidBroken"),
        *("BrokenSolid", "BrokenBroken", "BottsDots", "Grass", "Curb"),
    }
