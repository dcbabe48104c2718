"""CommonRoad's lanelets: which of them, side by side and end to end, make one road."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from typing import Self

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F64
from overtaking.core.units import mps_from_kmh
from overtaking.model.road import MIN_LANE_WIDTH, RoadMark
from overtaking.recordings.countries import from_sign, limit_in_mps
from overtaking.recordings.limits import NO_LIMIT
from overtaking.recordings.xml import Element

MAX_POINTS = 20_000
"""Points of one border; the files that were tried have fewer than a hundred."""

MARKS = {
    "solid": RoadMark.SOLID,
    "broad_solid": RoadMark.SOLID,
    "dashed": RoadMark.BROKEN,
    "broad_dashed": RoadMark.BROKEN,
    "solid_solid": RoadMark.SOLID_SOLID,
    "dashed_dashed": RoadMark.BROKEN_BROKEN,
    "solid_dashed": RoadMark.SOLID_BROKEN,
    "dashed_solid": RoadMark.BROKEN_SOLID,
    "curb": RoadMark.CURB,
    "lowered_curb": RoadMark.CURB,
    "no_marking": RoadMark.NONE,
}
"""CommonRoad's line markings; any other, or none, is unknown."""

DRIVING = "driving"
_KINDS = {
    "shoulder": "shoulder",
    "border": "border",
    "sidewalk": "sidewalk",
    "crosswalk": "sidewalk",
    "bicycleLane": "biking",
    "busLane": "bus",
    "busStop": "bus",
    "parking": "parking",
    "accessRamp": "entry",
    "exitRamp": "exit",
}
"""CommonRoad's types of lanelets that are no lanes for all, as OpenDRIVE's types of lanes."""

_UNITS: dict[str, Callable[[float], float]] = {
    "km/h": mps_from_kmh,
    "kmh": mps_from_kmh,
    "mph": lambda number: from_sign(number, "mph"),
    "m/s": float,
}
"""Conversion to m/s from each unit that writers append to the number of a limit."""

_ROAD_KINDS = (DRIVING, "entry", "exit")  # What a road can be made of, each kind by itself.
_DRIVERS = frozenset({"vehicle", "car"})  # Users without whom a lanelet is no driving lane.

_MAX_CHAIN = 40  # Slices on either side of one that are looked at.
_MAX_GAP = 0.5  # How far the ends of lanelets that follow each other may lie apart [m].


@dataclass(frozen=True, slots=True, kw_only=True)
class Lanelet:
    """A piece of a lane.

    Attributes:
        number: Its id.
        element: Where it stands in the file, for messages.
        left: Border on its left, in its direction, shape (point, 2) [m].
        right: Border on its right, likewise.
        length: Length of its middle, roughly [m].
        narrowest: Distance between its borders at the narrower end [m].
        left_mark: Line on its left, None if unknown.
        right_mark: Line on its right, None if unknown.
        left_neighbour: Id of the lanelet on its left with the same direction, or None.
        right_neighbour: The same on its right.
        oncoming_left: Id of the lanelet on its left with the other direction, or None.
        oncoming_right: The same on its right.
        before: Ids of the lanelets that lead into it.
        after: Ids of those that it leads into.
        types: Its types.
        kind: OpenDRIVE's type of lane, from its types and users.
        signs: Ids of the traffic signs that apply to it.
        speed_limit: Limit that it states itself, None if it states none [m/s].
    """

    number: int
    element: Element
    left: F64
    right: F64
    length: float
    narrowest: float
    left_mark: RoadMark | None
    right_mark: RoadMark | None
    left_neighbour: int | None
    right_neighbour: int | None
    oncoming_left: int | None
    oncoming_right: int | None
    before: tuple[int, ...]
    after: tuple[int, ...]
    types: tuple[str, ...]
    kind: str
    signs: tuple[int, ...]
    speed_limit: float | None

    @property
    def is_lane(self) -> bool:
        """Whether it can be a lane of a road."""
        return self.kind in _ROAD_KINDS

    def moved(self, shift: F64) -> Self:
        """The lanelet in a world whose origin lies at `shift` [m]."""
        return replace(self, left=self.left - shift, right=self.right - shift)

    def mirrored(self) -> Self:
        """The lanelet in a world where left and right are swapped."""
        mirror = np.array([1.0, -1.0])
        return replace(
            self,
            left=self.right * mirror,
            right=self.left * mirror,
            left_mark=self.right_mark,
            right_mark=self.left_mark,
            left_neighbour=self.right_neighbour,
            right_neighbour=self.left_neighbour,
            oncoming_left=self.oncoming_right,
            oncoming_right=self.oncoming_left,
        )

    @property
    def box(self) -> tuple[F64, F64]:
        """The smallest and the largest x and y of its borders [m]."""
        points = np.concatenate([self.left, self.right])
        return points.min(axis=0), points.max(axis=0)


