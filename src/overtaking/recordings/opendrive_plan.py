"""The reference line of an OpenDRIVE road: lines, arcs, clothoids and cubics."""

import itertools
import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Sequence
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from overtaking.core.arrays import F64
from overtaking.model.reference_line import CurveSegment, ReferenceLine, segment_displacement
from overtaking.recordings.opendrive_shape import TOLERANCE, Cubic, geometries, unfit
from overtaking.recordings.xml import Element

MAX_GAP = 0.05
"""Gap between two pieces that still counts as a joint [m]."""
MAX_KINK = 0.01
"""Change of the heading between two pieces that still counts as a joint [rad]."""
MAX_CORNER = 0.1
"""Largest change of the heading between two pieces that is rounded; beyond it is an error [rad]."""
MAX_ROUNDING = 0.1
"""Largest distance of a rounded corner from its tip: as close as fitted lines of recordings [m]."""
MAX_MISFIT = 0.001
"""How far a clothoid may end beside the cubic that it stands for [m]."""
MAX_STRETCH = 0.002
"""Part by which the length of a piece may differ from what the file states."""
MAX_CURVATURE = 1.0
"""A sharper bend is no road [1/m]."""

_STEEPEST = 1.0
"""How fast the line may be moved aside, by way along it; lanes widen by a tenth of that."""

_FIRST_PARTS, _MOST_PARTS = 4, 4096


def plan(road: Element) -> ReferenceLine:
    """The reference line that a `<road>` states in its `<planView>`.

    Raises:
        ImportFormatError: As for `pieces`.
    """
    return ReferenceLine.from_segments(pieces(road))


def pieces(road: Element) -> list[CurveSegment]:
    """The pieces of the reference line that a `<road>` states in its `<planView>`.

    Raises:
        ImportFormatError: It has no piece or one of unknown shape, or its pieces do not join.
    """
    return [piece for chain, _ in _chains(road) for piece in chain]


def _chains(road: Element) -> list[tuple[list[CurveSegment], float]]:
    """The pieces of each `<geometry>`, and its length as the file states it [m]."""
    found = geometries(road)
    chains = [_pieces(geometry) for geometry in found]
    for before, after, geometry in zip(chains, chains[1:], found[1:], strict=False):
        check_joint(before[-1], after[0], geometry, max_kink=MAX_CORNER)
    _round_corners(chains)
    lengths = [geometry.number("length") for geometry in found]
    return list(zip(chains, lengths, strict=True))


def pieces_between(
    road: Element, start: float, end: float, inner: Sequence[Cubic]
) -> list[CurveSegment]:
    """A line along a road from one station to another, moved to the left of its reference line.

    Args:
        road: The `<road>`.
        start: Station where the line begins [m].
        end: Station where it ends [m].
        inner: How far to the left it is, by polynomials from one station to the next, the first
            from `start` on [m].

    Raises:
        ImportFormatError: As for `pieces`, or it bends too sharply for that.
    """
    found: list[CurveSegment] = []
    station = 0.0
    for chain, stated in _chains(road):
        # The chain of a cubic is a hair longer or shorter than the file says.
        scale = stated / sum(piece.length for piece in chain)
        for piece in chain:
            beyond = station + piece.length * scale
            first, last = max(station, start), min(beyond, end)
            if last - first > TOLERANCE:
                begin = 0.0 if first - station <= TOLERANCE else (first - station) / scale
                whole = beyond - last <= TOLERANCE
                stop = piece.length if whole else (last - station) / scale
                part = _cut(piece, begin, stop)
                found += _moved(part, station + begin * scale, scale, inner, road)
            station = beyond
    return found


def _round_corners(chains: list[list[CurveSegment]]) -> None:
    """Replace each corner between two chains of pieces by two arcs, one in each chain.

    Some exporters approximate bends by lines with corners between them; real roads have none.

    Args:
        chains: The pieces of each `<geometry>`, which are changed in place.
    """
    # A piece may have corners at both ends; each uses less than half of it.
    reach = [(0.45 * chain[0].length, 0.45 * chain[-1].length) for chain in chains]
    for index, (before, after) in enumerate(itertools.pairwise(chains)):
        kink = abs(_kink(before[-1], after[0]))
        if kink <= MAX_KINK:
            continue
        # An arc that is tangent to both lines t before the tip lies t tan(kink / 4) beside it.
        trimmed = min(reach[index][1], reach[index + 1][0], MAX_ROUNDING / math.tan(0.25 * kink))
        first = _cut(before[-1], 0.0, before[-1].length - trimmed)
        last = _cut(after[0], trimmed, after[0].length)
        begin = ReferenceLine.from_segments([first]).pose_at(first.length)
        arcs = _two_arcs((float(begin.x), float(begin.y), float(begin.heading)), last[:3])
        chains[index] = [*before[:-1], first, arcs[0]]
        chains[index + 1] = [arcs[1], last, *after[1:]]


