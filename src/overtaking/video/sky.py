"""Weather and light as they are seen: tone, shadows, veil of fog or sun, rain, and the night."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from overtaking.core.philox import Draws
from overtaking.knowledge import presets
from overtaking.model.weather import NO_PRESET
from overtaking.physics.constants import known
from overtaking.physics.film import rain_rate
from overtaking.physics.visibility import fog_extinction, rain_extinction
from overtaking.video.canvas import OPAQUE, WIDTH, Canvas
from overtaking.video.palette import yuv
from overtaking.video.road import Tone

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.model.trajectory import Trajectories
    from overtaking.video.canvas import U16

_NIGHT, _DAY, _OVERCAST, _SUNSET = (
    (0.80, 0.88, 1.10),
    (1.0, 1.0, 0.98),
    (0.86, 0.89, 0.93),
    (1.10, 0.90, 0.70),
)
_LOW_SUN = math.radians(20.0)
_SHADE_BY_DAY = 0.42
_LONGEST_SHADOW = 3.2  # Per height of what casts it.
_CLEAR_TO_SEE = 1500.0  # Fog that lets one see farther is not drawn [m].
_LEAST_SHARE = 24  # Of 256: what lies in fog stays a hint, so that the film still tells it.
_HEAVY_RAIN = 60.0  # Rate at which wetness and spray are drawn in full [mm/h].
_NUM_RAIN_PICTURES = 5
_STREAK = 12  # Length of a streak of rain [px].
_MOONLIGHT = 92  # Of 256.
_GLIMMER, _GLIMMER_REACH = 90, 8.0  # Of 256, and metres.


@dataclass(frozen=True, slots=True, kw_only=True)
class Sky:
    """Weather of one simulation, as far as it is drawn.

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

    text: str
    tone: Tone
    is_night: bool
    shade: tuple[float, float, float]
    spray: float
    extinction: float
    rate: float
    glare: float


def sky(run: Trajectories) -> Sky:
    """The weather of a batch of one simulation; where it is not known, a fine day."""
    if "weather" in run.unknown:
        return _FINE
    weather = run.scenario.weather
    rate = float(rain_rate(weather.rain)[0])
    extinction = float(fog_extinction(weather.fog)[0] + rain_extinction(rain_rate(weather.rain))[0])
    is_night = bool(weather.night[0])
    altitude, azimuth = float(weather.sun_altitude[0]), float(weather.sun_azimuth[0])
    is_low = not is_night and 0.0 < altitude < _LOW_SUN
    clear = 1.0 - float(weather.cloudiness[0]) / 100.0
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


_FINE = Sky(
    text="weather not recorded",
    tone=Tone(_DAY, 0.0),
    is_night=False,
    shade=(0.0, 0.0, 0.0),
    spray=0.0,
    extinction=0.0,
    rate=0.0,
    glare=0.0,
)


def _words(run: Trajectories, rate: float, extinction: float, *, is_low: bool) -> str:
    """The weather as text, the name of a preset first."""
    weather = run.scenario.weather
    code = weather.preset[0]
    parts = [] if code == NO_PRESET else [list(presets())[code]]
    parts.append("night" if weather.night[0] else "low sun" if is_low else "day")
    if rate > 0.0:
        parts.append(f"rain {rate:.0f} mm/h")
    optical_range = float(known("weather.fog.transmission_depth")) / extinction
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


