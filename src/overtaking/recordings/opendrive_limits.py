"""Kind and speed limit of an OpenDRIVE road."""

from collections.abc import Callable, Sequence

from overtaking.core.units import mps_from_kmh
from overtaking.knowledge.roads import general_limit
from overtaking.model.road import MAX_SPEED_LIMIT
from overtaking.recordings.messages import shown
from overtaking.recordings.xml_element import Element

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
