"""Lanes of an OpenDRIVE road: their order, width and marks, wherever one of them is stated anew."""

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, NamedTuple, Self

from overtaking.model.road import (
    MAX_LANE_WIDTH,
    MAX_LANES,
    MIN_LANE_WIDTH,
    DrivingSide,
    RoadMark,
)
from overtaking.recordings.countries import keeps_left
from overtaking.recordings.messages import shown
from overtaking.recordings.opendrive_limits import kind_at, limit_at
from overtaking.recordings.opendrive_shape import (
    TOLERANCE,
    Banking,
    Cubic,
    Profile,
    Records,
    Unfit,
    out_of_order,
    unfit,
)
from overtaking.recordings.xml import Element

Side = Literal["right", "left"]
"""Side of a file's reference line, looking along it."""

Direction = Literal["along", "against", "both", "unstated"]
"""Direction of traffic relative to the reference line; "unstated" where only the side of the lane
implies it."""

SIDES: tuple[Side, Side] = ("right", "left")

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


DRIVING = "driving"


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneRecords:
    """A lane of a lane section, with its records by station of the road.

    Attributes:
        element: The `<lane>`.
        lane_id: Its id.
        kind: Its type.
        direction: Direction of its traffic, if the file states it for the lane itself.
        widths: Its width [m].
        marks: Its `<roadMark>` elements.
        speeds: Its `<speed>` elements.
    """

    element: Element
    lane_id: int
    kind: str
    direction: Direction
    widths: Profile
    marks: Records
    speeds: Records

    @classmethod
    def of(cls, element: Element, origin: float, direction: Direction = "unstated") -> Self:
        """The records of a `<lane>` whose section begins at `origin` [m]."""
        marks, speeds = (
            Records.of(element.all(name), origin=origin, station="sOffset")
            for name in ("roadMark", "speed")
        )
        return cls(
            element=element,
            lane_id=element.integer("id"),
            kind=element.attribute("type", default=""),
            direction=direction,
            widths=Profile.of(element.all("width"), origin=origin, station="sOffset"),
            marks=marks,
            speeds=speeds,
        )

    @property
    def stations(self) -> Iterator[float]:
        """Stations at which a record of the lane begins [m]."""
        yield from self.widths.starts
        yield from self.marks.starts
        yield from self.speeds.starts

    def mark_at(self, station: float) -> RoadMark:
        """The line on the outer side of the lane."""
        entry = self.marks.at(station)
        # Types of marks that OpenDRIVE does not define are `OTHER`.
        return (
            RoadMark.NONE if entry is None else MARKS.get(entry.attribute("type"), RoadMark.OTHER)
        )

    def width_from(self, start: float, end: float) -> Cubic:
        """The width between two stations, counted from the first [m].

        Raises:
            ImportFormatError: The file states no width there, or a negative one.
        """
        width = self.widths.at(start)
        if width is None:
            raise unfit(
                self.element,
                f"{self.lane_id} has no width",
                "a <width> from sOffset = 0 on",
                "<border>" if self.element.all("border") else "none",
            )
        least = min(width.extremes(end - start))
        if least < -TOLERANCE:
            expected = "a width of at least 0"
            raise width.element.error(f"of lane {self.lane_id}", expected, f"{least:g} m")
        return width

    def has_width(self, start: float, end: float) -> bool:
        """Whether the lane has a width somewhere between two stations.

        A lane without records of a width counts as one, so that `width_from` raises the error.
        """
        spans = self.widths.spans(start, end)
        return not spans or any(
            abs(width) > TOLERANCE for piece, length in spans for width in piece.extremes(length)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SideSection:
    """One side of a lane section.

    Attributes:
        element: The `<laneSection>`.
        start: Station where it begins [m].
        end: Station where the next one of this side begins [m].
        lanes: The lanes of the side, from the reference line outward.
        centre: The lane without width on the reference line, None where the file leaves it out.
    """

    element: Element
    start: float
    end: float
    lanes: tuple[LaneRecords, ...]
    centre: LaneRecords | None

    @property
    def driving(self) -> list[LaneRecords]:
        """The driving lanes that have a width somewhere, from the reference line outward."""
        return [
            lane
            for lane in self.lanes
            if lane.kind == DRIVING and lane.has_width(self.start, self.end)
        ]

    @property
    def stations(self) -> Iterator[float]:
        """Stations at which the section or a record of its lanes begins [m]."""
        yield self.start
        for lane in self.lanes if self.centre is None else (*self.lanes, self.centre):
            for station in lane.stations:
                if station < self.end - TOLERANCE:
                    yield station


@dataclass(frozen=True, slots=True)
class SideSections:
    """The lane sections of one side of a road, in its order.

    Attributes:
        sections: The sections.
        starts: Station at which each begins [m].
    """

    sections: tuple[SideSection, ...]
    starts: tuple[float, ...]

    @classmethod
    def of(cls, road: Element, side: Side, length: float) -> Self:
        """The sections of a side of a `<road>`.

        Args:
            road: The `<road>`.
            side: "right" or "left" of the reference line.
            length: Length of the road [m].

        Raises:
            ImportFormatError: The road has no sections, they are out of order, or lanes lack an id.
        """
        lanes = road.required("lanes")
        elements = lanes.all("laneSection")
        starts = [element.number("s") for element in elements]
        if not elements or abs(starts[0]) > TOLERANCE:
            raise lanes.error(
                "is incomplete", "a <laneSection> from s = 0 on", f"{len(elements)} sections"
            )
        for element, (start, after) in zip(elements[1:], pairwise(starts), strict=True):
            if after < start:
                raise out_of_order(element, "s")
        if not length > TOLERANCE:
            raise road.error("attribute length", "more than 0 m", f"{length:g} m")
        rule = stated_rule(road) or DrivingSide.RIGHT
        of_side = [
            (element, start)
            for element, start in zip(elements, starts, strict=True)
            if start < length - TOLERANCE and _states_side(element, side)
        ]
        ends = [*(start for _, start in of_side[1:]), length]
        sections = tuple(
            SideSection(
                element=element,
                start=start,
                end=end,
                lanes=_side_lanes(element, side, start, rule),
                centre=_centre_lane(element, start),
            )
            # Without sections of this side, `ends` still holds the end of the road.
            for (element, start), end in zip(of_side, ends, strict=False)
            if end - start > TOLERANCE
        )
        return cls(sections, tuple(section.start for section in sections))

    def at(self, station: float) -> SideSection | None:
        """The section that holds at a station; None where the side has none."""
        index = bisect_right(self.starts, station + TOLERANCE) - 1
        return None if index < 0 else self.sections[index]

    @property
    def driving(self) -> list[LaneRecords]:
        """The driving lanes of all sections."""
        return [lane for section in self.sections for lane in section.driving]


def _states_side(section: Element, side: Side) -> bool:
    """Whether a lane section holds for a side: with `singleSide`, only if it has lanes there."""
    if section.attribute("singleSide", default="false").strip() not in ("true", "1"):
        return True
    group = section.optional(side)
    return group is not None and bool(group.all("lane"))


def _side_lanes(
    section: Element, side: Side, origin: float, rule: DrivingSide
) -> tuple[LaneRecords, ...]:
    """The lanes on one side of a section, outward.

    Args:
        section: The `<laneSection>`.
        side: The side.
        origin: Station where the section begins [m].
        rule: Side of traffic by the `rule` of the road.

    Raises:
        ImportFormatError: Their ids are not -1, -2, ... or 1, 2, ...
    """
    group = section.optional(side)
    if group is None:
        return ()
    sign = -1 if side == "right" else 1
    lanes = sorted(group.all("lane"), key=lambda lane: sign * lane.integer("id"))
    for number, lane in enumerate(lanes, start=1):
        if lane.integer("id") != sign * number:
            raise lane.error(
                "attribute id",
                f"ids {sign}, {2 * sign}, ... without gaps in <{side}>",
                lane.attribute("id"),
            )
    return tuple(LaneRecords.of(lane, origin, _direction(lane, side, rule)) for lane in lanes)


_TRAVEL: dict[str, Direction] = {
    "forward": "along",
    "backward": "against",
    "bidirectional": "both",
}
"""Direction of traffic for each `travelDir` in RoadRunner's user data of lanes. Other values, such
as "undirected", state no direction."""


def _direction(lane: Element, side: Side, rule: DrivingSide) -> Direction:
    """The direction of the traffic of a lane, if the file states it for the lane.

    Args:
        lane: The `<lane>`.
        side: Side of the reference line on which it lies.
        rule: Side of traffic by the `rule` of the road. The attribute `direction` is relative to
            it: "reversed" is against the direction that the rule gives to this side.
    """
    stated = lane.attribute("direction", default="standard").strip()
    if stated == "both":
        return "both"
    if stated == "reversed":
        return "against" if runs_along(side, rule) else "along"
    for data in lane.all("userData"):
        for element in (data, *data.children):
            is_code = element.attributes.get("code") == "travelDir"
            name = "value" if is_code else "travelDir"
            travel = _TRAVEL.get(element.attributes.get(name, ""))
            if travel is not None:
                return travel
    return "unstated"


def runs_along(side: Side, driving_side: DrivingSide) -> bool:
    """Whether the lanes on a side of the reference line run along it."""
    return (side == "right") == (driving_side is DrivingSide.RIGHT)


_RULES = {"RHT": DrivingSide.RIGHT, "LHT": DrivingSide.LEFT}


def stated_rule(road: Element) -> DrivingSide | None:
    """The side of traffic by the `rule` of a road, None where it states none.

    Raises:
        ImportFormatError: The rule is not one of OpenDRIVE's.
    """
    rule = road.attribute("rule", default="").strip()
    if rule and rule not in _RULES:
        raise road.error("attribute rule", " or ".join(_RULES), f'"{shown(rule)}"')
    return _RULES.get(rule)


def side_of_traffic(road: Element, length: float) -> DrivingSide:
    """The side of the road that traffic keeps to.

    The directions that driving lanes state decide on a road without a `rule`, and on one with
    driving lanes on both sides of the reference line. Else the `rule` decides, or without one the
    countries of the signals.

    Args:
        road: The `<road>`.
        length: Its length [m].

    Raises:
        ImportFormatError: The rule is not one of OpenDRIVE's, or the lanes are damaged.
    """
    rule = stated_rule(road)
    default = rule or _side_of_signals(road)
    right, left = (SideSections.of(road, side, length).driving for side in SIDES)
    lanes = [*((lane, True) for lane in right), *((lane, False) for lane in left)]
    votes = Counter[DrivingSide]()
    for lane, is_right in lanes:
        if lane.direction == "unstated":
            votes[default] += 1
        elif lane.direction != "both":
            keeps_right = (lane.direction == "along") == is_right
            votes[DrivingSide.RIGHT if keeps_right else DrivingSide.LEFT] += 1
    if votes[default.opposite] > votes[default] and (rule is None or (right and left)):
        return default.opposite
    return default


def _side_of_signals(road: Element) -> DrivingSide:
    """The side of traffic in the most frequent country of a road's signals; else the right."""
    signals = road.optional("signals")
    codes = (
        []
        if signals is None
        else [signal.attributes.get("country", "") for signal in signals.children]
    )
    # Signals without a country of ISO 3166-1 name a catalogue, often "OpenDRIVE".
    countries = Counter(code for code in codes if len(code) in (2, 3))
    most_common = countries.most_common(1)
    return DrivingSide.LEFT if most_common and keeps_left(most_common[0][0]) else DrivingSide.RIGHT


def _centre_lane(section: Element, origin: float) -> LaneRecords | None:
    centre = section.optional("center")
    lane = None if centre is None else centre.optional("lane")
    return None if lane is None else LaneRecords.of(lane, origin)


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

    def turned(self) -> Self:
        """The lane with its lines swapped."""
        return self._replace(inner_mark=self.outer_mark, outer_mark=self.inner_mark)


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
    road: Element,
    *,
    side: Side,
    length: float,
    speed_limit: float | None = None,
    driving_side: DrivingSide = DrivingSide.RIGHT,
) -> list[Cell | Unfit]:
    """The stretches of one side of a road, in its order, or why they do not fit.

    Args:
        road: The `<road>`.
        side: "right" or "left" of the reference line.
        length: Length of the road [m].
        speed_limit: Limit in place of the file's [m/s].
        driving_side: Side of the road that traffic keeps to.

    Raises:
        ImportFormatError: The file is damaged.
    """
    offsets = Profile.of(road.required("lanes").all("laneOffset"))
    types, banking = Records.of(road.all("type")), Banking.of(road)
    near, far = (SideSections.of(road, each, length) for each in (side, OTHER_SIDE[side]))
    stations = [*offsets.starts, *types.starts, *banking.stations]
    for section in (*near.sections, *far.sections):
        stations += section.stations
    cells: list[Cell | Unfit] = []
    for start, end in _between(stations, length):
        sections = near.at(start), far.at(start)
        along = runs_along(side, driving_side)
        cross_section = _CrossSection(road, side, start, end, *sections, along=along)
        try:
            banking.check_flat(start, end)
            cell = _cell(cross_section, kind_at(types, start))
            limit = against = speed_limit or limit_at(road, types, cross_section.speeds, start)
            if cell.is_two_way and speed_limit is None:
                against = limit_at(road, types, cross_section.speeds_oncoming, start)
            inner = _plus(cell.inner, _offset(offsets, start, side))
            cells.append(replace(cell, inner=inner, limit=limit, limit_against=against))
        except Unfit as error:
            cells.append(error)
    return cells