class Veil:
    """Brightness between the eye and the road that hides what lies behind it.

    Args:
        share: What shines through, for each column of a strip.
        colour: Of the veil.
    """

    def __init__(self, share: NDArray[np.floating], colour: str) -> None:
        """Prepare what is multiplied and what is added."""
        keep = np.clip(np.rint(share * OPAQUE), _LEAST_SHARE, OPAQUE).astype(np.uint16)
        half = keep[::2]
        y, u, v = (np.uint16(round(part)) for part in yuv(colour))
        self._luma = (keep, (OPAQUE - keep) * y)
        self._chroma = (half, (OPAQUE - half) * np.array([u, v], np.uint16)[:, None, None])

    def columns(self, first: int) -> tuple[U16, U16, U16]:
        """What shines through at half the resolution, and what is added to luma and chroma."""
        half = slice(first // 2, (first + WIDTH) // 2)
        added = self._luma[1][first : first + WIDTH]
        return self._chroma[0][half], added, self._chroma[1][:, :, half]

    def lay(self, canvas: Canvas, first: int = 0) -> None:
        """Lay the columns of the veil from an even one on over a canvas."""
        columns, half = slice(first, first + WIDTH), slice(first // 2, (first + WIDTH) // 2)
        _veiled(canvas.luma, self._luma[0][columns], self._luma[1][columns])
        _veiled(canvas.chroma, self._chroma[0][half], self._chroma[1][:, :, half])


def _veiled(plane: NDArray[np.uint8], keep: U16, added: U16) -> None:
    mixed = plane.astype(np.uint16)  # Operands of two types would be converted piece by piece.
    mixed *= keep
    mixed += added
    mixed >>= 8
    plane[...] = mixed


def fog(sky: Sky, scale: float) -> Veil | None:
    """What fog and rain hide, growing from the middle of a strip two pictures wide.

    Source:
        Koschmieder: contrast falls as exp(-extinction x distance).
    """
    if sky.extinction * _CLEAR_TO_SEE < float(known("weather.fog.transmission_depth")):
        return None
    distance = np.abs(np.arange(2 * WIDTH) - WIDTH) / scale
    return Veil(np.exp(-sky.extinction * distance), "#2c343d" if sky.is_night else "#c3c9cd")


def glare(sky: Sky) -> Veil | None:
    """The low sun, from the side of the picture on which it stands."""
    if abs(sky.glare) < 0.1:
        return None
    ahead = np.arange(WIDTH) / WIDTH
    towards = ahead if sky.glare > 0.0 else 1.0 - ahead
    strength = 0.55 * abs(sky.glare)
    return Veil(1.0 - strength * np.clip((towards - 0.35) / 0.65, 0.0, 1.0) ** 2, "#ffdf9a")


@lru_cache(maxsize=8)
def rain(rate: float, height: int, *, is_night: bool) -> tuple[NDArray[np.uint8], ...]:
    """Pictures of falling rain, black but for the streaks; shape of each (height, WIDTH)."""
    num_streaks = round(40 + 2.4 * rate)
    bright = 82 if is_night else 138
    pictures: list[NDArray[np.uint8]] = []
    for number in range(_NUM_RAIN_PICTURES):
        draws = Draws(number, np.arange(num_streaks, dtype=np.uint64), 0)
        x, y = draws.integer(WIDTH), draws.integer(height)
        length = _STREAK // 2 + draws.integer(_STREAK)
        along = np.arange(_STREAK + _STREAK // 2)[:, None]
        is_there = (along < length) & (y + along < height)
        picture = np.zeros((height, WIDTH), dtype=np.uint8)
        rows, columns = np.broadcast_arrays(y + along, (x - along // 4) % WIDTH)
        picture[rows[is_there], columns[is_there]] = bright
        pictures.append(picture)
    return tuple(pictures)


class Night:
    """Darkness, and what the headlamps make of it; computed at the resolution of chroma.

    Args:
        scale: [px/m].
        height: Rows of the canvas.
    """

    def __init__(self, scale: float, height: int) -> None:
        """Everything dark."""
        self._scale = 0.5 * scale
        self._light = np.empty((height // 2, WIDTH // 2), dtype=np.uint16)

    def fall(self) -> None:
        """Begin a frame: no light but the moon's."""
        self._light.fill(_MOONLIGHT)

    def shine(self, x: float, y: float, angle: float, *, is_high: bool) -> None:
        """Add the light of the headlamps of a vehicle.

        Args:
            x: Column of the middle of its front.
            y: Row.
            angle: Of the vehicle, anticlockwise [rad].
            is_high: Whether the high beam is on.
        """
        self._add(_beam(round(math.degrees(angle)), self._scale, is_high=is_high), x, y)

    def glimmer(self, x: float, y: float) -> None:
        """Add a little light around a vehicle, that its colour may be told."""
        self._add(_glimmer(self._scale), x, y)

    def _add(self, lit: tuple[U16, int, int], x: float, y: float) -> None:
        beam, left, top = lit
        column, row = round(0.5 * x) + left, round(0.5 * y) + top
        first = (max(-row, 0), max(-column, 0))
        target = self._light[max(row, 0) : max(row + len(beam), 0)]
        target = target[:, max(column, 0) : max(column + beam.shape[1], 0)]
        height, width = target.shape
        target += beam[first[0] : first[0] + height, first[1] : first[1] + width]

    def lay(self, canvas: Canvas, veil: Veil | None = None, first: int = 0) -> None:
        """Darken a canvas where no light falls, and lay a veil over it in the same pass.

        Args:
            canvas: What to darken.
            veil: Fog, if there is any.
            first: Its first column, even.
        """
        light = np.minimum(self._light, OPAQUE, out=self._light)
        grey = (OPAQUE - light) * np.uint16(128)
        bright = None
        if veil is not None:
            through, bright, tint = veil.columns(first)
            grey = ((grey >> 8) * through) + tint
            # Full light through clear air is 256 x 256, one more than sixteen bits hold.
            light = ((light.astype(np.uint32) * through) >> 8).astype(np.uint16)
        # Two columns of luma to one of the light: a number that holds the same one twice.
        twice = (light.astype(np.uint32) * np.uint32(0x0001_0001)).view(np.uint16)
        for rows in (canvas.luma[0::2], canvas.luma[1::2]):
            dim = rows * twice
            if bright is not None:
                dim += bright
            dim >>= 8
            rows[...] = dim
        chroma = canvas.chroma * light
        chroma += grey
        chroma >>= 8
        canvas.chroma[...] = chroma


@lru_cache(maxsize=512)
def _beam(degrees: int, scale: float, *, is_high: bool) -> tuple[U16, int, int]:
    """Light of two headlamps, and where its left upper corner lies from them."""
    reach = float(known(f"weather.headlamps.{'high' if is_high else 'low'}_beam"))
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
    power = (OPAQUE - _MOONLIGHT) * 0.95 * fading * np.exp(-1.2 * (aside / spread) ** 2)
    return np.rint(power).astype(np.uint16), left, top


@lru_cache(maxsize=16)
def _glimmer(scale: float) -> tuple[U16, int, int]:
    """A round patch of light, and where its left upper corner lies from its middle."""
    half = round(_GLIMMER_REACH * scale)
    away = (np.arange(-half, half) + 0.5) / half
    inside = np.maximum(1.0 - away * away - (away * away)[:, None], 0.0)
    return np.rint(_GLIMMER * inside).astype(np.uint16), -half, -half
