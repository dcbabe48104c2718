"""From a road to a network of SUMO: one edge with our lanes, longer than any vehicle drives.

SUMO's x is `s` and its y is `d`, turned so that the fast side is on the left: in left-hand traffic
SUMO sees the mirror image, as the step of this package does (ADR 6). So roads that bend and rise
are straight and level there: its drivers slow down for no bend of an edge, and the EIDM asks for no
slope. No netconvert is needed, as an edge without junctions has nothing to compute.
"""

from collections.abc import Sequence

from overtaking.model.road import Road

EDGE = "road"

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


def network(road: Road, ahead: float, friction: Sequence[float]) -> str:
    """The content of a `.net.xml` file.

    Args:
        road: The road.
        ahead: Length of the edge after s = 0 [m].
        friction: Friction coefficient of each lane, from the slow side [1].

    Source:
        Eclipse SUMO user documentation: SUMO Road Networks. Lanes are counted from the right.
    """
    lanes = "".join(_lane(road, k, ahead, grip) for k, grip in enumerate(friction))
    names = " ".join(f"{EDGE}_{k}" for k in range(road.num_lanes))
    low, high = sorted((road.side * road.boundaries[0], road.side * road.boundaries[-1]))
    box = f"{-BEHIND!r},{float(low)!r},{ahead!r},{float(high)!r}"
    return (
        '<net version="1.20">'
        f'<location netOffset="0,0" convBoundary="{box}" origBoundary="{box}" projParameter="!"/>'
        f'<edge id="{EDGE}" from="start" to="end" priority="-1">{lanes}</edge>'
        f"{_dead_end('start', -BEHIND, low, high, '')}{_dead_end('end', ahead, low, high, names)}"
        "</net>"
    )


def _lane(road: Road, index: int, ahead: float, friction: float) -> str:
    width = road.lanes[index].width
    y = float(road.side * road.centres[index])
    return (
        f'<lane id="{EDGE}_{index}" index="{index}" speed="{road.speed_limit!r}"'
        f' length="{ahead + BEHIND!r}" width="{width!r}" friction="{float(friction)!r}"'
        f' shape="{-BEHIND!r},{y!r} {ahead!r},{y!r}"/>'
    )


def _dead_end(name: str, x: float, low: float, high: float, arriving: str) -> str:
    low, high = float(low), float(high)
    return (
        f'<junction id="{name}" type="dead_end" x="{x!r}" y="{low!r}" incLanes="{arriving}"'
        f' intLanes="" shape="{x!r},{low!r} {x!r},{high!r}"/>'
    )
