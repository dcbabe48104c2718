"""What stands above and below the road: who and where, stages, speeds and gap over time."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from overtaking.core.units import kmh_from_mps
from overtaking.model.trajectory import Stage
from overtaking.model.vehicles import Role
from overtaking.video.canvas import HEIGHT, WIDTH
from overtaking.video.palette import (
    ASIDE,
    EGO,
    FAINT,
    GAP,
    GRID,
    INK,
    PANEL,
    PANEL_EDGE,
    STAGES,
    TARGET,
    TEXT,
    WARNING,
)
from overtaking.video.sheet import Sheet
from overtaking.video.text import lettering, line, spelled
from overtaking.video.view import SCENE_BOTTOM, SCENE_TOP

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from overtaking.video.display import Part
    from overtaking.video.notes import Note
    from overtaking.video.pictures import Tile
    from overtaking.video.scene import Scene

    F32 = NDArray[np.float32]

_STRIP = HEIGHT - SCENE_BOTTOM
_LEFT, _RIGHT = 80, 1096  # Columns of the plots.
_SPEED_ROWS, _GAP_ROWS = (9.0, 41.0), (61.0, 93.0)
_STAGE_ROWS, _BREACH_ROWS = (100.0, 106.0), (108.0, 112.0)
_READOUT = 1112
_ROW = 66  # Of the distance to the target.
_NUM_PILLS = 5  # The stages of an overtake that goes well; the other two take the last one's place.
_PILL_LEFT, _PILL_WIDTH, _PILL_GAP = 428, 74, 8
_SMALL, _NORMAL, _LARGE = 11, 13, 16
_FUTURE = 0.28  # Opacity of what has not happened yet.


class Header:
    """The line above the road.

    Args:
        title: Name of the simulation.
        subtitle: Where it comes from, and its class.
        meaning: What the class means.
        weather: Weather in words.
    """

    def __init__(self, title: str, subtitle: str, meaning: str, weather: str) -> None:
        """Draw what does not change."""
        sheet = _panel(SCENE_TOP)
        name, row = lettering(title, _LARGE, bold=True), 3 if meaning else 10
        sheet.write(name, 16, row, TEXT)
        sheet.write(lettering(subtitle, _NORMAL), 28 + name.width, row + 3, FAINT)
        sheet.write(lettering(meaning, _SMALL), 16, 23, FAINT)
        sky = lettering(weather, _NORMAL)
        sheet.write(sky, WIDTH - 16 - sky.width, 13, TEXT)
        self._tile = sheet.tile()

    def lay(self, part: Part, stages: NDArray[np.uint8] | None) -> None:
        """Put it on all frames, with the stage of the ego in each if that is known."""
        part.tile(self._tile)
        if stages is not None:
            for stage in np.unique(stages):
                frames = np.flatnonzero(stages == stage)
                part.tile(_pills(Stage(int(stage))), _PILL_LEFT, 8, frames=frames)


@cache
def _pills(stage: Stage) -> Tile:
    """The stages in their order, the present one lit."""
    shown = [Stage(number) for number in range(_NUM_PILLS)]
    if stage not in shown:
        shown[-1] = stage
    pitch = _PILL_WIDTH + _PILL_GAP
    sheet = Sheet((0.0, float(_NUM_PILLS * pitch), 0.0, 24.0), 1.0)
    sheet.fill(PANEL)
    for place, one in enumerate(shown):
        _pill(sheet, one, place * pitch, is_lit=one is stage)
    return sheet.tile()


def _pill(sheet: Sheet, stage: Stage, left: int, *, is_lit: bool) -> None:
    label, colour, ink = STAGES[stage]
    box = (float(left), float(left + _PILL_WIDTH)), (1.0, 23.0)
    if is_lit:
        sheet.rect(*box, colour, radius=11.0)
    else:
        sheet.frame(*box, PANEL_EDGE, line=1.0, radius=11.0)
    letters = lettering(label, _NORMAL, bold=is_lit)
    middle = left + (_PILL_WIDTH - letters.width) // 2
    sheet.write(letters, middle, 12 - letters.height // 2, ink if is_lit else FAINT)


class Timeline:
    """Speeds and gap over time, with a cursor: what was lies left of it, what comes is faint.

    Args:
        scene: What is drawn.
        breaches: Breaches of the law, those that count first.
    """

    def __init__(self, scene: Scene, breaches: Sequence[Note]) -> None:
        """Draw past and future once."""
        self._scene = scene
        self._lead = scene.lead
        self._past = _plots(scene, breaches, 1.0)
        self._future = _plots(scene, breaches, _FUTURE)
        cursor = Sheet((0.0, 2.0, 0.0, _BREACH_ROWS[1] - 8.0), 1.0)
        cursor.rect((-1.0, 3.0), (-1.0, _STRIP + 1.0), TEXT)
        self._cursor = cursor.tile()

    def lay(self, part: Part) -> None:
        """Put the strip on all frames."""
        columns = self.columns()
        part.tile(self._past, columns=(0, columns))
        part.tile(self._future, columns, columns=(columns, WIDTH))
        part.tile(self._cursor, columns, 8)
        self._speeds(part)
        self._distances(part)
        times = [f"{time:.2f} s" for time in self._scene.time.tolist()]
        _numbers(part, times, _READOUT, 94, FAINT, frames=np.arange(self._scene.num_frames))

    def columns(self) -> NDArray[np.int64]:
        """Column of the cursor in each frame, even."""
        frames = np.arange(self._scene.num_frames)
        last = max(self._scene.num_frames - 1, 1)
        return 2 * np.rint(0.5 * (_LEFT + (_RIGHT - _LEFT) * frames / last)).astype(np.int64)

    def _speeds(self, part: Part) -> None:
        """How fast ego and target are."""
        target = self._scene.target
        shown = [("Ego", int(Role.EGO), EGO, 8)]
        if target is not None:
            shown.append(("Target", target, TARGET, 30))
        for name, slot, colour, row in shown:
            speeds = np.rint(kmh_from_mps(self._scene.speed[slot]))
            for speed in np.unique(speeds):
                text = line(f"{name} {speed:.0f} km/h", _LARGE, colour, bold=True)
                part.sprite(text, _READOUT, row, frames=np.flatnonzero(speeds == speed))

    def _distances(self, part: Part) -> None:
        """Where the target is, in words."""
        if self._lead is None:
            return
        beside = np.flatnonzero(self._lead == 0.0)
        part.sprite(line("target alongside", _NORMAL, GAP), _READOUT, _ROW, frames=beside)
        frames = np.flatnonzero(self._lead)
        name, lead = line("target", _NORMAL, GAP), self._lead[frames]
        part.sprite(name, _READOUT, _ROW, frames=frames)
        metres = [f"{abs(one):.1f} m" for one in lead.tolist()]
        ends = _numbers(part, metres, _READOUT + name.size[0] + 4, _ROW, GAP, frames=frames)
        for text, is_meant in (("ahead", lead > 0.0), ("behind", lead < 0.0)):
            side = line(text, _NORMAL, GAP)
            part.sprite(side, ends[is_meant] + 4, _ROW, frames=frames[is_meant])


def _numbers(
    part: Part, texts: list[str], x: int, y: int, colour: str, *, frames: NDArray[np.intp]
) -> NDArray[np.int64]:
    """Write a text on each of some frames, letter beside letter; gives the columns after them."""
    if not texts:
        return np.empty(0, np.int64)
    written = np.array(texts)
    letters = written.view(np.uint32).reshape(len(texts), -1)  # Shorter texts end in zeros.
    known, which = np.unique(letters, return_inverse=True)
    blanks = int(known[0] == 0)
    sprites = spelled("".join(map(chr, known[blanks:])), _NORMAL, colour)
    widths = np.array([0] * blanks + [one.size[0] for one in sprites])[which]
    columns = x + np.cumsum(widths, axis=1)
    is_there = letters != 0
    chosen = np.broadcast_to(frames[:, None], letters.shape)[is_there]
    places = (columns - widths)[is_there]
    part.sprites(sprites, which[is_there] - blanks, places, y, frames=chosen)
    return columns[:, -1]


def _panel(height: int) -> Sheet:
    """A dark sheet as wide as the film."""
    sheet = Sheet((0.0, float(WIDTH), 0.0, float(height)), 1.0)
    sheet.fill(PANEL)
    return sheet


def _plots(scene: Scene, breaches: Sequence[Note], opacity: float) -> Tile:
    """The strip with its curves as they are left or right of the cursor."""
    sheet = _panel(_STRIP)
    columns = np.linspace(_LEFT, _RIGHT, max(scene.num_frames, 2), dtype=np.float32)
    _speeds(sheet, scene, columns, opacity)
    _gap(sheet, scene, columns, opacity)
    _stages(sheet, scene, columns, opacity)
    for one in reversed(breaches):  # What counts lies above what does not.
        ends = (float(columns[one.first]), float(columns[min(one.last + 1, len(columns) - 1)]))
        colour = WARNING if one.counts else ASIDE
        sheet.rect(ends, _BREACH_ROWS, colour, opacity=max(opacity, 0.5), radius=2.0)
    return sheet.tile()


def _curve(
    sheet: Sheet, columns: F32, rows: NDArray[np.floating], colour: str, opacity: float
) -> None:
    """A curve over the frames of the film."""
    padded = np.broadcast_to(rows, columns.shape) if len(rows) == 1 else rows
    sheet.curve(columns, padded.astype(np.float32), colour, line=2.0, opacity=opacity)


def _speeds(sheet: Sheet, scene: Scene, columns: F32, opacity: float) -> None:
    """Speeds of ego and target."""
    shown = [(Role.EGO, EGO)] if scene.target is None else [(scene.target, TARGET), (Role.EGO, EGO)]
    speeds = {slot: kmh_from_mps(scene.speed[slot]) for slot, _ in shown}
    low, high, step = _axis([float(f(v)) for v in speeds.values() for f in (np.min, np.max)], 20.0)
    _grid(sheet, (low, high, step), _SPEED_ROWS, " km/h")
    for slot, colour in shown:
        _curve(sheet, columns, _rows(speeds[slot], low, high, _SPEED_ROWS), colour, opacity)


def _gap(sheet: Sheet, scene: Scene, columns: F32, opacity: float) -> None:
    """Distance to the target, positive while it is ahead."""
    lead = scene.lead
    if lead is None:
        letters = lettering("nobody to overtake", _NORMAL)
        sheet.write(letters, _LEFT + 8, int(_GAP_ROWS[0]) + 8, FAINT)
        return
    low, high, step = _axis([0.0, float(lead.min()), float(lead.max())], 20.0)
    _grid(sheet, (low, high, step), _GAP_ROWS, " m ahead")
    zero = float(_rows(np.zeros(1), low, high, _GAP_ROWS)[0])
    sheet.rect((_LEFT, _RIGHT), (zero - 0.5, zero + 0.5), FAINT, opacity=0.7)
    _curve(sheet, columns, _rows(lead, low, high, _GAP_ROWS), GAP, opacity)


def _stages(sheet: Sheet, scene: Scene, columns: F32, opacity: float) -> None:
    """A band in the colours of the stages."""
    if scene.stage is None:
        return
    starts = np.flatnonzero(np.diff(scene.stage, prepend=255))
    for first, after in zip(starts, [*starts[1:], len(columns) - 1], strict=True):
        _, colour, _ = STAGES[Stage(int(scene.stage[first]))]
        ends = (float(columns[first]), float(columns[after]))
        sheet.rect(ends, _STAGE_ROWS, colour, opacity=max(opacity, 0.4))


def _rows(
    values: NDArray[np.floating], low: float, high: float, rows: tuple[float, float]
) -> NDArray[np.floating]:
    """Rows of values on an axis that grows upwards."""
    return rows[1] - (values - low) / (high - low) * (rows[1] - rows[0])


def _axis(values: list[float], step: float) -> tuple[float, float, float]:
    """Round ends of an axis around some values, and the step between its lines."""
    while max(values) - min(values) > 3.0 * step:
        step *= 2.0 if str(step)[0] in "15" else 2.5
    low = step * np.floor(min(values) / step)
    return float(low), float(max(step * np.ceil(max(values) / step), low + step)), step


def _grid(
    sheet: Sheet, axis: tuple[float, float, float], rows: tuple[float, float], unit: str
) -> None:
    """Lines on a ground of their own, with the first and the last value; unit at the last."""
    low, high, step = axis
    sheet.rect((_LEFT, _RIGHT), (rows[0] - 5.0, rows[1] + 5.0), INK, opacity=0.4, radius=3.0)
    for value in np.arange(low, high + 0.5 * step, step):
        row = float(_rows(np.array([value]), low, high, rows)[0])
        sheet.rect((_LEFT, _RIGHT), (row - 0.5, row + 0.5), GRID)
    for value, shown in ((low, ""), (high, unit)):
        row = float(_rows(np.array([value]), low, high, rows)[0])
        label = lettering(f"{value:.0f}{shown}", _SMALL)
        sheet.write(label, _LEFT - 6 - label.width, round(row) - label.height // 2, FAINT)
