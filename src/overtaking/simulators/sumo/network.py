"""From a road to a network of SUMO: one edge with our lanes, longer than any vehicle drives.

SUMO's x is `s` and its y is `d`, turned so that the fast side is on the left: in left-hand traffic
SUMO sees the mirror image, as the step of this package does (ADR 6). So roads that bend and rise
are straight and level there: its drivers slow down for no bend of an edge, and the EIDM asks for no
slope. The limit of an edge is that of the road; `run` tells drivers of lower ones. The lane of
oncoming traffic is an edge the other way, whose lane is stated to be the neighbour of ours, so that
SL2015 overtakes on it. No netconvert is needed, as an edge without junctions has nothing to
compute.
"""

from collections.abc import Sequence

from overtaking.model.road import Road
from overtaking.world.road_parameters import has_two_directions

EDGE, OPPOSITE = "road", "opposite"

BEHIND = 1000.0
"""Road before s = 0, for vehicles that start or stand on it [m]."""

_FASTEST = 80.0
"""Above the top speed of any class, to make the edge long enough [m/s]."""

_LOOK_AHEAD = 60.0
"""Time at that speed beyond the horizon; lane changes of SUMO look some 10 s ahead [s]."""


def length_for(farthest_start: float, horizon: float) -> float:
    """Length of the edge after s = 0, so that no vehicle reaches its end [m].

    Args:
        farthest_start: Largest `s` at the first frame [m].
        horizon: Longest duration [s].
    """
    return max(farthest_start, 0.0) + _FASTEST * (horizon + _LOOK_AHEAD)


def length_before(road: Road, horizon: float) -> float:
    """Length of the edges before s = 0: on two-way roads others drive there, too [m].

    Args:
        road: The road.
        horizon: Longest duration [s].
    """
    return _FASTEST * (horizon + _LOOK_AHEAD) if has_two_directions(road) else BEHIND


def network(road: Road, ahead: float, friction: Sequence[float], before: float = BEHIND) -> str:
    """The content of a `.net.xml` file.

    Args:
        road: The road.
        ahead: Length of the edges after s = 0 [m].
        friction: Friction coefficient of each lane, from the slow side, that of oncoming traffic
            the last [1].
        before: Length before it [m].

    Source:
        Eclipse SUMO user documentation: SUMO Road Networks; Simulation: Opposite Direction Driving.
        Lanes are counted from the right.
    """
    borders = lateral_borders(road)
    last, neighbour = f"{EDGE}_{road.num_lanes - 1}", f"{OPPOSITE}_0"
    both = len(friction) > road.num_lanes
    besides = [""] * (road.num_lanes - 1) + [neighbour if both else ""]
    own = "".join(
        _lane(road, f"{EDGE}_{k}", k, (-before, ahead), friction[k], beside)
        for k, beside in enumerate(besides)
    )
    names = " ".join(f"{EDGE}_{k}" for k in range(road.num_lanes))
    low, high = borders[0], borders[-1]
    box = f"{-before!r},{low!r},{ahead!r},{high!r}"
    edges = f'<edge id="{EDGE}" from="start" to="end" priority="-1">{own}</edge>'
    arriving = ""
    if both:
        theirs = _lane(road, neighbour, road.num_lanes, (ahead, -before), friction[-1], last)
        edges += f'<edge id="{OPPOSITE}" from="end" to="start" priority="-1">{theirs}</edge>'
        arriving = neighbour
    ends = _dead_end("start", -before, low, high, arriving)
    ends += _dead_end("end", ahead, low, high, names)
    return (
        '<net version="1.20">'
        f'<location netOffset="0,0" convBoundary="{box}" origBoundary="{box}" projParameter="!"/>'
        f"{edges}{ends}</net>"
    )


def lateral_borders(road: Road) -> list[float]:
    """Borders of all lanes, that of oncoming traffic the last, towards the fast side [m]."""
    borders: list[float] = (road.overtaking_sign * road.lane_boundaries).tolist()
    beyond = road.overtaking_side_neighbour
    if beyond is not None and has_two_directions(road):
        borders.append(borders[-1] + beyond.width)
    return borders


def _lane(
    road: Road, name: str, lane: int, ends: tuple[float, float], friction: float, beside: str
) -> str:
    """A lane by its number on the road; the only one of its edge where it is of the other way."""
    low, high = lateral_borders(road)[lane : lane + 2]
    y, (start, stop) = 0.5 * (low + high), ends
    width = road.lanes[min(lane, road.num_lanes - 1)].width
    neighbour = f'<neigh lane="{beside}"/>' if beside else ""
    return (
        f'<lane id="{name}" index="{lane % road.num_lanes}" speed="{road.speed_limit!r}"'
        f' length="{abs(stop - start)!r}" width="{width!r}" friction="{float(friction)!r}"'
        f' shape="{start!r},{y!r} {stop!r},{y!r}">{neighbour}</lane>'
    )


def _dead_end(name: str, x: float, low: float, high: float, arriving: str) -> str:
    return (
        f'<junction id="{name}" type="dead_end" x="{x!r}" y="{low!r}" incLanes="{arriving}"'
        f' intLanes="" shape="{x!r},{low!r} {x!r},{high!r}"/>'
    )
