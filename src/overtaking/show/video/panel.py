"""Panels above and below the road: vehicles, stages, speeds and gap over time."""

from collections.abc import Sequence
from functools import cache

import numpy as np

from overtaking.core.arrays import F64
from overtaking.core.units import kmh_from_mps
from overtaking.model.trajectories import Stage
from overtaking.model.vehicles import EGO_SLOT
from overtaking.show.video import palette
from overtaking.show.video.canvas import HEIGHT, WIDTH, Canvas, Drawing
from overtaking.show.video.notes import Note
from overtaking.show.video.scene import FilmScene
from overtaking.show.video.text import lettering, line, write_number
from overtaking.show.video.view import SCENE_BOTTOM, SCENE_TOP

_LEFT, _RIGHT = 80, 1096  # Columns of the plots.
_SPEED_ROWS, _GAP_ROWS = (9.0, 41.0), (61.0, 93.0)
_STAGE_ROWS, _BREACH_ROWS = (100.0, 106.0), (108.0, 112.0)
_READOUT = 1112
_ROW = 66  # Of the distance to the target.
_NUM_PILLS = 5  # The stages of an overtake that goes well; the other two take the last one's place.
_PILL_LEFT, _PILL_WIDTH, _PILL_PITCH = 428, 74, 82
_SMALL, _NORMAL, _LARGE = 11, 13, 16
_FUTURE = 0.28  # Opacity of later frames.


class Header:
    """The line above the road.

    Args:
        title: Name of the simulation.
        subtitle: Where it comes from, and its class.
        meaning: What the class means.
        weather: Weather in words.
    """

    def __init__(self, title: str, subtitle: str, meaning: str, weather: str) -> None:
        """Draw the constant parts."""
        drawing, row = Drawing(), 3 if meaning else 10
        name, sky = lettering(title, _LARGE, bold=True), lettering(weather, _NORMAL)
        drawing.mask(name, (16, row), palette.TEXT)
        drawing.mask(lettering(subtitle, _NORMAL), (28 + name.shape[1], row + 3), palette.FAINT)
        drawing.mask(lettering(meaning, _SMALL), (16, 23), palette.FAINT)
        drawing.mask(sky, (WIDTH - 16 - sky.shape[1], 13), palette.TEXT)
        self._canvas = Canvas(WIDTH, SCENE_TOP, palette.PANEL)
        self._canvas.draw(drawing)

    def draw(self, canvas: Canvas, stage: int | None) -> None:
        """Draw it, with the stage of the ego if that is known."""
        canvas.copy_columns(self._canvas, 0, 0, (0, WIDTH))
        if stage is not None:
            canvas.copy_columns(_pills(Stage(stage)), _PILL_LEFT, 8, (0, _NUM_PILLS * _PILL_PITCH))


@cache
def _pills(stage: Stage) -> Canvas:
    """The stages in their order, the present one lit."""
    shown = [Stage(number) for number in range(_NUM_PILLS)]
    if stage not in shown:
        shown[-1] = stage
    drawing = Drawing()
    for place, one in enumerate(shown):
        _pill(drawing, one, place * _PILL_PITCH, is_lit=one is stage)
    canvas = Canvas(_NUM_PILLS * _PILL_PITCH, 24, palette.PANEL)
    canvas.draw(drawing)
    return canvas


def _pill(drawing: Drawing, stage: Stage, left: int, *, is_lit: bool) -> None:
    label, colour, ink = palette.STAGES[stage]
    box = (float(left), float(left + _PILL_WIDTH)), (1.0, 23.0)
    if is_lit:
        drawing.rect(*box, colour, radius=11.0)
    else:
        drawing.outline(*box, palette.PANEL_EDGE, line=1.0, radius=11.0)
    letters = lettering(label, _NORMAL, bold=is_lit)
    height, width = letters.shape
    place = left + (_PILL_WIDTH - width) // 2, 12 - height // 2
    drawing.mask(letters, place, ink if is_lit else palette.FAINT)


