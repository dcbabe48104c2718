"""Lanes of an OpenDRIVE road: their order, width and marks, wherever one of them is stated anew."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, NamedTuple

from overtaking.model.road import MAX_LANE_WIDTH, MAX_LANES, MIN_LANE_WIDTH, RoadMark
from overtaking.recordings.messages import shown
from overtaking.recordings.opendrive_limits import kind_at, limit_at
from overtaking.recordings.opendrive_shape import (
    TOLERANCE,
    Cubic,
    Unfit,
    check_not_banked,
    in_force,
    out_of_order,
    profile,
    unfit,
)
from overtaking.recordings.xml import Element

Side = Literal["right", "left"]
"""Side of a file's reference line, looking along it."""

OTHER_SIDE: dict[Side, Side] = {"right": "left", "left": "right"}

MARKS = {
    "none": RoadMark.NONE,
    "solid": RoadMark.SOLID,
    "broken": RoadMark.BROKEN,
    "solid solid": RoadMark.SOLID_SOLID,
    "solid broken": RoadMark.SOLID_BROKEN,
    "broken solid": RoadMark.BROKEN_SOLID,
    "broken broken": RoadMark.BROKEN_BROKEN,
    "botts dots": RoadMark.BOTTS_DOTS,
    "curb": RoadMark.CURB,
    "grass": RoadMark.GRASS,
}
"""OpenDRIVE's road marks; any other is `OTHER`."""


class Section(NamedTuple):
    """A lane section, or a part of it.

    Attributes:
        element: The `<laneSection>`.
        start: Station where it begins [m].
        end: Station where it ends [m].
        origin: Station that its entries are counted from [m].
    """

    element: Element
    start: float
    end: float
    origin: float

    @property
    def length(self) -> float:
        """Its length [m]."""
        return self.end - self.start

    @property
    def ahead(self) -> float:
        """Where it begins, as its entries are counted [m]."""
        return self.start - self.origin


class Strip(NamedTuple):
    """One lane of the file, its marks as seen from within it.

    Attributes:
        lane_id: Id in the file.
        kind: Lane type in the file.
        width: Width, the least where it varies [m].
        inner_mark: Line towards the reference line.
        outer_mark: Line away from it.
    """

    lane_id: int
    kind: str
    width: float
    inner_mark: RoadMark
    outer_mark: RoadMark


def lane_sections(road: Element, length: float) -> list[Section]:
    """The lane sections of a road, in its order; ImportFormatError if there are none."""
    lanes = road.required("lanes")
    found = lanes.all("laneSection")
    starts = [section.number("s") for section in found]
    if not found or abs(starts[0]) > TOLERANCE:
        raise lanes.error(
            "is incomplete", "a <laneSection> from s = 0 on", f"{len(found)} sections"
        )
    for section, (start, after) in zip(found[1:], pairwise(starts), strict=True):
        if after < start:
            raise out_of_order(section, "s")
    ends = [*starts[1:], length]
    sections = [
        Section(section, start, min(end, length), start)
        for section, start, end in zip(found, starts, ends, strict=True)
        if min(end, length) > start
    ]
    if not sections:  # The road ends before they begin.
        raise road.error("attribute length", "more than 0 m", f"{length:g} m")
    return sections


def side_lanes(section: Element, side: Side) -> list[Element]:
    """The lanes on one side, from the reference line outward.

    Args:
        section: The `<laneSection>`.
        side: "right" or "left" of the reference line.

    Raises:
        ImportFormatError: Their ids are not -1, -2, ... or 1, 2, ...
    """
    group = section.optional(side)
    if group is None:
        return []
    sign = -1 if side == "right" else 1
    lanes = sorted(group.all("lane"), key=lambda lane: sign * lane.integer("id"))
    for number, lane in enumerate(lanes, start=1):
        if lane.integer("id") != sign * number:
            raise lane.error(
                "attribute id",
                f"ids {sign}, {2 * sign}, ... without gaps in <{side}>",
                lane.attribute("id"),
            )
    return lanes


