"""What SUMO is told of the weather."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.knowledge import numbers_of
from tests.support.worlds import Vehicle, scenario

from overtaking.data.tables.derived import derived_weather
from overtaking.simulators.sumo.traffic import distance_error, is_wet, lane_friction

SKIES = [{}, {"rain": 30.0}, {"rain": 100.0}, {"puddles": 50.0}, {"puddles": 10.0}]


def batch(*skies):
    return scenario(*[[Vehicle()]] * len(skies), weather=list(skies))


def test_rain_and_deposits_make_the_road_wet():
    assert is_wet(batch(*SKIES)).tolist() == [False, True, True, True, False]


def test_friction_is_that_of_the_handbook_at_50_kmh():
    """Half-worn, between the columns of the Bosch handbook: dry 0.925, wet 0.575 or less."""
    told = lane_friction(batch(*SKIES))[:, 0]
    table = numbers_of("friction.toml").table
    new, worn = np.array(table.new[0]), np.array(table.worn[0])
    knots = (new + worn) / 2
    assert told[0] == pytest.approx(knots[0])
    assert told[3] == pytest.approx(knots[1])
    assert told[4] == pytest.approx(knots[0])
    assert knots[1] >= told[1] > told[2] > knots[3]


def test_friction_at_that_speed_is_never_less_than_at_the_speed_of_the_weather_table():
    world = batch(*SKIES)
    assert (lane_friction(world)[:, 0] >= derived_weather(world)["friction"]).all()


def test_lanes_far_from_the_crown_are_never_less_slippery():
    friction = lane_friction(batch(*SKIES))
    assert (np.diff(friction, axis=1) >= 0).all()
    assert friction[2, 0] < friction[2, -1]
    assert np.ptp(friction[0]) == 0


def test_distances_are_judged_worse_at_night_and_worst_in_fog():
    errors = distance_error(batch({}, {"night": 1.0}, {"fog": 90.0}, {"night": 1.0, "fog": 90.0}))
    assert errors == pytest.approx([0.10, 0.18, 0.25, 0.25])
