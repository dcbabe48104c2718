"""Every column of every table says what it is and in which unit, as the nouns in memory do."""

from __future__ import annotations

import dataclasses
import inspect
import re

import pyarrow as pa
import pytest

from overtaking.data.tables.columns import STEPS, SUFFIXES, names_of, si_name, unit_of
from overtaking.data.tables.schemas import (
    BODY_FIELDS,
    DRIVER_FIELDS,
    KEYS,
    SCHEMAS,
    STATE_FIELDS,
    VERSION,
    WEATHER_FIELDS,
)
from overtaking.model.drivers import Drivers
from overtaking.model.trajectory import Contacts, Percepts, States
from overtaking.model.vehicles import VehicleSpecs
from overtaking.model.weather import Weather


def units_in_docstring(cls: type) -> dict[str, str]:
    """The unit that the docstring of a batch gives for each attribute, `1` where it gives none."""
    text = inspect.getdoc(cls) or ""
    entries = re.findall(r"^    (\w+): (.*(?:\n {6,}.*)*)", text, re.MULTILINE)
    found = {name: re.findall(r"\[([^]]+)\]", words) for name, words in entries}
    return {name: units[-1] if units else "1" for name, units in found.items()}


@pytest.mark.parametrize("table", SCHEMAS)
def test_a_schema_says_its_name_and_version(table: str):
    assert SCHEMAS[table].metadata == {
        b"schema": f"overtaking.{table}".encode(),
        b"version": str(VERSION).encode(),
    }


@pytest.mark.parametrize("table", SCHEMAS)
def test_a_column_has_a_unit_and_a_description(table: str):
    for field in SCHEMAS[table]:
        assert unit_of(field) in SUFFIXES, field.name
        assert field.name.endswith(SUFFIXES[unit_of(field)])
        description = field.metadata[b"description"].decode()
        assert description, field.name
        assert not description.endswith("."), field.name


@pytest.mark.parametrize("table", SCHEMAS)
def test_a_column_without_a_unit_does_not_look_as_if_it_had_one(table: str):
    endings = tuple(ending for unit, ending in SUFFIXES.items() if unit != "1")
    without = [field.name for field in SCHEMAS[table] if unit_of(field) == "1"]
    assert [name for name in without if name.endswith(endings)] == []


@pytest.mark.parametrize("table", SCHEMAS)
def test_an_integer_with_a_unit_counts_steps_and_a_float_does_not(table: str):
    for field in SCHEMAS[table]:
        if unit_of(field) not in ("1", "N s"):
            counts = pa.types.is_integer(field.type)
            assert counts == (unit_of(field) in STEPS), field.name


@pytest.mark.parametrize("table", SCHEMAS)
def test_the_keys_come_first_and_are_never_null(table: str):
    assert tuple(SCHEMAS[table].names[: len(KEYS[table])]) == KEYS[table]
    assert not any(SCHEMAS[table].field(key).nullable for key in KEYS[table])


@pytest.mark.parametrize("table", SCHEMAS)
def test_no_two_columns_have_the_same_name_in_si(table: str):
    names = [si_name(field) for field in SCHEMAS[table]]
    assert len(set(names)) == len(names)


def test_a_column_of_the_same_name_means_the_same_in_every_table():
    seen: dict[str, set[tuple[str, str]]] = {}
    for field in (field for schema in SCHEMAS.values() for field in schema):
        # `kind` is what a vehicle is and what a decision is about.
        if field.name != "kind":
            seen.setdefault(field.name, set()).add((str(field.type), unit_of(field)))
    assert {name for name, kinds in seen.items() if len(kinds) > 1} == set()


@pytest.mark.parametrize(
    ("cls", "table", "fields", "elsewhere"),
    [
        (VehicleSpecs, "vehicles", BODY_FIELDS, {"valid", "kind", "colour"}),
        (Drivers, "vehicles", DRIVER_FIELDS, set()),
        (Weather, "weather", WEATHER_FIELDS, {"preset"}),
        (States, "states", STATE_FIELDS, {"lane", "lights"}),
    ],
)
def test_every_attribute_has_a_column_in_its_unit(cls, table, fields, elsewhere):
    attributes = {field.name for field in dataclasses.fields(cls)}
    assert {name for name, _ in fields} | elsewhere == attributes
    documented = units_in_docstring(cls)
    for name, column in fields:
        assert unit_of(SCHEMAS[table].field(column)) == documented[name], name


@pytest.mark.parametrize(
    ("cls", "table", "column"),
    [
        (Contacts, "vehicles", "contact_{}"),
        (Percepts, "percepts", "leader_{}"),
        (Percepts, "percepts", "rear_{}"),
    ],
)
def test_every_recorded_length_speed_and_time_has_a_column_in_its_unit(cls, table, column):
    for name, unit in units_in_docstring(cls).items():
        if unit != "1":
            names = {column.format(name) + SUFFIXES[unit], name + SUFFIXES[unit]}
            assert names & set(SCHEMAS[table].names), name


def test_the_docstrings_are_read():
    """The tests above would pass if no unit were found."""
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
