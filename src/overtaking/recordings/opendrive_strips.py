"""Single lanes of an OpenDRIVE lane section: their order, width and marks."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Literal, NamedTuple

from overtaking.model.road import RoadMark
from overtaking.recordings.opendrive_shape import (
    TOLERANCE,
    check_constant,
    out_of_order,
    profile,
    unfit,
)
from overtaking.recordings.xml_element import Element

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
    return [
        Section(section, start, min(end, length))
        for section, start, end in zip(found, starts, ends, strict=True)
        if min(end, length) > start
    ]


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
