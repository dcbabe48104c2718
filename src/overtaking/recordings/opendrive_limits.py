"""Type and speed limit of an OpenDRIVE road, from station to station."""

from collections.abc import Callable, Sequence

from overtaking.core.units import mps_from_kmh
from overtaking.knowledge.roads import general_limit
from overtaking.model.course import MAX_SPEED_LIMIT
from overtaking.recordings.messages import shown
from overtaking.recordings.opendrive_shape import in_force, unfit
from overtaking.recordings.xml import Element

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
_OWN = "pass a speed limit of your own"


def kind_at(road: Element, station: float) -> str:
    """The type of a road at a station, that of its first entry before it."""
    entry = _type_at(road, station)
    return UNKNOWN if entry is None else shown(entry.attribute("type"))


def _type_at(road: Element, station: float) -> Element | None:
    types = road.all("type")
    return in_force(types, station) or (types[0] if types else None)


def limit_at(road: Element, lanes: Sequence[Element], station: float, ahead: float) -> float:
    """The speed limit of a road at a station [m/s].

    Args:
        road: The `<road>`.
        lanes: Its driving lanes of the chosen direction there.
        station: The station [m].
        ahead: The same from the beginning of the lane section [m].

    Returns:
        The limit of the lanes; if they state none, of the road; if that states none, the general
        limit of Portuguese law for its type.

    Raises:
        ImportFormatError: The lanes have several, or one that the model cannot use.
    """
    of_lanes = [_limit(in_force(lane.all("speed"), ahead, "sOffset")) for lane in lanes]
    if any(limit is not None for limit in of_lanes):
        return _common(road, of_lanes)
    entry = _type_at(road, station)
    of_road = [] if entry is None else [_limit(speed) for speed in entry.all("speed")]
    if any(limit is not None for limit in of_road):
        return _common(road, of_road)
    return general_limit(kind_at(road, station))


def _common(road: Element, limits: Sequence[float | None]) -> float:
    """The value that all entries agree on."""
    first = limits[0]
    if first is None or any(limit != first for limit in limits):
        stated = sorted({"none" if limit is None else f"{limit:.2f} m/s" for limit in limits})
        wanted = "one for all driving lanes"
        raise unfit(road, "has several speed limits", wanted, ", ".join(stated[:8]), _OWN)
    return first


def _limit(entry: Element | None) -> float | None:
    """The limit of a `<speed>` [m/s], or None where there is none or it is stated as unknown."""
    text = _UNDEFINED if entry is None else entry.attribute("max").strip()
    if entry is None or text == _UNDEFINED:
        return None
    if text == _NO_LIMIT:
        raise unfit(entry, "attribute max", "a number", f'"{_NO_LIMIT}"', _OWN)
    unit = entry.attribute("unit", default="m/s")
    if unit not in _IN_MPS:
        raise entry.error("attribute unit", "m/s, km/h or mph", f'"{shown(unit)}"')
    limit = _IN_MPS[unit](entry.number("max"))
    if not 0.0 < limit <= MAX_SPEED_LIMIT:
        wanted = f"more than 0 and at most {MAX_SPEED_LIMIT:g} m/s"
        raise unfit(entry, "attribute max", wanted, f"{limit:g} m/s", _OWN)
    return limit
