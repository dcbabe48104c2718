"""The shape of an OpenDRIVE road: its reference line and grade, and what must be constant."""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from operator import itemgetter
from typing import Self

import numpy as np

from overtaking.core.errors import ImportFormatError
from overtaking.model.road_course import RoadCourse
from overtaking.recordings.xml import Element

TOLERANCE = 0.005
"""Half of the centimetre to which lane centres must be right [m]."""
MAX_CURVATURE = 1.0e-9
"""A smaller curvature moves the end of 3 km of road by less than `TOLERANCE` [1/m]."""
MIN_GEOMETRY_LENGTH = 0.001
"""Shorter geometries are skipped: they are below `TOLERANCE`, and their heading is noise [m]."""
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
    """A reference line: pose of its start and length.

    Attributes:
        x, y: Its start [m].
        heading: Direction there [rad].
        length: Its length [m].
        inner_edge: Distance of the innermost border of the driving lanes from it, outward [m].
        course: What changes along it; None where nothing does.
        origin: Position in the file of the point that x and y are counted from [m].
    """

    x: float
    y: float
    heading: float
    length: float
    inner_edge: float = 0.0
    course: RoadCourse | None = None
    origin: tuple[float, float] = (0.0, 0.0)


def geometries(road: Element) -> list[Element]:
    """The `<geometry>` elements of a road, except those shorter than `MIN_GEOMETRY_LENGTH`.

    Raises:
        ImportFormatError: No geometry is left, or a length is negative.
    """
    elements = road.required("planView").all("geometry")
    for geometry in elements:
        if geometry.number("length") < 0.0:
            length = geometry.attribute("length")
            raise geometry.error("attribute length", "0 m or more", f"{length} m")
    # Some exporters end each road with a geometry of length 0 and an arbitrary heading.
    geometries = [
        geometry for geometry in elements if geometry.number("length") > MIN_GEOMETRY_LENGTH
    ]
    if not geometries:
        raise road.error(
            "has no geometry", "a <geometry> with a length in <planView>", str(len(elements))
        )
    return geometries


def straight_line(road: Element, length: float) -> Alignment | None:
    """The reference line of a road if it is one straight line, else None.

    Args:
        road: The `<road>`.
        length: Length of the road [m].

    Raises:
        ImportFormatError: As for `geometries`.
    """
    pieces = geometries(road)
    first = pieces[0]
    heading = math.remainder(first.number("hdg"), math.tau)
    line = Alignment(x=first.number("x"), y=first.number("y"), heading=heading, length=length)
    covered = 0.0
    for piece in pieces:
        if not (_is_line(piece) and _continues(piece, line, covered)):
            return None
        covered = piece.number("s") + piece.number("length")
    return line if abs(covered - length) <= 2.0 * TOLERANCE else None


def _is_line(piece: Element) -> bool:
    """Whether a `<geometry>` does not bend."""
    shapes = [child for child in piece.children if child.name in _SHAPES]
    if len(shapes) != 1:
        return False
    names = _CURVATURES.get(shapes[0].name)
    if names is None:
        return shapes[0].name == "line"
    return all(abs(shapes[0].number(name)) <= MAX_CURVATURE for name in names)


def _continues(piece: Element, line: Alignment, covered: float) -> bool:
    """Whether a straight piece lies on a line and begins where the piece before it ends."""
    start, length = piece.number("s"), piece.number("length")
    east, north = piece.number("x") - line.x, piece.number("y") - line.y
    cosine, sine = math.cos(line.heading), math.sin(line.heading)
    turn = piece.number("hdg") - line.heading
    ahead, left = east * cosine + north * sine, north * cosine - east * sine
    aside = max(abs(left), abs(left + length * math.sin(turn)))
    apart = max(abs(start - covered), abs(ahead - start))
    return max(aside, apart) <= TOLERANCE and math.cos(turn) > 0.0


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


@dataclass(frozen=True, slots=True)
class Profile:
    """A value along the road, by polynomials each of which holds until the next one begins.

    Attributes:
        pieces: The polynomials, in the order of the road.
        starts: Station at which each begins [m].
    """

    pieces: tuple[Cubic, ...]
    starts: tuple[float, ...]

    @classmethod
    def of(cls, entries: Sequence[Element], *, origin: float = 0.0, station: str = "s") -> Self:
        """The profile that some elements state.

        Args:
            entries: The elements.
            origin: What their stations are counted from [m].
            station: Attribute with the station, `s` or `sOffset`; a missing one counts as 0.

        Raises:
            ImportFormatError: The stations do not ascend.
        """
        pieces = tuple(
            Cubic.of(entry, origin + entry.number(station, default=0.0)) for entry in entries
        )
        for before, after in pairwise(pieces):
            if after.start < before.start:
                raise out_of_order(after.element, station)
        return cls(pieces, tuple(piece.start for piece in pieces))

    def at(self, station: float) -> Cubic | None:
        """The polynomial that holds at a station, beginning there; None before the first."""
        index = bisect_right(self.starts, station + TOLERANCE) - 1
        return None if index < 0 else self.pieces[index].starting(station)

    def value(self, station: float) -> float:
        """The value at a station; the first polynomial also holds before its start."""
        index = max(bisect_right(self.starts, station) - 1, 0)
        return self.pieces[index].value(station - self.starts[index])

    def spans(self, start: float, end: float) -> list[tuple[Cubic, float]]:
        """The polynomials between two stations, each with the length on which it holds [m]."""
        first = max(bisect_right(self.starts, start) - 1, 0)
        last = bisect_left(self.starts, end)
        stops = [*self.starts[first + 1 : last], end]
        spans: list[tuple[Cubic, float]] = []
        for piece, stop in zip(self.pieces[first:last], stops, strict=False):
            begin = max(piece.start, start)
            if stop > begin:
                spans.append((piece.starting(begin), stop - begin))
        return spans