Place = tuple[float, float, float]
"""World x, y [m] and heading [rad]."""


def _two_arcs(start: Place, end: Place) -> tuple[CurveSegment, CurveSegment]:
    """The two arcs from one place and direction to another whose tangents are equally long.

    Source: Bolton, Biarc curves, Computer-Aided Design 7 (1975).
    """
    start_direction, end_direction = (
        np.array([math.cos(place[2]), math.sin(place[2])]) for place in (start, end)
    )
    start_point, end_point = np.array(start[:2]), np.array(end[:2])
    chord_vector = end_point - start_point
    along = float(chord_vector @ (start_direction + end_direction))
    bend = 2.0 * (1.0 - float(start_direction @ end_direction))
    # The length d of the tangents solves bend d^2 + 2 along d = chord^2. This form of the root does
    # not divide by `bend`, which is nearly 0 for a small corner.
    square = float(chord_vector @ chord_vector)
    tangent = square / (along + math.sqrt(along * along + bend * square))
    joint = 0.5 * (start_point + tangent * start_direction + end_point - tangent * end_direction)
    first = _arc_to(start, joint)
    joint_heading = start[2] + first.curvature * first.length
    return first, _arc_to((float(joint[0]), float(joint[1]), joint_heading), end_point)


def _arc_to(start: Place, end: F64) -> CurveSegment:
    """The arc from a place and direction to a point."""
    east, north = float(end[0]) - start[0], float(end[1]) - start[1]
    chord_length = math.hypot(east, north)
    # The chord of an arc turns by half of the angle by which the arc turns.
    half_turn = math.remainder(math.atan2(north, east) - start[2], math.tau)
    curvature = 2.0 * math.sin(half_turn) / chord_length
    length = chord_length if half_turn == 0.0 else chord_length * half_turn / math.sin(half_turn)
    return CurveSegment(*start, length, curvature, curvature)


def _cut(piece: CurveSegment, start: float, end: float) -> CurveSegment:
    """The part of a piece between two ways along it [m]."""
    if start <= 0.0 and end >= piece.length:
        return piece
    ends = ReferenceLine.from_segments([piece]).pose_at([start, end])
    curvature = np.interp([start, end], [0.0, piece.length], piece[4:])
    x, y, heading = (float(one[0]) for one in (ends.x, ends.y, ends.heading))
    return CurveSegment(x, y, heading, end - start, float(curvature[0]), float(curvature[1]))


def _moved(
    piece: CurveSegment, station: float, scale: float, inner: Sequence[Cubic], element: Element
) -> Iterator[CurveSegment]:
    """A piece moved to the left.

    Args:
        piece: The piece.
        station: Station of its start [m].
        scale: Stations by way along it.
        inner: How far it is moved, by station, in order [m].
        element: The road, for messages.
    """
    # The cubics that hold on the piece: the last that begins before it, and those that begin on it.
    start_of = attrgetter("start")
    low = max(bisect_right(inner, station, key=start_of) - 1, 0)
    high = bisect_left(inner, station + piece.length * scale, key=start_of)
    on_piece = inner[low : max(high, low + 1)]
    begins = [(cubic.start - station) / scale for cubic in on_piece]
    for cubic, begin, stop in zip(on_piece, begins, [*begins[1:], math.inf], strict=True):
        first, last = max(begin, 0.0), min(stop, piece.length)
        if last - first > TOLERANCE or (first == 0.0 and last == piece.length):
            left = cubic.starting(station + first * scale)
            yield from _beside(_cut(piece, first, last), left, scale, element)


