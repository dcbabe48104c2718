"""Draws weather and light: tone, shadows, the veil of fog or sun, rain, and the night."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import U8
from overtaking.core.random_numbers import PhiloxStream
from overtaking.knowledge.carla_catalogue import weather_presets
from overtaking.knowledge.toml_reader import constant
from overtaking.model.trajectories import Trajectories
from overtaking.model.weather import NO_PRESET
from overtaking.show.video.canvas import WIDTH, Drawing
from overtaking.show.video.road import Tone
from overtaking.world.road_surface import rain_rate
from overtaking.world.visibility import fog_extinction, rain_extinction

_NIGHT, _DAY, _OVERCAST, _SUNSET = (
    (0.80, 0.88, 1.10),
    (1.0, 1.0, 0.98),
    (0.86, 0.89, 0.93),
    (1.10, 0.90, 0.70),
)
_DRY_DAY = Tone(_DAY, 0.0)
_LOW_SUN = math.radians(20.0)
_SHADE_BY_DAY = 0.42
_LONGEST_SHADOW = 3.2  # Per height of the object.
_CLEAR_TO_SEE = 1500.0  # Fog that lets one see farther is not drawn [m].
_OWN_HALF = 2.3  # Half a car's length [m].
_FOG_ABOVE = 100.0  # Depth of fog that the sun shines through before it casts a shadow [m].
_LEAST_SHARE = 24  # Of 256: what lies in fog stays a hint, so that the film still tells it.
_OPAQUE = 256
"""Scale of the veil of rain and fog."""

MOONLIGHT = 64
"""Share of the daylight that remains at night, of 256."""

_HEAVY_RAIN = 60.0  # Rate at which wetness and spray are drawn in full [mm/h].
_NUM_RAIN_PICTURES = 5  # These take turns.
_STREAK = 12  # Length of a streak of rain [px].
_GLIMMER, _GLIMMER_REACH = 90, 8.0  # Of 256, and metres.


@dataclass(frozen=True, slots=True, kw_only=True)
class Sky:
    """Weather of one simulation, as far as it is drawn; a fine day by default.

    Attributes:
        text: In words.
        tone: Light and wetness of the road.
        is_night: Whether vehicles need their lamps to light the road.
        shade: Shadow per height, forwards and to the right, and its darkness.
        spray: 0 none to 1.
        extinction: Of fog and rain [1/m].
        rate: Rain [mm/h].
        glare: How dazzling the low sun is, 0 to 1; negative if it stands behind.
    """

    text: str = "weather not recorded"
    tone: Tone = _DRY_DAY
    is_night: bool = False
    shade: tuple[float, float, float] = (0.0, 0.0, 0.0)
    spray: float = 0.0
    extinction: float = 0.0
    rate: float = 0.0
    glare: float = 0.0


def sky(run: Trajectories) -> Sky:
    """The weather of a batch of one simulation; where it is not known, a fine day."""
    if "weather" in run.unknown:
        return Sky()
    weather = run.scenario.weather
    rate = float(rain_rate(weather.rain)[0])
    extinction = float(fog_extinction(weather.fog)[0] + rain_extinction(rain_rate(weather.rain))[0])
    is_night = bool(weather.night[0])
    altitude, azimuth = float(weather.sun_altitude[0]), float(weather.sun_azimuth[0])
    is_low = not is_night and 0.0 < altitude < _LOW_SUN
    clear = 1.0 - float(weather.cloudiness[0]) / 100.0
    if _is_hazy(extinction):
        clear *= math.exp(-extinction * _FOG_ABOVE)
    wet = min(1.0, max(float(weather.puddles[0]) / 60.0, rate / _HEAVY_RAIN))
    return Sky(
        text=_words(run, rate, extinction, is_low=is_low),
        tone=Tone(_light(clear, is_night=is_night, is_low=is_low), round(wet, 1)),
        is_night=is_night,
        shade=_shade(altitude, azimuth, clear, is_night=is_night),
        spray=round(wet * min(1.0, 0.4 + rate / _HEAVY_RAIN), 2) if wet > 0.1 else 0.0,
        extinction=extinction,
        rate=rate,
        glare=clear * math.cos(azimuth) if is_low else 0.0,
    )


def _is_hazy(extinction: float) -> bool:
    """Whether so much is hidden that it is drawn."""
    return extinction * _CLEAR_TO_SEE >= float(constant("weather.fog.transmission_depth"))


def haze(seen: Sky) -> float:
    """Extinction of fog and rain as far as it is drawn, 0 where it hides too little [1/m]."""
    return seen.extinction if _is_hazy(seen.extinction) else 0.0


def _words(run: Trajectories, rate: float, extinction: float, *, is_low: bool) -> str:
    """The weather as text, the name of a preset first."""
    weather = run.scenario.weather
    code = weather.preset[0]
    parts = [] if code == NO_PRESET else [list(weather_presets())[code]]
    parts.append("night" if weather.night[0] else "low sun" if is_low else "day")
    if rate > 0.0:
        parts.append(f"rain {rate:.0f} mm/h")
    optical_range = float(constant("weather.fog.transmission_depth")) / extinction
    if optical_range < _CLEAR_TO_SEE:
        parts.append(f"visibility {_rounded(optical_range)} m")
    if weather.wind[0] > 0.0:
        parts.append(f"wind {weather.wind[0]:.0f} %")
    return " · ".join(parts)


def _rounded(value: float) -> int:
    """A number with two digits that mean something."""
    step = 10 ** max(math.floor(math.log10(value)) - 1, 0)
    return round(value / step) * step


def _light(clear: float, *, is_night: bool, is_low: bool) -> tuple[float, float, float]:
    """Colour of the light."""
    if is_night:
        return _NIGHT
    bright = _SUNSET if is_low else _DAY
    red, green, blue = (a + (1.0 - clear) * (b - a) for a, b in zip(bright, _OVERCAST, strict=True))
    return red, green, blue


def _shade(
    altitude: float, azimuth: float, clear: float, *, is_night: bool
) -> tuple[float, float, float]:
    """Shadows: opposite the sun, long if it is low; short and faint in dull light."""
    if is_night or altitude <= 0.0:
        return 0.0, 0.0, 0.0
    long = min(1.0 / math.tan(altitude), _LONGEST_SHADOW) * clear
    # The sun's direction grows anticlockwise from the direction of travel, rows grow to the right.
    darkness = _SHADE_BY_DAY * (0.35 + 0.65 * clear)
    return -long * math.cos(azimuth), long * math.sin(azimuth), darkness


class Veil(NamedTuple):
    """What hides the road, column by column.

    Attributes:
        hidden: Share of each column, of 256.
        colour: Colour of the veil.
    """

    hidden: NDArray[np.uint16]
    colour: str


def _veil(share: NDArray[np.floating], colour: str) -> Veil:
    """A veil that lets a share of each column shine through."""
    hidden = np.clip(np.rint((1.0 - share) * _OPAQUE), 0, _OPAQUE - _LEAST_SHARE)
    return Veil(hidden.astype(np.uint16), colour)


def fog(sky: Sky, scale: float) -> Veil | None:
    """What fog and rain hide, growing from the middle of a strip two pictures wide.

    Distances are those from the ends of a car in the middle, which nothing hides; counted from a
    point, they would leave a crease across the road there.

    Source:
        Koschmieder: contrast falls as exp(-extinction x distance).
    """
    if not _is_hazy(sky.extinction):
        return None
    away = (np.arange(2 * WIDTH) - WIDTH) / scale
    distance = np.hypot(away, _OWN_HALF) - _OWN_HALF
    return _veil(np.exp(-sky.extinction * distance), "#2c343d" if sky.is_night else "#c3c9cd")


def glare(sky: Sky) -> Veil | None:
    """The low sun, from the side of the picture on which it stands."""
    if abs(sky.glare) < 0.1:
        return None
    ahead = np.arange(WIDTH) / WIDTH
    towards = ahead if sky.glare > 0.0 else 1.0 - ahead
    strength = 0.55 * abs(sky.glare)
    return _veil(1.0 - strength * np.clip((towards - 0.35) / 0.65, 0.0, 1.0) ** 2, "#ffdf9a")


@lru_cache(maxsize=8)
def rain(rate: float, height: int, *, is_night: bool) -> tuple[Drawing, ...]:
    """Pictures of falling rain on so many rows."""
    num_streaks = round(40 + 2.4 * rate)
    falling: list[Drawing] = []
    for number in range(_NUM_RAIN_PICTURES):
        draws = PhiloxStream(number, np.arange(num_streaks, dtype=np.uint64), 0)
        x, y = draws.integer(WIDTH).astype(float), draws.integer(height - _STREAK).astype(float)
        length = _STREAK // 2 + draws.integer(_STREAK // 2)
        ends = zip(x.tolist(), y.tolist(), length.tolist(), strict=True)
        streaks = [[(x, y), (x - 0.25 * long, y + long)] for x, y, long in ends]
        drawing = Drawing()
        drawing.lines(streaks, "#e8eef4", width=1.0, opacity=0.3 if is_night else 0.45)
        falling.append(drawing)
    return tuple(falling)


class Light(NamedTuple):
    """A patch of light, at half the resolution of the picture.

    Attributes:
        power: What it adds to the light of the night, of 256; shape (rows, columns).
        left: Column of its left upper corner from where it comes from.
        top: Row of that corner.
    """

    power: U8
    left: int
    top: int


@lru_cache(maxsize=64)  # Each is about half a megabyte.
def beam(degrees: int, scale: float, *, is_high: bool) -> Light:
    """Light of two headlamps, from the middle of the front of a vehicle.

    Args:
        degrees: Angle of the vehicle, anticlockwise.
        scale: [px/m].
        is_high: Whether the high beam is on.
    """
    scale *= 0.5
    reach = float(constant(f"weather.headlamps.{'high' if is_high else 'low'}_beam"))
    angle = math.radians(degrees)
    cosine, sine = math.cos(angle), math.sin(angle)
    side = 0.35 * reach
    corners = [
        (far * cosine - left * sine, -far * sine - left * cosine)
        for far in (0.0, reach)
        for left in (-side, side)
    ]
    left, right = (round(scale * edge([x for x, _ in corners])) for edge in (min, max))
    top, bottom = (round(scale * edge([y for _, y in corners])) for edge in (min, max))
    x = (np.arange(left, right) + 0.5) / scale
    y = (np.arange(top, bottom)[:, None] + 0.5) / scale
    forward, aside = x * cosine - y * sine, x * sine + y * cosine
    spread = 1.0 + 0.17 * np.maximum(forward, 0.0)
    fading = np.clip(1.0 - forward / reach, 0.0, 1.0) * np.clip(forward / 1.5, 0.0, 1.0)
    power = (_OPAQUE - MOONLIGHT) * 0.95 * fading * np.exp(-1.2 * (aside / spread) ** 2)
    return Light(np.rint(power).astype(np.uint8), left, top)


@lru_cache(maxsize=16)
def glimmer(scale: float) -> Light:
    """A little light around the middle of a vehicle, that its colour may be told."""
    half = round(_GLIMMER_REACH * 0.5 * scale)
    away = (np.arange(-half, half) + 0.5) / half
    inside = np.maximum(1.0 - away * away - (away * away)[:, None], 0.0)
    return Light(np.rint(_GLIMMER * inside).astype(np.uint8), -half, -half)
