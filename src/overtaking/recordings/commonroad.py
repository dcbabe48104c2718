"""CommonRoad scenarios (XML, versions 2018b and 2020a) as recordings.

Goals, predictions, signals and static obstacles of a scenario are not read. In left-hand traffic
the scenario is read as its mirror image, in which traffic keeps to the right, and the result is
mirrored back.
"""

import re
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F64
from overtaking.core.errors import ConfigError
from overtaking.model.road import DrivingSide, Road
from overtaking.model.vehicles import VehicleKind, may_be_kind
from overtaking.recordings.commonroad_lanes import Lanelet, lanelet, slices
from overtaking.recordings.commonroad_obstacles import (
    QUANTITIES,
    LeftOut,
    Obstacle,
    is_dynamic,
    read_obstacle,
)
from overtaking.recordings.commonroad_road import Network, Stretch, chosen_road, posted_limit
from overtaking.recordings.commonroad_side import side_of_traffic
from overtaking.recordings.countries import speed_unit
from overtaking.recordings.examination import examine
from overtaking.recordings.messages import refused, shown
from overtaking.recordings.origins import origin_near
from overtaking.recordings.recording import (
    NEVER_RECORDED,
    Recording,
    Tracks,
    Ways,
    bending,
    by_ways,
    kept,
    lane_codes,
    on_road,
    slope,
)
from overtaking.recordings.road import Projection
from overtaking.recordings.state_examination import examine_states
from overtaking.recordings.xml import Element, elements
from overtaking.scenarios.recording_defaults import kinds_by_length

FORMAT = "commonroad"
VERSIONS = ("2018b", "2020a")

_CARS, _TRUCKS = ("car", "taxi"), ("truck", "bus")
_MOTORWAYS = ("highway", "interstate")
_MAX_STEP_S = 1.0
_READ = frozenset(
    {"lanelet", "dynamicObstacle", "obstacle", "trafficSign", "scenarioTags", "location"}
)
_COUNTRY = re.compile("(?:C-)?([A-Za-z]{3})_.*")
"""Id of a benchmark, which begins with its country, such as ZAM_Merge-1_1_T-1. The prefix "C-"
marks scenarios of cooperative driving."""

_MAX_NAMED = 5  # A message lists this many of the obstacles that are left out.
_UNREAD = frozenset(
    {"occupancySet", "signalSeries", "initialSignalState", "planningProblem", "cycle", "stopLine"}
)


def read_commonroad(
    path: Path | str,
    *,
    lanelet_id: int | None = None,
    driving_side: Literal["right", "left"] | None = None,
) -> Recording:
    """The traffic on one road of a CommonRoad scenario.

    Args:
        path: The XML file.
        lanelet_id: A lanelet of the road; by default the road with most recorded states is taken,
            where those of a road with a single lane count for a tenth.
        driving_side: Side of the road that traffic keeps to. By default oncoming lanelets show it,
            and where there are none the country in the scenario's id.

    Returns:
        The recording, with what was left out and how far the road is from the real one in its
        notes.

    Raises:
        ImportFormatError: The file is no such scenario, or its road cannot be represented; the
            message names line and element.
        ConfigError: There is no such lanelet or side.
    """
    if driving_side is not None and driving_side not in ("right", "left"):
        sides = ("right", "left")
        raise ConfigError.unknown_choice(
            what="driving_side", where="read_commonroad", choices=sides, got=repr(driving_side)
        )
    source = Path(path)
    document = _Document()
    for element in elements(source, root="commonRoad", keep=_is_read, skip=_UNREAD):
        document.add(element)
    document.check(source.name)
    document.move_near()
    side, source_of_side = side_of_traffic(document.lanelets.values(), document.country)
    if driving_side is not None:
        side, source_of_side = DrivingSide(driving_side), "option"
    if side is DrivingSide.LEFT:
        document.mirror()
    x, y = (
        np.concatenate([one.states[:, k] for one in document.obstacles.values()]) for k in (0, 1)
    )
    network = Network(
        name=document.name,
        kind=document.road_kind,
        lanelets=document.lanelets,
        limits=document.limits,
        rows={one.number: row for row in slices(document.lanelets) for one in row},
    )
    recording = _recording(document, chosen_road(network, lanelet_id, x, y))
    if side is DrivingSide.LEFT:
        recording = _mirrored(recording)
    origin_x, origin_y = document.shift.tolist()
    return replace(
        recording,
        road=replace(recording.road, origin_x=origin_x, origin_y=origin_y),
        notes=recording.notes | {"driving_side": f"{side.value}, by the {source_of_side}"},
    )


