"""Recordings that cannot tell everything: null in the tables, the same gaps after reading."""

from __future__ import annotations

import dataclasses

import numpy as np
import pyarrow as pa
import pytest

from overtaking.data.tables.decode import decode
from overtaking.data.tables.encode import encode
from overtaking.data.tables.files import TableWriter, read_table
from overtaking.data.tables.restore import restore
from overtaking.data.tables.schemas import COLUMNS, KEYS, RECORDED_TABLES, SCHEMAS, schema_of
from overtaking.model.trajectories import UNKNOWNS
from overtaking.scenarios.recording_defaults import (
    default_drivers,
    default_vehicles,
    default_weather,
)

SOURCES = [f"scene {number}" for number in range(5)]


@pytest.fixture(scope="module")
def silent(recorder):
    """A batch of which nothing is known but movements and sizes, with vehicles that come and go."""
    given = recorder(seed=7)
    shape = given.states.x.shape
    present = np.random.default_rng(3).random(shape) < 0.7
    present[:, 0] = True
    return given.replace(unknown=frozenset(UNKNOWNS), is_recorded=present)


@pytest.fixture(scope="module")
def tables(silent):
    return encode(silent, np.arange(5), sources=SOURCES)


def test_a_column_needs_only_what_may_be_unknown():
    needs = {name for columns in COLUMNS.values() for one in columns for name in one.spec.needs}
    assert needs == set(UNKNOWNS)


def test_what_is_unknown_is_null_and_nothing_else_is(tables):
    for name in RECORDED_TABLES:
        empty = {one.name for one in COLUMNS[name] if one.is_silent(UNKNOWNS)}
        assert not empty & set(KEYS[name])
        for field in tables[name].schema:
            column = tables[name][field.name]
            if field.name in empty:
                assert column.null_count == len(column), field.name
            elif not SCHEMAS[name].field(field.name).nullable and field.name != "seed":
                assert column.null_count == 0, field.name


def test_only_known_lengths_and_widths_are_left_of_a_body(tables):
    left = [
        name
        for name in tables["vehicles"].column_names
        if tables["vehicles"][name].null_count < tables["vehicles"].num_rows
    ]
    assert {"length_m", "width_m"} <= set(left)
    assert not {"mass_kg", "kind", "colour", "desired_speed_mps"} & set(left)


def test_a_recording_has_a_source_and_no_seed(tables):
    assert tables["simulations"]["source_recording"].to_pylist() == SOURCES
    assert tables["simulations"]["seed"].null_count == 5


def test_a_simulation_keeps_its_schema(recorder):
    for name, table in encode(recorder(), np.arange(5)).items():
        assert table.schema.equals(SCHEMAS[name], check_metadata=True)


def test_files_give_back_what_was_written_and_the_rows_that_are_missing(silent, tables, tmp_path):
    again = {}
    for name, table in tables.items():
        schema = schema_of(name, silent.unknown, recorded=True)
        assert table.schema.equals(schema, check_metadata=True)
        with TableWriter(tmp_path / name, name, schema) as writer:
            writer.write(table)
            writer.finish()
        again[name] = read_table(tmp_path / name, name)
    back = restore(again, silent.road, silent.unknown)
    assert back.unknown == silent.unknown
    where = silent.state_mask
    assert np.array_equal(back.state_mask, where)
    for name in ("x", "y", "s", "d", "speed", "heading", "accel_lon", "accel_lat", "lane"):
        ours, theirs = getattr(back.states, name), getattr(silent.states, name)
        assert np.array_equal(ours[where], theirs[where]), name
    valid = silent.scenario.vehicles.valid
    assert np.array_equal(
        back.scenario.vehicles.length[valid], silent.scenario.vehicles.length[valid]
    )


def test_people_see_gaps_and_no_invented_numbers(tables):
    vehicles, states = decode(tables["vehicles"]), decode(tables["states"])
    assert vehicles["mass_kg"].isna().all()
    assert vehicles["kind"].isna().all()
    assert vehicles["two_wheeler"].isna().all()
    assert states[["wheel_angle_rad", "yaw_rate_radps", "indicator", "brake"]].isna().all(axis=None)
    assert decode(tables["simulations"])["seed"].isna().all()
    assert decode(tables["weather"])["night"].isna().all()


def test_what_is_assumed_can_be_computed_with():
    shape = (2, 3)
    length = np.full(shape, 4.0, np.float32)
    bodies = default_vehicles(np.ones(shape, bool), np.full(shape, 4, np.uint8), length, length / 2)
    drivers, weather = default_drivers(shape), default_weather(2)
    assert np.array_equal(bodies.length, length)
    for batch in (bodies, drivers, weather):
        for field in dataclasses.fields(batch):
            values = getattr(batch, field.name)
            assert len(values) == 2
            assert np.isfinite(values).all(), field.name
            assert (values.dtype == bool) == ("bool" in str(field.type)), field.name
    for name in ("mass", "wheelbase", "yaw_inertia", "power", "max_speed", "track_width"):
        assert (getattr(bodies, name) > 0).all(), name


def test_a_schema_without_gaps_is_the_schema_itself():
    assert all(schema_of(name) is SCHEMAS[name] for name in SCHEMAS)
    relaxed = schema_of("states", ("lamps",))
    assert relaxed.field("lights").nullable
    assert relaxed.field("lights").metadata == SCHEMAS["states"].field("lights").metadata
    assert relaxed.metadata == SCHEMAS["states"].metadata
    assert isinstance(relaxed, pa.Schema)
