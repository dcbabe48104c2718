"""Recordings written by hand: CommonRoad scenarios and highD files with every number known.

The writers here are not those of the package, so that readers are held to the formats themselves.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from overtaking.recordings.batch import trajectories
from overtaking.recordings.candidates import Window

# The columns of highD's files, as the owners' own reader names them.
RECORDING_META = (
    *("id", "frameRate", "locationId", "speedLimit", "month", "weekDay", "startTime", "duration"),
    *("totalDrivenDistance", "totalDrivenTime", "numVehicles", "numCars", "numTrucks"),
    *("upperLaneMarkings", "lowerLaneMarkings"),
)
TRACKS_META = (
    *("id", "width", "height", "initialFrame", "finalFrame", "numFrames", "class"),
    *("drivingDirection", "traveledDistance", "minXVelocity", "maxXVelocity", "meanXVelocity"),
    *("minDHW", "minTHW", "minTTC", "numLaneChanges"),
)
TRACKS = (
    *("frame", "id", "x", "y", "width", "height", "xVelocity", "yVelocity", "xAcceleration"),
    *("yAcceleration", "frontSightDistance", "backSightDistance", "dhw", "thw", "ttc"),
    *("precedingXVelocity", "precedingId", "followingId", "leftPrecedingId", "leftAlongsideId"),
    *("leftFollowingId", "rightPrecedingId", "rightAlongsideId", "rightFollowingId", "laneId"),
)


if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from overtaking.model.trajectories import Trajectories
    from overtaking.recordings.recording import Recording

WIDTH = 3.5


def with_gaps(run: Trajectories) -> Trajectories:
    """The recording as if some vehicles had not been there in some frames."""
    draw = np.random.default_rng(1)
    return dataclasses.replace(run, is_recorded=draw.random(run.states.s.shape) > 0.3)


@dataclass(frozen=True, kw_only=True)
class Mover:
    """A vehicle that drives at one speed and changes lanes on smooth ramps.

    Attributes:
        number: Its id.
        s: Centre at the first frame of the recording, were it there [m].
        speed: [m/s]; below 0 it drives against the road, forwards.
        lane: Lane index at the beginning, 0 the slowest.
        moves: (second, lane index) of each change: the middle of the ramp, and where it leads.
        ramp: Duration of a change [s].
        first: First frame in which it is there.
        last: Last one.
        length: [m].
        kind: CommonRoad's type.
    """

    number: int
    s: float = 0.0
    speed: float = 25.0
    lane: int = 0
    moves: Sequence[tuple[float, int]] = ()
    ramp: float = 4.0
    first: int = 0
    last: int = 299
    length: float = 4.5
    kind: str = "car"

    def path(self, frame_interval_ms: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Frames, positions along and lane positions (in lanes from the slow lane's centre)."""
        frame = np.arange(self.first, self.last + 1)
        time = frame * frame_interval_ms * 1e-3
        place, lane = np.full(len(time), float(self.lane)), self.lane
        for middle, target in self.moves:
            part = np.clip((time - middle) / self.ramp + 0.5, 0.0, 1.0)
            place += (target - lane) * part**3 * (10.0 - 15.0 * part + 6.0 * part * part)
            lane = target
        return frame, self.s + self.speed * time, place


OVERTAKE = (
    Mover(number=7, s=20.0, speed=30.0, moves=((4.0, 1), (14.0, 0))),
    Mover(number=3, s=80.0, speed=24.0),
    Mover(number=5, s=-30.0, speed=26.0, lane=1),
    Mover(number=9, s=300.0, speed=20.0, length=12.0),
)
"""Vehicle 7 overtakes vehicle 3 and returns; 5 follows on the left, 9 is far ahead."""


