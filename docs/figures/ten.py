"""Draws the first ten simulations of each profile: place, offset and speed over time.

`python docs/generate.py` writes `ten-<profile>.svg` beside this file. They are the first ones of a
seed, as they come, so that a driver can judge what the profile makes. On two-way roads, where few
egos overtake, they are the first ones in which the ego pulls out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from figures.overtake import THEMES
from figures.svg import box, curve, document, element, label, line

import overtaking as ot
from overtaking.core.arrays import F64
from overtaking.labels.snapshots import lane_borders
from overtaking.model.overtake_events import NEVER
from overtaking.model.trajectories import Stage
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.verdicts import OvertakeClass

if TYPE_CHECKING:
    from collections.abc import Iterator

Number = TypeVar("Number", float, F64)

PROFILES = ("pinto2023", "pinto2023-physical", "motorway", "motorway-risk", "rural")
NUMBER, SEED = 10, 1
ENOUGH, PIECE = 256, 64  # Scenes in which attempts are looked for, so many at a time.
THEME = THEMES[0]  # On white paper: one picture serves light and dark pages.

WIDTH, TOP, ROW, TALL = 960.0, 64.0, 96.0, 76.0
LEFT, PANEL, BETWEEN = 136.0, 240.0, 44.0
REACH = 100.0  # Metres of road before and behind the ego.
VERGE = 1.0  # Metres beyond the lines at the edges.
APART = 0.35  # Pixels that a curve may be off.
COLUMNS = ("ahead of the ego [m]", "offset d [m], left is up", "speed [km/h]")
EVENTS = ("attempt", "contact", "off the road")
END, MIDDLE = {"text_anchor": "end"}, {"text_anchor": "middle"}


@dataclass(frozen=True)
class Panel:
    """A small diagram: where it lies, and what its two axes span."""

    left: float
    top: float
    last: float
    low: float
    high: float

    def x(self, time: Number) -> Number:
        """Where times are drawn."""
        return self.left + PANEL * time / self.last

    def y(self, value: Number) -> Number:
        """Where values are drawn."""
        return self.top + TALL * (self.high - value) / (self.high - self.low)

    def follow(self, time: F64, values: F64, stroke: str, width: float) -> list[str]:
        """Curves through the values, broken where they are NaN."""
        pieces = np.split(np.arange(len(time)), np.flatnonzero(np.diff(np.isnan(values))) + 1)
        return [
            curve(thinned(self.x(time[piece]), self.y(values[piece])), stroke, width)
            for piece in pieces
            if len(piece) > 1 and not np.isnan(values[piece[0]])
        ]


def thinned(x: F64, y: F64) -> list[tuple[float, float]]:
    """The points of a line that shows the same to `APART` pixels (Ramer, Douglas and Peucker)."""
    keep, rest = {0, len(x) - 1}, [(0, len(x) - 1)]
    while rest:
        first, last = rest.pop()
        inner = np.arange(first + 1, last)
        if not len(inner):
            continue
        share = (x[inner] - x[first]) / (x[last] - x[first])
        off = np.abs(y[inner] - y[first] - share * (y[last] - y[first]))
        if off.max() > APART:
            middle = int(inner[off.argmax()])
            keep.add(middle)
            rest += [(first, middle), (middle, last)]
    return [(float(x[place]), float(y[place])) for place in sorted(keep)]


class Row:
    """One simulation: three panels side by side."""

    def __init__(
        self, runs: ot.Trajectories, found: ot.LabelledTrajectories, row: int, last: float
    ) -> None:
        """Take a simulation of a batch; `last` is the end of the time axis [s]."""
        count = int(runs.num_frames[row])
        self.time = np.asarray(runs.time_ms[:count], float) / 1000.0
        s, d, speed = (
            np.asarray(values[row, :, :count], float)
            for values in (runs.states.s, runs.states.d, runs.states.speed)
        )
        ahead = (s - s[EGO_SLOT]) / 1000.0
        near = np.abs(ahead) <= REACH
        self.borders = np.sort(lane_borders(runs.road))
        d = np.clip(d / 1e3, self.borders[0] - VERGE, self.borders[-1] + VERGE)
        self.curves = [np.where(near, one, np.nan) for one in (ahead, d, speed * 3.6e-3)]
        self.others = np.flatnonzero(runs.scenario.vehicles.valid[row])[1:]
        events = found.events
        self.target = int(events.target_slot[row])
        marked = (events.attempt, events.collision, events.road_departure)
        self.events = {
            name: float(self.time[int(frames[row])])
            for name, frames in zip(EVENTS, marked, strict=True)
            if frames[row] != NEVER
        }
        self.name = OvertakeClass(int(found.labels.classes[row, 0])).title
        self.last = last

    def draw(self, number: int, top: float, fastest: float) -> list[str]:
        """Its number and name, and the three panels, from `top` down."""
        middle = top + TALL / 2
        parts = [
            label((LEFT - 34, middle - 2), f"{number}", THEME.ink, 15, **END, font_weight=600),
            label((LEFT - 34, middle + 14), self.name, THEME.faint, 11, **END),
        ]
        for place, (low, high, levels) in enumerate(self._axes(fastest)):
            panel = Panel(LEFT + place * (PANEL + BETWEEN), top, self.last, low, high)
            parts += self._ground(panel, levels)
            parts += self._curves(panel, self.curves[place])
            parts += self._marks(panel)
        return parts

    def _axes(self, fastest: float) -> Iterator[tuple[float, float, dict[float, str]]]:
        """Least and greatest value of each panel, and its lines with their names."""
        yield -REACH, REACH, {at: f"{at:g}" for at in (-REACH, 0.0, REACH)}
        edges = float(self.borders[0]) - VERGE, float(self.borders[-1]) + VERGE
        named = (self.borders[0], self.borders[-1])
        yield *edges, {float(at): f"{at:.0f}" if at in named else "" for at in self.borders}
        yield 0.0, fastest, {at: f"{at:g}" for at in (0.0, 60.0, 120.0) if at <= fastest}

    def _ground(self, panel: Panel, levels: dict[float, str]) -> list[str]:
        ends = panel.left, panel.x(float(self.time[-1]))
        parts = [box((ends[0], panel.top), (ends[1] - ends[0], TALL), THEME.band[1])]
        for level, name in levels.items():
            y = panel.y(level)
            parts.append(line((ends[0], y), (ends[1], y), THEME.paper, 1.1))
            parts.append(label((ends[0] - 5, y + 3.5), name, THEME.faint, 10, **END))
        return parts

    def _curves(self, panel: Panel, values: F64) -> list[str]:
        strokes = {int(slot): (THEME.faint, 0.8) for slot in self.others}
        if self.target in strokes:
            strokes[self.target] = (THEME.overtaken, 1.6)
        strokes[EGO_SLOT] = (THEME.ego, 2.0)
        return [
            part
            for slot, stroke in strokes.items()
            for part in panel.follow(self.time, values[slot], *stroke)
        ]

    def _marks(self, panel: Panel) -> list[str]:
        parts = list[str]()
        for name, time in self.events.items():
            parts += mark(name, panel.x(time), panel.top, panel.top + TALL)
        return parts


def mark(name: str, x: float, top: float, bottom: float) -> list[str]:
    """The sign of an event: dashes, or a line with a cross or a ring on top."""
    if name == "attempt":
        return [line((x, top), (x, bottom), THEME.ink, 1.1, stroke_dasharray="3 2")]
    parts = [line((x, top), (x, bottom), THEME.ink, 1.6)]
    if name == "contact":
        return parts + [line((x - 4, top + y), (x + 4, top - y), THEME.ink, 2) for y in (-4, 4)]
    ring = {"fill": THEME.paper, "stroke": THEME.ink, "stroke_width": 1.6}
    return [*parts, element("circle", cx=x, cy=top, r=4, **ring)]


def heading(profile: str, chosen: str) -> list[str]:
    """What is shown, who is who, and the names of the three columns."""
    parts = [label((20, 26), f"{profile}: {chosen} of seed {SEED}", THEME.ink, 16)]
    x = LEFT + PANEL + BETWEEN
    signs = (("ego", THEME.ego), ("to overtake", THEME.overtaken), ("others", THEME.faint))
    for name, stroke in signs:
        parts += [line((x, 21), (x + 22, 21), stroke, 2.4), label((x + 28, 26), name, THEME.ink)]
        x += 46 + 6.6 * len(name)
    for name in EVENTS:
        parts += [*mark(name, x + 6, 12, 30), label((x + 16, 26), name, THEME.ink)]
        x += 34 + 6.6 * len(name)
    for place, name in enumerate(COLUMNS):
        parts.append(label((LEFT + place * (PANEL + BETWEEN), TOP - 12), name, THEME.ink))
    return parts


def clock(top: float, last: float) -> list[str]:
    """Seconds below the last row."""
    step = 20.0 if last > 40.0 else 5.0
    panels = [Panel(LEFT + place * (PANEL + BETWEEN), top, last, 0, 1) for place in range(3)]
    return [
        label((one.x(time), top), f"{time:g}{' s' if not time else ''}", THEME.faint, 10, **MIDDLE)
        for one in panels
        for time in np.arange(0.0, last + 0.1, step).tolist()
    ]


def first(profile: str) -> tuple[ot.Scenario, str]:
    """The first scenes of a profile, on two-way roads those with an attempt; and what they are."""
    scenes = ot.sample(profile, num_simulations=NUMBER, seed=SEED)
    if not scenes.road.is_two_way:
        return scenes, f"simulations 0 to {NUMBER - 1}"
    scenes = ot.sample(profile, num_simulations=ENOUGH, seed=SEED)
    tried = [
        (ot.simulate(scenes.select(slice(at, at + PIECE))).stage == Stage.PULL_OUT).any(axis=1)
        for at in range(0, ENOUGH, PIECE)
    ]
    return scenes.select(np.flatnonzero(np.concatenate(tried))[:NUMBER]), "the first attempts"


def picture(profile: str) -> str:
    """The first simulations of a profile."""
    scenes, chosen = first(profile)
    runs = ot.simulate(scenes)
    found = ot.label(runs)
    seconds = float(runs.time_ms[int(runs.num_frames.max()) - 1]) / 1000.0
    last = 10.0 * float(np.ceil(seconds / 10.0))
    fastest = 20.0 * float(np.ceil(float(runs.states.speed.max()) * 3.6e-3 / 20.0))
    size = WIDTH, TOP + NUMBER * ROW + 8.0
    parts = [box((0, 0), size, THEME.paper), *heading(profile, chosen)]
    for row, number in enumerate(runs.scenario.scenario_index.tolist()):
        parts += Row(runs, found, row, last).draw(number, TOP + row * ROW, fastest)
    parts += clock(TOP + NUMBER * ROW - 4.0, last)
    return document(size, f"Ten simulations of {profile}: place, offset and speed over time", parts)


def pictures() -> dict[str, str]:
    """The picture of each profile, by file name."""
    return {f"ten-{profile}.svg": picture(profile) for profile in PROFILES}