Slice = tuple[Lanelet, ...]
"""Lanelets beside each other with the same direction and kind, from right to left."""


def lanelet(element: Element, unit: str = "km/h") -> Lanelet:
    """A lanelet from its element.

    Args:
        element: The `<lanelet>`.
        unit: The unit on the speed signs of its country, "km/h" or "mph".

    Raises:
        ImportFormatError: Something is missing or no number; the message names line and element.
    """
    left, right = element.required("leftBound"), element.required("rightBound")
    sides = (_points(left), _points(right))
    stated = element.optional("speedLimit")
    types = tuple(one.text for one in element.all("laneletType"))
    return Lanelet(
        number=element.integer("id"),
        element=element,
        left=sides[0],
        right=sides[1],
        length=float(np.mean([np.hypot(*np.diff(side, axis=0).T).sum() for side in sides])),
        narrowest=min(float(np.hypot(*(sides[0][k] - sides[1][k]))) for k in (0, -1)),
        left_mark=_mark(left),
        right_mark=_mark(right),
        left_neighbour=_beside(element, "adjacentLeft", "same"),
        right_neighbour=_beside(element, "adjacentRight", "same"),
        oncoming_left=_beside(element, "adjacentLeft", "opposite"),
        oncoming_right=_beside(element, "adjacentRight", "opposite"),
        before=tuple(one.integer("ref") for one in element.all("predecessor")),
        after=tuple(one.integer("ref") for one in element.all("successor")),
        types=types,
        kind=_kind(element, types),
        signs=tuple(one.integer("ref") for one in element.all("trafficSignRef")),
        speed_limit=None if stated is None else stated_limit(stated, unit),
    )


def stated_limit(element: Element, unit: str) -> float | None:
    """A speed limit that an element states [m/s].

    Args:
        element: The element. The format prescribes m/s. Some writers append another unit, as in
            30kmh or 25mph. A number too large for a limit in m/s is taken as the number on the
            sign.
        unit: The unit on the speed signs of the country, "km/h" or "mph".

    Returns:
        The limit, `NO_LIMIT` for infinity; None for zero and negative numbers, which some writers
        use for an unknown limit.

    Raises:
        ImportFormatError: The text of the element is no number, or a limit above `NO_LIMIT`.
    """
    if element.text.lower() in ("inf", "infinity"):
        return NO_LIMIT
    text = element.text.strip().lower()
    stated_unit = next((name for name in _UNITS if text.endswith(name)), None)
    if stated_unit is None:
        limit = limit_in_mps(element.value(), unit)
    else:
        number = element.parse_number(text.removesuffix(stated_unit), what="text")
        limit = _UNITS[stated_unit](number)
    if limit > NO_LIMIT:
        raise element.error("is no speed limit", f"at most {NO_LIMIT:g} m/s", f"{limit:g} m/s")
    return limit if limit > 0.0 else None


def _kind(element: Element, types: tuple[str, ...]) -> str:
    """OpenDRIVE's type of lane."""
    users = {one.text for name in ("userOneWay", "userBidirectional") for one in element.all(name)}
    special = [_KINDS[one] for one in types if one in _KINDS]
    if special:
        return special[0]
    return DRIVING if not users or users & _DRIVERS else "restricted"


def _points(border: Element) -> F64:
    """The points of a border."""
    points = border.all("point")
    if not 2 <= len(points) <= MAX_POINTS:
        raise border.error("has a wrong number of points", f"2 to {MAX_POINTS}", str(len(points)))
    return np.array([[point.required(axis).value() for axis in ("x", "y")] for point in points])


def _mark(border: Element) -> RoadMark | None:
    given = border.optional("lineMarking")
    return MARKS.get(given.text) if given else None


def _beside(element: Element, name: str, direction: str) -> int | None:
    """Id of the neighbour of that name, if its traffic runs in that direction."""
    neighbour = element.optional(name)
    if neighbour is None or neighbour.attribute("drivingDir") != direction:
        return None
    return neighbour.integer("ref")


def slices(lanelets: Mapping[int, Lanelet]) -> list[Slice]:
    """The lanelets that a road can be made of, neighbours of the same kind together.

    Raises:
        ImportFormatError: A neighbour does not exist, or two do not name each other.
    """
    rightmost = [one for one in lanelets.values() if one.right_neighbour is None]
    found = [tuple(_leftwards(one, lanelets)) for one in rightmost]
    num_found = sum(len(row) for row in found)
    if num_found != len(lanelets):
        known = {one.number for row in found for one in row}
        odd = next(one for one in lanelets.values() if one.number not in known)
        raise _broken(odd, "no lanelet right of it begins a row of neighbours")
    alike = (groupby(row, key=lambda one: one.kind) for row in found)
    return [row for row in (tuple(some) for found in alike for _, some in found) if row[0].is_lane]


