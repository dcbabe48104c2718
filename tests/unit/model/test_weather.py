"""Weather with something taken away, and what that does to road and sight."""

from __future__ import annotations

import numpy as np
import pytest

from overtaking.core.errors import ConfigError
from overtaking.model.weather import (
    NO_PRESET,
    REMOVABLE_FACTORS,
    bright,
    clear,
    dry,
    still,
    without,
    without_glare,
)
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.world.step_parameters import parameters


@pytest.fixture(scope="module")
def drawn():
    """Scenarios under all presets."""
    given = load_specification("pinto2023-physical")
    return ScenarioSource(given, load_road(given.road), 3).sample(np.arange(200))


def test_rain_goes_with_all_that_it_brings(drawn):
    wet = drawn.weather.rain > 0
    assert wet.any()
    dried = dry(drawn.weather)
    step = parameters(drawn.replace(weather=dried)).of_simulations
    for name in ("least_film", "film_rain", "puddle_film", "puddle_reach", "rain_extinction"):
        assert not getattr(step, name).any(), name
    assert not dried.cloudiness[wet].any()
    np.testing.assert_array_equal(dried.cloudiness[~wet], drawn.weather.cloudiness[~wet])
    np.testing.assert_array_equal(dried.wind, drawn.weather.wind)
    # Nothing lights low beams by day any more, but fog.
    lights = parameters(drawn.replace(weather=clear(dried))).of_vehicles.lights
    assert not lights[:, ~dried.night].any()


def test_wind_fog_night_and_a_low_sun_go_alone(drawn):
    weather = drawn.weather
    assert not parameters(drawn.replace(weather=still(weather))).of_simulations.wind_across.any()
    thin = parameters(drawn.replace(weather=clear(weather))).of_simulations.fog_extinction
    # Clear air has the extinction of the best visibility that airports report.
    assert len(np.unique(thin)) == 1
    assert thin[0] < 1e-3
    day = bright(weather)
    assert not day.night.any()
    assert (day.sun_altitude[weather.night] > 0.5).all()
    np.testing.assert_array_equal(
        day.sun_altitude[~weather.night], weather.sun_altitude[~weather.night]
    )
    assert weather.horizon_line.any()
    assert not without_glare(weather).horizon_line.any()
    for take in REMOVABLE_FACTORS.values():
        assert (take(weather).preset == NO_PRESET).all()


def test_behind_the_clouds_of_rain_there_may_be_a_low_sun(drawn):
    wet = drawn.weather.select(drawn.weather.rain > 0).select(slice(0, 1))
    low = np.float32([0.15])
    sunset = wet.replace(sun_altitude=low, sun_azimuth=np.float32([0.1]), night=np.array([False]))
    assert dry(sunset.replace(cloudiness=np.float32([100.0]))).horizon_line.all()


def test_several_things_are_taken_away_in_any_order(drawn):
    one, two = (without(drawn.weather, names) for names in (("rain", "fog"), ("fog", "rain")))
    for name in type(one).__slots__:
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
    with pytest.raises(ConfigError, match=r"without: expected .*rain.*got snow"):
        without(drawn.weather, ["snow"])
