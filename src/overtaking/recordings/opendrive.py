"""Same-direction stretches of road out of OpenDRIVE files.

Read from ASAM OpenDRIVE 1.4 to 1.8: road header and rule, type and speed, plan view, elevation and
lateral profile, lane offset, lane sections with widths, marks and speeds. A road that is banked,
belongs to a junction, or changes its lanes on the way is refused with the reason.

The file's station runs along its reference line and its lateral coordinate t to the left of that.
Where the chosen lanes run along the line, `s` and `d` are the file's. Where they run against it, as
positive lane ids do in right-hand traffic, the road is turned about: it starts at the end of the
reference line, s = length - station, d = -t and the heading is half a turn on. Lane ids stay the
file's.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from overtaking.core.errors import ConfigError, ImportFormatError
from overtaking.core.units import mps_from_kmh
from overtaking.knowledge.roads import general_limit
from overtaking.model.course import Course
from overtaking.model.road import MAX_LENGTH, MAX_SPEED_LIMIT, DrivingSide, Lane, Road
from overtaking.recordings.messages import refused, shown
from overtaking.recordings.opendrive_lanes import (
    OTHER_SIDE,
    Carriageway,
    Side,
    Strip,
    carriageway,
    driving_lanes,
)
from overtaking.recordings.opendrive_plan import MAX_STRETCH, pieces
from overtaking.recordings.opendrive_shape import (
    TOLERANCE,
    Line,
    grade_of,
    is_straight,
    straight_line,
    unfit,
)
from overtaking.recordings.xml import Element, elements

_SKIPPED = frozenset(["objects", "signals", "surface", "railroad", "userData", "link", "include"])
_RULES = {"RHT": DrivingSide.RIGHT, "LHT": DrivingSide.LEFT}
_MAX_LISTED = 6


def read_opendrive(
    path: str | Path,
    road_id: str | int | None = None,
    *,
    lanes: Side | None = None,
    speed_limit: float | None = None,
) -> Road:
    """One road of an OpenDRIVE file.

    Args:
        path: The file, not compressed.
        road_id: Id of the road in the file; may be left out if the file has only one.
        lanes: Take the lanes right or left of the reference line. Without it those that run along
            the line are taken, or the others where there are no such lanes.
        speed_limit: Limit in place of the file's [m/s]. Where neither states one, the general
            limit of Portuguese law for the kind of road holds.

    Returns:
        The road, named after file and id.

    Raises:
        ConfigError: `lanes` or `speed_limit` is out of range.
        ImportFormatError: The file is no such OpenDRIVE, or the road is of a shape that is not
            supported; the message names file, line, element, road and reason.
    """
    _check_choice(lanes, speed_limit)
    file = Path(path)
    wanted = None if road_id is None else str(road_id)
    found: list[Element] = []
    ids: list[str] = []
    for road in roads_in(file, wanted, ids):
        found.append(road)
        del found[2:]  # Two are enough to know that the choice is not clear.
    try:
        if len(found) != 1:
            raise _unclear(file, wanted, ids)
        return read_road(file, found[0], lanes, speed_limit)
    except ImportFormatError as error:
        if len(ids) < 2:
            raise
        fit = _drivable(survey_opendrive(file, lanes=lanes, speed_limit=speed_limit))
        raise ImportFormatError(f"{error}; {fit}") from None


def survey_opendrive(
    path: str | Path, *, lanes: Side | None = None, speed_limit: float | None = None
) -> dict[str, Road | ImportFormatError]:
    """Every road of an OpenDRIVE file, or the reason why it cannot be used, by id.

    Args:
        path: The file.
        lanes: As for `read_opendrive`.
        speed_limit: As for `read_opendrive` [m/s].

    Raises:
        ImportFormatError: The file as a whole cannot be read.
    """
    verdicts: dict[str, Road | ImportFormatError] = {}
    for road in roads_in(Path(path)):
        name = shown(road.attribute("id"))
        try:
            verdicts[name] = read_road(Path(path), road, lanes, speed_limit)
        except ImportFormatError as error:
            verdicts[name] = error
    return verdicts


def _drivable(verdicts: Mapping[str, Road | ImportFormatError]) -> str:
    """The roads of a file with room to overtake, the longest first, for a message."""
    roads = [
        (name, one) for name, one in verdicts.items() if isinstance(one, Road) and one.num_lanes > 1
    ]
    if not roads:
        return "no road of the file can be driven and has two or more lanes in one direction"
    longest = sorted(roads, key=lambda each: -each[1].length)[:_MAX_LISTED]
    named = ", ".join(
        f"{name} ({one.num_lanes} lanes, {one.length:.0f} m)" for name, one in longest
    )
    return f"roads with two or more lanes in one direction: --road {named}"


def _check_choice(lanes: str | None, speed_limit: float | None) -> None:
    """Refuse what a caller cannot ask for."""
    if lanes is not None and lanes not in OTHER_SIDE:
        raise ConfigError.not_among("lanes", "read_opendrive", OTHER_SIDE, repr(lanes))
    if speed_limit is not None and not 0.0 < speed_limit <= MAX_SPEED_LIMIT:
        raise ConfigError.of(
            what="speed_limit",
            where="read_opendrive",
            expected=f"more than 0 and at most {MAX_SPEED_LIMIT:g} m/s",
            got=f"{speed_limit:g} m/s",
            next_step="pass a limit in m/s",
        )


def roads_in(
    path: Path, wanted: str | None = None, ids: list[str] | None = None
) -> Iterator[Element]:
    """The roads of a file, one after the other.

    Args:
        path: The file.
        wanted: Id of the only one to read; all of them without it.
        ids: Collects the ids of all of them.

    Raises:
        ImportFormatError: The file cannot be read.
    """
    seen = [] if ids is None else ids

    def keep(name: str, attributes: Mapping[str, str]) -> bool:
        if name != "road":
            return False
        seen.append(attributes.get("id", ""))
        return wanted is None or seen[-1] == wanted

    document = elements(path, root="OpenDRIVE", keep=keep, skip=_SKIPPED)
    next(document)
    yield from document


def _unclear(path: Path, wanted: str | None, ids: list[str]) -> ImportFormatError:
    """The error for a file that has no such road, or several."""
    listed = ", ".join(shown(road_id) for road_id in ids[:_MAX_LISTED])
    more = f" and {len(ids) - _MAX_LISTED} more" if len(ids) > _MAX_LISTED else ""
    return refused(
        shown(path.name, length=80),
        "road" if wanted is None else f"road {shown(wanted)}",
        "exactly one",
        f"the roads {listed}{more}" if ids else "no road at all",
        "choose one of them by its id",
    )


def read_road(
    path: Path, road: Element, lanes: Side | None = None, speed_limit: float | None = None
) -> Road:
    """A road from its element.

    Args:
        path: The file, for the name of the road.
        road: The `<road>`.
        lanes: As for `read_opendrive`.
        speed_limit: As for `read_opendrive` [m/s].

    Raises:
        ImportFormatError: The road is of a shape that is not supported.
    """
    name = shown(road.attribute("id"))
    road.belongs_to(f"road {name}")
    if road.attribute("junction", default="-1") != "-1":
        raise unfit(
            road,
            "belongs to a junction",
            "a road outside junctions",
            f'junction "{shown(road.attribute("junction"))}"',
        )
    length = _length(road)
    kind = kind_of(road)
    driving_side = _driving_side(road)
    side = lanes or _default_side(road, driving_side, length)
    along = (side == "right") == (driving_side is DrivingSide.RIGHT)
    section = carriageway(road, side=side, length=length)
    if speed_limit is None:
        speed_limit = limit_of(road, driving_lanes(road, side=side, length=length))
    try:
        return _build(
            name=f"{shown(path.stem)} road {name}",
            kind=kind,
            driving_side=driving_side,
            line=_line(road, length, along=along),
            section=section,
            speed_limit=speed_limit,
        )
    except ConfigError as error:
        raise unfit(road, "is beyond the model", "a road of ordinary size", str(error)) from None


def _build(
    *,
    name: str,
    kind: str,
    driving_side: DrivingSide,
    line: Line,
    section: Carriageway,
    speed_limit: float,
) -> Road:
    """The road of a cross-section, turned about where its traffic runs against the file."""
    right_hand = driving_side is DrivingSide.RIGHT
    # Outward is away from the reference line: to the right of travel in right-hand traffic, both
    # along the line and, on its other side, against it.
    outward = -1.0 if right_hand else 1.0
    outer_edge = section.inner_edge + sum(strip.width for strip in section.strips)

    def lane(strip: Strip, direction: int = 1) -> Lane:
        # A lane across the centre line has its own outside on the other hand.
        inner_on_left = right_hand == (direction == 1)
        left, right = strip.inner_mark, strip.outer_mark
        return Lane(
            lane_id=strip.lane_id,
            width=strip.width,
            kind=strip.kind,
            direction=direction,
            left_mark=left if inner_on_left else right,
            right_mark=right if inner_on_left else left,
        )

    slow, fast = section.outer_neighbour, section.inner_neighbour
    return Road(
        name=name,
        kind=kind,
        driving_side=driving_side,
        lanes=tuple(lane(strip) for strip in reversed(section.strips)),
        edge_d=outward * outer_edge,
        length=line.length,
        x0=line.x,
        y0=line.y,
        heading=line.heading,
        course=line.course,
        speed_limit=speed_limit,
        slow_side_neighbour=lane(slow) if slow else None,
        fast_side_neighbour=lane(fast, -1 if section.across else 1) if fast else None,
    )


def _line(road: Element, length: float, *, along: bool) -> Line:
    """The reference line, from its end where the traffic runs against it."""
    grade = grade_of(road, length)
    if not along:
        grade = tuple((length - s, -slope) for s, slope in reversed(grade))
    if is_straight(road):
        line = straight_line(road, length)
        start = 0.0 if along else line.length
        x = line.x + start * math.cos(line.heading)
        y = line.y + start * math.sin(line.heading)
        turned = math.remainder(line.heading + math.pi, math.tau)
        line = Line(x=x, y=y, heading=line.heading if along else turned, length=line.length)
        return replace(line, course=Course(grade=grade) if grade else None)
    bends = [one._replace(heading=math.remainder(one.heading, math.tau)) for one in pieces(road)]
    covered = sum(one.length for one in bends)
    if abs(covered - length) > TOLERANCE + MAX_STRETCH * length:
        raise road.error("does not end with its line", f"a line of {length:g} m", f"{covered:g} m")
    if not along:
        bends = [one.reversed() for one in reversed(bends)]
    # Where cubics are a hair shorter or longer than stated, the road is as long as they are.
    grade = tuple((min(s, covered), slope) for s, slope in grade)
    course = Course(line=tuple(bends), grade=grade)
    first = bends[0]
    return Line(x=first.x, y=first.y, heading=first.heading, length=covered, course=course)


def _length(road: Element) -> float:
    length = road.number("length")
    if not 0.0 < length <= MAX_LENGTH:
        raise unfit(
            road, "attribute length", f"more than 0 and at most {MAX_LENGTH:g} m", f"{length:g}"
        )
    return length


def _driving_side(road: Element) -> DrivingSide:
    rule = road.attribute("rule", default="RHT")
    if rule not in _RULES:
        raise road.error("attribute rule", " or ".join(_RULES), f'"{shown(rule)}"')
    return _RULES[rule]


def _default_side(road: Element, driving_side: DrivingSide, length: float) -> Side:
    """The side whose lanes run along the reference line, unless only the other has any."""
    along: Side = "right" if driving_side is DrivingSide.RIGHT else "left"
    against: Side = OTHER_SIDE[along]
    has_along = bool(driving_lanes(road, side=along, length=length))
    return along if has_along or not driving_lanes(road, side=against, length=length) else against


UNKNOWN = "unknown"  # OpenDRIVE's word for a road without a type.

_MPS_PER_MPH = 0.44704  # Exact: 1609.344 m in 3600 s, international yard and pound agreement, 1959.
_IN_MPS: dict[str, Callable[[float], float]] = {
    "m/s": float,
    "km/h": mps_from_kmh,
    "mph": lambda value: value * _MPS_PER_MPH,
}
"""From each of OpenDRIVE's units of speed."""

