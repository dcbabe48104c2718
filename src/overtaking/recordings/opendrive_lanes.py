"""Lanes of an OpenDRIVE road: one cross-section that holds from its start to its end."""

from collections.abc import Sequence
from dataclasses import dataclass

from overtaking.model.road import MAX_LANE_WIDTH, MAX_LANES, MIN_LANE_WIDTH, RoadMark
from overtaking.recordings.messages import shown
from overtaking.recordings.opendrive_shape import TOLERANCE, check_constant, profile, unfit
from overtaking.recordings.opendrive_strips import (
    OTHER_SIDE,
    Section,
    Side,
    Strip,
    centre_lane,
    check_mark,
    lane_sections,
    side_lanes,
    strip,
)
from overtaking.recordings.xml_element import Element

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
    offset = _lane_offset(road.required("lanes"), length)
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


def _lane_offset(lanes: Element, length: float) -> float:
    """The constant lane offset [m]; ImportFormatError if it varies."""
    pieces = profile(lanes.all("laneOffset"), origin=0.0)
    value = pieces[0].a if pieces and pieces[0].start <= TOLERANCE else 0.0
    check_constant(pieces, value, end=length)
    return value


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
