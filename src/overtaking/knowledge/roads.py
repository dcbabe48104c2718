"""Facts about the roads that come with the package, and the limits of roads without a sign."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from overtaking.knowledge.reader import read_section

ROAD_NAMES = ("town06", "motorway", "rural")
"""The roads that come with the package."""

_FILE = "roads.toml"


@dataclass(frozen=True, slots=True, kw_only=True)
class BesideFacts:
    """A lane beside the driving lanes.

    Attributes:
        lane_id: OpenDRIVE id.
        kind: OpenDRIVE lane type.
        width: Width [m].
        far_mark: Line on its side away from the driving lanes, spelled as CARLA does.
        is_oncoming: Whether its traffic comes the other way.
    """

    lane_id: int
    kind: str
    width: float
    far_mark: str
    is_oncoming: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseFacts:
    """What changes along a two-way road: where each stretch begins and ends [m].

    Attributes:
        solid: Where the line between the directions is solid for both.
        solid_broken: Where it is solid for the driving lanes alone.
        broken_solid: Where it is solid for oncoming traffic alone.
        junction: Junctions.
        crest: Crests.
        bend: Bends of reduced visibility.
        sight: Stations, and how far one sees from there along the road.
        sight_against: The same for oncoming traffic.
    """

    solid: tuple[tuple[float, float], ...] = ()
    solid_broken: tuple[tuple[float, float], ...] = ()
    broken_solid: tuple[tuple[float, float], ...] = ()
    junction: tuple[tuple[float, float], ...] = ()
    crest: tuple[tuple[float, float], ...] = ()
    bend: tuple[tuple[float, float], ...] = ()
    sight: tuple[tuple[float, float], ...] = ()
    sight_against: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadFacts:
    """A straight road, lanes from the slow to the fast side, all in SI.

    Attributes:
        kind: OpenDRIVE road type.
        driving_side: "right" or "left".
        lane_ids: OpenDRIVE ids.
        lane_widths: Widths [m].
        slow_edge_mark: Line on the slow side of the first lane.
        lane_mark: Line between two lanes.
        fast_edge_mark: Line on the fast side of the last lane.
        edge_d: Offset of the slow-side edge of the first lane [m].
        length: Length [m].
        x0: World x of (s, d) = (0, 0) [m].
        y0: World y of (s, d) = (0, 0) [m].
        heading: Direction of travel, anticlockwise from x [rad].
        speed_limit: Posted limit [m/s].
        slow_side: Lane beside the first lane.
        fast_side: Lane beside the last lane.
        course: What changes along it, if anything does.
    """

    kind: str
    driving_side: str
    lane_ids: tuple[float, ...]
    lane_widths: tuple[float, ...]
    slow_edge_mark: str
    lane_mark: str
    fast_edge_mark: str
    edge_d: float
    length: float
    x0: float
    y0: float
    heading: float
    speed_limit: float
    slow_side: BesideFacts
    fast_side: BesideFacts
    course: CourseFacts | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class GeneralLimits:
    """Limits that hold where none is posted, for light passenger vehicles [m/s].

    Attributes:
        motorway: On motorways.
        town: Inside localities.
        other: Everywhere else.
    """

    motorway: float
    town: float
    other: float


@cache
def road_facts(name: str) -> RoadFacts:
    """The facts about one of `ROAD_NAMES`; KnowledgeError for any other name."""
    return read_section(RoadFacts, _FILE, name)


@dataclass(frozen=True, slots=True, kw_only=True)
class SightFacts:
    """What limits the sight of a road, and below which sight one does not pass; all in SI.

    Attributes:
        clearance: From the middle of the lane inside a bend to what hides the road [m].
        eye_height: Of who drives a car, above the road [m].
        truck_eye_height: Of who drives a truck [m].
        object_height: Of what is seen of a vehicle [m].
        passing_speed: Speed limits [m/s].
        passing_sight: Least sight at each of them where lines let one pass [m].
    """

    clearance: float
    eye_height: float
    truck_eye_height: float
    object_height: float
    passing_speed: tuple[float, ...]
    passing_sight: tuple[float, ...]


@cache
def sight_facts() -> SightFacts:
    """What limits the sight of a road that bends or rises."""
    return read_section(SightFacts, _FILE, "sight")


@cache
def general_limits() -> GeneralLimits:
    """The limits that Portuguese law sets for roads without a sign."""
    return read_section(GeneralLimits, _FILE, "general_limits")


def general_limit(kind: str) -> float:
    """The limit of a road without a sign [m/s], by its OpenDRIVE road type.

    Every type whose name begins with "town" and "lowSpeed" lie inside localities.
    """
    limits = general_limits()
    if kind == "motorway":
        return limits.motorway
    return limits.town if kind.startswith("town") or kind == "lowSpeed" else limits.other