def _mirrored(recording: Recording) -> Recording:
    """A recording in a world where left and right are swapped."""
    tracks = recording.tracks
    names = ("y", "d", "heading", "accel_lat", "yaw_rate", "wheel_angle")
    changes: dict[str, Any] = {name: -getattr(tracks, name) for name in names}
    return replace(recording, road=recording.road.mirror(), tracks=replace(tracks, **changes))


def _is_read(name: str, attributes: Mapping[str, str]) -> bool:
    del attributes
    return name in _READ


@dataclass(slots=True)
class _Document:
    """What was read so far.

    Attributes:
        name: Id of the benchmark.
        step_ms: Time between states [ms].
        lanelets: By id.
        obstacles: The vehicles, by id.
        limits: Speed limits that signs post, by the id of the sign [m/s].
        tags: Tags of the scenario.
        country: Code of ISO 3166-1 of its country, None if it is not known.
        left_out: Number of obstacles without a recorded path, by type.
        unreadable: Id and reason of each vehicle among them whose states are not exact.
        shift: Position in the file of the point that coordinates are counted from [m].
    """

    name: str = ""
    step_ms: int = 0
    lanelets: dict[int, Lanelet] = field(default_factory=dict[int, Lanelet])
    obstacles: dict[int, Obstacle] = field(default_factory=dict[int, Obstacle])
    limits: dict[int, float] = field(default_factory=dict[int, float])
    tags: frozenset[str] = frozenset()
    country: str | None = None
    left_out: Counter[str] = field(default_factory=Counter[str])
    unreadable: list[str] = field(default_factory=list[str])
    shift: F64 = field(default_factory=lambda: np.zeros(2))

    @property
    def road_kind(self) -> str | None:
        """OpenDRIVE's type of road, as far as the tags tell."""
        return "motorway" if self.tags & set(_MOTORWAYS) else None

    def add(self, element: Element) -> None:
        """Note one element."""
        if element.name == "commonRoad":
            self._begin(element)
        elif element.name == "lanelet":
            new_lanelet = lanelet(element, speed_unit(self.country))
            self._once(element, new_lanelet.number, self.lanelets)
            self.lanelets[new_lanelet.number] = new_lanelet
            element.children.clear()  # Only its place is still needed: points take much memory.
        elif element.name == "trafficSign":
            limit = posted_limit(element, speed_unit(self.country))
            if limit is not None:
                self.limits[element.integer("id")] = limit
        elif element.name == "scenarioTags":
            self.tags = frozenset(child.name for child in element.children)
        elif element.name == "location":
            country = element.optional("country")
            self.country = country.text if country is not None and country.text else self.country
        elif is_dynamic(element):
            self._obstacle(element)

    def check(self, file: str) -> None:
        """Refuse a scenario without a road or without traffic."""
        next_step = "choose a scenario with recorded traffic"
        if not self.lanelets:
            raise refused(file, "scenario", "lanelets", "none", next_step)
        if not self.obstacles:
            got = self.described_left_out or "none"
            raise refused(file, "scenario", "vehicles with a path", got, next_step)

    @property
    def described_left_out(self) -> str | None:
        """Ids and reasons of vehicles without exact states, None if there are none."""
        num_unnamed = len(self.unreadable) - _MAX_NAMED
        named = "; ".join(self.unreadable[:_MAX_NAMED])
        return f"{named}; and {num_unnamed} more" if num_unnamed > 0 else named or None

    def mirror(self) -> None:
        """Swap left and right."""
        self.lanelets = {number: lanelet.mirrored() for number, lanelet in self.lanelets.items()}
        mirrored = [QUANTITIES.index(name) for name in ("y", "orientation", "yawRate")]
        for vehicle in self.obstacles.values():
            vehicle.states[:, mirrored] *= -1.0

    def move_near(self) -> None:
        """Bring lanelets and vehicles near the origin, by whole kilometres, if they are far."""
        corners = np.array([corner for lanelet in self.lanelets.values() for corner in lanelet.box])
        self.shift = np.array(origin_near(*corners.T))
        if not self.shift.any():
            return
        self.lanelets = {
            number: lanelet.moved(self.shift) for number, lanelet in self.lanelets.items()
        }
        for vehicle in self.obstacles.values():
            vehicle.states[:, :2] -= self.shift

    def _begin(self, root: Element) -> None:
        version = root.attribute("commonRoadVersion")
        if version not in VERSIONS:
            raise root.error(
                "has an unknown version",
                " or ".join(VERSIONS),
                shown(version),
                "convert it with CommonRoad's own tools",
            )
        step = root.number("timeStepSize")
        self.step_ms = round(step * 1000.0)
        if not (0.01 <= step <= _MAX_STEP_S) or abs(self.step_ms - step * 1000.0) > 1e-6:
            raise root.error(
                "attribute timeStepSize",
                f"whole milliseconds from 0.01 to {_MAX_STEP_S:g} s",
                f"{step:g}",
            )
        self.name = shown(root.attribute("benchmarkID"), length=80)
        match = _COUNTRY.fullmatch(self.name)
        self.country = None if match is None else match[1]

    def _obstacle(self, element: Element) -> None:
        vehicle = read_obstacle(element)
        if isinstance(vehicle, LeftOut):
            self.left_out[shown(vehicle.kind)] += 1
            if vehicle.reason is not None:
                self.unreadable.append(f"obstacle {vehicle.number}: {vehicle.reason}")
            return
        self._once(element, vehicle.number, self.obstacles)
        self.obstacles[vehicle.number] = vehicle

    def _once(self, element: Element, number: int, known: Collection[int]) -> None:
        if number in known:
            raise element.error("has an id that another has", "different ids", str(number))


