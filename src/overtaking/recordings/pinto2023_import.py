"""The paper's table, ours or another's, as recorded simulations.

The table holds the positions of all vehicles, and little else. Lanes and lines come from its road;
the weather is a preset where it equals that of one exactly. Column D is read as we write it: front
wheels and body, clockwise. Accelerations are computed from positions, because A is a norm without a
direction.
"""

# pyright: reportUnknownParameterType=false, reportAttributeAccessIssue=false

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from overtaking.core.arrays import F64, I64, Mask
from overtaking.core.representation import as_utf8
from overtaking.core.units import mps_from_kmh
from overtaking.model.road import Road
from overtaking.model.trajectories import Stage, Trajectories
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.weather import Weather
from overtaking.recordings.batch import MAX_SLOTS
from overtaking.recordings.candidates import MAX_FRAMES, Window
from overtaking.recordings.examination import examine
from overtaking.recordings.pinto2023_files import read_table
from overtaking.recordings.pinto2023_schema import FORMAT
from overtaking.recordings.pinto2023_tracks import (
    NEAR_SCALE,
    SCALES,
    SLOW_KMH,
    Frames,
    examine_vehicles,
    frames_of,
    interval_ms_of,
    limits_of,
    refused,
    road_of,
    tracks_of,
    vehicle_values,
    weather_of,
)
from overtaking.recordings.recording import NEVER_RECORDED, Recording, Tracks, slope
from overtaking.recordings.scenes import Parts

_ROUNDING = 0.01 / 3.6  # By what limits of a table differ from those of its road [m/s].


@dataclass(frozen=True, slots=True, kw_only=True)
class TableScenes(Parts):
    """The simulations of the paper's table, in order of their number.

    Each has a carriageway of its own in the recording; the ego comes first, the others by id.

    Attributes:
        numbers: The table's number of each simulation.
        frames: What belongs to each simulation and frame.
        weather: Of each simulation.
    """

    numbers: I64
    frames: Frames
    weather: Weather

    @property
    def counts(self) -> dict[str, Any]:
        """What was found."""
        return {
            "vehicles": self.recording.tracks.num_vehicles,
            "simulations": len(self),
            "frames": len(self.frames.simulation),
        }

    def trajectories(self, numbers: range) -> Trajectories:
        """Some of the simulations."""
        made = Parts.trajectories(self, numbers)
        part = slice(numbers.start, numbers.stop)
        scenario = made.scenario.replace(weather=self.weather.select(part))
        return self._with_frames(made.replace(scenario=scenario), numbers)

    def _part(self, number: int) -> str:
        """The table's number of a simulation."""
        return f"simulation {self.numbers[number]}"

    def _with_frames(self, made: Trajectories, numbers: range) -> Trajectories:
        """The batch with stages and collisions, as far as OV and C tell."""
        given, name_of = self.frames, self.recording.tracks.name_of
        stage, collided = made.stage.copy(), made.collided_with.copy()
        contacts = made.contacts
        partner, time = contacts.partner.copy(), contacts.time.copy()
        for place, number in enumerate(numbers):
            rows = given.simulation == number
            begun = np.cumsum(given.overtaking[rows])
            count = len(begun)
            stage[place, :count] = np.select(
                [begun == 0, begun == 1], [Stage.FOLLOW, Stage.PULL_OUT], Stage.RETURN
            )
            slots = {
                name_of(vehicle): slot for slot, vehicle in enumerate(self.windows[number].vehicles)
            }
            hit = given.partner[rows]
            frames = np.flatnonzero(hit > 0)
            if len(frames):
                slot = slots[str(hit[frames[0]])]
                at = frames[0] * self.recording.frame_interval_ms
                collided[place, frames] = [slots[str(partner_id)] for partner_id in hit[frames]]
                partner[place, [EGO_SLOT, slot]] = [slot, EGO_SLOT]
                time[place, [EGO_SLOT, slot]] = at
        return made.replace(
            stage=stage,
            collided_with=collided,
            contacts=contacts.replace(partner=partner, time=time),
        )


def read_pinto2023(path: Path | str, *, road: Road | None = None) -> TableScenes:
    """The simulations of a table.

    Args:
        path: A CSV or Parquet file with the paper's 22 columns.
        road: The road that it was recorded on; by default one of the package on which its
            vehicles are in the lanes that the table names.

    Returns:
        The simulations. `notes` has how measured speeds compare with recorded ones.

    Raises:
        ImportFormatError: The file is no such table, its frames are not evenly spaced, or its
            road is none that is known; the message names line and column.
    """
    source = Path(path)
    table = read_table(source)
    if not table.num_rows:
        raise refused(source, "table", "at least one row", "none")
    numbers, frames = frames_of(source, table)
    interval = interval_ms_of(source, table, frames)
    values = vehicle_values(table, frames)
    place, agreement = road_of(source, road, values)
    examined = examine_vehicles(source, table, values, frames, interval)
    tracks = tracks_of(examined, values, place, interval)
    place, knows_limit = _with_limits(place, limits_of(table))
    unknown = NEVER_RECORDED - {"stage", "wheel_angle"} | {"kinds", "yaw_rate"}
    weather, is_known = weather_of(table, frames, len(numbers))
    unknown |= set() if is_known else {"weather"}
    unknown |= set() if knows_limit else {"speed_limit"}
    place = place.extend_to(max(place.length, float(tracks.s.max()) + 1.0))
    recording = Recording(
        name=as_utf8(source.name),
        file_format=FORMAT,
        road=place,
        frame_interval_ms=interval,
        tracks=tracks,
        unknown=frozenset(unknown),
        notes={"road": place.name, "lanes_as_named": round(agreement, 4)},
        findings=examined.findings,
    )
    recording.notes.update(time_scaling(recording))
    recording = examine(recording, needed=_is_ego_or_partner(tracks, frames))
    return TableScenes(
        recording=recording,
        windows=_windows(source, recording.tracks, numbers, frames),
        numbers=numbers,
        frames=frames,
        weather=weather,
    )