class Timeline:
    """Speeds and gap over time, with a cursor; later values are faint.

    Args:
        scene: The drawn simulation.
        breaches: Breaches of the law, those that count first.
        num_frames: Of the time axis, at least those of the scene.
    """

    def __init__(self, scene: FilmScene, breaches: Sequence[Note], num_frames: int) -> None:
        """Draw past and future once."""
        self._scene, self._lead = scene, scene.lead
        self._columns = np.linspace(_LEFT, _RIGHT, max(num_frames, 2)).tolist()
        known = self._columns[: max(scene.num_frames, 2)]
        self._past = _plots(scene, breaches, known, 1.0)
        self._future = _plots(scene, breaches, known, _FUTURE)
        self._cursor = Drawing()
        self._cursor.rect(
            (0.0, 2.0), (SCENE_BOTTOM + 8.0, SCENE_BOTTOM + _BREACH_ROWS[1]), palette.TEXT
        )

    def draw(self, canvas: Canvas, frame: int) -> None:
        """Draw the strip."""
        column = self.column(frame)
        canvas.copy_columns(self._past, 0, SCENE_BOTTOM, (0, column))
        canvas.copy_columns(self._future, column, SCENE_BOTTOM, (column, WIDTH))
        canvas.draw(self._cursor, column)
        self._speeds(canvas, frame)
        self._distance(canvas, frame)
        time = f"{self._scene.time[frame]:.2f} s"
        write_number(canvas, time, (_READOUT, SCENE_BOTTOM + 94), _NORMAL, palette.FAINT)

    def column(self, frame: int) -> int:
        """Column of the cursor."""
        return round(self._columns[frame])

    def _speeds(self, canvas: Canvas, frame: int) -> None:
        """How fast ego and target are."""
        target = self._scene.target
        shown = [("Ego", EGO_SLOT, palette.EGO, 8)]
        if target is not None:
            shown.append(("Target", target, palette.TARGET, 30))
        for name, slot, colour, row in shown:
            speed = kmh_from_mps(float(self._scene.speed[slot, frame]))
            text = line(f"{name} {speed:.0f} km/h", _LARGE, colour, bold=True)
            canvas.draw(text.drawing, _READOUT, SCENE_BOTTOM + row)

    def _distance(self, canvas: Canvas, frame: int) -> None:
        """Where the target is, in words."""
        if self._lead is None:
            return
        lead, row = float(self._lead[frame]), SCENE_BOTTOM + _ROW
        name = line("target " if lead else "target alongside", _NORMAL, palette.GAP)
        canvas.draw(name.drawing, _READOUT, row)
        if lead:
            place = _READOUT + name.width, row
            end = write_number(canvas, f"{abs(lead):.1f} m", place, _NORMAL, palette.GAP)
            side = line(" ahead" if lead > 0.0 else " behind", _NORMAL, palette.GAP)
            canvas.draw(side.drawing, end, row)


def _plots(
    scene: FilmScene, breaches: Sequence[Note], columns: list[float], opacity: float
) -> Canvas:
    """The strip with its curves as they are left or right of the cursor."""
    drawing = Drawing()
    _speeds(drawing, scene, columns, opacity)
    _gap(drawing, scene, columns, opacity)
    _stages(drawing, scene, columns, opacity)
    for one in reversed(breaches):  # Rules that the policy requires lie above the others.
        ends = columns[one.first], columns[min(one.last + 1, len(columns) - 1)]
        colour = palette.WARNING if one.counts else palette.ASIDE
        drawing.rect(ends, _BREACH_ROWS, colour, opacity=max(opacity, 0.5), radius=2.0)
    canvas = Canvas(WIDTH, HEIGHT - SCENE_BOTTOM, palette.PANEL)
    canvas.draw(drawing)
    return canvas