def _between(stations: Iterable[float], length: float) -> Iterator[tuple[float, float]]:
    """Start and end of each stretch between stations, without stretches of no length [m]."""
    cuts = [0.0]
    for station in sorted(stations):
        if cuts[-1] + TOLERANCE < station < length - TOLERANCE:
            cuts.append(station)
    return pairwise([*cuts, length])


def _offset(offsets: Profile, start: float, side: Side) -> Cubic | None:
    """The lane offset from a station on, outward positive; None where there is none."""
    offset = offsets.at(start)
    if offset is None:
        return None
    sign = -1.0 if side == "right" else 1.0
    a, b, c, d = (sign * value for value in (offset.a, offset.b, offset.c, offset.d))
    return replace(offset, a=a, b=b, c=c, d=d)


def _plus(one: Cubic, other: Cubic | None) -> Cubic:
    """The sum of two polynomials that are counted from the same place."""
    if other is None:
        return one
    return replace(one, a=one.a + other.a, b=one.b + other.b, c=one.c + other.c, d=one.d + other.d)


class _CrossSection(NamedTuple):
    """The lanes of a stretch of road, on the chosen side of the reference line and on the other.

    Attributes:
        road: The `<road>`.
        side: The chosen side.
        start: Station where the stretch begins [m].
        end: Station where it ends [m].
        near: The lane section of the chosen side, None where it has none.
        far: The same of the other side.
        along: Whether traffic of the chosen side runs along the reference line.
    """

    road: Element
    side: Side
    start: float
    end: float
    near: SideSection | None
    far: SideSection | None
    along: bool

    def is_oncoming(self, lane: LaneRecords) -> bool:
        """Whether the traffic of a lane runs against that of the chosen side."""
        return lane.direction == ("against" if self.along else "along")

    @property
    def speeds(self) -> list[Records]:
        """Speeds of the driving lanes of the chosen side, without oncoming ones."""
        return [lane.speeds for lane in self._driving(self.near) if not self.is_oncoming(lane)]

    @property
    def speeds_oncoming(self) -> list[Records]:
        """Speeds of the oncoming lanes: those on the chosen side, or else those on the other."""
        near = [lane for lane in self._driving(self.near) if self.is_oncoming(lane)]
        return [lane.speeds for lane in near or self._driving(self.far)]

    @property
    def element(self) -> Element:
        """The element that states the lanes, for messages."""
        section = self.near or self.far
        return self.road if section is None else section.element

    @property
    def centre(self) -> RoadMark:
        """The mark on the reference line, its parts from left to right."""
        sections = [section for section in (self.near, self.far) if section is not None]
        stated = [section for section in sections if section.centre is not None]
        if not stated:
            return RoadMark.NONE
        # If each side has a section of its own, the later one replaces the mark of the other.
        latest = max(stated, key=lambda section: section.start)
        assert latest.centre is not None
        return latest.centre.mark_at(self.start)

    def _driving(self, section: SideSection | None) -> list[LaneRecords]:
        """The driving lanes of a section that have a width on the stretch."""
        lanes = () if section is None else section.lanes
        return [lane for lane in lanes if lane.kind == DRIVING and self._has_width(lane)]

    def _has_width(self, lane: LaneRecords) -> bool:
        # Skip the tolerance: a record that begins within it already holds at the start.
        return lane.has_width(min(self.start + TOLERANCE, self.end), self.end)

    def width(self, lane: LaneRecords) -> Cubic:
        """The width of a lane along the stretch [m]."""
        return lane.width_from(self.start, self.end)

    def least_width(self, lane: LaneRecords) -> float:
        """The least width of a lane along the stretch [m]."""
        return min(self.width(lane).extremes(self.end - self.start))

    def strips(self, side: Side) -> list["_MarkedLane"]:
        """The lanes of a side that have a width, from the reference line outward.

        A lane of no width is left out. Its inner and outer line coincide; the outermost of them
        that is painted remains.
        """
        section = self.near if side == self.side else self.far
        lanes = () if section is None else section.lanes
        inner = self.centre.reverse if side == "right" else self.centre
        strips: list[_MarkedLane] = []
        for lane in lanes:
            mark = lane.mark_at(self.start)
            if self._has_width(lane):
                strips.append(_MarkedLane(lane, inner, mark, mark))
                inner = mark.reverse
            elif mark is not RoadMark.NONE:
                inner = mark.reverse
                if strips:
                    strips[-1] = strips[-1].bounded_by(mark, is_edge=lane.kind == DRIVING)
        return strips