def _beside(piece: CurveSegment, left: Cubic, scale: float, element: Element) -> list[CurveSegment]:
    """The line to the left of a piece, by a distance that is a polynomial along it."""
    if (left.a, left.b, left.c, left.d) == (0.0, 0.0, 0.0, 0.0):
        return [piece]
    # By way along the piece, not by station.
    moved = Polynomial([left.a, left.b * scale, left.c * scale**2, left.d * scale**3])
    aside, more = moved.deriv(), moved.deriv().deriv()
    growth = (piece.end_curvature - piece.curvature) / piece.length
    line = ReferenceLine.from_segments([piece])

    def curve(p: F64) -> Curve:
        pose, d = line.pose_at(p), moved(p)
        # At its ends the line of one piece has no curvature.
        bend = piece.curvature + growth * p
        along, across = 1.0 - bend * d, aside(p)
        if not np.all(np.abs(along - 1.0) < 0.5):
            raise unfit(element, "bends", "lanes within half of the radius", "a sharper bend")
        if not np.all(np.abs(across) <= _STEEPEST):
            wanted = f"lanes that move aside by at most {_STEEPEST:g} m per metre"
            raise unfit(element, "widens", wanted, "more")
        square = along * along + across * across
        turn = (along * more(p) + across * (growth * d + bend * across)) / square
        speed = np.sqrt(square)
        heading = pose.heading + np.arctan2(across, along)
        x, y = pose.x - d * np.sin(pose.heading), pose.y + d * np.cos(pose.heading)
        return Curve(x, y, heading, (bend + turn) / speed, speed)

    if growth == 0.0 and not np.any(moved.coef[1:]):
        # Beside a straight line or an arc lies another.
        start = curve(np.zeros(1))
        speed, bend = float(start.speed[0]), float(start.curvature[0])
        x, y, heading = (float(one[0]) for one in start[:3])
        return [CurveSegment(x, y, heading, piece.length * speed, bend, bend)]
    return _followed(curve, piece.length, element)


def _pieces(geometry: Element) -> list[CurveSegment]:
    """One `<geometry>` as pieces of linear curvature."""
    shapes = [child for child in geometry.children if child.name in _SHAPES]
    if len(shapes) != 1:
        known = " or ".join(_SHAPES)
        raise unfit(geometry, "has no shape that is known", known, f"{len(shapes)} of them")
    length = geometry.number("length")
    x, y, heading = (geometry.number(name) for name in ("x", "y", "hdg"))
    chain = _SHAPES[shapes[0].name](CurveSegment(x, y, heading, length), shapes[0])
    sharpest = max(max(abs(one.curvature), abs(one.end_curvature)) for one in chain)
    if sharpest > MAX_CURVATURE:
        raise unfit(shapes[0], "bends", f"at most {MAX_CURVATURE:g} /m", f"{sharpest:g} /m")
    return chain


def _line(piece: CurveSegment, _: Element) -> list[CurveSegment]:
    return [piece]


def _arc(piece: CurveSegment, shape: Element) -> list[CurveSegment]:
    curvature = shape.number("curvature")
    return [piece._replace(curvature=curvature, end_curvature=curvature)]


def _spiral(piece: CurveSegment, shape: Element) -> list[CurveSegment]:
    first, last = shape.number("curvStart"), shape.number("curvEnd")
    return [piece._replace(curvature=first, end_curvature=last)]


class Curve(NamedTuple):
    """Points of a curve by a parameter; every array has the same shape.

    Attributes:
        x, y: World coordinates [m].
        heading: Direction [rad].
        curvature: Change of the heading [1/m].
        speed: Way by parameter.
    """

    x: F64
    y: F64
    heading: F64
    curvature: F64
    speed: F64


def _cubic(piece: CurveSegment, shape: Element) -> list[CurveSegment]:
    """As many clothoids in a chain as it takes to follow a parametric cubic."""
    ranges = {"arcLength": piece.length, "normalized": 1.0}
    name = shape.attribute("pRange", default="normalized")
    if name not in ranges:
        raise shape.error("attribute pRange", " or ".join(ranges), f'"{name}"')
    u = Polynomial([shape.number(f"{one}U") for one in "abcd"])
    v = Polynomial([shape.number(f"{one}V") for one in "abcd"])
    du, dv = u.deriv(), v.deriv()

    def curve(p: F64) -> Curve:
        speed = np.hypot(du(p), dv(p))
        bend = du(p) * dv.deriv()(p) - dv(p) * du.deriv()(p)
        if np.any(np.abs(bend) > MAX_CURVATURE * speed**3) or not np.all(speed > 0.0):
            wanted = f"at most {MAX_CURVATURE:g} /m"
            raise unfit(shape, "bends", wanted, "a sharper bend or a cusp")
        heading = piece.heading + np.unwrap(np.arctan2(dv(p), du(p)))
        return Curve(*_placed(piece, u(p), v(p)), heading, bend / speed**3, speed)

    chain = _followed(curve, ranges[name], shape)
    length = sum(one.length for one in chain)
    if abs(length - piece.length) > MAX_STRETCH * piece.length:
        raise shape.error(
            "does not fit its length", f"a way of {piece.length:g} m", f"{length:g} m"
        )
    return chain