def _is_ego_or_partner(tracks: Tracks, frames: Frames) -> Mask:
    """Whether a vehicle is an ego, or one that an ego collides with, shape (vehicle,)."""
    needed = {*zip(frames.simulation.tolist(), frames.ego.astype(str).tolist(), strict=True)}
    needed |= {*zip(frames.simulation.tolist(), frames.partner.astype(str).tolist(), strict=True)}
    places = zip(tracks.carriageway.tolist(), tracks.names.tolist(), strict=True)
    return np.array([place in needed for place in places])


def _with_limits(road: Road, given: F64) -> tuple[Road, bool]:
    """The road with the limits of a table, and whether they are known.

    They are if there is one, or if the road posts all of them, and then where it does.
    """
    lower = road.course.speed_limit_spans if road.course else ()
    posted = np.array([road.speed_limit, *(one.speed for one in lower)])
    if lower and (np.abs(posted - given[:, None]).min(axis=1) < _ROUNDING).all():
        return road, True
    course = dataclasses.replace(road.course, speed_limit_spans=()) if road.course else None
    return dataclasses.replace(road, speed_limit=float(given[0]), course=course), len(given) == 1


def speed_ratios(recording: Recording) -> F64:
    """Speed measured from positions and times over recorded speed, NaN for slow vehicles.

    Returns:
        The median over the frames of each vehicle, shape (vehicle,).
    """
    tracks, interval = recording.tracks, recording.frame_interval_ms
    measured = np.hypot(
        slope(tracks.x, tracks.start, interval), slope(tracks.y, tracks.start, interval)
    )
    moves = tracks.speed > mps_from_kmh(SLOW_KMH)
    ratio = np.where(moves, measured / np.where(moves, tracks.speed, 1.0), np.nan)
    ratios = np.full(tracks.num_vehicles, np.nan)
    for one in range(tracks.num_vehicles):
        own = ratio[tracks.start[one] : tracks.start[one + 1]]
        if len(own) > 1 and not np.isnan(own).all():
            ratios[one] = np.nanmedian(own)
    return ratios


def time_scaling(recording: Recording) -> dict[str, Any]:
    """What the ratios of measured to recorded speed say about a table's clock."""
    ratios = speed_ratios(recording)
    known = ratios[~np.isnan(ratios)]
    if not len(known):
        return {"speed_ratio_median": None, "time_scaling": None, "vehicles_at_other_speeds": 0}
    near = {name: np.abs(known / scale - 1.0) <= NEAR_SCALE for name, scale in SCALES.items()}
    most = max(near, key=lambda name: int(near[name].sum()))
    return {
        "speed_ratio_median": round(float(np.median(known)), 4),
        "speed_ratio_lowest": round(float(known.min()), 4),
        "speed_ratio_highest": round(float(known.max()), 4),
        "vehicles_at_other_speeds": int((np.abs(known - 1.0) > NEAR_SCALE).sum()),
        "time_scaling": most if near[most].mean() > 0.5 else None,
    }


def _windows(source: Path, tracks: Tracks, numbers: I64, frames: Frames) -> list[Window]:
    """The frames and vehicles of each simulation."""
    first = np.searchsorted(frames.simulation, np.arange(len(numbers)))
    last = np.append(first[1:], len(frames.simulation)) - 1
    windows: list[Window] = []
    for k in range(len(numbers)):
        there = np.flatnonzero(tracks.carriageway == k)
        is_ego = tracks.names[there] == str(frames.ego[first[k]])
        ego = int(there[is_ego][0])
        begin, end = int(frames.frame[first[k]]), int(frames.frame[last[k]])
        has_ego = (int(tracks.first[ego]), int(tracks.last[ego])) == (begin, end)
        what = f"simulation {numbers[k]}"
        if len(there) > MAX_SLOTS or not has_ego:
            expected = f"an ego in every frame and at most {MAX_SLOTS} vehicles"
            raise refused(source, what, expected, "another")
        vehicles = (ego, *there[~is_ego].tolist())
        window = Window(ego=ego, leader=ego, first=begin, last=end, vehicles=vehicles)
        if window.num_frames > MAX_FRAMES:
            got = str(window.num_frames)
            raise refused(source, what, f"at most {MAX_FRAMES} frames", got)
        windows.append(window)
    return windows