_UNDEFINED = "undefined"
_NO_LIMIT = "no limit"


def kind_of(road: Element) -> str:
    """The type of a road; ImportFormatError if it changes along the road."""
    types = road.all("type")
    kinds = [entry.attribute("type") for entry in types]
    for entry, kind in zip(types, kinds, strict=True):
        if kind != kinds[0]:
            raise entry.error(
                f"changes at s = {entry.number('s'):.1f} m",
                f'"{shown(kinds[0])}" along the whole road',
                f'"{shown(kind)}"',
                "choose another road",
            )
    return shown(kinds[0]) if kinds else UNKNOWN


def limit_of(road: Element, lanes: Sequence[Element]) -> float:
    """The speed limit of a road [m/s].

    Args:
        road: The `<road>`.
        lanes: Its driving lanes of the chosen direction, section after section.

    Returns:
        The limit of the lanes; if they state none, of the road; if that states none, the general
        limit of Portuguese law for its kind.

    Raises:
        ImportFormatError: The limit changes, is none that the model can use, or is lifted.
    """
    for owners in (lanes, road.all("type")):
        limits = [_only_limit(owner) for owner in owners]
        if any(limit is not None for limit in limits):
            return _common(road, limits)
    return general_limit(kind_of(road))


def _common(road: Element, limits: Sequence[float | None]) -> float:
    """The value that all entries agree on."""
    first = limits[0]
    if first is None or any(limit != first for limit in limits):
        stated = sorted({"none" if limit is None else f"{limit:.2f} m/s" for limit in limits})
        raise road.error(
            "has several speed limits",
            "one for all driving lanes and the whole road",
            ", ".join(stated[:8]),
            "pass a speed limit of your own",
        )
    return first


def _only_limit(owner: Element) -> float | None:
    """The limit that the `<speed>` elements of a lane or type agree on, or None without any."""
    limits = [_limit(entry) for entry in owner.all("speed")]
    return _common(owner, limits) if any(limit is not None for limit in limits) else None


def _limit(entry: Element) -> float | None:
    """The limit of one `<speed>` [m/s], or None where it is stated as unknown."""
    text = entry.attribute("max").strip()
    if text == _UNDEFINED:
        return None
    if text == _NO_LIMIT:
        raise entry.error(
            "attribute max", "a number", f'"{_NO_LIMIT}"', "pass a speed limit of your own"
        )
    unit = entry.attribute("unit", default="m/s")
    if unit not in _IN_MPS:
        raise entry.error("attribute unit", "m/s, km/h or mph", f'"{shown(unit)}"')
    limit = _IN_MPS[unit](entry.number("max"))
    if not 0.0 < limit <= MAX_SPEED_LIMIT:
        raise entry.error(
            "attribute max",
            f"more than 0 and at most {MAX_SPEED_LIMIT:g} m/s",
            f"{limit:g} m/s",
            "pass a speed limit of your own",
        )
    return limit