def _recording(document: _Document, road: Stretch) -> Recording:
    """The vehicles of a document on one of its roads."""
    obstacles = [obstacle for _, obstacle in sorted(document.obstacles.items())]
    states = np.concatenate([obstacle.states for obstacle in obstacles])
    time = np.concatenate([obstacle.times for obstacle in obstacles]).astype(np.float64)
    examined = examine_states(
        np.repeat(np.arange(len(obstacles)), [len(obstacle.states) for obstacle in obstacles]),
        time,
        {name: states[:, k] for k, name in enumerate(QUANTITIES)},
        names=np.array([str(obstacle.number) for obstacle in obstacles], np.object_),
        interval_ms=document.step_ms,
        file_name=document.name,
    )
    # Obstacles are in the order of the file.
    rank = {number: row for row, number in enumerate(document.obstacles)}
    file_row = np.array([rank[obstacle.number] for obstacle in obstacles], np.int64)
    start, given = examined.start, examined.values
    place = road.shape.project(given["x"], given["y"])
    derived = [name for name, values in given.items() if np.isnan(values).any()]
    values: dict[str, Any] = _bodies([obstacles[vehicle] for vehicle in examined.vehicle.tolist()])
    values |= _motion(given, place, road.road, start, document.step_ms)
    tracks = Tracks(
        names=examined.names,
        file_row=file_row[examined.vehicle],
        first=examined.first,
        start=start,
        x=given["x"],
        y=given["y"],
        s=place.s,
        d=place.d,
        lane=lane_codes(road.road, place.d),
        wheel_angle=np.zeros(len(place.s)),
        **values,
    )
    there = on_road(road.road, place.s, place.d)
    ways = by_ways(kept(tracks, there, document.step_ms), road.road)
    _check_some(document.name, ways)
    unknown = NEVER_RECORDED | {"weather"} | road.unknown
    if "yawRate" in derived:
        unknown |= {"yaw_rate"}
    x, y = road.road.to_world(place.s[there], place.d[there])
    off = np.hypot(x - given["x"][there], y - given["y"][there])
    recording = Recording(
        name=document.name,
        file_format=FORMAT,
        road=road.road,
        frame_interval_ms=document.step_ms,
        tracks=ways.tracks,
        unknown=unknown,
        notes={
            **road.notes,
            **ways.notes,
            "straightening_m": round(float(off.max()), 3),
            "longest_way": round(float(np.abs(place.stretch[there] - 1.0).max()), 5),
            "states": ways.tracks.num_rows,
            "states_off_the_road": len(there) - int(there.sum()),
            "obstacles_left_out": dict(sorted(document.left_out.items())),
            "vehicles_left_out": document.described_left_out,
            "world_shift_m": document.shift.tolist(),
            "derived": derived,
        },
        findings=examined.findings,
    )
    return examine(recording)