def centre_lane(section: Element) -> Element | None:
    """The lane without width on the reference line, or None where the file leaves it out."""
    centre = section.optional("center")
    return centre.optional("lane") if centre is not None else None


DRIVING = "driving"


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """A stretch of road on which nothing is stated anew: one side of it, all along the same.

    Attributes:
        start: Station where it begins [m].
        end: Station where it ends [m].
        strips: Driving lanes, the innermost first.
        inner: Distance of the innermost border from the reference line, outward positive, from
            `start` on [m].
        inner_neighbour: Lane beside the innermost driving lane, or None.
        outer_neighbour: Lane beside the outermost driving lane, or None.
        across: Whether the inner neighbour lies beyond the centre line, where traffic runs the
            other way.
        kind: Type of the road.
        limit: Speed limit [m/s].
        limit_against: That of oncoming traffic, the same where none is beside [m/s].
    """

    start: float
    end: float
    strips: tuple[Strip, ...]
    inner: Cubic
    inner_neighbour: Strip | None
    outer_neighbour: Strip | None
    across: bool
    kind: str
    limit: float = 0.0
    limit_against: float = 0.0

    @property
    def is_two_way(self) -> bool:
        """Whether oncoming traffic has the lane beside the innermost one."""
        beyond = self.inner_neighbour
        return self.across and beyond is not None and beyond.kind == DRIVING

    def goes_on(self, other: "Cell") -> bool:
        """Whether lanes and type of another stretch are those of this one.

        The line between the directions and the limit may be others.
        """
        return (
            len(self.strips) == len(other.strips)
            and (self.across, self.kind) == (other.across, other.kind)
            and all(map(_alike, self._compared(), other._compared()))
            and _beside_alike(self.outer_neighbour, other.outer_neighbour)
            and _beside_alike(self.inner_neighbour, other.inner_neighbour)
        )

    def _compared(self) -> Iterator[Strip]:
        first, *rest = self.strips
        yield first._replace(inner_mark=RoadMark.NONE) if self.is_two_way else first
        yield from rest


def _alike(before: Strip, after: Strip) -> bool:
    """Whether two lanes agree in everything but the last millimetres of their width, and the id."""
    same_width = abs(before.width - after.width) <= TOLERANCE
    return same_width and before[1:2] + before[3:] == after[1:2] + after[3:]


def _beside_alike(before: Strip | None, after: Strip | None) -> bool:
    """The same of lanes beside: no rule asks for their far marks, nor how wide a shoulder is."""
    if before is None or after is None:
        return before is after
    same_width = abs(before.width - after.width) <= TOLERANCE or before.kind != DRIVING
    return before.kind == after.kind and same_width


def cells(
    road: Element, *, side: Side, length: float, speed_limit: float | None = None
) -> list[Cell | Unfit]:
    """The stretches of one side of a road, in its order, or why they do not fit.

    Args:
        road: The `<road>`.
        side: "right" or "left" of the reference line.
        length: Length of the road [m].
        speed_limit: Limit in place of the file's [m/s].

    Raises:
        ImportFormatError: The file is damaged.
    """
    offsets = profile(road.required("lanes").all("laneOffset"), origin=0.0)
    found: list[Cell | Unfit] = []
    for section in lane_sections(road, length):
        driving, beyond = (_driving(section.element, one) for one in (side, OTHER_SIDE[side]))
        for start, end in _between_entries(road, section):
            here = section._replace(start=start, end=end)
            try:
                check_not_banked(road, start, end)
                cell = _cell(here, side, kind=kind_at(road, start))
                limit = against = speed_limit or limit_at(road, driving, start, here.ahead)
                if cell.is_two_way and speed_limit is None:
                    against = limit_at(road, beyond, start, here.ahead)
                inner = _plus(cell.inner, _offset(offsets, start, side))
                found.append(replace(cell, inner=inner, limit=limit, limit_against=against))
            except Unfit as error:
                found.append(error)
    return found