def _leftwards(one: Lanelet, lanelets: Mapping[int, Lanelet]) -> Iterator[Lanelet]:
    """A lanelet and all on its left."""
    while True:
        yield one
        if one.left_neighbour is None:
            return
        left = lanelets.get(one.left_neighbour)
        if left is None or left.right_neighbour != one.number:
            raise _broken(one, f"lanelet {one.left_neighbour} left of it, which does not name it")
        one = left


def _broken(one: Lanelet, got: str) -> Exception:
    return one.element.error("has neighbours that do not fit", "lanelets that name each other", got)


Lane = tuple[Lanelet, ...]
"""Lanelets that follow each other."""

Strip = tuple[Lane, ...]
"""Lanes beside each other, from right to left, with equally many lanelets."""


def strips(row: Slice, rows: Mapping[int, Slice]) -> Iterator[Strip]:
    """The stretches of road with lanes that run through beside each other and past a slice.

    A stretch is left out where a longer one has the same lanes. A lane runs through where each of
    its lanelets leads into exactly one, which no other leads into: where lanes part or meet, a
    stretch ends.

    Args:
        row: The slice.
        rows: The slice of each lanelet that is a lane, by id.
    """
    chain = [row]
    for forwards in (True, False):
        for _ in range(_MAX_CHAIN):
            following = _neighbour(chain[-1 if forwards else 0], rows, forwards=forwards)
            if following is None or following in chain:
                break
            chain.insert(len(chain) if forwards else 0, following)
    place = chain.index(row)
    for first in range(place + 1):
        found = _side_by_side([(one,) for one in chain[first] if one.narrowest >= MIN_LANE_WIDTH])
        for last, (here, there) in enumerate(pairwise(chain[first:]), start=first):
            longer = [_extended(strip, here, there) for strip in found]
            for strip, beyond in zip(found, longer, strict=True):
                if last >= place and [len(one) for one in beyond] != [len(strip)]:
                    yield strip
            found = [strip for beyond in longer for strip in beyond]
        yield from found


def _neighbour(row: Slice, rows: Mapping[int, Slice], *, forwards: bool) -> Slice | None:
    """The slice that most lanelets of a slice lead into, or come from."""
    linked = [number for one in row for number in (one.after if forwards else one.before)]
    known = [rows[number] for number in linked if number in rows]
    return max(known, key=known.count) if known else None


def _extended(strip: Strip, here: Slice, there: Slice) -> list[Strip]:
    """The lanes that run through into the next slice, side by side."""
    links = ((lane, _only_link(lane[-1], here, there)) for lane in strip)
    return _side_by_side([(*lane, ahead) for lane, ahead in links if ahead is not None])


def _side_by_side(lanes: Sequence[Lane]) -> list[Strip]:
    """The lanes, parted where the last lanelet of one is not the neighbour of the next."""
    parts = [
        k
        for k, (one, other) in enumerate(pairwise(lanes), start=1)
        if one[-1].left_neighbour != other[-1].number
    ]
    ends = [0, *parts, len(lanes)]
    return [tuple(lanes[first:last]) for first, last in pairwise(ends) if last > first]


def _only_link(one: Lanelet, here: Slice, there: Slice) -> Lanelet | None:
    """The lanelet that alone follows one, in the next slice, and follows nothing else."""
    targets = [other for other in there if other.number in one.after]
    if len(one.after) != 1 or len(targets) != 1 or targets[0].narrowest < MIN_LANE_WIDTH:
        return None
    sources = [other for other in here if targets[0].number in other.after]
    if len(sources) != 1 or len(set(targets[0].before) - {one.number}) > 0:
        return None
    apart = np.hypot(*(targets[0].left[0] - one.left[-1]))
    return targets[0] if apart <= _MAX_GAP else None


def borders(strip: Strip) -> list[F64]:
    """The borders of the lanes of a strip, from the right edge to the left edge.

    Where two lanelets give a border that they share, that of the left one is taken.
    """
    lines = [np.concatenate([piece.right for piece in lane]) for lane in strip]
    return [*lines, np.concatenate([piece.left for piece in strip[-1]])]


def contains(one: Lanelet, x: F64, y: F64) -> NDArray[np.bool_]:
    """Which points lie in a lanelet, by the parity of the edges to the right of each.

    Args:
        one: The lanelet.
        x: World positions, shape (point,) [m].
        y: The same.
    """
    ring = np.concatenate([one.left, one.right[::-1]])
    inside = np.zeros(len(x), np.bool_)
    for (ax, ay), (bx, by) in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        crosses = (ay > y) != (by > y)
        # A cross product and no slope: edges may be as short, or as flat, as a float64 can be.
        is_left = (x - ax) * (by - ay) < (y - ay) * (bx - ax)
        inside ^= crosses & (is_left == (by > ay))
    return inside
