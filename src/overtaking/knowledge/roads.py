"""Sight facts and general speed limits, from `data/roads.toml`.

`read_record` turns each entry into the SI value of its unit, so that the limits that the file
states in km/h are m/s here.
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
        motorway: On motorways.
        town: Inside localities.
        other: Everywhere else.
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
        clearance: Lateral distance from the centre of the innermost lane of a bend to the objects
            beside the road that block the view [m].
        eye_height: Height of a car driver's eyes above the road [m].
        truck_eye_height: Height of a truck driver's eyes above the road [m].
        object_height: Height of the part of a vehicle that a driver must see, above the road [m].
        passing_zone_speeds: Speed limits, ascending [m/s].
        passing_zone_sight: Smallest sight distance at each of these speed limits at which markings
            allow passing [m].

    Source:
        AASHTO, A Policy on Geometric Design of Highways and Streets (2018), section 3.2.6 and
        table 3-4; the clearance is a choice, see the file.
    """

    clearance: float
    eye_height: float
    truck_eye_height: float
    object_height: float
    passing_zone_speeds: tuple[float, ...]
    passing_zone_sight: tuple[float, ...]


@cache
def sight_facts() -> SightFacts:
    """The numbers for sight on roads that bend or rise."""
    return read_record(SightFacts, _FILE, "sight")


@cache
def general_limits() -> GeneralLimits:
    """The limits that article 27 of the Portuguese highway code sets for roads without a sign."""
    return read_record(GeneralLimits, _FILE, "general_limits")


def general_limit(road_type: str) -> float:
    """The limit of a road without a sign, by its OpenDRIVE road type.

    The types "town", "townArterial" and the others that begin with "town" lie inside localities; so
    does "lowSpeed", OpenDRIVE's word for a 30 km/h zone. All types except these and "motorway" get
    the limit outside localities: "rural"; "unknown", because nothing shows that such a road lies in
    a locality; "pedestrian" and "bicycle", on which the package simulates no traffic.

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
