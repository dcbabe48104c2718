"""Lanes of an OpenDRIVE road: their order, width and marks, the same from its start to its end."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, NamedTuple

from overtaking.model.road import MAX_LANE_WIDTH, MAX_LANES, MIN_LANE_WIDTH, RoadMark
from overtaking.recordings.messages import shown
from overtaking.recordings.opendrive_shape import (
    TOLERANCE,
    check_constant,
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
    """A lane section: its element and the stations between which it holds [m]."""

    element: Element
    start: float
    end: float


class Strip(NamedTuple):
    """One lane of the file, its marks as seen from within it.

    Attributes:
        lane_id: Id in the file.
        kind: Lane type in the file.
        width: Width [m].
        inner_mark: Line towards the reference line, where the section starts.
        outer_mark: Line away from it, where the section starts.
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
        Section(section, start, min(end, length))
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


def _inner_mark(section: Section, lanes: Sequence[Element], index: int, side: Side) -> RoadMark:
    """The line between a lane and the one inside it, as seen from the lane.

    A lane's own element states the line on its outer side. The first word of a double line is the
    inner one; of the centre line, the left one.
    """
    if index > 0:
        return _mark(lanes[index - 1]).reversed
    centre = centre_lane(section.element)
    mark = RoadMark.NONE if centre is None else _mark(centre)
    return mark.reversed if side == "right" else mark


def strip(section: Section, lanes: Sequence[Element], index: int, side: Side) -> Strip:
    """One lane with its constant width; ImportFormatError if the width varies."""
    lane = lanes[index]
    return Strip(
        lane_id=lane.integer("id"),
        kind=lane.attribute("type"),
        width=_width(lane, section),
        inner_mark=_inner_mark(section, lanes, index, side),
        outer_mark=_mark(lane),
    )


def check_mark(lane: Element, section: Section) -> None:
    """Refuse a lane whose outer mark changes within the section."""
    first = _mark(lane)
    for entry in lane.all("roadMark"):
        station = section.start + entry.number("sOffset", default=0.0)
        if station < section.end - TOLERANCE and _named(entry) is not first:
            raise unfit(
                entry,
                f"of lane {lane.integer('id')} changes at s = {station:.1f} m",
                f"{first.value} along the whole road",
                _named(entry).value,
            )


def _mark(lane: Element) -> RoadMark:
    """The outer mark of a lane where the section starts."""
    entries = lane.all("roadMark")
    if entries and entries[0].number("sOffset", default=0.0) <= TOLERANCE:
        return _named(entries[0])
    return RoadMark.NONE


def _named(entry: Element) -> RoadMark:
    """The mark that an element names; whatever a file invents is `OTHER`."""
    return MARKS.get(entry.attribute("type"), RoadMark.OTHER)


def _width(lane: Element, section: Section) -> float:
    """The constant width of a lane [m]."""
    name = f"{lane.integer('id')}"
    entries = lane.all("width")
    if not entries or abs(entries[0].number("sOffset")) > TOLERANCE:
        raise unfit(
            lane,
            f"{name} has no width",
            "a <width> from sOffset = 0 on",
            "<border>" if lane.all("border") else "none",
        )
    pieces = profile(entries, origin=section.start, station="sOffset")
    check_constant(pieces, pieces[0].a, end=section.end, what=f"of lane {name} ")
    if pieces[0].a < 0.0:
        raise entries[0].error(f"of lane {name}", "a width of at least 0", f"{pieces[0].a:g} m")
    return pieces[0].a


DRIVING = "driving"


@dataclass(frozen=True, slots=True, kw_only=True)
class Carriageway:
    """The driving lanes of one direction, on one side of the reference line.

    Attributes:
        strips: Driving lanes, the innermost first.
        inner_edge: Distance of the innermost border from the reference line, outward positive [m].
        inner_neighbour: Lane beside the innermost driving lane, or None.
        outer_neighbour: Lane beside the outermost driving lane, or None.
        across: Whether the inner neighbour lies beyond the centre line, where traffic runs the
            other way.
    """

    strips: tuple[Strip, ...]
    inner_edge: float
    inner_neighbour: Strip | None
    outer_neighbour: Strip | None
    across: bool


