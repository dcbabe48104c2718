"""The reference line of an OpenDRIVE road: lines, arcs, clothoids and parametric cubics."""

import math
from collections.abc import Callable

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from overtaking.model.line import Piece, ReferenceLine
from overtaking.recordings.opendrive_shape import unfit
from overtaking.recordings.xml import Element

F64 = NDArray[np.float64]

MAX_GAP = 0.05
"""Gap between two pieces that still counts as a joint [m]."""
MAX_KINK = 0.01
"""Change of the heading between two pieces that still counts as a joint [rad]."""
MAX_MISFIT = 0.001
"""How far a clothoid may end beside the cubic that it stands for [m]."""
MAX_STRETCH = 0.002
"""Part by which the length of a piece may differ from what the file states."""
MAX_CURVATURE = 1.0
"""A sharper bend is no road [1/m]."""

_FIRST_PARTS, _MOST_PARTS = 4, 4096


def plan(road: Element) -> ReferenceLine:
    """The reference line that a `<road>` states in its `<planView>`.

    Raises:
        ImportFormatError: As for `pieces`.
    """
    return ReferenceLine.of(pieces(road))


def pieces(road: Element) -> list[Piece]:
    """The pieces of the reference line that a `<road>` states in its `<planView>`.

    Raises:
        ImportFormatError: It has no piece or one of unknown shape, or its pieces do not join.
    """
    found = road.required("planView").all("geometry")
    if not found:
        raise road.error("has no geometry", "a <geometry> in <planView>", "none")
    chains = [_pieces(geometry) for geometry in found]
    for before, after, geometry in zip(chains, chains[1:], found[1:], strict=False):
        _check_joint(before[-1], after[0], geometry)
    return [piece for chain in chains for piece in chain]


def _pieces(geometry: Element) -> list[Piece]:
    """One `<geometry>` as pieces of linear curvature."""
    shapes = [child for child in geometry.children if child.name in _SHAPES]
    if len(shapes) != 1:
        known = " or ".join(_SHAPES)
        raise unfit(geometry, "has no shape that is known", known, f"{len(shapes)} of them")
    length = geometry.number("length")
    if not length > 0.0:
        raise geometry.error("attribute length", "more than 0 m", f"{length:g} m")
    x, y, heading = (geometry.number(name) for name in ("x", "y", "hdg"))
    chain = _SHAPES[shapes[0].name](Piece(x, y, heading, length), shapes[0])
    sharpest = max(max(abs(one.curvature), abs(one.end_curvature)) for one in chain)
    if sharpest > MAX_CURVATURE:
        raise unfit(shapes[0], "bends", f"at most {MAX_CURVATURE:g} /m", f"{sharpest:g} /m")
    return chain


def _line(piece: Piece, _: Element) -> list[Piece]:
    return [piece]


def _arc(piece: Piece, shape: Element) -> list[Piece]:
    curvature = shape.number("curvature")
    return [piece._replace(curvature=curvature, end_curvature=curvature)]


def _spiral(piece: Piece, shape: Element) -> list[Piece]:
    first, last = shape.number("curvStart"), shape.number("curvEnd")
    return [piece._replace(curvature=first, end_curvature=last)]


def _cubic(piece: Piece, shape: Element) -> list[Piece]:
    """As many clothoids in a chain as it takes to follow a parametric cubic."""
    ranges = {"arcLength": piece.length, "normalized": 1.0}
    name = shape.attribute("pRange", default="normalized")
    if name not in ranges:
        raise shape.error("attribute pRange", " or ".join(ranges), f'"{name}"')
    u = Polynomial([shape.number(f"{one}U") for one in "abcd"])
    v = Polynomial([shape.number(f"{one}V") for one in "abcd"])
    parts = _FIRST_PARTS
    while parts <= _MOST_PARTS:
        p = np.linspace(0.0, ranges[name], parts + 1)
        chain = _clothoids(piece, u, v, p, shape)
        if _misfit(chain, piece, u, v, p) <= MAX_MISFIT:
            length = sum(one.length for one in chain)
            if abs(length - piece.length) > MAX_STRETCH * piece.length:
                wanted = f"a way of {piece.length:g} m"
                raise shape.error("does not fit its length", wanted, f"{length:g} m")
            return chain
        parts *= 2
    raise unfit(shape, "bends too often", f"{_MOST_PARTS} clothoids or fewer", "more")


def _clothoids(piece: Piece, u: Polynomial, v: Polynomial, p: F64, shape: Element) -> list[Piece]:
    """A clothoid from each value of the parameter to the next."""
    du, dv = u.deriv(), v.deriv()
    speed = np.hypot(du(p), dv(p))
    bend = np.abs(du(p) * dv.deriv()(p) - dv(p) * du.deriv()(p))
    if np.any(bend > MAX_CURVATURE * speed**3) or not np.all(speed > 0.0):
        raise unfit(shape, "bends", f"at most {MAX_CURVATURE:g} /m", "a sharper bend or a cusp")
    curvature = (du(p) * dv.deriv()(p) - dv(p) * du.deriv()(p)) / speed**3
    nodes, weights = np.polynomial.legendre.leggauss(8)
    half = np.diff(p)[:, None] * 0.5
    at = p[:-1, None] + half * (nodes + 1.0)
    lengths = (np.hypot(du(at), dv(at)) * weights * half).sum(axis=1)
    heading = piece.heading + np.unwrap(np.arctan2(dv(p), du(p)))
    rows = zip(
        *_placed(piece, u(p), v(p)), heading, lengths, curvature, curvature[1:], strict=False
    )
    return [Piece(*map(float, row)) for row in rows]


def _misfit(chain: list[Piece], piece: Piece, u: Polynomial, v: Polynomial, p: F64) -> float:
    """How far a clothoid of a chain ends beside the cubic at most [m]."""
    ends = [ReferenceLine.of([one]).at(one.length) for one in chain]
    x, y = _placed(piece, u(p[1:]), v(p[1:]))
    return float(np.hypot([end.x for end in ends] - x, [end.y for end in ends] - y).max())


def _placed(piece: Piece, u: F64, v: F64) -> tuple[F64, F64]:
    """World coordinates of points given along and across the start of a piece [m]."""
    cosine, sine = math.cos(piece.heading), math.sin(piece.heading)
    return piece.x + u * cosine - v * sine, piece.y + u * sine + v * cosine


_SHAPES: dict[str, Callable[[Piece, Element], list[Piece]]] = {
    "line": _line,
    "arc": _arc,
    "spiral": _spiral,
    "paramPoly3": _cubic,
}
"""How each shape is read, by its element."""


def _check_joint(before: Piece, after: Piece, geometry: Element) -> None:
    """Refuse a piece that does not begin where the one before it ends."""
    end = ReferenceLine.of([before]).at(before.length)
    gap = math.hypot(after.x - float(end.x), after.y - float(end.y))
    kink = abs(math.remainder(after.heading - float(end.heading), math.tau))
    if gap > MAX_GAP or kink > MAX_KINK:
        raise geometry.error(
            "does not join",
            f"at most {MAX_GAP:g} m and {MAX_KINK:g} rad from the end of the piece before",
            f"{gap:.3f} m and {kink:.4f} rad",
        )
