"""Columns of an observation are declared once, and every reader of them has the same names."""

from __future__ import annotations

import numpy as np

from overtaking.gym.spaces import OBSERVATION_COLUMNS
from overtaking.model.driver_interface import (
    EGO_COLUMNS,
    NEIGHBOUR_COLUMNS,
    NEIGHBOUR_ROLES,
    OBSERVATION_SIZE,
    PASSING_COLUMNS,
)
from overtaking.sim.ego_observation import EgoObservation
from overtaking.world.step_parameters import VEHICLE_FIELDS, VehicleParameters


def numbered_observation() -> EgoObservation:
    """An observation of two simulations whose columns hold their own numbers."""
    numbers = np.arange(OBSERVATION_SIZE, dtype=np.float32)
    return EgoObservation(
        time=0.0,
        is_running=np.ones(2, np.bool_),
        table=np.stack([numbers, 1000.0 + numbers]),
        vehicle=VehicleParameters._make(np.zeros((len(VEHICLE_FIELDS), 2), np.float32)),
    )


def test_every_column_of_the_table_is_an_attribute_in_its_order():
    observation = numbered_observation()
    assert len(OBSERVATION_COLUMNS) == OBSERVATION_SIZE
    for index, column in enumerate(OBSERVATION_COLUMNS):
        group, name = column.name.split(".")
        values = getattr(getattr(observation, group), name)
        np.testing.assert_array_equal(values, [index, 1000 + index], err_msg=column.name)


def test_attributes_are_views_of_the_table():
    observation = numbered_observation()
    groups = ("ego", *NEIGHBOUR_ROLES, "neighbours", "passing")
    for columns in (getattr(observation, group) for group in groups):
        assert all(np.shares_memory(values, observation.table) for values in columns)


def test_all_neighbours_at_once_are_those_by_role():
    observation = numbered_observation()
    for index, role in enumerate(NEIGHBOUR_ROLES):
        for values, same in zip(observation.neighbours, getattr(observation, role), strict=True):
            np.testing.assert_array_equal(values[index], same)


def test_every_column_has_a_unit_and_a_meaning():
    for columns in (EGO_COLUMNS, NEIGHBOUR_COLUMNS, PASSING_COLUMNS):
        for name, (unit, meaning) in columns.items():
            assert unit, name
            assert meaning[0].isupper(), name
            assert not meaning.endswith("."), name
