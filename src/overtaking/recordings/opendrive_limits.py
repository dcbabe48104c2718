"""Type and speed limit of an OpenDRIVE road, from station to station."""

from collections.abc import Callable, Sequence

from overtaking.core.units import mps_from_kmh
from overtaking.knowledge.roads import general_limit
from overtaking.model.road_course import MAX_SPEED_LIMIT
from overtaking.recordings.countries import MPS_PER_MPH
from overtaking.recordings.limits import NO_LIMIT
from overtaking.recordings.messages import shown
from overtaking.recordings.opendrive_shape import Records, unfit
from overtaking.recordings.xml import Element

UNKNOWN = "unknown"  # OpenDRIVE's word for a road without a type.

_IN_MPS: dict[str, Callable[[float], float]] = {
    "m/s": float,
    "km/h": mps_from_kmh,
    "kmh": mps_from_kmh,
    "mph": lambda value: value * MPS_PER_MPH,
}
"""Conversion to m/s from OpenDRIVE's units of speed, and from kmh, which files also have."""

_UNDEFINED = "undefined"
_NO_LIMIT = ("no limit", "no_limit", "unlimited", "none")  # The first is OpenDRIVE's own word.
_NEXT_STEP = "pass a limit with --speed-limit"


def kind_at(types: Records, station: float) -> str:
    """The type of a road at a station; before the first `<type>`, the type that it states."""
    entry = _type_at(types, station)
    return UNKNOWN if entry is None else shown(entry.attribute("type"))


def _type_at(types: Records, station: float) -> Element | None:
    return types.at(station) or (types.elements[0] if types.elements else None)


def limit_at(road: Element, types: Records, speeds: Sequence[Records], station: float) -> float:
    """The speed limit of a road at a station [m/s].

    Args:
        road: The `<road>`.
        types: Its `<type>` elements.
        speeds: The `<speed>` elements of each of its driving lanes of the chosen direction there.
        station: The station [m].

    Returns:
        The limit of the lanes; if they state none, of the road; if that states none, the general
        limit of Portuguese law for its type. `NO_LIMIT` where the file states "no limit".

    Raises:
        ImportFormatError: The lanes have different limits, or one that the model cannot use.
    """
    of_lanes = [_limit(lane.at(station)) for lane in speeds]
    if any(limit is not None for limit in of_lanes):
        return _common(road, of_lanes)
    entry = _type_at(types, station)
    of_road = [] if entry is None else [_limit(speed) for speed in entry.all("speed")]
    if any(limit is not None for limit in of_road):
        return _common(road, of_road)
    return general_limit(kind_at(types, station))


def _common(road: Element, limits: Sequence[float | None]) -> float:
    """The value that all entries agree on."""
    first = limits[0]
    if first is None or any(limit != first for limit in limits):
        stated = sorted({"none" if limit is None else f"{limit:.2f} m/s" for limit in limits})
        wanted = "one for all driving lanes"
        raise unfit(road, "has several speed limits", wanted, ", ".join(stated[:8]), _NEXT_STEP)
    return first


def _limit(entry: Element | None) -> float | None:
    """The limit of a `<speed>` [m/s], None where the element is missing or has no known value."""
    text = _UNDEFINED if entry is None else entry.attribute("max").strip().lower()
    if entry is None or text == _UNDEFINED:
        return None
    if text in _NO_LIMIT:
        return NO_LIMIT
    unit = entry.attribute("unit", default="m/s").strip()
    if unit.lower() not in _IN_MPS:
        raise entry.error("attribute unit", "m/s, km/h or mph", f'"{shown(unit)}"')
    limit = _IN_MPS[unit.lower()](entry.number("max"))
    if not 0.0 < limit <= MAX_SPEED_LIMIT:
        expected = f"more than 0 and at most {MAX_SPEED_LIMIT:g} m/s"
        note = "" if "unit" in entry.attributes else ", as no unit is stated"
        raise unfit(entry, "attribute max", expected, f"{limit:g} m/s{note}", _NEXT_STEP)
    return limit
