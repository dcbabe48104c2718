"""Recorded simulations as CommonRoad scenarios (XML, version 2020a), one file each.

The road becomes lanelets, the vehicles dynamic obstacles, the ego among them with the smallest id.
Positions are those along and across the road, put onto the lanelets with enough digits to come back
the same; what CommonRoad has no place for is left out.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from overtaking.core.folders import put_file
from overtaking.model.road import Road, RoadMark
from overtaking.model.trajectory import STEPS, Trajectories
from overtaking.model.vehicles import VehicleKind
from overtaking.recordings.commonroad_lanes import MARKS
from overtaking.recordings.xml import quoted
from overtaking.world.lanes import refuse_oncoming

FORMAT = "commonroad"

FIRST_OBSTACLE = 1000
"""Id of the ego; the other vehicles follow by slot."""

SPEED_SIGN = 900
"""Id of the sign that posts the limit."""

DATE = "1970-01-01"
"""What stands where a date is required: a scenario is the same whenever it is written."""

_POINT_SPACING, _IN_BENDS = 50.0, 2.0  # Between the points of borders [m].
_MARGIN = 50.0  # How far the lanelets go on beyond the vehicles [m].
_LARGEST_LIMIT = 99.0  # What is higher stands for no limit [m/s].

_TYPES = {VehicleKind.T: "truck", VehicleKind.MC: "motorcycle", VehicleKind.B: "bicycle"}
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
        ConfigError: Others come the other way, or the road rises.
        OSError: A file cannot be written.
    """
    refuse_oncoming(trajectories.scenario, "export to CommonRoad")
    if trajectories.road.course and trajectories.road.course.grade:
        trajectories.road.needs_to_be_straight("export to CommonRoad")
    for place, number in enumerate(numbers.tolist()):
        text = "\n".join(_lines(trajectories, place, number)) + "\n"
        put_file(folder / f"{scenario_id(number)}.xml", text)
    return int(trajectories.state_valid.sum())


def scenario_id(number: int) -> str:
    """Id of the scenario of a simulation: no country, one map, no prediction but what happened."""
    return f"ZAM_Overtaking-1_{number + 1}_T-1"


def _lines(trajectories: Trajectories, place: int, number: int) -> Iterator[str]:
    """The lines of one file."""
    scenario, road = trajectories.scenario, trajectories.road
    source = f"{scenario.profile}, seed {scenario.seed}, index {scenario.index[place]}"
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield (
        f'<commonRoad timeStepSize="{scenario.frame_interval_ms / 1000:g}" '
        f'commonRoadVersion="2020a" author="overtaking" affiliation="overtaking" '
        f'source={quoted(source)} benchmarkID="{scenario_id(number)}" date="{DATE}">'
    )
    yield "<location><geoNameId>-999</geoNameId>"
    yield "<gpsLatitude>999</gpsLatitude><gpsLongitude>999</gpsLongitude></location>"
    kind = "<highway/>" if road.kind == "motorway" else ""
    yield f"<scenarioTags>{kind}<multi_lane/><no_oncoming_traffic/></scenarioTags>"
    limit = None if "speed_limit" in trajectories.unknown else road.speed_limit
    limit = limit if limit is not None and limit < _LARGEST_LIMIT else None
    knows_marks = "marks" not in trajectories.unknown
    yield from _lanelets(road, _extent(trajectories, place), limit=limit, knows_marks=knows_marks)
    if limit is not None:
        yield _sign(limit)
    for slot in np.flatnonzero(scenario.vehicles.valid[place]).tolist():
        yield from _obstacle(trajectories, place, slot)
    yield "</commonRoad>"


def _extent(trajectories: Trajectories, place: int) -> tuple[float, float]:
    """Where the lanelets begin and end, in whole metres so that no digit of `s` is lost [m]."""
    s = trajectories.states.s[place][trajectories.state_valid[place]] * STEPS["s"]
    begin, end = float(s.min()) - _MARGIN, float(s.max()) + _MARGIN
    return min(0.0, np.floor(begin)), np.ceil(max(trajectories.road.length, end))


def _lanelets(
    road: Road, extent: tuple[float, float], *, limit: float | None, knows_marks: bool
) -> Iterator[str]:
    """The lanelets from the slow to the fast side, ids from 1."""
    borders = road.boundaries
    spacing = _IN_BENDS if road.bends else _POINT_SPACING
    s = np.linspace(*extent, 2 + int((extent[1] - extent[0]) / spacing))
    lane_type = "highway" if road.kind == "motorway" else "unknown"
    towards_left = 1 if road.side > 0 else -1
    for k, lane in enumerate(road.lanes):
        right, left = sorted((borders[k], borders[k + 1]))
        marks = (lane.left_mark, lane.right_mark) if knows_marks else (None, None)
        yield f'<lanelet id="{k + 1}">'
        yield from _bound("leftBound", road, s, left, marks[0])
        yield from _bound("rightBound", road, s, right, marks[1])
        for name, other in (("Left", k + towards_left), ("Right", k - towards_left)):
            if 0 <= other < road.num_lanes:
                yield f'<adjacent{name} ref="{other + 1}" drivingDir="same"/>'
        yield f"<laneletType>{lane_type}</laneletType><userOneWay>vehicle</userOneWay>"
        if limit is not None:
            yield f'<trafficSignRef ref="{SPEED_SIGN}"/>'
        yield "</lanelet>"


def _bound(
    name: str, road: Road, s: NDArray[np.float64], d: float, mark: RoadMark | None
) -> Iterator[str]:
    """One border of a lanelet."""
    yield f"<{name}>"
    for x, y in zip(*road.world(s, d), strict=True):
        yield f"<point><x>{x:.6f}</x><y>{y:.6f}</y></point>"
    if mark in _MARKS:
        yield f"<lineMarking>{_MARKS[mark]}</lineMarking>"
    yield f"</{name}>"


def _sign(limit: float) -> str:
    """The sign that posts the speed limit, in m/s as CommonRoad wants it."""
    return (
        f'<trafficSign id="{SPEED_SIGN}"><trafficSignElement><trafficSignID>274</trafficSignID>'
        f"<additionalValue>{limit:.6f}</additionalValue></trafficSignElement>"
        "<virtual>true</virtual></trafficSign>"
    )


def _obstacle(trajectories: Trajectories, place: int, slot: int) -> Iterator[str]:
    """One vehicle with its states in the frames in which it is present."""
    bodies, there = trajectories.scenario.vehicles, trajectories.state_valid[place, slot]
    frames = np.flatnonzero(there)
    if not len(frames):
        return
    kind = VehicleKind(bodies.kind[place, slot])
    word = "unknown" if "kinds" in trajectories.unknown else _TYPES.get(kind, "car")
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
        return getattr(recorded, name)[place, slot, frames] * STEPS[name]

    # Not the recorded world: in a recording lanes may widen, the lanelets here do not.
    x, y = trajectories.road.world(column("s"), column("d"))
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