@dataclass(frozen=True, kw_only=True)
class Bend:
    """A road of constant curvature, its right edge beginning at the origin along x.

    Attributes:
        curvature: To the left [1/m].
        lanes: Number of lanes.
        length: Along the right edge [m].
        cuts: Ways at which lanelets end and others begin [m].
    """

    curvature: float = 0.0
    lanes: int = 3
    length: float = 1000.0
    cuts: Sequence[float] = field(default_factory=tuple)

    def to_world(
        self, s: np.ndarray, left: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """World x, y and direction at a way along the right edge and an offset to its left."""
        s, left = np.broadcast_arrays(np.asarray(s, float), np.asarray(left, float))
        angle = self.curvature * s
        if self.curvature == 0.0:
            return s, left, angle
        radius = 1.0 / self.curvature - left
        return radius * np.sin(angle), 1.0 / self.curvature - radius * np.cos(angle), angle

    def points(self, begin: float, end: float, left: float) -> str:
        """A border as points."""
        s = np.linspace(begin, end, 2 + int((end - begin) / 5.0))
        x, y, _ = self.to_world(s, np.full(len(s), left))
        pairs = zip(x, y, strict=True)
        return "".join(f"<point><x>{a:.6f}</x><y>{b:.6f}</y></point>" for a, b in pairs)

    def lanelets(self) -> str:
        """All lanelets; that of lane k and piece p is called 10 (p + 1) + k + 1."""
        ends = [0.0, *self.cuts, self.length]
        return "".join(
            self._lanelet(k, p, ends) for p in range(len(ends) - 1) for k in range(self.lanes)
        )

    def _lanelet(self, k: int, p: int, ends: list[float]) -> str:
        number, last = 10 * (p + 1) + k + 1, self.lanes - 1
        left_mark = "solid" if k == last else "dashed"
        right_mark = "solid" if k == 0 else "dashed"
        links = f'<predecessor ref="{number - 10}"/>' if p else ""
        links += f'<successor ref="{number + 10}"/>' if p < len(ends) - 2 else ""
        beside = f'<adjacentLeft ref="{number + 1}" drivingDir="same"/>' if k < last else ""
        beside += f'<adjacentRight ref="{number - 1}" drivingDir="same"/>' if k else ""
        span = (ends[p], ends[p + 1])
        return (
            f'<lanelet id="{number}"><leftBound>{self.points(*span, (k + 1) * WIDTH)}'
            f"<lineMarking>{left_mark}</lineMarking></leftBound>"
            f"<rightBound>{self.points(*span, k * WIDTH)}"
            f"<lineMarking>{right_mark}</lineMarking></rightBound>{links}{beside}"
            "<laneletType>interstate</laneletType></lanelet>"
        )


def commonroad(
    movers: Sequence[Mover] = OVERTAKE,
    road: Bend | None = None,
    *,
    version: str = "2020a",
    frame_interval_ms: int = 100,
    more: str = "",
    yaws: bool = False,
) -> str:
    """A CommonRoad scenario; vehicles point along the road, unless they yaw as they move."""
    bend = road or Bend()
    vehicles = "".join(_obstacle(one, bend, version, frame_interval_ms, yaws) for one in movers)
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<commonRoad commonRoadVersion="{version}" '
        f'timeStepSize="{frame_interval_ms / 1000:g}" benchmarkID="ZAM_Hand-1_1_T-1">\n'
        f"{bend.lanelets()}\n{more}\n{vehicles}\n</commonRoad>\n"
    )


def _obstacle(one: Mover, road: Bend, version: str, interval: int, yaws: bool = False) -> str:
    frame, s, place = one.path(interval)
    x, y, angle = road.to_world(s, (place + 0.5) * WIDTH)
    angle = angle + np.pi * (one.speed < 0.0)
    speed = np.full(len(frame), abs(one.speed))
    if yaws:
        left = motion(one, interval)[3]
        angle, speed = angle + np.arctan2(left, one.speed), np.hypot(one.speed, left)
    states = [
        f"<position><point><x>{x[k]:.4f}</x><y>{y[k]:.4f}</y></point></position>"
        f"<orientation><exact>{angle[k]:.6f}</exact></orientation>"
        f"<time><exact>{frame[k]}</exact></time><velocity><exact>{speed[k]:.9g}</exact></velocity>"
        for k in range(len(frame))
    ]
    begin = f'<dynamicObstacle id="{one.number}">'
    if version == "2018b":
        begin = f'<obstacle id="{one.number}"><role>dynamic</role>'
    end = "</obstacle>" if version == "2018b" else "</dynamicObstacle>"
    path = "".join(f"<state>{state}</state>" for state in states[1:])
    return (
        f"{begin}<type>{one.kind}</type><shape><rectangle><length>{one.length:g}</length>"
        f"<width>1.8</width></rectangle></shape><initialState>{states[0]}</initialState>"
        f"<trajectory>{path}</trajectory>{end}\n"
    )


