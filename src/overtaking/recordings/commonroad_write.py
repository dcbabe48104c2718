"""Recorded simulations as CommonRoad scenarios (XML, version 2020a), one file each.

The road becomes lanelets, the vehicles dynamic obstacles, the ego among them with the smallest id.
Positions are those along and across the road, put onto the lanelets with enough digits to come back
the same; what CommonRoad has no place for is left out. The borders of bends are within
`_SAGITTA` of the road's. The lane of oncoming traffic is a lanelet the other way, and where the
line between the directions or a limit changes other lanelets follow.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from overtaking.core.files import write_new_file
from overtaking.model.road import Lane, Road, RoadMark
from overtaking.model.trajectories import STATE_RESOLUTION, Trajectories
from overtaking.model.vehicles import VehicleKind
from overtaking.recordings.commonroad_lanes import MARKS
from overtaking.recordings.xml import quoted

FORMAT = "commonroad"

FIRST_OBSTACLE = 1000
"""Id of the ego; the other vehicles follow by slot."""

SPEED_SIGN = 900
"""Id of the sign that posts the lowest limit; those of higher ones follow."""

DATE = "1970-01-01"
"""What stands where a date is required: a scenario is the same whenever it is written."""

_POINT_SPACING = 50.0
_SAGITTA = 0.005  # How far the points of a bend's border may be from it in between [m].
_MARGIN = 50.0  # How far the lanelets go on beyond the vehicles [m].
_LARGEST_LIMIT = 99.0  # What is higher stands for no limit [m/s].

_TYPES = {
    VehicleKind.TRUCK: "truck",
    VehicleKind.MOTORCYCLE: "motorcycle",
    VehicleKind.BICYCLE: "bicycle",
}
_MARKS = {mark: name for name, mark in reversed(MARKS.items())}  # The plain name of several.


def write_commonroad(trajectories: Trajectories, numbers: NDArray[np.integer], folder: Path) -> int:
    """Write a scenario for each simulation of a batch.

    Args:
        trajectories: Recorded simulations.
        numbers: Number of each in its data set, shape (simulation,).
        folder: Where the files go; they are called after the ids of the scenarios.

    Returns:
        Number of states written.

    Raises:
        OSError: A file cannot be written.
    """
    for place, number in enumerate(numbers.tolist()):
        text = "\n".join(_lines(trajectories, place, number)) + "\n"
        write_new_file(folder / f"{scenario_id(number)}.xml", text)
    return int(trajectories.state_mask.sum())


def scenario_id(number: int) -> str:
    """Id of the scenario of a simulation: no country, one map, no prediction but what happened."""
    return f"ZAM_Overtaking-1_{number + 1}_T-1"


def _lines(trajectories: Trajectories, place: int, number: int) -> Iterator[str]:
    """The lines of one file."""
    scenario, road = trajectories.scenario, trajectories.road
    source = f"{scenario.profile}, seed {scenario.seed}, index {scenario.scenario_index[place]}"
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield (
        f'<commonRoad timeStepSize="{scenario.frame_interval_ms / 1000:g}" '
        f'commonRoadVersion="2020a" author="overtaking" affiliation="overtaking" '
        f'source={quoted(source)} benchmarkID="{scenario_id(number)}" date="{DATE}">'
    )
    yield "<location><geoNameId>-999</geoNameId>"
    yield "<gpsLatitude>999</gpsLatitude><gpsLongitude>999</gpsLongitude></location>"
    kind = {"motorway": "<highway/>", "rural": "<rural/>"}.get(road.kind, "")
    ways = "<no_oncoming_traffic/>"
    if road.is_two_way:
        ways = "<two_lane/><oncoming_traffic/>" if road.num_lanes == 1 else "<oncoming_traffic/>"
    many = "<multi_lane/>" if road.num_lanes > 1 else ""
    yield f"<scenarioTags>{kind}{many}{ways}</scenarioTags>"
    signs = {} if "speed_limit" in trajectories.unknown else _signs(road)
    knows_marks = "marks" not in trajectories.unknown
    yield from _lanelets(road, _extent(trajectories, place), signs, knows_marks=knows_marks)
    for limit, number in signs.items():
        yield _sign(limit, number)
    for slot in np.flatnonzero(scenario.vehicles.valid[place]).tolist():
        yield from _obstacle(trajectories, place, slot)
    yield "</commonRoad>"


def _extent(trajectories: Trajectories, place: int) -> tuple[float, float]:
    """Where the lanelets begin and end, in whole metres so that no digit of `s` is lost [m]."""
    s = trajectories.states.s[place][trajectories.state_mask[place]] * STATE_RESOLUTION["s"]
    begin, end = float(s.min()) - _MARGIN, float(s.max()) + _MARGIN
    return min(0.0, np.floor(begin)), np.ceil(max(trajectories.road.length, end))


def _signs(road: Road) -> dict[float, int]:
    """Ids of the signs that post the limits of a road, by limit [m/s]."""
    lower = road.course.speed_limit_spans if road.course else ()
    limits = sorted({road.speed_limit, *(one.speed for one in lower)})
    posted = [limit for limit in limits if limit < _LARGEST_LIMIT]
    return {limit: SPEED_SIGN + k for k, limit in enumerate(posted)}


def _edges(road: Road, extent: tuple[float, float]) -> list[float]:
    """Where lanelets begin and end: where the line between the directions or a limit changes."""
    changes = (
        {start for start, _ in road.overtaking_edge_marks[1:]} if road.is_two_way else set[float]()
    )
    limits = road.course.speed_limit_spans if road.course else ()
    changes |= {end for one in limits for end in (one.start, one.stop)} - {0.0, road.length}
    return [extent[0], *sorted(s for s in changes if extent[0] < s < extent[1]), extent[1]]


def _lanelets(
    road: Road, extent: tuple[float, float], signs: Mapping[float, int], *, knows_marks: bool
) -> Iterator[str]:
    """The lanelets stretch by stretch, from the slow to the fast side; ids from 1.

    Args:
        road: The road.
        extent: Where they begin and end [m].
        signs: Ids of the signs by the limit that they post [m/s].
        knows_marks: Whether the lines are known.
    """
    lanes, borders = list(road.lanes), road.lane_boundaries
    if (beyond := road.overtaking_side_neighbour) is not None and road.is_two_way:
        lanes.append(beyond)
        borders = np.append(borders, borders[-1] + road.overtaking_sign * beyond.width)
    edges = _edges(road, extent)
    kind = "highway" if road.kind == "motorway" else "unknown"
    for part, (start, stop) in enumerate(pairwise(edges)):
        s = _stations(road, start, stop)
        middle = next(mark for at, mark in reversed(road.overtaking_edge_marks) if at <= start)
        neighbours = [part + step for step in (-1, 1) if 0 <= part + step < len(edges) - 1]
        for k, lane in enumerate(lanes):
            marks = _own_marks(road, lane, k, middle) if knows_marks else (None, None)
            number = 1 + k + part * len(lanes)
            yield f'<lanelet id="{number}">'
            yield from _bounds(road, s, lane, (borders[k], borders[k + 1]), marks)
            linked = [(after, 1 + k + after * len(lanes)) for after in neighbours]
            for word, is_next in (("predecessor", -1), ("successor", 1)):
                for after, other in linked:
                    if (after - part) * lane.direction == is_next:
                        yield f'<{word} ref="{other}"/>'
            yield from _adjacent(road, lanes, k, number)
            yield f"<laneletType>{kind}</laneletType><userOneWay>vehicle</userOneWay>"
            sign = signs.get(float(road.speed_limit_at(max(start, 0.0), lane.direction)))
            if sign is not None:
                yield f'<trafficSignRef ref="{sign}"/>'
            yield "</lanelet>"


def _bounds(
    road: Road,
    s: NDArray[np.float64],
    lane: Lane,
    edges: tuple[float, float],
    marks: tuple[RoadMark | None, RoadMark | None],
) -> Iterator[str]:
    """Both borders of a lanelet, from where its own drivers come.

    Args:
        road: The road.
        s: Stations of the points [m].
        lane: The lane.
        edges: `d` of its borders, in any order [m].
        marks: The lines on its left and right, seen along the road.
    """
    right, left = sorted(edges)
    bounds = [(left, marks[0]), (right, marks[1])]
    if lane.direction < 0:
        bounds, s = bounds[::-1], s[::-1]
    for name, (d, mark) in zip(("leftBound", "rightBound"), bounds, strict=True):
        yield from _bound(name, road, s, d, mark)


def _stations(road: Road, start: float, stop: float) -> NDArray[np.float64]:
    """Stations of the points of a border, near enough to each other in bends [m]."""
    spacing = _POINT_SPACING
    if road.is_curved:
        sharpest = max(max(abs(one.curvature), abs(one.end_curvature)) for one in road.segments)
        # The chord of an arc; lanes on the outside of a bend are longer than the reference line,
        # by half at most (`MAX_CURVED_WIDTH`) and that of who comes.
        spacing = min(spacing, 0.5 * float(np.sqrt(8.0 * _SAGITTA / max(sharpest, 1e-9))))
    return np.linspace(start, stop, 2 + int((stop - start) / spacing))


def _own_marks(road: Road, lane: Lane, k: int, middle: RoadMark) -> tuple[RoadMark, RoadMark]:
    """The lines on the left and right of a lane; the one between the directions as it is here."""
    left, right = lane.left_mark, lane.right_mark
    fast_is_left = road.overtaking_sign > 0
    if k == road.num_lanes - 1:
        left, right = (middle, right) if fast_is_left else (left, middle)
    elif k == road.num_lanes:
        shared = middle.reverse
        left, right = (left, shared) if fast_is_left else (shared, right)
    return left, right


def _adjacent(road: Road, lanes: Sequence[Lane], k: int, number: int) -> Iterator[str]:
    """The lanelets beside one, as its own drivers have them on the left and right."""
    towards_left = 1 if road.overtaking_sign > 0 else -1
    turned = lanes[k].direction
    for name, step in (("Left", towards_left * turned), ("Right", -towards_left * turned)):
        if 0 <= k + step < len(lanes):
            same = lanes[k + step].direction == turned
            way = "same" if same else "opposite"
            yield f'<adjacent{name} ref="{number + step}" drivingDir="{way}"/>'


def _bound(
    name: str, road: Road, s: NDArray[np.float64], d: float, mark: RoadMark | None
) -> Iterator[str]:
    """One border of a lanelet."""
    yield f"<{name}>"
    for x, y in zip(*_source_points(road, s, d), strict=True):
        yield f"<point><x>{x:.6f}</x><y>{y:.6f}</y></point>"
    if mark in _MARKS:
        yield f"<lineMarking>{_MARKS[mark]}</lineMarking>"
    yield f"</{name}>"


def _source_points(
    road: Road, s: NDArray[np.float64], d: NDArray[np.float64] | float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points of a road in the coordinates of the file that it comes from [m]."""
    points = road.to_world(s, d)
    return road.to_source(*points) if road.origin_x or road.origin_y else points


