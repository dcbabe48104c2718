"""Roads out of OpenDRIVE files, to be driven in one direction.

Read from ASAM OpenDRIVE 1.4 to 1.8: road header, rule and links, type and speed, plan view,
elevation and lateral profile, lane offset, lane sections with widths, marks and speeds. Of a road
whose lanes change on the way the longest stretch is read on which they do not. What is banked or
belongs to a junction is refused with the reason.

The file's station runs along its reference line and its lateral coordinate t to the left of that.
Where the chosen lanes run along the line, `s` and `d` are the file's, `s` from the beginning of
the stretch. Where they run against it, as positive lane ids do in right-hand traffic, the road is
turned about: it starts at the end of the stretch, d = -t and the heading is half a turn on. Where
the lanes leave the line, as lane offsets make them, the road has a line of its own that keeps
their distance. Lane ids are the file's, where the stretch begins.
"""

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from overtaking.core.errors import ConfigError, ImportFormatError
from overtaking.model.road import DrivingSide, Road
from overtaking.model.road_course import MAX_SPEED_LIMIT
from overtaking.recordings.messages import refused, shown
from overtaking.recordings.opendrive_lanes import OTHER_SIDE, Side
from overtaking.recordings.opendrive_route import Choice, join_roads, read_part
from overtaking.recordings.xml import Element, elements

_SKIPPED = frozenset(["objects", "surface", "railroad", "include"])
_MAX_LISTED = 6


def read_opendrive(
    path: str | Path,
    road_id: str | int | None = None,
    *,
    lanes: Side | None = None,
    speed_limit: float | None = None,
    driving_side: Side | None = None,
) -> Road:
    """One road of an OpenDRIVE file, or several that lead to each other.

    Args:
        path: The file, not compressed.
        road_id: Id of the road in the file; may be left out if the file has only one. Ids with
            commas between them are a route: each road leads to the next without a junction.
        lanes: Side of the reference line, "right" or "left", whose lanes are taken. By default
            they are those that run along the line, or the others where there are no such lanes.
        speed_limit: Limit in place of all of the file's [m/s]. Where neither states one, the
            general limit of Portuguese law for the kind of road holds.
        driving_side: Side of the road that traffic keeps to, "right" or "left". By default it
            follows from the file: from the directions of lanes, the `rule` of the road or the
            countries of its signals, as `side_of_traffic` describes; else it is the right.

    Returns:
        The road, named after file and id, and its part of the file's road if it is not all of it.

    Raises:
        ConfigError: `lanes` or `driving_side` is no side, or `speed_limit` is out of range.
        ImportFormatError: The file is no such OpenDRIVE, or the road is of a shape that is not
            supported; the message names file, line, element, road and reason.
    """
    choice = road_choice(lanes, speed_limit, driving_side)
    file = Path(path)
    wanted = None if road_id is None else str(road_id)
    route = () if wanted is None else tuple(one.strip() for one in wanted.split(","))
    found: list[Element] = []
    ids: list[str] = []
    for road in roads_in(file, None if wanted is None else {wanted, *route}, ids):
        found.append(road)
        del found[max(2, len(route)) :]  # Two are enough to know that the choice is not clear.
    try:
        if len(route) > 1 and wanted not in ids:
            by_id = {road.attribute("id", default=""): road for road in found}
            for one in route:
                if ids.count(one) != 1:
                    raise _unclear(file, one, ids)
            return join_roads(file, [by_id[one] for one in route], choice).road
        if len(found) != 1:
            raise _unclear(file, wanted, ids)
        return read_part(file, found[0], choice).road
    except ImportFormatError as error:
        if len(ids) < 2:
            raise
        fit = _drivable(_survey(file, choice))
        raise ImportFormatError(f"{error}; {fit}") from None


def survey_opendrive(
    path: str | Path,
    *,
    lanes: Side | None = None,
    speed_limit: float | None = None,
    driving_side: Side | None = None,
) -> dict[str, Road | ImportFormatError]:
    """Every road of an OpenDRIVE file, or the reason why it cannot be used, by id.

    Args:
        path: The file.
        lanes: As for `read_opendrive`.
        speed_limit: As for `read_opendrive` [m/s].
        driving_side: As for `read_opendrive`.

    Raises:
        ImportFormatError: The file as a whole cannot be read.
    """
    return _survey(Path(path), road_choice(lanes, speed_limit, driving_side))


def _survey(path: Path, choice: Choice) -> dict[str, Road | ImportFormatError]:
    """Every road of a file, or the reason why it cannot be used, by id."""
    verdicts: dict[str, Road | ImportFormatError] = {}
    for road in roads_in(path):
        name = shown(road.attribute("id"))
        try:
            verdicts[name] = read_part(path, road, choice).road
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


def road_choice(
    lanes: Side | None = None, speed_limit: float | None = None, driving_side: Side | None = None
) -> Choice:
    """The options of a caller of `read_opendrive`, checked.

    Raises:
        ConfigError: A side is neither "right" nor "left", or the limit is out of range.
    """
    for name, side in (("lanes", lanes), ("driving_side", driving_side)):
        if side is not None and side not in OTHER_SIDE:
            raise ConfigError.unknown_choice(
                what=name, where="read_opendrive", choices=OTHER_SIDE, got=repr(side)
            )
    if speed_limit is not None and not 0.0 < speed_limit <= MAX_SPEED_LIMIT:
        raise ConfigError(
            what="speed_limit",
            where="read_opendrive",
            expected=f"more than 0 and at most {MAX_SPEED_LIMIT:g} m/s",
            got=f"{speed_limit:g} m/s",
            next_step="pass a limit in m/s",
        )
    return Choice(
        lanes=lanes,
        speed_limit=speed_limit,
        driving_side=None if driving_side is None else DrivingSide(driving_side),
    )


def roads_in(
    path: Path, wanted: Collection[str] | None = None, ids: list[str] | None = None
) -> Iterator[Element]:
    """The roads of a file, one after the other.

    Args:
        path: The file.
        wanted: Ids of those to read; all of them without it.
        ids: Collects the ids of all of them.

    Raises:
        ImportFormatError: The file cannot be read.
    """
    seen = [] if ids is None else ids

    def keep(name: str, attributes: Mapping[str, str]) -> bool:
        if name != "road":
            return False
        seen.append(attributes.get("id", ""))
        return wanted is None or seen[-1] in wanted

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
