"""Weather is drawn by its physics: Koschmieder's fog, lamps that light what lies ahead, shadows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.drawing import drawn
from tests.support.worlds import Vehicle, scenario

import overtaking as ot
from overtaking.show.video import sky as skies
from overtaking.show.video.canvas import WIDTH
from overtaking.show.video.film import Film

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.show.video.canvas import Canvas
    from overtaking.show.video.sky import Sky, Veil

SCALE = 10.0


def sky_of(**weather: float) -> Sky:
    return skies.sky(ot.simulate(scenario([Vehicle(s=100.0)], weather=weather, horizon=0.2)))


def veiled(veil: Veil, first: int = 0, grey: int = 0) -> NDArray[np.float64]:
    """A row of a grey road behind the columns of a veil from one on."""
    hidden = veil.hidden[first : first + WIDTH]
    return drawn(lambda canvas: canvas.blend_colour((0, 10), hidden, veil.colour), grey)[9]


def lit(*beams: tuple[float, float, float, bool], grey: int = 200) -> NDArray[np.float64]:
    """A grey road at night, lit by the lamps of vehicles: column, row, angle, and high beam."""

    def paint(canvas: Canvas) -> None:
        lights: list[tuple[NDArray[np.uint8], int, int]] = []
        for x, y, angle, is_high in beams:
            light = skies.beam(round(math.degrees(angle)), SCALE, is_high=is_high)
            lights.append((light.power, round(x / 2) + light.left, round(y / 2) + light.top))
        canvas.darken((0, 200), skies.MOONLIGHT, lights)

    return drawn(paint, grey)


@pytest.mark.parametrize("fog", [40.0, 70.0, 100.0])
def test_fog_takes_as_much_contrast_as_koschmieder_says(fog):
    """What is left between black and white at a distance is exp(-extinction x distance).

    The distance is that from a car's end, which is 2.3 m nearer than its middle.
    """
    sky = sky_of(fog=fog)
    veil = skies.fog(sky, SCALE)
    assert veil is not None
    black, white = (veiled(veil, WIDTH, grey) for grey in (0, 200))
    contrast = (white - black) / 200.0
    distance = np.arange(WIDTH) / SCALE
    least, most = (
        np.maximum(np.exp(-sky.extinction * np.maximum(distance - nearer, 0.0)), 24 / 256)
        for nearer in (0.0, 2.3)
    )
    assert (contrast > least - 0.01).all()
    assert (contrast < most + 0.01).all()
    assert np.abs(contrast - most)[round(20.0 * SCALE) :].max() < 0.015


def test_no_crease_lies_across_the_road_where_fog_begins():
    """Within the first metre it hides less than a tenth of what it hides within five."""
    veil = skies.fog(sky_of(fog=100.0), SCALE)
    assert veil is not None
    road = veiled(veil, WIDTH // 2)
    rise = road[[WIDTH // 2 + round(metres * SCALE) for metres in (1.0, 5.0)]] - road[WIDTH // 2]
    assert rise[1] > 20
    assert rise[0] < 0.1 * rise[1]


def test_fog_takes_the_shadows_away():
    clear, misty, thick = (sky_of(fog=fog, sun_altitude=0.7).shade for fog in (0.0, 50.0, 100.0))
    long = [float(np.hypot(*shade[:2])) for shade in (clear, misty, thick)]
    assert long[0] > long[1] > long[2]
    assert long[2] < 0.02 * long[0]
    assert clear[2] > misty[2] > thick[2]


def test_at_the_optical_range_a_twentieth_is_left_of_contrast():
    """The definition of the meteorological optical range (WMO)."""
    sky = sky_of(fog=100.0)
    told = float(sky.text.split("visibility ")[1].split(" m")[0])
    assert math.exp(-sky.extinction * told) == pytest.approx(0.05, abs=0.01)


def test_clear_air_hides_nothing():
    assert skies.fog(sky_of(fog=0.0), SCALE) is None


def test_headlamps_light_the_road_ahead_and_not_behind():
    road = lit((400.0, 100.0, 0.0, False))
    dark = road[100, 200]
    assert road[100, 500] > 1.5 * dark
    assert road[100, 380] == dark
    assert road[20, 410] == dark


def test_fog_hides_nothing_of_what_stands_where_it_begins_however_bright_it_is():
    veil = skies.fog(sky_of(fog=90.0), SCALE)
    assert veil is not None
    assert veiled(veil, WIDTH - 640, 200)[640] == 200
    assert lit(*3 * [(600.0, 100.0, 0.0, True)])[100, 640] == 200


def test_high_beams_reach_farther():
    low, high = (lit((100.0, 100.0, 0.0, is_high)) for is_high in (False, True))
    far = 100 + round(75 * SCALE)
    assert high[100, far] > low[100, far]


@pytest.mark.parametrize("degrees", [0.0, 20.0, -20.0])
def test_a_beam_turns_with_its_vehicle(degrees):
    """Along its own axis it is as bright as one that points straight ahead, and beside it not."""
    angle = math.radians(degrees)
    turned = lit((400.0, 100.0, angle, False))
    straight = lit((400.0, 100.0, 0.0, False))
    for distance in (60.0, 150.0, 250.0):
        row = round(100.0 - distance * math.sin(angle))
        column = round(400.0 + distance * math.cos(angle))
        expected = straight[100, round(400.0 + distance)]
        assert turned[row, column] == pytest.approx(expected, abs=6.0)


def test_the_night_is_darker_than_the_day():
    def brightness(**weather: float) -> float:
        run = ot.simulate(scenario([Vehicle(s=100.0)], weather=weather, horizon=0.2))
        return float(Film(run).draw(0).to_rgb()[60:280].mean())

    assert brightness(night=1.0, sun_altitude=-1.5) < 0.6 * brightness()


def test_shadows_fall_away_from_the_sun_and_grow_as_it_sinks():
    ahead = sky_of(sun_altitude=math.radians(30.0), sun_azimuth=0.0).shade
    left = sky_of(sun_altitude=math.radians(30.0), sun_azimuth=math.pi / 2.0).shade
    low = sky_of(sun_altitude=math.radians(20.0), sun_azimuth=0.0).shade
    assert ahead[0] == pytest.approx(-1.0 / math.tan(math.radians(30.0)), rel=1e-4)
    assert ahead[1] == pytest.approx(0.0, abs=1e-6)
    assert left[1] == pytest.approx(1.0 / math.tan(math.radians(30.0)), rel=1e-4)  # To the right.
    assert low[0] < ahead[0]


def test_the_low_sun_dazzles_from_the_side_on_which_it_stands():
    for azimuth, bright, dark in ((0.0, 1250, 30), (math.pi, 30, 1250)):
        glare = skies.glare(sky_of(sun_altitude=0.2, sun_azimuth=azimuth))
        assert glare is not None
        road = veiled(glare, grey=80)
        assert road[bright] > road[dark] + 20


def test_more_rain_draws_more_streaks_and_every_time_the_same():
    def shown(rate: float) -> list[NDArray[np.bool_]]:
        skies.rain.cache_clear()
        pictures = skies.rain(rate, 240, is_night=False)
        return [drawn(lambda canvas, rain=one: canvas.draw(rain)) > 0.0 for one in pictures]

    light, heavy = shown(5.0), shown(50.0)
    assert np.count_nonzero(heavy[0]) > 1.5 * np.count_nonzero(light[0]) > 0
    assert all(np.array_equal(a, b) for a, b in zip(light, shown(5.0), strict=True))