def _sign(limit: float, number: int) -> str:
    """A sign that posts a speed limit, in m/s as CommonRoad wants it."""
    return (
        f'<trafficSign id="{number}"><trafficSignElement><trafficSignID>274</trafficSignID>'
        f"<additionalValue>{limit:.6f}</additionalValue></trafficSignElement>"
        "<virtual>true</virtual></trafficSign>"
    )


def _obstacle(trajectories: Trajectories, place: int, slot: int) -> Iterator[str]:
    """One vehicle with its states in the frames in which it is present."""
    bodies, there = trajectories.scenario.vehicles, trajectories.state_mask[place, slot]
    frames = np.flatnonzero(there)
    if not len(frames):
        return
    kind = VehicleKind(bodies.kind[place, slot])
    is_known = bool(trajectories.known_kinds[place, slot])
    word = _TYPES.get(kind, "car") if is_known else "unknown"
    yield f'<dynamicObstacle id="{FIRST_OBSTACLE + slot}"><type>{word}</type><shape><rectangle>'
    yield f"<length>{bodies.length[place, slot]:.4f}</length>"
    yield f"<width>{bodies.width[place, slot]:.4f}</width></rectangle></shape>"
    states = _states(trajectories, place, slot, frames)
    yield f"<initialState>{next(states)}</initialState>"
    yield "<trajectory>"
    for state in states:
        yield f"<state>{state}</state>"
    yield "</trajectory></dynamicObstacle>"


