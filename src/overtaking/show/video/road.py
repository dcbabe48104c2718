"""The road as a strip that is painted once and scrolls by."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

from overtaking.model.road import Road, RoadMark
from overtaking.show.video.canvas import WIDTH, Canvas, Drawing
from overtaking.show.video.palette import mixed, tinted
from overtaking.show.video.view import SCENE_BOTTOM, SCENE_TOP, Camera, shown_width

DASH, DASH_PERIOD = 4.0, 12.0
"""Length of a painted dash, and of dash and gap [m]; a choice, as maps do not tell."""

_DOT = 0.3  # Four dots to a period.
_LINE = 0.2  # Width of a painted line; of two lines beside each other, also the gap [m].
_POST_PERIODS = 5  # A post at the roadside after so many dashes.
_KERB = 0.35
_WHEEL_PATHS = (0.27, 0.73)  # Where wheels run, across a lane.

_SOLID_PARTS = {
    RoadMark.SOLID: ("solid",),
    RoadMark.BROKEN: ("broken",),
    RoadMark.SOLID_SOLID: ("solid", "solid"),
    RoadMark.SOLID_BROKEN: ("solid", "broken"),
    RoadMark.BROKEN_SOLID: ("broken", "solid"),
    RoadMark.BROKEN_BROKEN: ("broken", "broken"),
    RoadMark.BOTTS_DOTS: ("dots",),
    RoadMark.CURB: ("kerb",),
    RoadMark.OTHER: ("solid",),
}


class Tone(NamedTuple):
    """The light that the road lies in, and whether it is wet.

    Attributes:
        light: Factors for red, green and blue.
        wet: 0 dry to 1 under water.
    """

    light: tuple[float, float, float]
    wet: float


class Strip(NamedTuple):
    """The empty road, a little longer than a picture is wide.

    Attributes:
        canvas: The picture of it.
        period: Columns after which it repeats, even.
    """

    canvas: Canvas
    period: int


@lru_cache(maxsize=16)
def strip(road: Road, scale: float, middle_d: float, tone: Tone) -> Strip:
    """Paint a road.

    Args:
        road: The road.
        scale: [px/m].
        middle_d: `d` of the middle of the picture [m].
        tone: Its light.
    """
    dash = dash_period(scale)
    period = dash * _POST_PERIODS
    size = (WIDTH + period, SCENE_BOTTOM - SCENE_TOP)
    painter = _Painter(road=road, scale=scale, middle_d=middle_d, tone=tone, size=size, dash=dash)
    painter.ground()
    painter.lanes()
    painter.marks()
    painter.posts()
    canvas = Canvas(*size, "#000000")
    canvas.draw(painter.drawing)
    return Strip(canvas, period)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Painter:
    """Paints a strip, in pixels; the fields are those of `strip`, its size and a dash's period."""

    road: Road
    scale: float
    middle_d: float
    tone: Tone
    size: tuple[int, int]
    dash: int
    drawing: Drawing = field(default_factory=Drawing)

    def _y(self, d: float) -> float:
        return 0.5 * self.size[1] - (d - self.middle_d) * self.scale

    def _band(self, d: float, other: float) -> tuple[float, float]:
        one, two = self._y(d), self._y(other)
        return min(one, two), max(one, two)

    def _colour(self, dry: str, wet: str | None = None) -> str:
        return tinted(mixed(dry, wet or dry, self.tone.wet), self.tone.light)

    @property
    def _whole(self) -> tuple[float, float]:
        """All columns."""
        return -2.0, self.size[0] + 2.0

    def _fill(
        self, rows: tuple[float, float], dry: str, wet: str | None = None, opacity: float = 1.0
    ) -> None:
        """Paint some rows as far as the strip goes."""
        self.drawing.rect(self._whole, rows, self._colour(dry, wet), opacity=opacity)

    def ground(self) -> None:
        """Verges and paved surface."""
        low, high = shown_width(self.road)
        top, bottom, gravel = self._y(high), self._y(low), 0.35 * self.scale
        self._fill((-2.0, self.size[1] + 2.0), "#71885c", "#55694a")
        self._fill((top - gravel, bottom + gravel), "#a39c88", "#7c776a")
        self._fill((top, bottom), "#666b70", "#51565c")

    def lanes(self) -> None:
        """The lanes of both directions, a little darker where the wheels run."""
        borders = lane_borders(self.road)
        self._fill(self._band(float(borders[0]), float(borders[-1])), "#5c6166", "#454a50")
        for slow, fast in pairwise(borders):
            for share in _WHEEL_PATHS:
                d = float(slow + share * (fast - slow))
                self._fill(self._band(d - 0.3, d + 0.3), "#54595e", "#3d4248", 0.8)

    def marks(self) -> None:
        """The painted lines."""
        road = self.road
        for index, border in enumerate(road.lane_boundaries):
            if index == road.num_lanes and changes(road):
                continue  # Drawn for each frame, by `centre_line`.
            lane = road.lanes[max(index - 1, 0)]
            is_left = (index > 0) == (road.overtaking_sign > 0)
            mark = lane.left_mark if is_left else lane.right_mark
            for d, part in _parts(float(border), mark, is_left=is_left):
                self._line(d, part)
        if (beyond := road.overtaking_side_neighbour) is not None and road.is_two_way:
            mark = beyond.left_mark if road.overtaking_sign > 0 else beyond.right_mark
            for d, part in _parts(lane_borders(road)[-1], mark, is_left=road.overtaking_sign > 0):
                self._line(d, part)

    def _line(self, d: float, kind: str) -> None:
        if kind == "kerb":
            self._fill(self._band(d, d + _KERB), "#b9bcbd")
            return
        rows = self._band(d - 0.5 * _LINE, d + 0.5 * _LINE)
        for columns in self._stretches(kind):
            self.drawing.rect(columns, rows, self._colour("#f1f2ee", "#dfe2e3"))

    def _stretches(self, kind: str) -> Iterator[tuple[float, float]]:
        """The painted columns of a line."""
        yield from _painted(kind, self._whole, self.scale)

    def posts(self) -> None:
        """Posts beside the road, so that speed is seen where all dashes look the same."""
        low, high = shown_width(self.road)
        for first in range(0, self.size[0] + 1, self.dash * _POST_PERIODS):
            for d in (high + 0.85, low - 0.85):
                y = self._y(d)
                for x in (first, first - 0.01):
                    box = (x - 1.5, x + 2.5), (y - 2.0, y + 2.0)
                    self.drawing.rect(*box, self._colour("#eceeec"))