def _between_entries(road: Element, section: Section) -> Iterator[tuple[float, float]]:
    """The stretches of a section between all places where something of the road is stated anew."""
    lateral = road.optional("lateralProfile")
    entries = [*road.required("lanes").all("laneOffset"), *road.all("type")]
    for name in ("superelevation", "crossfall"):
        entries += lateral.all(name) if lateral is not None else []
    stations = [entry.number("s") for entry in entries]
    groups = (section.element.optional(side) for side in ("left", "center", "right"))
    stations += [
        section.start + entry.number("sOffset", default=0.0)
        for group in groups
        if group is not None
        for lane in group.all("lane")
        for name in ("width", "roadMark", "speed")
        for entry in lane.all(name)
    ]
    cuts = [section.start]
    for station in sorted(stations):
        if cuts[-1] + TOLERANCE < station < section.end - TOLERANCE:
            cuts.append(station)
    return pairwise([*cuts, section.end])


def _offset(offsets: Sequence[Cubic], start: float, side: Side) -> Cubic | None:
    """The lane offset from a station on, outward positive; None where there is none."""
    begun = [one for one in offsets if one.start <= start + TOLERANCE]
    if not begun:
        return None
    sign, here = -1.0 if side == "right" else 1.0, begun[-1].starting(start)
    return replace(here, a=sign * here.a, b=sign * here.b, c=sign * here.c, d=sign * here.d)


def _plus(one: Cubic, other: Cubic | None) -> Cubic:
    """The sum of two polynomials that are counted from the same place."""
    if other is None:
        return one
    return replace(one, a=one.a + other.a, b=one.b + other.b, c=one.c + other.c, d=one.d + other.d)


def _cell(here: Section, side: Side, *, kind: str) -> Cell:
    """The driving lanes of a part of a section and what lies beside them, without limits yet."""
    lanes = side_lanes(here.element, side)
    first, last = _driving_block(here, lanes, side)
    inside = [_width(lane, here) for lane in lanes[:first]]
    inner = Cubic(element=here.element, start=here.start, a=0.0, b=0.0, c=0.0, d=0.0)
    for width in inside:
        inner = _plus(inner, width)
    strips = []
    for index in range(first, last + 1):
        width = _constant(_width(lanes[index], here), here, lanes[index])
        _check_driving(lanes[index], width)
        strips.append(_strip(here, lanes, index, side)._replace(width=width))
    across = not any(max(width.extremes(here.length)) > TOLERANCE for width in inside)
    opposite = side_lanes(here.element, OTHER_SIDE[side])
    outward = range(last + 1, len(lanes))
    return Cell(
        start=here.start,
        end=here.end,
        strips=tuple(strips),
        inner=inner,
        inner_neighbour=(
            _first_wide(here, opposite, range(len(opposite)), OTHER_SIDE[side])
            if across
            else _first_wide(here, lanes, range(first - 1, -1, -1), side)
        ),
        outer_neighbour=_first_wide(here, lanes, outward, side),
        across=across,
        kind=kind,
    )


def _strip(here: Section, lanes: Sequence[Element], index: int, side: Side) -> Strip:
    """One lane with its least width."""
    lane = lanes[index]
    return Strip(
        lane_id=lane.integer("id"),
        kind=lane.attribute("type"),
        width=min(_width(lane, here).extremes(here.length)),
        inner_mark=_inner_mark(here, lanes, index, side),
        outer_mark=_mark(lane, here.ahead),
    )


def _inner_mark(here: Section, lanes: Sequence[Element], index: int, side: Side) -> RoadMark:
    """The line between a lane and the one inside it, as seen from the lane.

    A lane's own element states the line on its outer side. The first word of a double line is the
    inner one; of the centre line, the left one.
    """
    ahead = here.ahead
    if index > 0:
        return _mark(lanes[index - 1], ahead).reversed
    centre = centre_lane(here.element)
    mark = RoadMark.NONE if centre is None else _mark(centre, ahead)
    return mark.reversed if side == "right" else mark


