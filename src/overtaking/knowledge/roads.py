"""Sight facts and general speed limits."""

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
    """Numbers for the sight on a road and the sight that passing needs; all in SI.

    Attributes:
        clearance: From the middle of the lane inside a bend to the obstacle to sight [m].
        eye_height: Height of a car driver's eyes above the road [m].
        truck_eye_height: Height of a truck driver's eyes above the road [m].
        object_height: Height of the part of a vehicle that a driver must see, above the road [m].
        passing_zone_speeds: Speed limits [m/s].
        passing_zone_sight: Least sight at each speed limit where markings allow passing [m].
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
    """The limits that Portuguese law sets for roads without a sign."""
    return read_record(GeneralLimits, _FILE, "general_limits")


def general_limit(kind: str) -> float:
    """The limit of a road without a sign, by its OpenDRIVE road type.

    Args:
        kind: Road type. Types that begin with "town", and "lowSpeed", lie inside localities.

    Returns:
        The limit of light passenger vehicles [m/s].
    """
    limits = general_limits()
    if kind == "motorway":
        return limits.motorway
    return limits.town if kind.startswith("town") or kind == "lowSpeed" else limits.other