def _parts(border: float, mark: RoadMark, *, is_left: bool) -> Iterator[tuple[float, str]]:
    """Place across the road and kind of the lines of a mark on the left or right of a lane."""
    # Of two lines the first is nearer to the lane: nearer to its middle.
    inwards, parts = -1.0 if is_left else 1.0, _SOLID_PARTS.get(mark, ())
    middle = 0.5 * (len(parts) - 1)
    for place, part in enumerate(parts):
        yield border + inwards * (middle - place) * 2.0 * _LINE, part


def dash_period(scale: float) -> int:
    """Columns from one dash to the next, even."""
    return 2 * round(0.5 * DASH_PERIOD * scale)


def _painted(
    kind: str, columns: tuple[float, float], scale: float
) -> Iterator[tuple[float, float]]:
    """The painted columns of a line between two columns; a dash begins in column 0."""
    first, last = columns
    if kind == "solid":
        yield columns
        return
    dash = float(dash_period(scale))
    length, period = (DASH, dash) if kind == "broken" else (_DOT, 0.25 * dash)
    for number in range(math.floor(first / period), math.ceil(last / period)):
        begin = number * period
        yield max(begin, first), min(begin + length * scale, last)


def lane_borders(road: Road) -> list[float]:
    """`d` of the borders of all lanes, those of oncoming traffic too [m]."""
    borders, beyond = [float(one) for one in road.lane_boundaries], road.overtaking_side_neighbour
    if beyond is not None and road.is_two_way:
        borders.append(borders[-1] + road.overtaking_sign * beyond.width)
    return borders


def changes(road: Road) -> bool:
    """Whether the line on the fast side of the fastest lane changes along the road."""
    return len(road.overtaking_edge_marks) > 1


def centre_line(road: Road, camera: Camera, frame: int, tone: Tone) -> Drawing:
    """The line between the directions where it changes, in pixels of the picture of the road.

    Args:
        road: The road.
        camera: Where it is on the screen.
        frame: Number of the frame.
        tone: Its light.
    """
    drawing, left = Drawing(), int(camera.left[frame])
    begins, marks = zip(*road.overtaking_edge_marks, strict=True)
    border = float(road.lane_boundaries[-1])
    colour = tinted(mixed("#f1f2ee", "#dfe2e3", tone.wet), tone.light)
    for begin, end, mark in zip(begins, [*begins[1:], math.inf], marks, strict=True):
        columns = max(begin * camera.scale, left - 2.0), min(end * camera.scale, left + WIDTH + 2.0)
        if columns[0] >= columns[1]:
            continue
        for d, part in _parts(border, mark, is_left=road.overtaking_sign > 0):
            rows = camera.y(d + 0.5 * _LINE), camera.y(d - 0.5 * _LINE)
            for one, other in _painted(part, columns, camera.scale):
                if one < other:
                    drawing.rect((one - left, other - left), rows, colour)
    return drawing