@dataclass(frozen=True, slots=True)
class Records:
    """Elements of one kind, each of which holds until the next one begins.

    Attributes:
        elements: The elements, in the order of their stations.
        starts: Station of each, 0 where it is missing [m].
    """

    elements: tuple[Element, ...]
    starts: tuple[float, ...]

    @classmethod
    def of(cls, entries: Sequence[Element], *, origin: float = 0.0, station: str = "s") -> Self:
        """The records of some elements, whose stations are counted from `origin` [m]."""
        ordered = sorted(
            ((origin + entry.number(station, default=0.0), entry) for entry in entries),
            key=itemgetter(0),
        )
        return cls(tuple(entry for _, entry in ordered), tuple(start for start, _ in ordered))

    def at(self, station: float) -> Element | None:
        """The element that holds at a station; None before the first."""
        index = bisect_right(self.starts, station + TOLERANCE) - 1
        return None if index < 0 else self.elements[index]


def out_of_order(element: Element, station: str) -> Exception:
    """The error for an element whose station is smaller than that of the element before it."""
    got = element.attribute(station, default="none")
    return element.error(f"attribute {station}", "ascending values", got)


def grade_of(road: Element, length: float) -> tuple[tuple[float, float], ...]:
    """Slope by station, of the mean over `_SLOPE_WINDOW`; empty where the road is flat.

    Raises:
        ImportFormatError: The surface has a step.
    """
    elevation = road.optional("elevationProfile")
    heights = Profile.of(elevation.all("elevation") if elevation is not None else [])
    spans = heights.spans(0.0, length)
    for (before, span), (after, _) in pairwise(spans):
        _check_small(after, "steps", abs(after.a - before.value(span)), MAX_STEP)
    if all(
        abs(slope) <= MAX_GRADE for piece, span in spans for slope in piece.slope.extremes(span)
    ):
        return ()

    stations = np.linspace(0.0, length, max(2, math.ceil(length / _SLOPE_WINDOW) + 1)).tolist()
    slopes = []
    for s in stations:
        low, high = max(0.0, s - 0.5 * _SLOPE_WINDOW), min(length, s + 0.5 * _SLOPE_WINDOW)
        rise = heights.value(high) - heights.value(low)
        slopes.append(round(rise / (high - low), _DIGITS))
    # Where a slope is that of its neighbours, nothing changes there.
    kept = [
        k
        for k in range(len(slopes))
        if k in (0, len(slopes) - 1) or not slopes[k - 1] == slopes[k] == slopes[k + 1]
    ]
    return tuple((stations[k], slopes[k]) for k in kept)


@dataclass(frozen=True, slots=True)
class Banking:
    """The lateral profile of a road.

    Attributes:
        rolls: Superelevation and crossfall [rad].
        shape: A `<shape>` that bends the surface, None where there is none.
    """

    rolls: tuple[Profile, ...] = ()
    shape: Element | None = None

    @classmethod
    def of(cls, road: Element) -> Self:
        """The banking that a `<road>` states."""
        lateral = road.optional("lateralProfile")
        if lateral is None:
            return cls()
        curved_shapes = (
            shape
            for shape in lateral.all("shape")
            if any(shape.number(name) != 0.0 for name in "abcd")
        )
        rolls = tuple(Profile.of(lateral.all(name)) for name in ("superelevation", "crossfall"))
        return cls(rolls, next(curved_shapes, None))

    @property
    def stations(self) -> list[float]:
        """Stations at which a record of the roll begins [m]."""
        return [station for roll in self.rolls for station in roll.starts]

    def check_flat(self, start: float, end: float) -> None:
        """Check that the surface is flat between two stations, except for the fall that drains it.

        Raises:
            ImportFormatError: The surface is banked by more than `MAX_BANKING`, or curved.
        """
        for roll in self.rolls:
            for piece, length in roll.spans(start, end):
                largest_roll = max(map(abs, piece.extremes(length)))
                _check_small(piece, "is banked", largest_roll, MAX_BANKING)
        if self.shape is not None:
            raise unfit(self.shape, "bends the surface", "a flat road", "a lateral shape")


def _check_small(piece: Cubic, what: str, size: float, most: float) -> None:
    if size > most:
        raise unfit(
            piece.element,
            f"{what} after s = {piece.start:.1f} m",
            f"a flat road, at most {most:g}",
            f"{size:.4f}",
        )
