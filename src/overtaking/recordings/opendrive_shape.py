"""The shape of an OpenDRIVE road: its reference line and grade, and what must be constant."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np

from overtaking.core.errors import ImportFormatError
from overtaking.model.course import Course
from overtaking.recordings.xml import Element

TOLERANCE = 0.005
"""Half of the centimetre to which lane centres must be right [m]."""
MAX_CURVATURE = 1.0e-9
"""A smaller curvature moves the end of 3 km of road by less than `TOLERANCE` [1/m]."""
MAX_GRADE = 0.01
"""Slope that still counts as flat: its share of gravity is below 0.1 m/s^2 [1]."""
MAX_STEP = 0.01
"""Step between two pieces of the surface that still counts as a joint [m]."""
MAX_BANKING = 0.03
"""Roll that still counts as flat: carriageways fall 2 to 2.5 % sideways to drain [rad]."""

_SLOPE_WINDOW = 5.0  # Way over which a slope is a mean [m]; crests are ten times as long.

_DIGITS = 9  # To which slopes are kept: they are quotients of heights in millimetres.

_SHAPES = ("line", "arc", "spiral", "poly3", "paramPoly3")
_CURVATURES = {"arc": ("curvature",), "spiral": ("curvStart", "curvEnd")}


class Unfit(ImportFormatError):
    """What a file may hold and the model does not; other errors are of files that are damaged."""


def unfit(
    element: Element, what: str, expected: str, got: str, next_step: str = "choose another road"
) -> Unfit:
    """The error for what a file may hold and the model does not.

    Args:
        element: Where it stands.
        what: The part that does not fit.
        expected: What would fit.
        got: The value found.
        next_step: What can be done.
    """
    return Unfit(str(element.error(what, expected, got, next_step)))


@dataclass(frozen=True, slots=True)
class Alignment:
    """A reference line: pose of its start and length, in the file's frame.

    Attributes:
        x, y: Its start [m].
        heading: Direction there [rad].
        length: Its length [m].
        inner_edge: Distance of the innermost border of the driving lanes from it, outward [m].
        course: What changes along it; None where nothing does.
    """

    x: float
    y: float
    heading: float
    length: float
    inner_edge: float = 0.0
    course: Course | None = None


def is_straight(road: Element) -> bool:
    """Whether no piece of the reference line bends."""
    return not any(
        child.name in _SHAPES and not _is_line(child)
        for piece in road.required("planView").all("geometry")
        for child in piece.children
    )


def _is_line(shape: Element) -> bool:
    names = _CURVATURES.get(shape.name)
    if names is None:
        return shape.name == "line"
    return all(abs(shape.number(name)) <= MAX_CURVATURE for name in names)


def straight_line(road: Element, length: float) -> Alignment:
    """The reference line of a road; ImportFormatError where it is not one straight line."""
    pieces = road.required("planView").all("geometry")
    if not pieces:
        raise road.error("has no geometry", "a <geometry> in <planView>", "none")
    first = pieces[0]
    heading = math.remainder(first.number("hdg"), math.tau)
    line = Alignment(x=first.number("x"), y=first.number("y"), heading=heading, length=length)
    covered = 0.0
    for piece in pieces:
        _check_straight(piece)
        covered = _check_joint(piece, line, covered)
    if abs(covered - length) > 2.0 * TOLERANCE:
        raise pieces[-1].error(
            "does not end with the road", f"an end at s = {length:.3f} m", f"{covered:.3f} m"
        )
    return line


def _check_straight(piece: Element) -> None:
    """Refuse a piece of the reference line that bends."""
    found = [child for child in piece.children if child.name in _SHAPES]
    shape = found[0].name if len(found) == 1 else f"{len(found)} shapes"
    if len(found) != 1 or not _is_line(found[0]):
        raise unfit(piece, f"is curved at s = {piece.number('s'):.1f} m", "a straight line", shape)


def _check_joint(piece: Element, line: Alignment, covered: float) -> float:
    """Refuse a piece that does not go on along the line; the station of its end [m]."""
    start, length, heading = piece.number("s"), piece.number("length"), piece.number("hdg")
    east, north = piece.number("x") - line.x, piece.number("y") - line.y
    cosine, sine = math.cos(line.heading), math.sin(line.heading)
    turn = heading - line.heading
    ahead, left = east * cosine + north * sine, north * cosine - east * sine
    bent = max(abs(left), abs(left + length * math.sin(turn)))
    if length < 0.0 or abs(start - covered) > TOLERANCE or abs(ahead - start) > TOLERANCE:
        raise piece.error(
            "does not join",
            f"a start at s = {covered:.3f} m on the reference line",
            f"s = {start:.3f} m, {ahead:.3f} m along the line",
        )
    if bent > TOLERANCE or math.cos(turn) < 0.0:
        raise unfit(
            piece, f"bends at s = {start:.1f} m", "a straight line", f"{bent:.3f} m beside it"
        )
    return start + length


@dataclass(frozen=True, slots=True, kw_only=True)
class Cubic:
    """One piece `a + b x + c x^2 + d x^3` of a profile along the road, x counted from `start`."""

    element: Element
    start: float
    a: float
    b: float
    c: float
    d: float

    @classmethod
    def of(cls, element: Element, start: float) -> Self:
        """The piece that an element states."""
        a, b, c, d = (element.number(name) for name in "abcd")
        return cls(element=element, start=start, a=a, b=b, c=c, d=d)

    def starting(self, start: float) -> Self:
        """The same polynomial, counted from another place [m]."""
        x = start - self.start
        b, c = self.slope.value(x), self.c + 3.0 * self.d * x
        return replace(self, start=start, a=self.value(x), b=b, c=c)

    @property
    def slope(self) -> Self:
        """Its derivative."""
        return replace(self, a=self.b, b=2.0 * self.c, c=3.0 * self.d, d=0.0)

    def value(self, x: float) -> float:
        """Height of the polynomial, `x` after its start."""
        return self.a + x * (self.b + x * (self.c + x * self.d))

    def extremes(self, length: float) -> list[float]:
        """Values at both ends of a length, and where the polynomial turns between them."""
        turns = _roots(self.b, 2.0 * self.c, 3.0 * self.d, length)
        return [self.value(x) for x in sorted({0.0, length, *turns})]


def _roots(constant: float, linear: float, square: float, length: float) -> list[float]:
    """Roots of a quadratic that lie between 0 and `length`."""
    discriminant = linear * linear - 4.0 * square * constant
    if discriminant < 0.0:
        return []
    # The form that loses no digits where the linear term dominates.
    half = -0.5 * (linear + math.copysign(math.sqrt(discriminant), linear))
    found = [half / square] if square != 0.0 else []
    found += [constant / half] if half != 0.0 else []
    return [root for root in found if 0.0 < root < length]


def profile(entries: Sequence[Element], *, origin: float, station: str = "s") -> tuple[Cubic, ...]:
    """The pieces of a profile, in the order of the road.

    Args:
        entries: The elements that state them.
        origin: What their stations are counted from [m].
        station: Attribute with the station: `s` or `sOffset`.

    Raises:
        ImportFormatError: They are not in ascending order.
    """
    pieces = tuple(Cubic.of(entry, origin + entry.number(station)) for entry in entries)
    for before, after in pairwise(pieces):
        if after.start < before.start:
            raise out_of_order(after.element, station)
    return pieces


def out_of_order(element: Element, station: str) -> Exception:
    """The error for an entry that starts before the one that stands above it."""
    return element.error(f"attribute {station}", "ascending values", element.attribute(station))


def in_force(entries: Sequence[Element], station: float, name: str = "s") -> Element | None:
    """The last of some entries that begin at a station or before it; None if none does.

    Args:
        entries: The elements, in the order of the road.
        station: The station [m].
        name: Attribute with the station of each, 0 where it is missing.
    """
    begun = [one for one in entries if one.number(name, default=0.0) <= station + TOLERANCE]
    return begun[-1] if begun else None


def spans(pieces: Sequence[Cubic], end: float) -> list[tuple[Cubic, float]]:
    """Each piece with the length over which it holds, until the next one or `end` [m]."""
    ends = [*(min(piece.start, end) for piece in pieces[1:]), end]
    return [
        (piece, until - piece.start)
        for piece, until in zip(pieces, ends, strict=False)  # No pieces: one end is left.
        if until > piece.start
    ]


def grade_of(road: Element, length: float) -> tuple[tuple[float, float], ...]:
    """Slope by station, of the mean over `_SLOPE_WINDOW`; empty where the road is flat.

    Raises:
        ImportFormatError: The surface has a step.
    """
    elevation = road.optional("elevationProfile")
    heights = profile(elevation.all("elevation") if elevation is not None else [], origin=0.0)
    found = spans(heights, length)
    for (before, span), (after, _) in pairwise(found):
        _check_small(after, "steps", abs(after.a - before.value(span)), MAX_STEP)
    if all(abs(one) <= MAX_GRADE for piece, span in found for one in piece.slope.extremes(span)):
        return ()

    def height(s: float) -> float:
        piece = next((one for one in reversed(heights) if one.start <= s), heights[0])
        return piece.value(s - piece.start)

    stations = np.linspace(0.0, length, max(2, math.ceil(length / _SLOPE_WINDOW) + 1)).tolist()
    slopes = []
    for s in stations:
        low, high = max(0.0, s - 0.5 * _SLOPE_WINDOW), min(length, s + 0.5 * _SLOPE_WINDOW)
        slopes.append(round((height(high) - height(low)) / (high - low), _DIGITS))
    # Where a slope is that of its neighbours, nothing changes there.
    kept = [
        k
        for k in range(len(slopes))
        if k in (0, len(slopes) - 1) or not slopes[k - 1] == slopes[k] == slopes[k + 1]
    ]
    return tuple((stations[k], slopes[k]) for k in kept)


def check_not_banked(road: Element, start: float, end: float) -> None:
    """Refuse a surface that leans more than it must to drain, or is bent, between two stations."""
    lateral = road.optional("lateralProfile")
    if lateral is None:
        return
    for name in ("superelevation", "crossfall"):
        for piece, span in spans(profile(lateral.all(name), origin=0.0), end):
            if piece.start + span > start:
                here = piece.starting(max(piece.start, start))
                lean = max(map(abs, here.extremes(piece.start + span - here.start)))
                _check_small(piece, "is banked", lean, MAX_BANKING)
    for shape in lateral.all("shape"):
        if any(shape.number(name) != 0.0 for name in "abcd"):
            raise unfit(shape, "bends the surface", "a flat road", "a lateral shape")


def _check_small(piece: Cubic, what: str, size: float, most: float) -> None:
    if size > most:
        raise unfit(
            piece.element,
            f"{what} after s = {piece.start:.1f} m",
            f"a flat road, at most {most:g}",
            f"{size:.4f}",
        )
