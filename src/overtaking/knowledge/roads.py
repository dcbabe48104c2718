"""Numbers for sight on roads, and speed limits of roads without signs, from `data/roads.toml`.

`world.sight_distance` and the readers of road maps use them. `read_record` fills a dataclass from a
section of the file and converts each value to SI: the file states limits in km/h, the fields hold
m/s.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from overtaking.knowledge.toml_reader import read_record

_FILE = "roads.toml"


@dataclass(frozen=True, slots=True, kw_only=True)
class GeneralLimits:
    """Limits of roads without a posted limit, for light passenger vehicles [m/s].

    Attributes:
        motorway: Limit on motorways.
        town: Limit inside localities, which town signs mark.
        other: Limit everywhere else.
    """

    motorway: float
    town: float
    other: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SightFacts:
    """Numbers for the sight on a road and the sight that passing needs.

    `passing_zone_speeds` and `passing_zone_sight` are the two columns of a table;
    `world.sight_distance` interpolates linearly between its rows.

    Attributes:
        clearance: Lateral distance from the centre of the lane on the inside of a bend to objects
            beside the road that block the view, such as hedges [m].
        eye_height: Height of a car driver's eyes above the road [m].
        truck_eye_height: Height of a truck driver's eyes above the road [m].
        object_height: Height of the part of a vehicle that a driver must see, above the road [m].
        min_visible: Sight distance below which a bend is one of reduced visibility [m].
        passing_zone_speeds: Speed limits, ascending, shape (row,) [m/s].
        passing_zone_sight: Sight distance needed at each of these speed limits before the centre
            line may be broken, so that drivers may pass, shape (row,) [m].

    Source:
        AASHTO, A Policy on Geometric Design of Highways and Streets (2018), section 3.2.6 and
        table 3-4. The clearance is chosen: half a lane, a verge and a ditch. `min_visible` is from
        article 19 of the Portuguese highway code.
    """

    clearance: float
    eye_height: float
    truck_eye_height: float
    object_height: float
    min_visible: float
    passing_zone_speeds: tuple[float, ...]
    passing_zone_sight: tuple[float, ...]


@cache
def sight_facts() -> SightFacts:
    """The numbers for sight in bends and over crests."""
    return read_record(SightFacts, _FILE, "sight")


@cache
def general_limits() -> GeneralLimits:
    """The limits that article 27 of the Portuguese highway code sets for roads without a sign.

    They hold for maps of all countries that state no limit. This choice agrees with Portuguese law,
    by which recordings are judged unless the user names another law.
    """
    return read_record(GeneralLimits, _FILE, "general_limits")


def general_limit(road_type: str) -> float:
    """The limit of a road without a sign, by its road type in OpenDRIVE, a format of road maps.

    Types that begin with "town", such as "townArterial", lie inside localities. So does "lowSpeed",
    the type of 30 km/h zones: the limit of a zone holds by its signs, and without a sign the limit
    of the locality holds. All other types except "motorway" get the limit outside localities. This
    includes "unknown", because nothing shows that such a road lies in a locality.

    Args:
        road_type: Attribute `type` of an element `<type>` of OpenDRIVE.

    Returns:
        The limit of light passenger vehicles [m/s].
    """
    limits = general_limits()
    if road_type == "motorway":
        return limits.motorway
    is_in_locality = road_type.startswith("town") or road_type == "lowSpeed"
    return limits.town if is_in_locality else limits.other