def _mark(lane: Element, ahead: float) -> RoadMark:
    """The outer mark of a lane some way after the beginning of its section [m]."""
    entry = in_force(lane.all("roadMark"), ahead, "sOffset")
    # Whatever a file invents is `OTHER`.
    return RoadMark.NONE if entry is None else MARKS.get(entry.attribute("type"), RoadMark.OTHER)


def _width(lane: Element, here: Section) -> Cubic:
    """The width of a lane from the beginning of a stretch on [m]."""
    name, entries = f"{lane.integer('id')}", lane.all("width")
    if not entries or abs(entries[0].number("sOffset")) > TOLERANCE:
        raise unfit(
            lane,
            f"{name} has no width",
            "a <width> from sOffset = 0 on",
            "<border>" if lane.all("border") else "none",
        )
    begun = [
        piece
        for piece in profile(entries, origin=here.origin, station="sOffset")
        if piece.start <= here.start + TOLERANCE
    ]
    width = begun[-1].starting(here.start)
    least = min(width.extremes(here.length))
    if least < -TOLERANCE:
        raise width.element.error(f"of lane {name}", "a width of at least 0", f"{least:g} m")
    return width


def _constant(width: Cubic, here: Section, lane: Element) -> float:
    """A width that stays the same [m]; ImportFormatError if it varies."""
    for found in width.extremes(here.length):
        if abs(found - width.a) > TOLERANCE:
            where = f"of lane {lane.integer('id')} varies after s = {here.start:.1f} m"
            raise unfit(width.element, where, f"a constant {width.a:.3f} m", f"{found:.3f} m")
    return width.a


def has_driving_lanes(road: Element, *, side: Side, length: float) -> bool:
    """Whether there is a driving lane on one side of a road anywhere."""
    return any(_driving(section.element, side) for section in lane_sections(road, length))


def _driving(section: Element, side: Side) -> list[Element]:
    """The driving lanes on one side, from the reference line outward."""
    return [lane for lane in side_lanes(section, side) if lane.attribute("type") == DRIVING]


def _first_wide(
    here: Section, lanes: Sequence[Element], indices: range, side: Side
) -> Strip | None:
    """The first of some lanes with a width all along: files contain lanes of no width."""
    for index in indices:
        found = _strip(here, lanes, index, side)
        if found.width > TOLERANCE:
            return found
    return None


def _driving_block(section: Section, lanes: Sequence[Element], side: Side) -> tuple[int, int]:
    """First and last position of the driving lanes; ImportFormatError unless they are adjacent."""
    block = [index for index, lane in enumerate(lanes) if lane.attribute("type") == DRIVING]
    where = f"at s = {section.start:.1f} m"
    if not 1 <= len(block) <= MAX_LANES:
        raise unfit(
            section.element,
            f"{where}, {side} side",
            f"1 to {MAX_LANES} driving lanes",
            str(len(block)),
        )
    if block[-1] - block[0] >= len(block):
        between = next(lane for lane in lanes[block[0] :] if lane.attribute("type") != DRIVING)
        raise unfit(
            between,
            f"{between.attribute('id')} {where}",
            "driving lanes side by side",
            f'"{shown(between.attribute("type"))}" between two of them',
        )
    return block[0], block[-1]


def _check_driving(lane: Element, width: float) -> None:
    """Refuse a driving lane that no road of ours can have."""
    name = lane.attribute("id")
    if not MIN_LANE_WIDTH <= width <= MAX_LANE_WIDTH:
        raise unfit(
            lane,
            f"{name} has a width",
            f"{MIN_LANE_WIDTH:g} to {MAX_LANE_WIDTH:g} m",
            f"{width:.3f} m",
        )
    direction = lane.attribute("direction", default="standard")
    if direction != "standard":
        raise unfit(lane, f"{name} has a direction", '"standard"', f'"{shown(direction)}"')