class _MarkedLane(NamedTuple):
    """A lane with the lines on either side, as seen from within it, before its width is checked.

    Attributes:
        lane: The lane.
        inner_mark: Line towards the reference line.
        outer_mark: Line away from it.
        edge_mark: Line away from it if the lane is the outermost driving lane. Beyond it, a driving
            lane that has tapered to no width leaves its outer line here; the line of a lane of
            another type is not a border of the driving lanes.
    """

    lane: LaneRecords
    inner_mark: RoadMark
    outer_mark: RoadMark
    edge_mark: RoadMark

    def bounded_by(self, mark: RoadMark, *, is_edge: bool) -> Self:
        """The lane with the outer line of a lane of no width beside it."""
        return self._replace(outer_mark=mark, edge_mark=mark if is_edge else self.edge_mark)

    def measured(self, width: float) -> Strip:
        """The lane with its width [m]."""
        return Strip(self.lane.lane_id, self.lane.kind, width, self.inner_mark, self.outer_mark)


def _cell(cross_section: _CrossSection, kind: str) -> Cell:
    """The driving lanes of a stretch and the lanes beside them, without limits yet."""
    element, start, end = cross_section.element, cross_section.start, cross_section.end
    lanes = cross_section.strips(cross_section.side)
    first, last = _driving_block(cross_section, lanes)
    inner_widths = [cross_section.width(marked.lane) for marked in lanes[:first]]
    inner = Cubic(element=element, start=start, a=0.0, b=0.0, c=0.0, d=0.0)
    for width in inner_widths:
        inner = _plus(inner, width)
    strips = []
    for index in range(first, last + 1):
        lane = lanes[index]
        if index == last:
            lane = lane._replace(outer_mark=lane.edge_mark)
        width = _constant_width(cross_section, lane.lane)
        _check_driving(lane.lane, width)
        strips.append(lane.measured(width))
    across = not any(max(width.extremes(end - start)) > TOLERANCE for width in inner_widths)
    neighbours = (
        cross_section.strips(OTHER_SIDE[cross_section.side]) if across else lanes[:first][::-1]
    )
    inner_neighbour = _first_wide(cross_section, neighbours)
    if first and inner_neighbour is not None and cross_section.is_oncoming(lanes[first - 1].lane):
        # An oncoming lane on the chosen side of the reference line. Seen in its own direction, the
        # border to the driving lanes is its inner line.
        across, inner_neighbour = True, inner_neighbour.turned()
    return Cell(
        start=start,
        end=end,
        strips=tuple(strips),
        inner=inner,
        inner_neighbour=inner_neighbour,
        outer_neighbour=_first_wide(cross_section, lanes[last + 1 :]),
        across=across,
        kind=kind,
    )


