"""The engine has the parameters and constants that Python declares."""

from __future__ import annotations

import runpy
from pathlib import Path

from overtaking import _core
from overtaking.world.constants import CONSTANT_NAMES
from overtaking.world.step_parameters import SIMULATION_FIELDS, VEHICLE_FIELDS

CRATES = Path(__file__).parents[2] / "crates"


def test_the_names_of_the_engine_are_generated():
    generator = runpy.run_path(str(CRATES / "fields.py"))
    assert generator["TARGET"].read_text(encoding="utf-8") == generator["content"]()


def test_the_engine_was_built_with_these_names():
    assert tuple(_core.vehicle_fields()) == VEHICLE_FIELDS
    assert tuple(_core.simulation_fields()) == SIMULATION_FIELDS
    assert tuple(_core.constant_fields()) == CONSTANT_NAMES
