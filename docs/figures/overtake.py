"""Draws the picture of the README: one simulated overtake, seen from above and over time.

`python docs/generate.py` writes `overtake-light.svg` and `overtake-dark.svg` beside this file. What
they show is simulated when they are drawn; see `scene`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from figures.scene import AHEAD, BEHIND, SEED, Scene, chosen
from figures.svg import Point, box, curve, document, element, group, label, line

from overtaking.knowledge.carla_catalogue import weather_presets
from overtaking.model.trajectories import Lights, ManoeuvreKind, Stage
from overtaking.model.vehicles import EGO_SLOT
from overtaking.world import road_surface

WIDTH, LEFT, RIGHT = 960.0, 128.0, 16.0
PIXELS = (WIDTH - LEFT - RIGHT) / (BEHIND + AHEAD)  # A metre, along and across.
VERGE = 0.7  # Metres of asphalt beyond the lines at the edges.
KINDS = {"S": "small car", "M": "medium car", "L": "large car", "V": "van", "T": "truck"}


@dataclass(frozen=True, kw_only=True)
class Theme:
    """Colours; ego and overtaken are vermilion and blue of Okabe and Ito's palette, or lighter."""

    name: str
    paper: str
    ink: str
    faint: str
    road: str
    mark: str
    other: str
    ego: str
    overtaken: str
    band: tuple[str, str]


THEMES = (
    Theme(
        name="light",
        paper="#ffffff",
        ink="#24292f",
        faint="#6a737d",
        road="#d5d9de",
        mark="#ffffff",
        other="#969da6",
        ego="#d55e00",
        overtaken="#0072b2",
        band=("#eceff2", "#dde2e7"),
    ),
    Theme(
        name="dark",
        paper="#0d1117",
        ink="#e6edf3",
        faint="#8b949e",
        road="#262c34",
        mark="#78828d",
        other="#6e7681",
        ego="#f0883e",
        overtaken="#56b4e9",
        band=("#1c2128", "#2a313a"),
    ),
)