def _constant_width(cross_section: _CrossSection, lane: LaneRecords) -> float:
    """The width of a lane that is the same along the stretch [m]; ImportFormatError if not."""
    width = cross_section.width(lane)
    for extreme in width.extremes(cross_section.end - cross_section.start):
        if abs(extreme - width.a) > TOLERANCE:
            place = f"of lane {lane.lane_id} varies after s = {cross_section.start:.1f} m"
            raise unfit(width.element, place, f"a constant {width.a:.3f} m", f"{extreme:.3f} m")
    return width.a


def _first_wide(cross_section: _CrossSection, lanes: Sequence[_MarkedLane]) -> Strip | None:
    """The first of some lanes that has a width on the whole stretch."""
    for marked in lanes:
        width = cross_section.least_width(marked.lane)
        if width > TOLERANCE:
            return marked.measured(width)
    return None


def _driving_block(cross_section: _CrossSection, lanes: Sequence[_MarkedLane]) -> tuple[int, int]:
    """First and last index of the driving lanes; ImportFormatError unless they are adjacent."""
    driving = [index for index, marked in enumerate(lanes) if marked.lane.kind == DRIVING]
    block = [index for index in driving if not cross_section.is_oncoming(lanes[index].lane)]
    where = f"at s = {cross_section.start:.1f} m"
    if driving and not block:
        raise _unfit_direction(lanes[driving[0]].lane)
    if not 1 <= len(block) <= MAX_LANES:
        expected = f"1 to {MAX_LANES} driving lanes"
        what = f"{where}, {cross_section.side} side"
        raise unfit(cross_section.element, what, expected, str(len(block)))
    if block[-1] - block[0] >= len(block):
        between = next(
            lanes[index].lane for index in range(block[0], block[-1]) if index not in block
        )
        raise unfit(
            between.element,
            f"{between.lane_id} {where}",
            "driving lanes side by side",
            f'"{shown(between.kind)}" between two of them',
        )
    if driving[-1] > block[-1]:
        raise _unfit_direction(lanes[driving[-1]].lane)
    return block[0], block[-1]


def _unfit_direction(lane: LaneRecords) -> Unfit:
    """The error for a driving lane whose direction is not that of the other lanes of its side."""
    return unfit(
        lane.element,
        f"{lane.lane_id} has a direction",
        "that of the lanes on its side of the reference line",
        lane.direction,
        "choose another road, or state the side of traffic with --driving-side",
    )


def _check_driving(lane: LaneRecords, width: float) -> None:
    """Refuse a driving lane that no road of the model can have."""
    if not MIN_LANE_WIDTH <= width <= MAX_LANE_WIDTH:
        raise unfit(
            lane.element,
            f"{lane.lane_id} has a width",
            f"{MIN_LANE_WIDTH:g} to {MAX_LANE_WIDTH:g} m",
            f"{width:.3f} m",
        )
    if lane.direction == "both":
        raise _unfit_direction(lane)
