"""CARLA's presets, and the correlations that a study published without knowing where they are from.

Both of its strongest associations, rain with wind and fog with night, are properties of the eight
presets that it drew from, so they test our copy of the presets.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import pearsonr, spearmanr

from overtaking.knowledge.carla_catalogue import WeatherPreset, weather_presets

# CARLA's WeatherParameters.cpp: cloudiness, precipitation, deposits, wind, sun altitude, fog,
# fog distance, wetness; the eight of the study first.
CARLA_SOURCE = {
    "ClearNoon": (5, 0, 0, 10, 45, 2, 0.75, 0),
    "HardRainNoon": (100, 100, 90, 100, 45, 7, 0.75, 0),
    "ClearSunset": (5, 0, 0, 10, 15, 2, 0.75, 0),
    "ClearNight": (5, 0, 0, 10, -90, 60, 75, 0),
    "CloudyNight": (60, 0, 0, 10, -90, 60, 0.75, 0),
    "SoftRainNight": (60, 30, 50, 30, -90, 60, 0.75, 60),
    "MidRainyNight": (80, 60, 60, 60, -90, 60, 0.75, 80),
    "HardRainNight": (100, 100, 90, 100, -90, 100, 0.75, 100),
    "CloudyNoon": (60, 0, 0, 10, 45, 3, 0.75, 0),
    "CloudySunset": (60, 0, 0, 10, 15, 3, 0.75, 0),
    "DustStorm": (100, 0, 0, 100, 45, 2, 0.75, 0),
    "HardRainSunset": (100, 100, 90, 100, 15, 7, 0.75, 0),
    "MidRainSunset": (60, 60, 60, 60, 15, 3, 0.75, 0),
    "MidRainyNoon": (60, 60, 60, 60, 45, 3, 0.75, 0),
    "SoftRainNoon": (20, 30, 50, 30, 45, 3, 0.75, 0),
    "SoftRainSunset": (20, 30, 50, 30, 15, 2, 0.75, 0),
    "WetCloudyNight": (60, 0, 50, 10, -90, 60, 0.75, 60),
    "WetCloudyNoon": (60, 0, 50, 10, 45, 3, 0.75, 0),
    "WetCloudySunset": (60, 0, 50, 10, 15, 2, 0.75, 0),
    "WetNight": (5, 0, 50, 10, -90, 60, 75, 60),
    "WetNoon": (5, 0, 50, 10, 45, 3, 0.75, 0),
    "WetSunset": (5, 0, 50, 10, 15, 2, 0.75, 0),
}
CARLA_NAMES = [
    "cloudiness",
    "precipitation",
    "precipitation_deposits",
    "wind_intensity",
    "sun_azimuth_angle",
    "sun_altitude_angle",
    "fog_density",
    "fog_distance",
    "wetness",
    "fog_falloff",
    "scattering_intensity",
    "mie_scattering_scale",
    "rayleigh_scattering_scale",
    "dust_storm",
]


def study_presets() -> dict[str, WeatherPreset]:
    return {name: preset for name, preset in weather_presets().items() if preset.in_pinto2023}


def test_the_eight_presets_of_the_study_come_first():
    assert list(weather_presets()) == list(CARLA_SOURCE)
    assert list(study_presets()) == list(CARLA_SOURCE)[:8]


@pytest.mark.parametrize("name", CARLA_SOURCE)
def test_a_preset_has_the_values_of_carlas_source(name: str):
    preset = weather_presets()[name]
    assert CARLA_SOURCE[name] == (
        preset.cloudiness_percent,
        preset.precipitation_percent,
        preset.precipitation_deposits_percent,
        preset.wind_intensity_percent,
        preset.sun_altitude_deg,
        preset.fog_density_percent,
        preset.fog_distance,
        preset.wetness_percent,
    )


@pytest.mark.parametrize("name", CARLA_SOURCE)
def test_what_hardly_varies_in_carlas_source_is_right_too(name: str):
    preset = weather_presets()[name]
    # Only the fog of two clear nights begins far away, and only it thins out with height.
    assert preset.fog_falloff == (1.0 if preset.fog_distance == 75.0 else 0.1)
    assert preset.dust_storm_percent == (100.0 if name == "DustStorm" else 0.0)
    assert preset.sun_azimuth_deg == -1.0
    scales = (preset.scattering_intensity, preset.mie_scattering_scale)
    assert (*scales, preset.rayleigh_scattering_scale) == (1.0, 0.03, 0.0331)


def test_rain_and_wind_are_as_correlated_as_published():
    rain = [preset.precipitation_percent for preset in study_presets().values()]
    wind = [preset.wind_intensity_percent for preset in study_presets().values()]
    assert spearmanr(rain, wind)[0] == pytest.approx(1.0, abs=1e-12)
    assert pearsonr(rain, wind)[0] == pytest.approx(0.998, abs=5e-4)


def test_fog_and_night_are_as_correlated_as_published():
    fog = [preset.fog_density_percent for preset in study_presets().values()]
    night = [preset.sun_altitude_deg < 0.0 for preset in study_presets().values()]
    assert spearmanr(fog, night)[0] == pytest.approx(0.91, abs=5e-3)


def test_the_published_fog_of_legal_overtakes_leaves_one_mix_of_presets():
    # 29 runs of mean fog 3.90: how many of each fog value? One night would already be too many.
    values = sorted({preset.fog_density_percent for preset in study_presets().values()})
    assert values == [2.0, 7.0, 60.0, 100.0]
    mixes = [
        (29 - b - c - d, b, c, d)
        for b in range(30)
        for c in range(30 - b)
        for d in range(30 - b - c)
        if round(float(np.dot((29 - b - c - d, b, c, d), values)) / 29.0, 2) == 3.90
    ]
    assert mixes == [(18, 11, 0, 0)]


def test_the_one_published_row_is_a_mid_rainy_night():
    rows = [
        name
        for name, preset in study_presets().items()
        if preset.precipitation_percent == preset.fog_density_percent == 60.0
        and preset.wind_intensity_percent == 60.0
        and preset.sun_altitude_deg < 0.0
    ]
    assert rows == ["MidRainyNight"]


def test_every_preset_is_a_weather_that_carla_accepts():
    assert len(weather_presets()) == 22
    for preset in weather_presets().values():
        sent = preset.carla_fields()
        assert list(sent) == CARLA_NAMES
        for name in ("cloudiness", "precipitation", "wind_intensity", "fog_density", "wetness"):
            assert 0.0 <= sent[name] <= 100.0
        assert -90.0 <= sent["sun_altitude_angle"] <= 90.0
        assert sent["fog_distance"] > 0.0


def test_a_name_tells_the_time_of_day():
    altitude = {"Noon": 45.0, "Sunset": 15.0, "Night": -90.0}
    named = {name: preset for name, preset in weather_presets().items() if name != "DustStorm"}
    assert len(named) == 21
    for name, preset in named.items():
        suffix = next(word for word in altitude if name.endswith(word))
        assert preset.sun_altitude_deg == altitude[suffix]
