"""Weather without some of its factors, and its effects on road and sight."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from overtaking.core.errors import ConfigError
from overtaking.model.weather import NO_PRESET, REMOVABLE_FACTORS, is_dazzling
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.world.step_parameters import step_parameters


@pytest.fixture(scope="module")
def drawn():
    """Scenarios under all presets."""
    given = load_specification("pinto2023-physical")
    return ScenarioSource(given, load_road(given.road), 3).sample(np.arange(200))


def test_without_rain_there_are_no_films_puddles_and_rain_clouds(drawn):
    wet = drawn.weather.rain > 0
    assert wet.any()
    dried = drawn.weather.without("rain")
    step = step_parameters(drawn.replace(weather=dried)).simulations
    for name in (
        "min_wet_film",
        "film_rain_factor",
        "puddle_film",
        "puddle_threshold",
        "rain_extinction",
    ):
        assert not getattr(step, name).any(), name
    assert not dried.cloudiness[wet].any()
    np.testing.assert_array_equal(dried.cloudiness[~wet], drawn.weather.cloudiness[~wet])
    np.testing.assert_array_equal(dried.wind, drawn.weather.wind)
    # Nothing lights low beams by day any more, but fog.
    lights = step_parameters(drawn.replace(weather=dried.without("fog"))).vehicles.initial_lights
    assert not lights[:, ~dried.night].any()


def test_wind_fog_night_and_glare_can_be_removed_alone(drawn):
    weather = drawn.weather
    assert not step_parameters(
        drawn.replace(weather=weather.without("wind"))
    ).simulations.wind_across.any()
    thin = step_parameters(drawn.replace(weather=weather.without("fog"))).simulations.fog_extinction
    # Clear air has the extinction of the best visibility that airports report.
    assert len(np.unique(thin)) == 1
    assert thin[0] < 1e-3
    day = weather.without("night")
    assert not day.night.any()
    assert (day.sun_altitude[weather.night] > 0.5).all()
    np.testing.assert_array_equal(
        day.sun_altitude[~weather.night], weather.sun_altitude[~weather.night]
    )
    assert weather.low_sun.any()
    assert not weather.without("glare").low_sun.any()
    for name in REMOVABLE_FACTORS:
        assert (weather.without(name).preset == NO_PRESET).all()


def test_without_rain_clouds_a_low_sun_may_dazzle(drawn):
    wet = drawn.weather.select(drawn.weather.rain > 0).select(slice(0, 1))
    low = np.float32([0.15])
    sunset = wet.replace(sun_altitude=low, sun_azimuth=np.float32([0.1]), night=np.array([False]))
    overcast = sunset.replace(cloudiness=np.float32([100.0]))
    assert overcast.without("rain").low_sun.all()


@pytest.fixture(scope="module")
def stated(drawn):
    """Weather of a recording that states every mixture of night and glare for one assumed sun."""
    index = np.arange(len(drawn.weather.rain))
    return drawn.weather.replace(
        sun_altitude=np.full(len(index), np.pi / 4, np.float32),
        sun_azimuth=np.zeros(len(index), np.float32),
        night=index % 2 == 0,
        low_sun=index % 4 < 2,
    )


@pytest.mark.parametrize("name", ["wind", "fog"])
def test_without_a_factor_glare_stays_as_a_recording_states_it(stated, name):
    np.testing.assert_array_equal(stated.without(name).low_sun, stated.low_sun)


def test_without_rain_glare_changes_only_where_it_rained(stated):
    dry = stated.rain == 0
    assert (stated.low_sun & dry).any()
    np.testing.assert_array_equal(stated.without("rain").low_sun[dry], stated.low_sun[dry])


def test_without_night_glare_changes_only_where_it_was_night(stated):
    day = stated.without("night")
    np.testing.assert_array_equal(day.low_sun, stated.low_sun & ~stated.night)


def test_the_sun_dazzles_at_the_same_directions_in_both_counts():
    azimuth = np.radians([-30.0, -10.0, 10.0, 30.0, 330.0, 350.0, -350.0]).astype(np.float32)
    altitude, clouds = np.full(7, 0.1, np.float32), np.zeros(7, np.float32)
    dazzles = is_dazzling(altitude, azimuth, clouds)
    np.testing.assert_array_equal(dazzles, [False, True, True, False, False, True, True])


def test_without_factors_the_weather_is_the_same(drawn):
    assert drawn.weather.without() is drawn.weather


@pytest.mark.parametrize("pair", list(itertools.combinations(REMOVABLE_FACTORS, 2)))
def test_the_order_of_the_removed_factors_does_not_matter(drawn, stated, pair):
    low = stated.replace(sun_altitude=np.full(len(stated.rain), 0.15, np.float32))
    for weather in (drawn.weather, stated, low):
        assert weather.without(*pair).equals(weather.without(*reversed(pair)))


def test_an_unknown_factor_cannot_be_removed(drawn):
    with pytest.raises(ConfigError, match=r"without: expected .*rain.*got snow"):
        drawn.weather.without("snow")