class Above:
    """A stretch of road seen from above, the overtaken vehicle always at the same place."""

    def __init__(self, scene: Scene, theme: Theme, frame: int, top: float) -> None:
        """Draw the road of a frame from `top` down."""
        self.scene, self.theme, self.frame, self.top = scene, theme, frame, top
        self.borders = np.sort(scene.run.road.lane_boundaries)
        self.clip = f"road{round(top)}"

    @staticmethod
    def height(scene: Scene) -> float:
        """Height of the road [pixels]."""
        return PIXELS * (float(np.ptp(scene.run.road.lane_boundaries)) + 2 * VERGE)

    def place(self, ahead: float, d: float) -> Point:
        """Where a point is drawn: metres ahead of the overtaken vehicle, and across the road."""
        return LEFT + PIXELS * (ahead + BEHIND), self.top + PIXELS * (self.borders[-1] + VERGE - d)

    def road(self) -> list[str]:
        """Surface and lines; the dashes move as the road does."""
        theme, width = self.theme, WIDTH - LEFT - RIGHT
        parts = [box((LEFT, self.top), (width, self.height(self.scene)), theme.road)]
        start = float(self.scene.s[self.scene.target, self.frame]) - BEHIND
        for border in self.borders:
            y = self.place(0, border)[1]
            is_edge = border in (self.borders[0], self.borders[-1])
            dashes = {
                "stroke_dasharray": f"{3 * PIXELS:g} {6 * PIXELS:g}",
                "stroke_dashoffset": PIXELS * (start % 9.0),
            }
            ends = (LEFT, y), (LEFT + width, y)
            parts.append(line(*ends, theme.mark, 1.6, **({} if is_edge else dashes)))
        return parts

    def trail(self) -> list[str]:
        """The ego's way past the overtaken vehicle: all of it faintly, until now strongly."""
        scene = self.scene
        ahead, d = scene.offset, scene.d[EGO_SLOT]
        last = scene.first(Stage.DONE)
        way = [self.place(float(a), float(b)) for a, b in zip(ahead, d, strict=True)]
        now = self.frame + 1
        return [
            curve(way[: last + 1 : 4], self.theme.ego, 1.4, opacity=0.8, stroke_dasharray="1 5"),
            curve(way[max(0, now - 1 - now // 3 * 3) : now : 3], self.theme.ego, 2, opacity=0.55),
        ]

    def vehicle(self, slot: int) -> str:
        """A vehicle to scale."""
        scene, theme = self.scene, self.theme
        ahead = float(scene.s[slot, self.frame] - scene.s[scene.target, self.frame])
        x, y = self.place(ahead, float(scene.d[slot, self.frame]))
        length, width = PIXELS * scene.length[slot], PIXELS * scene.width[slot]
        fill = {EGO_SLOT: theme.ego, scene.target: theme.overtaken}.get(slot, theme.other)
        degrees = -float(np.degrees(scene.heading[slot, self.frame]))
        corner = min(3.0, width / 3)
        body = [box((-length / 2, -width / 2), (length, width), fill, rx=corner)]
        body += self._details(scene.kinds[slot], length, width)
        body += self._indicator(int(scene.lights[slot, self.frame]), length, width)
        turned = f"translate({x:.2f} {y:.2f})" + (
            f" rotate({degrees:.2f})" if abs(degrees) > 0.05 else ""
        )
        return group(body, transform=turned)

    def _details(self, kind: str, length: float, width: float) -> list[str]:
        """Windscreen, or the gap between a truck's cab and its body."""
        glass = self.theme.paper
        if kind in ("MC", "B"):
            return []
        if kind == "T":
            at = length / 2 - 2.2 * PIXELS
            return [line((at, -width / 2), (at, width / 2), glass, 1.2, opacity=0.8)]
        front = length / 2 - (0.9 if kind == "V" else 1.5) * PIXELS
        depth = 0.55 * PIXELS
        return [
            box((front - depth, -0.36 * width), (depth, 0.72 * width), glass, rx=1, opacity=0.75)
        ]

    def _indicator(self, lights: int, length: float, width: float) -> list[str]:
        sides = ((Lights.INDICATOR_LEFT, -1), (Lights.INDICATOR_RIGHT, 1))
        return [
            element("circle", cx=end * (length / 2 - 1.5), cy=side * (width / 2 - 0.5), r=2.2,
                    fill="#f0e442", stroke=self.theme.ink, stroke_width=0.5)
            for light, side in sides if lights & light for end in (-1, 1)
        ]  # fmt: skip

    def draw(self) -> list[str]:
        """Road, trail and everybody who is in view."""
        size = (WIDTH - LEFT - RIGHT, self.height(self.scene))
        clip = element("clipPath", box((LEFT, self.top), size, "none"), id=self.clip)
        others = [slot for slot in self.scene.slots if slot != EGO_SLOT]
        inside = [*self.road(), *self.trail(), *map(self.vehicle, [*others, EGO_SLOT])]
        return [clip, group(inside, clip_path=f"url(#{self.clip})")]


class Over:
    """Curves over time below the views from above."""

    def __init__(self, scene: Scene, theme: Theme, top: float, height: float) -> None:
        """An empty panel with its own scale, set by `range`."""
        self.scene, self.theme, self.top, self.tall = scene, theme, top, height
        self.last = float(scene.time[-1])
        self.low, self.high = 0.0, 1.0

    def x(self, time: float) -> float:
        """Where a time is drawn."""
        return LEFT + (WIDTH - LEFT - RIGHT) * time / self.last

    def y(self, value: float) -> float:
        """Where a value is drawn."""
        return self.top + self.tall * (self.high - value) / (self.high - self.low)

    def axis(self, low: int, high: int, ticks: tuple[int, ...], name: str, unit: str) -> list[str]:
        """Scale, thin lines at round values, and what is shown."""
        self.low, self.high = float(low), float(high)
        faint, end = self.theme.faint, WIDTH - RIGHT
        parts = [
            label(
                (LEFT - 44, self.top + self.tall / 2 - 2),
                name,
                self.theme.ink,
                13,
                text_anchor="end",
            )
        ]
        parts.append(
            label((LEFT - 44, self.top + self.tall / 2 + 14), unit, faint, 12, text_anchor="end")
        )
        for tick in ticks:
            y = self.y(tick)
            parts.append(line((LEFT, y), (end, y), faint, 0.6, opacity=0.45))
            parts.append(label((LEFT - 8, y + 4), f"{tick:g}", faint, 12, text_anchor="end"))
        return parts

    def follow(self, values: np.ndarray, stroke: str, **attributes: object) -> str:
        """A curve through the values of all frames, NaN where there is none."""
        points = [
            (self.x(float(t)), self.y(float(v)))
            for t, v in zip(self.scene.time[::2], values[::2], strict=True)
            if not np.isnan(v)
        ]
        return curve(points, stroke, 2, **attributes)


def stages(scene: Scene, theme: Theme, top: float) -> list[str]:
    """The band of the ego's stages."""
    over = Over(scene, theme, top, 22.0)
    starts = np.flatnonzero(np.diff(scene.stage, prepend=9))
    ends = [*starts[1:], len(scene.time) - 1]
    parts = [label((LEFT - 8, top + 15), "stage", theme.ink, 13, text_anchor="end")]
    for place, (start, end) in enumerate(zip(starts, ends, strict=True)):
        left, right = over.x(float(scene.time[start])), over.x(float(scene.time[end]))
        name = Stage(int(scene.stage[start])).name.lower().replace("_", " ")
        parts.append(box((left, top), (right - left, 22), theme.band[place % 2]))
        if right - left > 7 * len(name):
            middle = (left + right) / 2
            parts.append(label((middle, top + 15), name, theme.ink, 12.5, text_anchor="middle"))
    return parts


def speeds(scene: Scene, theme: Theme, top: float) -> list[str]:
    """Speeds of the two."""
    over = Over(scene, theme, top, 62.0)
    pair = scene.speed[[EGO_SLOT, scene.target]]
    low, high = int(pair.min() // 40) * 40, -int(-pair.max() // 40) * 40
    parts = over.axis(low, high, tuple(range(low, high + 1, 40)), "speed", "km/h")
    for slot, stroke in ((scene.target, theme.overtaken), (EGO_SLOT, theme.ego)):
        parts.append(over.follow(scene.speed[slot], stroke))
    return parts


def gaps(scene: Scene, theme: Theme, top: float) -> list[str]:
    """Gap between the bumpers, before and after, and what the ego believed it to be."""
    over = Over(scene, theme, top, 76.0)
    offset, reach = scene.offset, scene.reach
    gap = np.abs(offset) - reach
    ceiling = -int(-gap[: scene.first(Stage.DONE)].max() // 20) * 20
    parts = over.axis(0, ceiling, (0, ceiling // 2, ceiling), "gap", "m")
    beside = scene.time[np.flatnonzero(gap < 0)]
    left, right = over.x(float(beside[0])), over.x(float(beside[-1]))
    parts.append(box((left, top), (right - left, 76), theme.band[0]))
    middle = ((left + right) / 2, top + 14)
    parts.append(label(middle, "beside", theme.faint, 12, text_anchor="middle"))
    shown = gap <= ceiling
    parts.append(over.follow(np.where((offset < 0) & (gap >= 0) & shown, gap, np.nan), theme.ink))
    parts.append(over.follow(np.where((offset > 0) & (gap >= 0) & shown, gap, np.nan), theme.ink))
    for kind, column in ((ManoeuvreKind.PULL_OUT, 0), (ManoeuvreKind.RETURN, 2)):
        parts += _belief(over, scene.belief(kind, column), theme)
    return parts


def _belief(over: Over, believed: tuple[float, float] | None, theme: Theme) -> list[str]:
    if believed is None:
        return []
    x, y = over.x(believed[0]), over.y(believed[1])
    words = f"believed: {believed[1]:.0f} m"
    below = 7 if over.scene.offset[np.searchsorted(over.scene.time, believed[0])] < 0 else -13
    return [
        element("circle", cx=x, cy=y, r=4.5, fill=theme.paper, stroke=theme.ego, stroke_width=2),
        label((x + 9, y - below), words, theme.ego, 12),
    ]


def clock(scene: Scene, theme: Theme, top: float, bottom: float) -> list[str]:
    """Seconds below, and where on the time axis the views from above are."""
    over = Over(scene, theme, top, bottom - top)
    parts: list[str] = []
    for letter, (_, frame) in zip("abcde", scene.moments(), strict=True):
        x = over.x(float(scene.time[frame]))
        parts.append(
            line((x, top - 4), (x, bottom), theme.ink, 1, stroke_dasharray="2 3", opacity=0.6)
        )
        parts.append(
            label((x, top - 7), letter, theme.ink, 13, text_anchor="middle", font_weight=600)
        )
    for second in range(0, int(over.last) + 1, 2):
        words = f"{second} s" if second == 0 else f"{second}"
        parts.append(
            label((over.x(second), bottom + 17), words, theme.faint, 12, text_anchor="middle")
        )
    return parts


def heading(scene: Scene, theme: Theme) -> list[str]:
    """Who is who, and the weather."""
    weather = scene.run.scenario.weather
    preset = list(weather_presets())[int(weather.preset[0])]
    rate = float(road_surface.rain_rate(weather.rain)[0])
    ego, other = KINDS[scene.kinds[EGO_SLOT]], KINDS[scene.kinds[scene.target]]
    words = (
        f'<tspan fill="{theme.ego}" font-weight="600">{ego} (ego)</tspan> overtakes '
        f'<tspan fill="{theme.overtaken}" font-weight="600">{other}</tspan>'
    )
    facts = f"{preset}: rain {rate:.0f} mm/h · {len(scene.slots)} vehicles · "
    facts += f"simulation {scene.number}, seed {SEED}"
    return [
        label((LEFT, 24), words, theme.ink, 16),
        label((WIDTH - RIGHT, 24), facts, theme.faint, 13, text_anchor="end"),
    ]


def measure(theme: Theme, top: float) -> list[str]:
    """Direction of travel and scale, in the upper right corner of a view from above."""
    right, y = WIDTH - RIGHT - 3.0 * PIXELS, top + 6.6 * PIXELS
    left = right - 20 * PIXELS
    bar = [(left, y - 3), (left, y), (right, y), (right, y - 3)]
    words = label(((left + right) / 2, y - 5), "20 m", theme.ink, 12, text_anchor="middle")
    arrow = label((left - 14, y + 1), "travel →", theme.ink, 12, text_anchor="end")
    return [curve(bar, theme.ink, 1.2), words, arrow]


def picture(scene: Scene, theme: Theme) -> str:
    """The whole drawing."""
    tall = Above.height(scene)
    parts = heading(scene, theme)
    top = 38.0
    for letter, (caption, frame) in zip("abcde", scene.moments(), strict=True):
        parts += Above(scene, theme, frame, top).draw()
        middle = top + tall / 2
        parts += [
            label((16, middle + 5), letter, theme.ink, 18, font_weight=600),
            label((LEFT - 8, middle - 2), caption, theme.ink, 13, text_anchor="end"),
            label(
                (LEFT - 8, middle + 15),
                f"{scene.time[frame]:.1f} s",
                theme.faint,
                13,
                text_anchor="end",
            ),
        ]
        top += tall + 8
        if letter == "a":
            parts += measure(theme, top - tall - 8)
    top += 24
    parts += clock(scene, theme, top, top + 194)
    parts += stages(scene, theme, top)
    parts += speeds(scene, theme, top + 38)
    parts += gaps(scene, theme, top + 118)
    size = (WIDTH, top + 224)
    title = "A simulated overtake in five moments, with stages, speeds and the gap over time"
    return document(size, title, [box((0, 0), size, theme.paper, rx=8), *parts])


def pictures() -> dict[str, str]:
    """File names and contents of the pictures."""
    scene = chosen()
    return {f"overtake-{theme.name}.svg": picture(scene, theme) for theme in THEMES}