def _curve(drawing: Drawing, columns: list[float], rows: F64, colour: str, opacity: float) -> None:
    """A curve over the frames of the film."""
    padded = np.broadcast_to(rows, len(columns)) if len(rows) == 1 else rows
    points = list(zip(columns, padded.tolist(), strict=True))
    drawing.lines([points], colour, width=2.0, opacity=opacity)


def _speeds(drawing: Drawing, scene: FilmScene, columns: list[float], opacity: float) -> None:
    """Speeds of ego and target."""
    shown = (
        [(EGO_SLOT, palette.EGO)]
        if scene.target is None
        else [(scene.target, palette.TARGET), (EGO_SLOT, palette.EGO)]
    )
    speeds = {slot: kmh_from_mps(scene.speed[slot]) for slot, _ in shown}
    low, high, step = _axis([float(f(v)) for v in speeds.values() for f in (np.min, np.max)], 20.0)
    _grid(drawing, (low, high, step), _SPEED_ROWS, " km/h")
    for slot, colour in shown:
        _curve(drawing, columns, _rows(speeds[slot], low, high, _SPEED_ROWS), colour, opacity)


def _gap(drawing: Drawing, scene: FilmScene, columns: list[float], opacity: float) -> None:
    """Distance to the target, positive while it is ahead."""
    lead = scene.lead
    if lead is None:
        letters = lettering("nobody to overtake", _NORMAL)
        drawing.mask(letters, (_LEFT + 8, int(_GAP_ROWS[0]) + 8), palette.FAINT)
        return
    low, high, step = _axis([0.0, float(lead.min()), float(lead.max())], 20.0)
    _grid(drawing, (low, high, step), _GAP_ROWS, " m ahead")
    zero = float(_rows(np.zeros(1), low, high, _GAP_ROWS)[0])
    drawing.rect((_LEFT, _RIGHT), (zero - 0.5, zero + 0.5), palette.FAINT, opacity=0.7)
    _curve(drawing, columns, _rows(lead, low, high, _GAP_ROWS), palette.GAP, opacity)


def _stages(drawing: Drawing, scene: FilmScene, columns: list[float], opacity: float) -> None:
    """A band in the colours of the stages."""
    if scene.stage is None:
        return
    starts = np.flatnonzero(np.diff(scene.stage, prepend=255)).tolist()
    for first, after in zip(starts, [*starts[1:], len(columns) - 1], strict=True):
        _, colour, _ = palette.STAGES[Stage(int(scene.stage[first]))]
        ends = columns[first], columns[after]
        drawing.rect(ends, _STAGE_ROWS, colour, opacity=max(opacity, 0.4))


def _rows(values: F64, low: float, high: float, rows: tuple[float, float]) -> F64:
    """Rows of values on an axis that grows upwards."""
    return rows[1] - (values - low) / (high - low) * (rows[1] - rows[0])


def _axis(values: list[float], step: float) -> tuple[float, float, float]:
    """Round ends of an axis around some values, and the step between its lines."""
    while max(values) - min(values) > 3.0 * step:
        step *= 2.0 if str(step)[0] in "15" else 2.5
    low = step * np.floor(min(values) / step)
    return float(low), float(max(step * np.ceil(max(values) / step), low + step)), step


def _grid(
    drawing: Drawing, axis: tuple[float, float, float], rows: tuple[float, float], unit: str
) -> None:
    """Lines on a ground of their own, with the first and the last value; unit at the last."""
    low, high, step = axis
    ground = rows[0] - 5.0, rows[1] + 5.0
    drawing.rect((_LEFT, _RIGHT), ground, palette.INK, opacity=0.4, radius=3.0)
    for row in _rows(np.arange(low, high + 0.5 * step, step), low, high, rows).tolist():
        drawing.rect((_LEFT, _RIGHT), (row - 0.5, row + 0.5), palette.GRID)
    for text, row in ((f"{low:.0f}", rows[1]), (f"{high:.0f}{unit}", rows[0])):
        label = lettering(text, _SMALL)
        height, width = label.shape
        drawing.mask(label, (_LEFT - 6 - width, round(row) - height // 2), palette.FAINT)
