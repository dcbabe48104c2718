"""The friction table through another interpolator."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator
from tests.support.knowledge import numbers_of, weather_maps

from overtaking.core.units import mps_from_kmh
from overtaking.knowledge.toml_reader import number

GRAVITY = number("model.nature.gravity")


def film_mm(precipitation_percent: float, path: float) -> float:
    """Film of water [mm] on a lane with this drainage path [m], after Gallaway."""
    rain, film = weather_maps().rain, weather_maps().film
    rate = rain.max_rate_mmph * (precipitation_percent / 100.0) ** rain.exponent
    above = (
        film.coefficient
        * film.texture_depth_mm**film.texture_exponent
        * path**film.path_exponent
        * rate**film.rate_exponent
        / film.cross_slope**film.slope_exponent
    )
    return max(film.wet_film_mm, above - film.texture_depth_mm)


def friction(tyre: str, speed_kmh: float, film: float) -> float:
    table = numbers_of("friction.toml").table
    grid = RegularGridInterpolator((table.speeds, table.films_mm), np.array(getattr(table, tyre)))
    return float(grid((mps_from_kmh(speed_kmh), film)))


# Worked out by hand for 50, 90 and 120 km/h.
@pytest.mark.parametrize(
    ("tyre", "precipitation", "path", "expected"),
    [
        ("new", 30.0, 7.0, (0.65, 0.60, 0.56)),
        ("new", 60.0, 7.0, (0.65, 0.60, 0.56)),
        ("new", 90.0, 7.0, (0.61, 0.47, 0.41)),
        ("new", 100.0, 7.0, (0.58, 0.38, 0.32)),
        ("new", 100.0, 17.5, (0.52, 0.16, 0.11)),
        ("worn", 100.0, 7.0, (0.43, 0.13, 0.13)),
    ],
)
def test_rain_film_and_table_together_give_the_friction_worked_out_by_hand(
    tyre: str, precipitation: float, path: float, expected: tuple[float, ...]
):
    film = film_mm(precipitation, path)
    found = [friction(tyre, speed, film) for speed in (50.0, 90.0, 120.0)]
    assert found == pytest.approx(expected, abs=0.006)


@pytest.mark.parametrize(
    ("precipitation", "expected"), [(0.0, 125.0), (60.0, 151.0), (100.0, 227.0)]
)
def test_stopping_from_120_takes_as_long_as_worked_out_by_hand(
    precipitation: float, expected: float
):
    film = film_mm(precipitation, 7.0) if precipitation else 0.0
    speed, reaction = mps_from_kmh(120.0), 1.5
    grip = friction("new", 120.0, film)
    assert speed * reaction + speed**2 / (2.0 * GRAVITY * grip) == pytest.approx(expected, rel=0.02)


def test_the_table_is_rectangular_and_ordered():
    table = numbers_of("friction.toml").table
    assert [round(speed * 3.6, 9) for speed in table.speeds] == [50.0, 90.0, 130.0]
    for tyre in (np.array(table.new), np.array(table.worn)):
        assert tyre.shape == (3, 4)
        assert (np.diff(tyre, axis=0) <= 0.0).all(), "friction falls with speed"
        assert (np.diff(tyre, axis=1) <= 0.0).all(), "friction falls with water"
    assert (np.diff(table.films_mm) > 0.0).all()


def test_worn_tyres_grip_better_when_dry_and_worse_when_wet():
    table = numbers_of("friction.toml").table
    new, worn = np.array(table.new), np.array(table.worn)
    assert (worn[:, 0] > new[:, 0]).all()
    assert (worn[:, 1:] <= new[:, 1:]).all()
    assert (worn[:, 1] < new[:, 1]).all()
