"""The next kilometre of a two-way road: oncoming vehicles, line, places, sight, meeting point."""

import math
from collections.abc import Iterator
from operator import itemgetter

import numpy as np

from overtaking.model.road_course import RoadMark, ZoneKind
from overtaking.model.vehicles import EGO_SLOT
from overtaking.show.video import palette
from overtaking.show.video.canvas import WIDTH, Canvas, Drawing
from overtaking.show.video.scene import FilmScene
from overtaking.show.video.text import line
from overtaking.show.video.view import SCENE_TOP
from overtaking.world.sight_distance import all_zones_for, sight_at

AHEAD, BEHIND = 1_000.0, 100.0
"""How much of the road is shown [m]."""

_LEFT, _RIGHT = 12.0, WIDTH - 12.0
_TOP, _HEIGHT = SCENE_TOP + 30, 24
_ABOVE, _BELOW = -14, _HEIGHT  # Rows of labels.
_MIDDLE = 0.5 * _HEIGHT
_LABEL_GAP = 10.0
_LANE = 5.5  # From the line between the directions to the middle of a lane [px].
_SCALE = (_RIGHT - _LEFT) / (AHEAD + BEHIND)
_SOLID = {RoadMark.SOLID, RoadMark.SOLID_SOLID, RoadMark.SOLID_BROKEN, RoadMark.CURB}
_GROUND, _CLOSED, _OPEN, _UNSEEN = "#4a5057", "#ff8a7a", "#eef1f4", "#14181d"
_ONCOMING = "#ffffff"
_NAMES = {
    ZoneKind.CREST: "crest",
    ZoneKind.BEND: "bend",
    ZoneKind.JUNCTION: "junction",
    ZoneKind.PEDESTRIAN_CROSSING: "crossing",
    ZoneKind.LEVEL_CROSSING: "level crossing",
    ZoneKind.NARROW: "narrow",
    ZoneKind.NO_OVERTAKING: "no overtaking",
    ZoneKind.NO_OVERTAKING_HEAVY: "no overtaking, heavy",
    ZoneKind.NO_OVERTAKING_MOTORCYCLE: "no overtaking, motorcycles",
}
_PLACE = "#8a7434"


Label = tuple[str, float, int]
"""A text, the column of its middle, and its row."""


