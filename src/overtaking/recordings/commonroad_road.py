"""The road of a CommonRoad scenario: which one is read, and the `Road` it becomes."""

import dataclasses
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import islice
from typing import Any, NamedTuple

import numpy as np

from overtaking.core.arrays import F64
from overtaking.core.errors import ConfigError, ImportFormatError
from overtaking.model.road import DrivingSide, Lane, Road, RoadMark
from overtaking.model.road_course import RoadCourse
from overtaking.recordings.commonroad_lanes import (
    DRIVING,
    Lanelet,
    Slice,
    Strip,
    borders,
    contains,
    stated_limit,
    strips,
)
from overtaking.recordings.countries import from_sign, is_speed_sign, number_on_sign
from overtaking.recordings.fitting import is_straight
from overtaking.recordings.limits import Stated, highest_and_lower
from overtaking.recordings.messages import refused
from overtaking.recordings.road import RoadShape, RoadShapeError, shape_of
from overtaking.recordings.xml import Element

UNKNOWN_LIMIT = 100.0
"""Stands where no limit is known [m/s]; no vehicle reaches it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """A stretch of road with the same lanes from its beginning to its end.

    Attributes:
        shape: Where it lies.
        road: The road of constant lanes that stands for it.
        unknown: What the file does not tell about it, names of `UNKNOWNS`.
        notes: Which lanelets it is made of, and how constant its lanes are.
    """

    shape: RoadShape
    road: Road
    unknown: frozenset[str]
    notes: dict[str, Any]

    @property
    def lanelets(self) -> frozenset[int]:
        """Ids of its lanelets."""
        return frozenset(one for lane in self.notes["lanelets_by_lane"] for one in lane)


@dataclass(frozen=True, slots=True, kw_only=True)
class Network:
    """The lanelets of a scenario, with their common attributes.

    Attributes:
        name: Name of the scenario.
        kind: OpenDRIVE's type of its roads, None if unknown.
        lanelets: By id.
        limits: Speed limits that signs post, by the id of the sign [m/s].
        rows: The slice of each lanelet that is a lane, by id.
    """

    name: str
    kind: str | None
    lanelets: Mapping[int, Lanelet]
    limits: Mapping[int, float]
    rows: Mapping[int, Slice]

    def stretch(self, home: Lanelet, *, is_part: bool) -> Stretch:
        """The longest and widest stretch of road past a lanelet.

        Args:
            home: The lanelet.
            is_part: Whether it must be part of a lane, and not only lie beside the road.

        Raises:
            ImportFormatError: The lanelet is no lane to drive on, or the road bends too sharply,
                its lanes change their width, or are too many.
        """
        if home.number not in self.rows:
            raise _refused(home, "kind of lanelet", "a lane to drive on", home.kind)
        found = strips(self.rows[home.number], self.rows)
        if is_part:
            found = (strip for strip in found if any(home in lane for lane in strip))
        # Lane length that runs through; of two that are equal the shorter chain, then the first.
        best = max(
            found,
            key=lambda strip: float(sum(one.length for lane in strip for one in lane)),
            default=None,
        )
        if best is None:
            raise _refused(home, "lanelets beside it", "2 m wide at both ends", "narrower ones")
        try:
            shape = shape_of(borders(best))
            road, unknown = _road(best, shape, self)
        except RoadShapeError as error:
            raise _refused(home, error.what, error.expected, error.got) from None
        except ConfigError as error:
            raise _refused(home, "road", "one that the model is made for", str(error)) from None
        notes = {
            "lanelets_by_lane": [[piece.number for piece in lane] for lane in best],
            "length_m": round(shape.length, 2),
            "line_pieces": len(shape.pieces),
            "line_off_m": round(shape.miss, 3),
            "turn_rad": round(shape.turn, 4),
            "widening": round(shape.widening, 4),
        }
        return Stretch(shape=shape, road=road, unknown=unknown, notes=notes)


def _refused(home: Lanelet, what: str, expected: str, got: str) -> Exception:
    return home.element.error(
        f"{home.number} is part of a road that cannot be read: {what}",
        expected,
        got,
        "choose another road by one of its lanelets",
    )


def _road(strip: Strip, shape: RoadShape, network: Network) -> tuple[Road, frozenset[str]]:
    """The road, and the names of its unknown attributes."""
    marks, marks_known = _marks(strip)
    stated = _stated(strip, shape, network)
    limit, lower = highest_and_lower(stated, shape.length) if stated else (None, ())
    line = () if is_straight(shape.pieces) else shape.pieces
    count, widths = len(strip), np.diff(shape.mean_borders)
    begin = shape.pieces[0]
    types = {kind for lane in strip for piece in lane for kind in piece.types}
    known_kind = "motorway" if types & {"highway", "interstate"} else network.kind
    road = Road(
        name=network.name,
        kind=known_kind or "unknown",
        driving_side=DrivingSide.RIGHT,
        lanes=tuple(
            Lane(
                lane_id=k - count,
                width=float(widths[k]),
                right_mark=marks[k],
                left_mark=marks[k + 1].reverse,
            )
            for k in range(count)
        ),
        kerb_edge_d=float(shape.mean_borders[0]),
        length=shape.length,
        x0=begin.x,
        y0=begin.y,
        heading=begin.heading,
        speed_limit=UNKNOWN_LIMIT if limit is None else limit,
        kerb_side_neighbour=_beside_right(strip[0], network.lanelets, -count - 1),
        overtaking_side_neighbour=_beside_left(strip[-1], network.lanelets),
        course=RoadCourse(segments=line, speed_limit_spans=lower) if line or lower else None,
    )
    missing = {"road_kind": not known_kind, "marks": not marks_known, "speed_limit": limit is None}
    return road, frozenset(what for what, is_missing in missing.items() if is_missing)


def _marks(strip: Strip) -> tuple[list[RoadMark], bool]:
    """The lines from right to left as the lane on their left sees them, and if all are known.

    A line that changes along the stretch, or that two lanelets see differently, is not known; at
    the outer edges the mark of the longest piece counts.
    """
    seen: list[Counter[RoadMark | None]] = [Counter() for _ in range(len(strip) + 1)]
    for k, lane in enumerate(strip):
        for piece in lane:
            left = piece.left_mark.reverse if piece.left_mark else None
            seen[k][piece.right_mark] += round(piece.length)
            seen[k + 1][left] += round(piece.length)
    inner = seen[1:-1]
    is_known = all(len(one) == 1 and None not in one for one in inner)
    is_known &= all(any(mark is not None for mark in one) for one in (seen[0], seen[-1]))
    longest = [max(one, key=lambda mark: (mark is not None, one[mark])) for one in seen]
    return [mark or RoadMark.NONE for mark in longest], is_known


def _stated(strip: Strip, shape: RoadShape, network: Network) -> list[Stated] | None:
    """The limits from lanelet to lanelet, if those beside each other have the same, and all one.

    Where the lanelets of oncoming traffic state none, that of the road is theirs.
    """
    found: list[Stated] = []
    for beside in zip(*strip, strict=True):
        limits = {_limit_of(one, network.limits) for one in beside}
        limit = limits.pop()
        if limits or limit is None:
            return None
        begin = np.array([beside[0].right[0], beside[-1].left[0]])
        start = float(shape.line.to_road(*begin.T)[0].mean())
        other = network.lanelets.get(beside[-1].oncoming_left or -1)
        against = other and _limit_of(other, network.limits)
        found.append((max(start, 0.0) if found else 0.0, limit, against or limit))
    return found


def _limit_of(one: Lanelet, posted: Mapping[int, float]) -> float | None:
    """The limit that a lanelet states or that its signs post [m/s]."""
    if one.speed_limit is not None:
        return one.speed_limit
    return min((posted[number] for number in one.signs if number in posted), default=None)


def posted_limit(sign: Element, unit: str) -> float | None:
    """The lowest speed limit that a traffic sign posts, None if it posts none [m/s].

    Args:
        sign: The `<trafficSign>`.
        unit: The unit on the speed signs of its country.

    Raises:
        ImportFormatError: The sign has no id, or its limit is no number.
    """
    limits: list[float | None] = []
    for element in sign.all("trafficSignElement"):
        code = element.required("trafficSignID").text
        if is_speed_sign(code):
            values = element.all("additionalValue")
            number = number_on_sign(code)
            if values:
                limits.append(stated_limit(values[0], unit))
            elif number is not None:
                limits.append(from_sign(number, unit))
    return min((limit for limit in limits if limit is not None), default=None)


def _beside_right(
    lane: tuple[Lanelet, ...], lanelets: Mapping[int, Lanelet], lane_id: int
) -> Lane | None:
    """A lane that runs beside the slow lane for a part of the way, such as an entry."""
    found = [lanelets.get(piece.right_neighbour or -1) for piece in lane]
    there = [one for one in found if one]
    return _neighbour(there[0], lane_id, direction=1) if there else None


def _beside_left(lane: tuple[Lanelet, ...], lanelets: Mapping[int, Lanelet]) -> Lane | None:
    """A lane beside the fast lane: one more of the same direction, or an oncoming one."""
    same = [lanelets.get(piece.left_neighbour or -1) for piece in lane]
    other = [lanelets.get(piece.oncoming_left or -1) for piece in lane]
    for found, direction in ((same, 1), (other, -1)):
        there = [one for one in found if one]
        if there:
            return _neighbour(there[0], 1, direction=direction)
    return None


def _neighbour(one: Lanelet, lane_id: int, *, direction: int) -> Lane:
    """A lanelet as a lane beside the driving lanes."""
    width = float(np.hypot(*(one.left.mean(axis=0) - one.right.mean(axis=0))))
    ends = one.kind == DRIVING and direction == 1  # Else it would be a lane of the road.
    return Lane(
        lane_id=lane_id,
        width=max(width, 0.1),
        kind="entry" if ends else one.kind,
        direction=direction,
        right_mark=one.right_mark or RoadMark.NONE,
        left_mark=one.left_mark or RoadMark.NONE,
    )


MAX_ROADS = 48
"""Roads that are tried, the busiest lanelets first."""

SINGLE_LANE = 0.1
"""Weight of traffic on a road with one lane, on which no overtake is possible."""

_MAX_NAMED = 3  # Other roads that are named.
_MAX_SAMPLE = 2_000  # Points that decide how busy lanelets are.


class _Option(NamedTuple):
    """A road that can be read.

    Attributes:
        lanelet: Id of its busiest lanelet.
        road: The road.
        share: Part of all recorded states that is on it.
    """

    lanelet: int
    road: Stretch
    share: float

    @property
    def weight(self) -> float:
        """What the busiest road has most of."""
        return self.share * (1.0 if self.road.road.num_lanes > 1 else SINGLE_LANE)

    def __str__(self) -> str:
        """The lanelet to choose the road by, and what is on it."""
        lanes = self.road.road.num_lanes
        words = "1 lane" if lanes == 1 else f"{lanes} lanes"
        return f"{self.lanelet} ({words}, {self.share:.0%} of the states)"


def chosen_road(network: Network, wanted: int | None, x: F64, y: F64) -> Stretch:
    """The road of a lanelet, or else the one with most traffic.

    A road that cannot be represented is passed over. The notes of the result name the others.

    Args:
        network: The lanelets.
        wanted: Id of the lanelet, None for the busiest road.
        x: Positions of all recorded states, shape (row,) [m].
        y: The same.

    Raises:
        ConfigError: There is no such lanelet.
        ImportFormatError: The road, or every road with traffic, cannot be represented.
    """
    options, refused = _options(network, x, y)
    if wanted is None:
        if not options:
            raise refused[0] if refused else _nobody(network)
        best = max(options, key=lambda one: one.weight).road
    else:
        best = _asked_for(network, wanted, options)
    others = _named(one for one in options if one.road.lanelets != best.lanelets)
    return dataclasses.replace(best, notes=best.notes | {"other_roads": others or None})


def _named(options: Iterable[_Option]) -> str:
    """Some roads, for a message."""
    return "; ".join(map(str, islice(options, _MAX_NAMED)))


def _asked_for(network: Network, wanted: int, options: list[_Option]) -> Stretch:
    """The road of one lanelet."""
    if wanted not in network.lanelets:
        known = f"one of {', '.join(map(str, sorted(network.lanelets)))}"
        raise ConfigError.unknown_choice(
            what=f"lanelet {wanted}", where="read_commonroad", choices=[known], got=wanted
        )
    try:
        return network.stretch(network.lanelets[wanted], is_part=True)
    except ImportFormatError as error:
        named = f", --lanelet {_named(options)}" if options else ""
        raise ImportFormatError(f"{error}{named}") from None


def _options(network: Network, x: F64, y: F64) -> tuple[list[_Option], list[ImportFormatError]]:
    """The roads with traffic, the busiest first, and why others cannot be read."""
    share = _shares(network.lanelets, x, y)
    options: list[_Option] = []
    refused: list[ImportFormatError] = []
    seen: set[int] = set()
    tries = 0
    for number in sorted(share, key=lambda number: (-share[number], number)):
        if number in seen or tries == MAX_ROADS:
            continue
        tries += 1
        try:
            road = network.stretch(network.lanelets[number], is_part=False)
        except ImportFormatError as error:
            refused.append(error)
            seen |= {other.number for other in network.rows[number]}
            continue
        own = {one: share[one] for one in road.lanelets - seen if one in share}
        if own:
            total = sum(share.get(one, 0.0) for one in road.lanelets)
            busiest = max(own, key=lambda one: (own[one], -one))
            options.append(_Option(busiest, road, total))
        # What lies beside a part of it, such as an entry, is no road of its own.
        seen |= {other.number for one in road.lanelets for other in network.rows[one]}
    return sorted(options, key=lambda one: (-one.share, one.lanelet)), refused


def _shares(lanelets: Mapping[int, Lanelet], x: F64, y: F64) -> dict[int, float]:
    """Part of all points that is in each lanelet that is a lane and has any."""
    some = slice(None, None, 1 + len(x) // _MAX_SAMPLE)
    x, y = x[some], y[some]
    found: dict[int, float] = {}
    for number, one in lanelets.items():
        (left, bottom), (right, top) = one.box
        near = (x >= left) & (x <= right) & (y >= bottom) & (y <= top)
        inside = contains(one, x[near], y[near]).sum() if one.is_lane and near.any() else 0
        if inside:
            found[number] = float(inside) / len(x)
    return found


def _nobody(network: Network) -> ImportFormatError:
    return refused(
        network.name, "vehicles", "some on its lanes", "none", "choose another recording"
    )