def _check_some(name: str, ways: Ways) -> None:
    """Refuse a road without vehicles that drive along it."""
    if not ways.along:
        oncoming = ways.oncoming + ways.left_out
        raise refused(
            name,
            "road",
            "vehicles that drive along it",
            f"{oncoming} oncoming ones" if oncoming else "none",
            "choose another road by one of its lanelets: --lanelet",
        )


def _bodies(obstacles: list[Obstacle]) -> dict[str, Any]:
    """What does not change."""
    names = np.array([one.kind for one in obstacles])
    length = np.array([one.length for one in obstacles])
    is_car, is_truck = np.isin(names, _CARS), np.isin(names, _TRUCKS)
    kind = kinds_by_length(length, is_truck=is_truck, is_car=is_car)
    is_two_wheeler = np.zeros(len(names), np.bool_)
    for name, code in (("motorcycle", VehicleKind.MOTORCYCLE), ("bicycle", VehicleKind.BICYCLE)):
        kind[names == name] = code
        is_two_wheeler |= names == name
    # Many recordings call every vehicle a car, also trucks of 20 m.
    is_kind_known = (is_car | is_truck | is_two_wheeler) & may_be_kind(kind, length)
    return {
        "kind": kind,
        "is_kind_known": is_kind_known,
        "length": length,
        "width": np.array([one.width for one in obstacles]),
        "carriageway": np.zeros(len(obstacles), np.int64),
    }


def _motion(
    given: dict[str, F64], place: Projection, road: Road, start: NDArray[np.int64], step_ms: int
) -> dict[str, F64]:
    """Speeds, directions and accelerations, worked out from positions where they are not given."""

    def rate(values: F64) -> F64:
        return slope(values, start, step_ms)

    def or_else(name: str, other: F64) -> F64:
        return np.where(np.isnan(given[name]), other, given[name])

    east, north = rate(given["x"]), rate(given["y"])
    velocity = or_else("velocity", np.hypot(east, north))
    # A vehicle that hardly moves has no direction of movement.
    course = np.where(np.hypot(east, north) > 0.5, np.arctan2(north, east), place.tangent)
    turned = or_else("orientation", course) - place.tangent
    relative = turned - np.round(turned / (2.0 * np.pi)) * (2.0 * np.pi)
    cosine = np.cos(relative)
    turning = bending(road, place.s, place.d)[1] * (velocity * cosine) ** 2
    return {
        "speed": np.abs(velocity),
        "heading": place.tangent + relative,
        "accel_lon": or_else("acceleration", rate(velocity)),
        # Across the road, and with it as it bends; to the vehicle's left.
        "accel_lat": (rate(rate(place.d)) + turning) * np.where(cosine < 0.0, -1.0, 1.0),
        "yaw_rate": np.where(np.isnan(given["yawRate"]), 0.0, given["yawRate"]),
    }
