"""A road by what a user calls it: a name that comes with the package, or a file."""

from pathlib import Path

from overtaking.core.errors import ConfigError
from overtaking.model.known_roads import ROAD_NAMES, known_road
from overtaking.model.road import Road
from overtaking.recordings.opendrive import Side, read_opendrive
from overtaking.scenarios.profiles import path_exists


def resolve_road(road: str | Path | Road) -> Road:
    """A road itself, or the road of a name or file.

    Args:
        road: A road, the name of a road of the package, or the path of an OpenDRIVE file.

    Raises:
        ConfigError: No road has this name, or the file has several roads.
        ImportFormatError: The file or its road cannot be used.
    """
    return road if isinstance(road, Road) else load_road(road)


def load_road(
    name_or_path: str | Path,
    road_id: str | int | None = None,
    *,
    lanes: Side | None = None,
    speed_limit: float | None = None,
    driving_side: Side | None = None,
) -> Road:
    """A road that comes with the package, or one of an OpenDRIVE file.

    Args:
        name_or_path: One of `overtaking.model.known_roads.ROAD_NAMES`, or the path of a file.
        road_id: Id of the road in the file; may be left out if the file has only one.
        lanes: Lanes right or left of the file's reference line; see `read_opendrive`.
        speed_limit: Limit in place of the file's [m/s].
        driving_side: Side of the road that traffic keeps to, in place of the file's.

    Raises:
        ConfigError: Neither a known name nor a file, or a choice for a road that leaves none.
        ImportFormatError: The file or its road cannot be used; the message says why.
    """
    if name_or_path not in ROAD_NAMES:
        if not Path(name_or_path).suffix and not path_exists(str(name_or_path)):
            known = [*ROAD_NAMES, "an OpenDRIVE file"]
            raise ConfigError.unknown_choice(
                what="road", where="load_road", choices=known, got=repr(str(name_or_path))
            )
        return read_opendrive(
            name_or_path, road_id, lanes=lanes, speed_limit=speed_limit, driving_side=driving_side
        )
    if any(choice is not None for choice in (road_id, lanes, speed_limit, driving_side)):
        raise ConfigError(
            what=f"road {name_or_path}",
            where="load_road",
            expected="its name alone",
            got="a road id, side or speed limit beside it",
            next_step="leave them out, or pass a map file",
        )
    return known_road(str(name_or_path))