def _states(
    trajectories: Trajectories, place: int, slot: int, frames: NDArray[np.intp]
) -> Iterator[str]:
    """The content of each state; a single state is repeated, as a trajectory needs one."""
    recorded = trajectories.states

    def column(name: str) -> NDArray[np.float64]:
        return getattr(recorded, name)[place, slot, frames] * STATE_RESOLUTION[name]

    # Not the recorded world: that of a recording bends with its road, the lanelets here may not.
    x, y = _source_points(trajectories.road, column("s"), column("d"))
    heading, speed = column("heading"), column("speed")
    accel, yaw_rate = column("accel_lon"), column("yaw_rate")
    turns = "yaw_rate" not in trajectories.unknown
    for k, frame in enumerate([*frames.tolist(), *([frames[-1] + 1] if len(frames) == 1 else [])]):
        k = min(k, len(frames) - 1)
        yaw = f"<yawRate><exact>{yaw_rate[k]:.4f}</exact></yawRate>" if turns else ""
        yield (
            f"<position><point><x>{x[k]:.6f}</x><y>{y[k]:.6f}</y></point></position>"
            f"<orientation><exact>{heading[k]:.4f}</exact></orientation>"
            f"<time><exact>{frame}</exact></time>"
            f"<velocity><exact>{speed[k]:.3f}</exact></velocity>"
            f"<acceleration><exact>{accel[k]:.3f}</exact></acceleration>{yaw}"
        )
