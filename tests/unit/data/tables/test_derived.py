"""The numbers that weather stands for follow it, and agree with what is known of them."""

from __future__ import annotations

import numpy as np
import pytest

from overtaking.data.tables.derived import derived_weather
from overtaking.knowledge.carla_catalogue import weather_presets
from overtaking.model.known_roads import known_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource


@pytest.fixture(scope="module")
def calm():
    """One simulation on a dry, clear, windless day."""
    scenario = ScenarioSource(
        load_specification("pinto2023-physical"), known_road("town06"), 1
    ).sample(np.arange(1, dtype=np.uint64))
    zero = np.zeros(1, dtype=np.float32)
    weather = scenario.weather.replace(
        **dict.fromkeys(("cloudiness", "rain", "puddles", "wind", "fog"), zero),
        sun_altitude=zero + np.float32(0.8),
        night=zero > 0,
        low_sun=zero > 0,
    )
    return scenario.replace(weather=weather)


def derived(calm, **changes: float) -> dict[str, float]:
    """What weather with some changes stands for."""
    kinds = {name: getattr(calm.weather, name).dtype for name in changes}
    given = {name: np.array([value], dtype=kinds[name]) for name, value in changes.items()}
    changed = calm.replace(weather=calm.weather.replace(**given))
    return {name: values.item() for name, values in derived_weather(changed).items()}


def series(calm, weather: str, name: str) -> list[float]:
    """A derived number as one kind of weather grows from 0 to 100 %."""
    return [derived(calm, **{weather: percent})[name] for percent in range(0, 101, 10)]


def test_nothing_falls_blows_or_lies_on_a_calm_day(calm):
    found = derived(calm)
    assert (found["rain_mmph"], found["water_film_m"], found["wind_mps"]) == (0.0, 0.0, 0.0)
    # Bosch Automotive Handbook: 0.8 new and 0.95 worn on a dry road at 90 to 130 km/h.
    assert 0.75 < found["friction"] < 1.0


def test_more_rain_means_more_water_and_less_grip(calm):
    film, friction = (series(calm, "rain", name) for name in ("water_film_m", "friction"))
    assert film == sorted(film)
    assert friction == sorted(friction, reverse=True)
    assert friction[-1] < 0.5 * friction[0]


def test_the_heaviest_rain_leaves_about_a_millimetre_on_the_slowest_lane(calm):
    """Gallaway et al. 1979, the metric form: 50 mm/h over some metres of a 2.5 % cross slope."""
    assert 0.0005 < derived(calm, rain=100.0)["water_film_m"] < 0.003


def test_fog_shortens_every_sight(calm):
    for name in ("optical_range_m", "sight_unlit_m", "sight_lit_m"):
        distances = series(calm, "fog", name)
        assert distances == sorted(distances, reverse=True)
        assert distances[-1] < distances[0]


def test_at_the_optical_range_a_twentieth_of_the_contrast_is_left(calm):
    """Koschmieder's law with the 5 % of the World Meteorological Organization (WMO-No. 8)."""
    # By day the threshold of an unlit vehicle lies below 5 %, so it is seen a little farther.
    found = derived(calm, fog=100.0)
    extinction = -np.log(0.05) / found["optical_range_m"]
    left = 0.5 * np.exp(-extinction * found["sight_unlit_m"])
    assert 0.01 < left < 0.06


def test_lamps_are_seen_farther_than_bodies_at_night(calm):
    found = derived(calm, night=True, sun_altitude=-0.8, fog=60.0)
    assert found["sight_lit_m"] > found["sight_unlit_m"]


def test_wind_is_its_share_of_the_strongest(calm):
    speeds = np.array(series(calm, "wind", "wind_mps"))
    assert np.allclose(speeds, speeds[-1] * np.linspace(0, 1, 11), rtol=1e-6)
    turned = derived(calm, wind=100.0, wind_direction=1.0)["wind_mps"]
    assert turned == pytest.approx(speeds[-1], rel=1e-6)


def test_every_preset_gives_finite_numbers(calm):
    for name, preset in weather_presets().items():
        found = derived(
            calm,
            rain=preset.precipitation_percent,
            puddles=preset.precipitation_deposits_percent,
            wind=preset.wind_intensity_percent,
            fog=preset.fog_density_percent,
            night=preset.sun_altitude_deg < 0,
        )
        assert all(np.isfinite(value) and value >= 0 for value in found.values()), name