class Ahead:
    """The strip of the next kilometre.

    Args:
        scene: What is filmed, on a two-way road.
    """

    def __init__(self, scene: FilmScene) -> None:
        """Find who comes the other way."""
        self._scene, self._road = scene, scene.road
        first = np.argmax(scene.is_there, axis=1)
        row = np.arange(len(scene.slots))
        self._comes = np.cos(scene.angle[row, first]) < 0
        self._comes[EGO_SLOT] = False
        self._stretches = all_zones_for(scene.road, 1)

    def draw(self, canvas: Canvas, frame: int) -> None:
        """Draw the strip of a frame."""
        ego = float(self._scene.s[EGO_SLOT, frame])
        drawing = Drawing()
        drawing.rect((_LEFT - 6.0, _RIGHT + 6.0), (0.0, _HEIGHT), _GROUND, radius=5.0)
        labels = [*self._places(drawing, ego), *self._sight(drawing, ego)]
        self._line(drawing, ego)
        self._vehicles(drawing, ego, frame)
        labels += self._meeting(drawing, ego, frame)
        canvas.draw(drawing, 0.0, float(_TOP))
        taken = {_ABOVE: _LEFT, _BELOW: _LEFT}
        for text, x, row in sorted(labels, key=itemgetter(1)):
            picture = line(text, 10, palette.TEXT)
            wished = min(max(x - 0.5 * picture.width, _LEFT), _RIGHT - picture.width)
            column = round(max(wished, taken[row]))
            canvas.draw(picture.drawing, column, _TOP + row)
            taken[row] = column + picture.width + _LABEL_GAP

    def _x(self, s: float, ego: float) -> float:
        """Column of a station, cut at the ends of the strip."""
        return min(max(_LEFT + (s - ego + BEHIND) * _SCALE, _LEFT), _RIGHT)

    def _places(self, drawing: Drawing, ego: float) -> Iterator[Label]:
        for one in self._stretches:
            begin, end = self._x(one.start, ego), self._x(one.stop, ego)
            if begin < end:
                drawing.rect((begin, end), (0.0, float(_HEIGHT)), _PLACE)
                yield _NAMES[one.kind], 0.5 * (begin + end), _BELOW

    def _sight(self, drawing: Drawing, ego: float) -> Iterator[Label]:
        """What lies beyond sight is dark."""
        sight = float(sight_at(self._road, ego))
        if math.isfinite(sight) and (end := self._x(ego + sight, ego)) < _RIGHT:
            drawing.rect((end, _RIGHT + 6.0), (0.0, float(_HEIGHT)), _UNSEEN, opacity=0.8)
            drawing.rect((end - 1.0, end + 1.0), (-3.0, _HEIGHT + 3.0), _OPEN)
            yield f"sight {sight:.0f} m", end, _ABOVE

    def _line(self, drawing: Drawing, ego: float) -> None:
        """The line between the directions: red where it is solid for the ego."""
        begins, marks = zip(*self._road.overtaking_edge_marks, strict=True)
        for begin, end, mark in zip(begins, [*begins[1:], math.inf], marks, strict=True):
            first, last = self._x(begin, ego), self._x(end, ego)
            if mark in _SOLID and first < last:
                drawing.rect((first, last), (_MIDDLE - 1.0, _MIDDLE + 1.0), _CLOSED)
            elif first < last:
                for dash in _dashes(first, last, ego):
                    drawing.rect(dash, (_MIDDLE - 0.75, _MIDDLE + 0.75), _OPEN, opacity=0.8)

    def _vehicles(self, drawing: Drawing, ego: float, frame: int) -> None:
        """Arrows the way that vehicles drive, ego and target last."""
        scene, border = self._scene, float(self._road.lane_boundaries[-1])
        order = [k for k in range(len(scene.slots)) if k not in (EGO_SLOT, scene.target)]
        order += [k for k in (scene.target, EGO_SLOT) if k is not None]
        for k in order:
            s = float(scene.s[k, frame])
            if scene.is_there[k, frame] and -BEHIND < s - ego < AHEAD:
                across = self._road.overtaking_sign * (float(scene.d[k, frame]) - border)
                y = (
                    _MIDDLE
                    - self._road.overtaking_sign * min(max(across / 1.75, -1.2), 1.2) * _LANE
                )
                ahead = -1.0 if self._comes[k] else 1.0
                x = self._x(s, ego)
                points = [
                    (x + 6.0 * ahead, y),
                    (x - 5.0 * ahead, y - 4.5),
                    (x - 5.0 * ahead, y + 4.5),
                ]
                drawing.polygon(points, self._colour(k))

    def _colour(self, k: int) -> str:
        if k == EGO_SLOT:
            return palette.EGO
        if k == self._scene.target:
            return palette.TARGET
        return _ONCOMING if self._comes[k] else palette.FAINT

    def _meeting(self, drawing: Drawing, ego: float, frame: int) -> Iterator[Label]:
        """Where ego and the next who comes will be beside each other, as fast as they are."""
        scene = self._scene
        gaps = np.where(
            self._comes & scene.is_there[:, frame] & (scene.s[:, frame] > ego),
            scene.s[:, frame] - ego,
            np.inf,
        )
        k = int(np.argmin(gaps))
        own, both = scene.speed[EGO_SLOT, frame], scene.speed[[EGO_SLOT, k], frame].sum()
        if not (np.isfinite(gaps[k]) and both > 0):
            return
        seconds = float(gaps[k] / both)
        meet = ego + float(own) * seconds
        if meet - ego < AHEAD:
            x = self._x(meet, ego)
            for tilt in (-4.0, 4.0):
                cross = [[(x - 4.0, _MIDDLE - tilt), (x + 4.0, _MIDDLE + tilt)]]
                drawing.lines(cross, palette.INDICATOR_ON, width=2.0)
            yield f"meets {scene.slots[k]} in {seconds:.1f} s", x, _ABOVE


def _dashes(first: float, last: float, ego: float) -> Iterator[tuple[float, float]]:
    """Dashes that move with the road."""
    period = 24.0 * _SCALE
    offset = -((ego - BEHIND) * _SCALE - _LEFT) % period
    for number in range(math.floor((first - offset) / period), math.ceil((last - offset) / period)):
        begin = offset + number * period
        one, other = max(begin, first), min(begin + 0.4 * period, last)
        if one < other:
            yield one, other