def _cubic_by_abscissa(piece: CurveSegment, shape: Element) -> list[CurveSegment]:
    """A `<poly3>` of OpenDRIVE 1.4: the offset v to the left is a cubic of the abscissa u ahead."""
    left = Polynomial([shape.number(name) for name in "abcd"])
    slope, second = left.deriv(), left.deriv().deriv()
    nodes, weights = np.polynomial.legendre.leggauss(64)

    def length(end: float) -> float:
        """Length of the curve from u = 0 to an end [m]."""
        speed = np.hypot(1.0, slope(0.5 * end * (nodes + 1.0)))  # Of the curve as u grows [1].
        return 0.5 * end * float((weights * speed).sum())

    # The file states the length of the curve. The u of its end is found by bisection; it is at most
    # that length. 60 halvings reach the precision of float64.
    low, high = 0.0, piece.length
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if length(middle) < piece.length else (low, middle)

    def curve(p: F64) -> Curve:
        speed = np.hypot(1.0, slope(p))
        if np.any(np.abs(second(p)) > MAX_CURVATURE * speed**3):
            raise unfit(shape, "bends", f"at most {MAX_CURVATURE:g} /m", "a sharper bend")
        heading = piece.heading + np.arctan(slope(p))
        return Curve(*_placed(piece, p, left(p)), heading, second(p) / speed**3, speed)

    return _followed(curve, high, shape)


def _followed(curve: Callable[[F64], Curve], end: float, element: Element) -> list[CurveSegment]:
    """A chain of clothoids along a curve, none of which ends more than `MAX_MISFIT` beside it.

    Args:
        curve: The curve; its values of the parameter ascend from 0.
        end: The last one.
        element: What states it, for messages.
    """
    nodes, weights = np.polynomial.legendre.leggauss(8)
    parts = _FIRST_PARTS
    while parts <= _MOST_PARTS:
        p = np.linspace(0.0, end, parts + 1)
        at, half = curve(p), 0.5 * np.diff(p)[:, None]
        between = p[:-1, None] + half * (nodes + 1.0)
        speed = curve(between.ravel()).speed.reshape(between.shape)
        lengths = (speed * weights * half).sum(axis=1)
        rows = zip(at.x, at.y, at.heading, lengths, at.curvature, at.curvature[1:], strict=False)
        chain = [CurveSegment(*map(float, row)) for row in rows]
        first, last = at.curvature[:-1], at.curvature[1:]
        turns = lengths * np.maximum(np.abs(first), np.abs(last))
        if turns.max() <= 1.0:  # Of longer pieces the chord is not known, and they fit nothing.
            chord = segment_displacement(at.heading[:-1], first, (last - first) / lengths, lengths)
            misfit = np.hypot(at.x[:-1] + chord.x - at.x[1:], at.y[:-1] + chord.y - at.y[1:])
            if misfit.max() <= MAX_MISFIT:
                return chain
        parts *= 2
    raise unfit(element, "bends too often", f"{_MOST_PARTS} clothoids or fewer", "more")


def _placed(piece: CurveSegment, u: F64, v: F64) -> tuple[F64, F64]:
    """World coordinates of points given along and across the start of a piece [m]."""
    cosine, sine = math.cos(piece.heading), math.sin(piece.heading)
    return piece.x + u * cosine - v * sine, piece.y + u * sine + v * cosine


_SHAPES: dict[str, Callable[[CurveSegment, Element], list[CurveSegment]]] = {
    "line": _line,
    "arc": _arc,
    "spiral": _spiral,
    "paramPoly3": _cubic,
    "poly3": _cubic_by_abscissa,
}
"""How each shape is read, by its element."""


def check_joint(
    before: CurveSegment, after: CurveSegment, element: Element, *, max_kink: float = MAX_KINK
) -> None:
    """Refuse a piece that does not begin where the one before it ends.

    Args:
        before: The piece before it.
        after: The piece.
        element: Where it is stated, for messages.
        max_kink: Change of the heading that still counts as a joint [rad].
    """
    end = ReferenceLine.from_segments([before]).pose_at(before.length)
    gap = math.hypot(after.x - float(end.x), after.y - float(end.y))
    kink = abs(_kink(before, after))
    if gap > MAX_GAP or kink > max_kink:
        raise element.error(
            "does not join",
            f"at most {MAX_GAP:g} m and {max_kink:g} rad from the end of the piece before",
            f"{gap:.3f} m and {kink:.4f} rad",
        )


def _kink(before: CurveSegment, after: CurveSegment) -> float:
    """Change of the heading from the end of a piece to the start of the next one [rad]."""
    end = ReferenceLine.from_segments([before]).pose_at(before.length)
    return math.remainder(after.heading - float(end.heading), math.tau)
