"""The constants of the step: gathered once, in float32, and changed only by name."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.constants
from tests.support.knowledge import numbers_of

from overtaking.knowledge.toml_reader import number
from overtaking.world.constants import CONSTANT_NAMES, model_constants


@pytest.mark.parametrize(
    ("name", "path"),
    [
        ("step", "model.time.step"),
        ("restitution", "model.collision.restitution"),
        ("spray_reach", "weather.spray.reach"),
        ("sliding_ratio", "friction.table.sliding_ratio"),
        ("truck_loss_factor", "friction.table.truck_loss_factor"),
    ],
)
def test_a_constant_is_the_entry_of_the_knowledge_base(name: str, path: str):
    value = getattr(model_constants(), name)
    assert value == np.float32(number(path))


def test_every_constant_is_a_finite_float32():
    for name in CONSTANT_NAMES:
        value = getattr(model_constants(), name)
        assert isinstance(value, np.float32), name
        assert np.isfinite(value), name


def test_a_decision_is_a_whole_number_of_steps():
    c = model_constants()
    assert float(c.decision) / float(c.step) == pytest.approx(5.0, rel=1e-6)


def test_derived_constants_are_what_their_names_say():
    c = model_constants()
    assert float(c.half_air_density) == pytest.approx(0.5 * 1.2)
    assert float(c.inverse_puddle_wave_1) == pytest.approx(
        1.0 / number("weather.puddles.first_wave")
    )
    assert float(c.inverse_stop_lamp) == pytest.approx(1.0 / number("weather.lamps.stop"))


def test_the_friction_table_is_kept_whole():
    c, table = model_constants(), numbers_of("friction.toml").table
    np.testing.assert_allclose(c.friction_new, table.new, rtol=1e-7)
    np.testing.assert_allclose(c.friction_worn, table.worn, rtol=1e-7)
    assert (len(c.friction_speeds), len(c.friction_films)) == (3, 4)


def test_a_change_touches_only_what_is_named():
    changed = model_constants().replace(restitution=0.5)
    assert changed.restitution == np.float32(0.5)
    assert model_constants().restitution == np.float32(0.1)
    assert changed.replace(restitution=float(model_constants().restitution)) == model_constants()


def test_a_name_that_does_not_exist_is_refused():
    with pytest.raises(TypeError, match="bounce"):
        model_constants().replace(bounce=1.0)


def test_gravity_is_the_standard_value_to_two_decimals():
    assert round(scipy.constants.g, 2) == number("model.nature.gravity")


def test_air_density_is_that_of_dry_air_at_20_degrees_to_two_decimals():
    molar_mass = 0.0289652  # kg/mol, dry air, ICAO standard atmosphere
    density = scipy.constants.atm * molar_mass / (scipy.constants.R * 293.15)
    assert round(density, 2) == number("model.nature.air_density")
