import numpy as np
import pytest
from scipy import stats

from overtaking.core.random_numbers import Stream
from overtaking.knowledge.carla_catalogue import weather_presets
from overtaking.model.weather import NO_PRESET
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.random_draws import RandomStream
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.scenarios.weather_sampling import draw_weather

SMALLEST_P = 1e-3  # Seeds are fixed: a failure is a bug and not bad luck.
NAMES = tuple(weather_presets())


def spearman(one, other):
    """Correlation of ranks, ties sharing their mean rank."""
    return np.corrcoef(stats.rankdata(one), stats.rankdata(other))[0, 1]


def independent(road, **keys):
    overrides = {"weather.mode": "independent"} | {f"weather.{k}": v for k, v in keys.items()}
    return (
        ScenarioSource(load_specification("pinto2023-physical", overrides), road, seed=5)
        .sample(np.arange(20_000))
        .weather
    )


def test_the_eight_weathers_of_the_study_are_equally_likely(pinto):
    counts = np.bincount(pinto.weather.preset)
    assert counts.size == 8
    assert stats.chisquare(counts).pvalue > SMALLEST_P


def test_weights_decide_how_often_a_weather_comes(town06):
    chosen = load_specification(
        "pinto2023-physical", {"weather.presets": "{ClearNoon = 3, WetNight = 1}"}
    )
    weather = ScenarioSource(chosen, town06, seed=5).sample(np.arange(8_000)).weather
    counts = np.bincount(weather.preset, minlength=len(NAMES))
    wanted = [counts[NAMES.index("ClearNoon")], counts[NAMES.index("WetNight")]]
    assert sum(wanted) == 8_000
    assert stats.chisquare(wanted, [6_000, 2_000]).pvalue > SMALLEST_P


def test_rain_and_wind_are_one_and_fog_follows_the_night_as_in_the_study(pinto):
    # Spearman 1 and 0.91 in the study's correlation matrix.
    weather = pinto.weather
    assert spearman(weather.rain, weather.wind) == pytest.approx(1.0)
    fog_and_night = spearman(weather.fog, weather.night)
    assert fog_and_night == pytest.approx(0.91, abs=0.02)


def test_five_of_eight_weathers_are_night(pinto):
    night = int(pinto.weather.night.sum())
    assert stats.binomtest(night, len(pinto.weather.night), 5 / 8).pvalue > SMALLEST_P


def test_the_low_sun_dazzles_in_clear_sunset_and_nowhere_else(pinto):
    sunset = pinto.weather.preset == NAMES.index("ClearSunset")
    np.testing.assert_array_equal(pinto.weather.low_sun, sunset)
    assert np.abs(pinto.weather.sun_azimuth[sunset]).max() < np.radians(10.1)
    assert np.abs(pinto.weather.sun_azimuth[~sunset]).max() > np.radians(170)


def test_every_number_of_a_preset_is_that_of_carla(pinto):
    weather = pinto.weather
    for code, name in enumerate(NAMES[:8]):
        carla = weather_presets()[name]
        here = weather.select(weather.preset == code)
        assert set(here.rain) == {carla.precipitation_percent}
        assert set(here.puddles) == {carla.precipitation_deposits_percent}
        assert set(here.wind) == {carla.wind_intensity_percent}
        assert set(here.fog) == {carla.fog_density_percent}
        assert set(here.cloudiness) == {carla.cloudiness_percent}
        np.testing.assert_allclose(np.degrees(here.sun_altitude), carla.sun_altitude_deg, rtol=1e-6)
        assert np.all(here.night == (carla.sun_altitude_deg < 0))


def test_the_wind_blows_from_everywhere(pinto):
    turn = pinto.weather.wind_direction / (2 * np.pi) + 0.5
    assert stats.kstest(turn, "uniform").pvalue > SMALLEST_P


def test_independent_weather_has_no_preset_and_no_correlation(town06):
    weather = independent(town06)
    assert np.all(weather.preset == NO_PRESET)
    for one, other in (("rain", "wind"), ("rain", "fog"), ("wind", "fog")):
        assert abs(spearman(getattr(weather, one), getattr(weather, other))) < 0.03
    assert abs(spearman(weather.fog, weather.night)) < 0.03


def test_independent_weather_fills_its_ranges(town06):
    weather = independent(
        town06,
        rain_probability=0.3,
        rain_percent=[20.0, 40.0],
        fog_probability=1.0,
        fog_percent=[5.0, 15.0],
        wind_percent=[10.0, 30.0],
        sun_altitude_deg=[-10.0, 30.0],
    )
    rainy = weather.rain > 0
    assert stats.binomtest(int(rainy.sum()), rainy.size, 0.3).pvalue > SMALLEST_P
    for values, low, high in (
        (weather.rain[rainy], 20, 40),
        (weather.fog, 5, 15),
        (weather.wind, 10, 30),
        (np.degrees(weather.sun_altitude), -10, 30),
    ):
        assert stats.kstest(values, stats.uniform(low, high - low).cdf).pvalue > SMALLEST_P
    np.testing.assert_array_equal(weather.night, weather.sun_altitude < 0)


def test_rain_needs_clouds_and_leaves_water(town06):
    weather = independent(town06, cloudiness_percent=[0.0, 10.0])
    rainy = weather.rain > 0
    assert weather.cloudiness[rainy].min() >= 60
    assert weather.cloudiness[~rainy].max() <= 10
    assert np.all(weather.puddles >= 0.5 * weather.rain)


def test_an_independent_sun_dazzles_only_low_ahead_and_in_a_clear_sky(town06):
    weather = independent(town06, sun_altitude_deg=[-5.0, 40.0])
    altitude = np.degrees(weather.sun_altitude)
    ahead = np.abs(np.degrees(weather.sun_azimuth)) < 25
    wanted = (altitude >= 0) & (altitude <= 18) & ahead & (weather.cloudiness < 60)
    np.testing.assert_array_equal(weather.low_sun, wanted)
    assert 0 < wanted.mean() < 0.1


def test_what_is_seldom_extreme_may_be_weibull(town06):
    weather = independent(
        town06,
        rain_probability=1.0,
        rain_weibull=[14.0, 1.0],
        wind_weibull=[22.5, 2.0],
        puddles_percent=[10.0, 50.0],
        puddles_weibull=[6.3, 0.8],
    )
    for values, law in (
        (weather.rain, stats.weibull_min(1.0, scale=14.0)),
        (weather.wind, stats.weibull_min(2.0, scale=22.5)),
    ):
        assert stats.kstest(values[values < 99.0], law.cdf).pvalue > SMALLEST_P
    dry = weather.puddles > 0.5 * weather.rain
    assert weather.puddles[dry].min() >= 10.0
    assert weather.puddles[dry].max() == 50.0


def test_the_rain_of_the_profile_falls_as_often_as_that_of_western_iberia():
    index = np.arange(400_000, dtype=np.uint64)
    stream = RandomStream(5, index, Stream.WEATHER)
    weather = draw_weather(load_specification("motorway").weather, stream)
    rate = 50.0 * (weather.rain.astype(np.float64) / 100.0) ** 2.5
    # ITU-R P.837-1, zones H and K: exceeded in 0.1 % and in 0.01 % of the time.
    assert 10.0 * 0.8 < np.quantile(rate, 0.999) < 12.0 * 1.2
    assert 32.0 * 0.8 < np.quantile(rate, 0.9999) < 42.0 * 1.2