HIGHD_ROWS = (
    "frame,id,x,y,width,height,xVelocity,yVelocity,xAcceleration,yAcceleration,frontSightDistance,"
    "backSightDistance,dhw,thw,ttc,precedingXVelocity,precedingId,followingId,leftPrecedingId,"
    "leftAlongsideId,leftFollowingId,rightPrecedingId,rightAlongsideId,rightFollowingId,laneId"
)
HIGHD_VEHICLES = (
    "id,width,height,initialFrame,finalFrame,numFrames,class,drivingDirection,traveledDistance,"
    "minXVelocity,maxXVelocity,meanXVelocity,minDHW,minTHW,minTTC,numLaneChanges"
)
HIGHD_META = (
    "id,frameRate,locationId,speedLimit,month,weekDay,startTime,duration,totalDrivenDistance,"
    "totalDrivenTime,numVehicles,numCars,numTrucks,upperLaneMarkings,lowerLaneMarkings"
)


def highd(
    folder: Path,
    *,
    lower: Sequence[Mover] = OVERTAKE,
    upper: Sequence[Mover] = (),
    limit: float = -1.0,
    upper_lines: str = "4;7.5;11;14.5",
    lower_lines: str = "20;23.5;27;30.5",
    extent: float = 900.0,
) -> Path:
    """A highD recording in three files; the upper lanes drive to the left, from `extent` on.

    Returns:
        The path of its tracks.
    """
    rows, vehicles = [HIGHD_ROWS], [HIGHD_VEHICLES]
    for direction, movers in ((1, upper), (2, lower)):
        for one in movers:
            kind = "Truck" if one.kind == "truck" else "Car"
            vehicles.append(
                f"{one.number},{one.length:g},1.8,{one.first},{one.last},"
                f"{one.last - one.first + 1},{kind},{direction},0,0,0,0,0,0,0,0"
            )
            rows += _highd_rows(one, direction, extent)
    meta = f"1,25,1,{limit:g},9.2017,Tue,08:38,12,0,0,4,4,0,{upper_lines},{lower_lines}"
    for name, lines in (
        ("tracks", rows),
        ("tracksMeta", vehicles),
        ("recordingMeta", [HIGHD_META, meta]),
    ):
        (folder / f"01_{name}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder / "01_tracks.csv"


def _highd_rows(one: Mover, direction: int, extent: float) -> list[str]:
    frame, s, place = one.path(40)
    # From the slow edge: the lowest line for the lower lanes, the highest for the upper ones.
    across = (place + 0.5) * WIDTH
    x = s if direction == 2 else extent - s
    y = 30.5 - across if direction == 2 else 4.0 + across
    sign = 1.0 if direction == 2 else -1.0
    return [
        f"{frame[k]},{one.number},{x[k] - one.length / 2:.4f},{y[k] - 0.9:.4f},{one.length:g},1.8,"
        f"{sign * one.speed:g},0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,2"
        for k in range(len(frame))
    ]


EXID_ROWS = (
    "recordingId,trackId,frame,trackLifetime,xCenter,yCenter,heading,width,length,xVelocity,"
    "yVelocity,xAcceleration,yAcceleration,lonVelocity,latVelocity,lonAcceleration,latAcceleration,"
    "traveledDistance,latLaneCenterOffset,laneWidth,laneletId"
)
EXID_VEHICLES = "recordingId,trackId,initialFrame,finalFrame,numFrames,width,length,class"
EXID_META = "recordingId,locationId,frameRate,speedLimit,weekday,startTime,duration,numTracks"


def motion(
    one: Mover, frame_interval_ms: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Frames, way along the road, distance from its right edge and speed to the left."""
    frame, s, place = one.path(frame_interval_ms)
    across = (place + 0.5) * WIDTH
    left = np.gradient(across, frame_interval_ms * 1e-3) if len(across) > 1 else across * 0.0
    return frame, s, across, left


def exid(
    folder: Path, movers: Sequence[Mover] = OVERTAKE, *, rate: int = 25, turn: float = 0.0
) -> Path:
    """An exiD recording in three files: a road from the origin at an angle [rad].

    Returns:
        The path of its tracks.
    """
    rows, vehicles = [EXID_ROWS], [EXID_VEHICLES]
    cosine, sine = np.cos(turn), np.sin(turn)
    for one in movers:
        kind = "truck" if one.kind == "truck" else "car"
        vehicles.append(
            f"1,{one.number},{one.first},{one.last},{one.last - one.first + 1},1.8,"
            f"{one.length:g},{kind}"
        )
        frame, s, across, left = motion(one, 1000 // rate)
        x, y = s * cosine - across * sine, s * sine + across * cosine
        vx, vy = one.speed * cosine - left * sine, one.speed * sine + left * cosine
        heading = np.degrees(np.arctan2(vy, vx)) % 360.0
        rows += [
            f"1,{one.number},{frame[k]},{k},{x[k]:.5f},{y[k]:.5f},{heading[k]:.5f},1.8,"
            f"{one.length:g},{vx[k]:.5f},{vy[k]:.5f},0,0,{one.speed:g},0,0,0,0,0,3.5,1;2"
            for k in range(len(frame))
        ]
    meta = f"1,0,{rate},-1,tuesday,9,60,{len(movers)}"
    for name, lines in (
        ("tracks", rows),
        ("tracksMeta", vehicles),
        ("recordingMeta", [EXID_META, meta]),
    ):
        (folder / f"01_{name}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder / "01_tracks.csv"


NGSIM_ROWS = (
    "Vehicle_ID,Frame_ID,Total_Frames,Global_Time,Local_X,Local_Y,Global_X,Global_Y,v_length,"
    "v_Width,v_Class,v_Vel,v_Acc,Lane_ID,Preceding,Following,Space_Headway,Time_Headway,Location"
)
FOOT = 0.3048


def ngsim(movers: Sequence[Mover] = OVERTAKE, *, lanes: int = 3) -> str:
    """A recording of NGSIM, 10 frames a second, in feet, with the middles of the fronts."""
    lines = [NGSIM_ROWS]
    for one in movers:
        frame, s, across, left = motion(one, 100)
        angle = np.arctan2(left, one.speed)
        front = s + np.cos(angle) * one.length * 0.5
        from_left = lanes * WIDTH - across - np.sin(angle) * one.length * 0.5
        lane = lanes - np.floor(across / WIDTH).astype(int)
        speed = np.hypot(one.speed, left)
        kind = 3 if one.kind == "truck" else 2
        lines += [
            f"{one.number},{frame[k]},{len(frame)},{1118846980200 + 100 * frame[k]},"
            f"{from_left[k] / FOOT:.4f},{front[k] / FOOT:.4f},6451137.64,1873344.96,"
            f"{one.length / FOOT:.4f},{1.8 / FOOT:.4f},{kind},{speed[k] / FOOT:.4f},0,{lane[k]},0,"
            "0,0,0,us-101"
            for k in range(len(frame))
        ]
    return "\n".join(lines) + "\n"


def states(movers: Sequence[Mover] = OVERTAKE, *, interval_ms: float = 100) -> dict[str, list]:
    """The same as columns: centres and corners in metres, y to the left."""
    table: dict[str, list] = {name: [] for name in ("id", "t", "x", "y", "length", "width", "kind")}
    table |= {f"{axis}{corner}": [] for axis in "xy" for corner in range(1, 5)}
    table |= {name: [] for name in ("vx", "vy", "yaw")}
    for one in movers:
        frame, s, across, left = motion(one, interval_ms)
        angle = np.arctan2(left, one.speed)
        count = len(frame)
        for name, values in (
            ("id", [one.number] * count),
            ("t", frame * interval_ms * 1e-3),
            ("x", s),
            ("y", across),
            ("length", [one.length] * count),
            ("width", [1.8] * count),
            ("kind", [one.kind] * count),
            ("vx", [one.speed] * count),
            ("vy", left),
            ("yaw", np.degrees(angle)),
        ):
            table[name].extend(values)
        signs = ((1, -1), (-1, -1), (-1, 1), (1, 1))
        for corner, (along, side) in enumerate(signs, 1):
            lon, lat = along * one.length * 0.5, side * 0.9
            table[f"x{corner}"].extend(s + lon * np.cos(angle) - lat * np.sin(angle))
            table[f"y{corner}"].extend(across + lon * np.sin(angle) + lat * np.cos(angle))
    return table


def whole(recording: Recording, ego_id: int) -> Trajectories:
    """All of a recording as one simulation: the ego in slot 0, the others in order of their ids.

    What was exported and is read again is the simulation that it was, slot by slot.
    """
    tracks = recording.tracks
    ego = int(np.flatnonzero(tracks.names == str(ego_id))[0])
    others = [one for one in np.argsort(tracks.names.astype(np.int64)).tolist() if one != ego]
    first, last = int(tracks.first[ego]), int(tracks.last[ego])
    window = Window(ego=ego, leader=ego, first=first, last=last, vehicles=(ego, *others))
    return trajectories(recording, [window])