def carriageway(road: Element, *, side: Side, length: float) -> Carriageway:
    """The driving lanes on one side of the reference line.

    Args:
        road: The `<road>`.
        side: "right" or "left" of the reference line.
        length: Length of the road [m].

    Raises:
        ImportFormatError: There are none, or they change along the road.
    """
    sections = lane_sections(road, length)
    pieces = profile(road.required("lanes").all("laneOffset"), origin=0.0)
    offset = pieces[0].a if pieces and pieces[0].start <= TOLERANCE else 0.0
    check_constant(pieces, offset, end=length)
    outward = -offset if side == "right" else offset
    first = _cross_section(sections[0], side, outward)
    for section in sections[1:]:
        _check_same(section, first, _cross_section(section, side, outward))
    return first


def driving_lanes(road: Element, *, side: Side, length: float) -> list[Element]:
    """Every element of a driving lane on one side, section after section."""
    return [
        lane
        for section in lane_sections(road, length)
        for lane in side_lanes(section.element, side)
        if lane.attribute("type") == DRIVING
    ]


def _cross_section(section: Section, side: Side, outward: float) -> Carriageway:
    """The driving lanes of one section and what lies beside them."""
    lanes = side_lanes(section.element, side)
    first, last = _driving_block(section, lanes, side)
    inside = [strip(section, lanes, index, side) for index in range(first)]
    strips = tuple(strip(section, lanes, index, side) for index in range(first, last + 1))
    for index in range(first, last + 1):
        _check_driving(lanes[index], strips[index - first].width)
        check_mark(lanes[index], section)
    border = lanes[first - 1] if first else centre_lane(section.element)
    if border is not None:
        check_mark(border, section)
    across = not any(lane.width > TOLERANCE for lane in inside)
    beside = range(first - 1, -1, -1)
    opposite = side_lanes(section.element, OTHER_SIDE[side])
    return Carriageway(
        strips=strips,
        inner_edge=outward + sum(lane.width for lane in inside),
        inner_neighbour=(
            _first_wide(section, opposite, range(len(opposite)), OTHER_SIDE[side])
            if across
            else _first_wide(section, lanes, beside, side)
        ),
        outer_neighbour=_first_wide(section, lanes, range(last + 1, len(lanes)), side),
        across=across,
    )


def _first_wide(
    section: Section, lanes: Sequence[Element], indices: range, side: Side
) -> Strip | None:
    """The first of some lanes with a width: files contain lanes of no width."""
    for index in indices:
        found = strip(section, lanes, index, side)
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


def _check_same(section: Section, first: Carriageway, here: Carriageway) -> None:
    """Refuse a section whose lanes are not those that the road began with."""
    beside = (
        (first.inner_neighbour, here.inner_neighbour),
        (first.outer_neighbour, here.outer_neighbour),
    )
    same = (
        len(first.strips) == len(here.strips)
        and abs(first.inner_edge - here.inner_edge) <= TOLERANCE
        and all(_alike(*pair) for pair in zip(first.strips, here.strips, strict=True))
        and all(_alike(_unmarked(before), _unmarked(after)) for before, after in beside)
    )
    if not same:
        raise unfit(
            section.element,
            f"changes the lanes at s = {section.start:.1f} m",
            _described(first),
            _described(here),
        )


def _alike(before: Strip | None, after: Strip | None) -> bool:
    """Whether two lanes agree in everything but the last millimetres of their width."""
    if before is None or after is None:
        return before is after
    same_width = abs(before.width - after.width) <= TOLERANCE
    return same_width and before._replace(width=0.0) == after._replace(width=0.0)


def _unmarked(lane: Strip | None) -> Strip | None:
    """A lane beside the road without its marks: no rule asks for the far one."""
    if lane is None:
        return None
    return lane._replace(inner_mark=RoadMark.NONE, outer_mark=RoadMark.NONE)


def _described(lanes: Carriageway) -> str:
    """A cross-section in one line, from the inside outward."""
    beside = (lanes.inner_neighbour, *lanes.strips, lanes.outer_neighbour)
    parts = (
        f"{lane.lane_id} {shown(lane.kind)} {lane.width:.2f} {lane.outer_mark.value}"
        for lane in beside
        if lane is not None
    )
    return f"from {lanes.inner_edge:.2f} m: {', '.join(parts)}"
