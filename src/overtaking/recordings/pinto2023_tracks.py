"""From the rows of the paper's table to tracks and weather.

A row is one frame of one simulation, with a tuple for each vehicle in some of its cells.
"""

# pyright: reportUnknownParameterType=false, reportAttributeAccessIssue=false

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from overtaking.core.arrays import F32, F64, I64
from overtaking.core.units import mps_from_kmh, rad_from_deg
from overtaking.knowledge.carla_catalogue import weather_presets
from overtaking.model.known_roads import ROAD_NAMES, known_road
from overtaking.model.road import Road
from overtaking.model.weather import NO_PRESET, Weather
from overtaking.recordings import messages
from overtaking.recordings.pinto2023_schema import VEHICLE_COLUMNS
from overtaking.recordings.recording import Tracks, lane_codes, slope
from overtaking.recordings.state_examination import ExaminedStates, examine_states
from overtaking.scenarios.recording_defaults import default_weather, kinds_by_length

MIN_AGREEMENT = 0.95
"""Share of the lane ids of a table that must be those of its road."""

SCALES = {"a third": 1.0 / 3.0, "three times": 3.0}
"""Ratios of measured to recorded speed in a table whose time was scaled on one side only."""

NEAR_SCALE = 0.1
"""How near a ratio must be to one of them, as a part of it."""

SLOW_KMH = 10.0
"""Below this speed a whole km/h is too coarse for a ratio [km/h]."""

_GLARING = "ClearSunset"  # The only preset for which the paper says Yes in column HL.


@dataclass(frozen=True, slots=True, kw_only=True)
class Frames:
    """The table's values for each simulation and frame, in order; arrays of shape (frame,).

    Attributes:
        line: Where it stands in the table, from 0.
        simulation: Place of the simulation.
        frame: Its number in the simulation.
        ego: Id of the ego.
        partner: Id of the vehicle that the ego has collided with, 0 for none.
        overtaking: 1 where the ego begins to pull out or to return.
    """

    line: I64
    simulation: I64
    frame: I64
    ego: I64
    partner: I64
    overtaking: I64


def refused(source: Path, what: str, expected: str, got: str, next_step: str = "") -> Exception:
    """The error for a table that cannot be imported."""
    next_step = next_step or "export the table again"
    return messages.refused(str(source), what, expected, got, next_step)


def _integers(table: pa.Table, name: str) -> I64:
    """A column of whole numbers, 0 where it is null."""
    return table[name].fill_null(0).to_numpy().astype(np.int64)


def frames_of(source: Path, table: pa.Table) -> tuple[I64, Frames]:
    """The simulations' numbers, and their frames in order."""
    simulation, frame = _integers(table, "S"), _integers(table, "F")
    order = np.lexsort((frame, simulation))
    numbers, place = np.unique(simulation[order], return_inverse=True)
    same = np.diff(place) == 0
    for name, wrong in (
        ("F", same & (np.diff(frame[order]) != 1)),
        ("IDego", same & (np.diff(_integers(table, "IDego")[order]) != 0)),
    ):
        if wrong.any():
            row = int(order[int(np.argmax(wrong)) + 1])
            got = str(table[name][row].as_py())
            expected = "the frame after the one before" if name == "F" else "the same ego"
            raise refused(source, f"row {row + 1}, column {name}", expected, got)
    return numbers, Frames(
        line=order,
        simulation=place.astype(np.int64),
        frame=frame[order],
        ego=_integers(table, "IDego")[order],
        partner=_integers(table, "C")[order],
        overtaking=_integers(table, "OV")[order],
    )


def interval_ms_of(source: Path, table: pa.Table, frames: Frames) -> int:
    """Time between frames, which must be the same everywhere."""
    time = table["TS"].to_numpy()[frames.line]
    steps = np.diff(time)[np.diff(frames.simulation) == 0]
    if not len(steps):
        raise refused(source, "column TS", "two frames of a simulation", "one of each")
    interval = round(float(np.mean(steps)) * 1000.0)
    uneven = np.abs(steps * 1000.0 - interval) > 10.0 + 1e-6  # Two decimals of a second.
    if uneven.any() or not 10 <= interval <= 1000:
        got = f"{steps.min():g} to {steps.max():g} s"
        raise refused(source, "column TS", "even steps of 0.01 to 1 s", got)
    return interval


def vehicle_values(table: pa.Table, frames: Frames) -> dict[str, NDArray[Any]]:
    """The tuples of all rows, by vehicle and frame: one array for each of their values."""
    dimensions = table["Dim"].combine_chunks()
    lengths = np.diff(dimensions.offsets.to_numpy())
    place = np.empty(len(lengths), np.int64)
    place[frames.line] = np.arange(len(lengths))
    row = np.repeat(place, lengths)
    values: dict[str, NDArray[Any]] = {
        "line": np.repeat(np.arange(len(lengths)), lengths),
        "simulation": frames.simulation[row],
        "frame": frames.frame[row],
        "id": np.asarray(dimensions.flatten().field("id")).astype(np.int64),
    }
    for column, fields in VEHICLE_COLUMNS.items():
        flat = table[column].combine_chunks().flatten()
        values |= {name: np.asarray(flat.field(name)) for name, _ in fields}
    order = np.lexsort((values["frame"], values["id"], values["simulation"]))
    return {name: one[order] for name, one in values.items()}


def road_of(
    source: Path, given: Road | None, values: dict[str, NDArray[Any]]
) -> tuple[Road, float]:
    """The road on which the vehicles are in the lanes that the table names, and how often."""
    roads = [given] if given else [known_road(name) for name in ROAD_NAMES]
    shares = [_agreement(one, values) for one in roads]
    best = int(np.argmax(shares))
    if shares[best] < MIN_AGREEMENT:
        raise refused(
            source,
            "column L",
            f"lanes of {roads[best].name} in {MIN_AGREEMENT:.0%} of the positions",
            f"{shares[best]:.0%}",
            "name the road that it was recorded on",
        )
    return roads[best], shares[best]


def _agreement(road: Road, values: dict[str, NDArray[Any]]) -> float:
    """Share of the positions whose lane on a road is the one that the table names.

    Where a vehicle has left the road, the table names what lies beside it: such positions do not
    count, but at least half of all are in the lanes of the road that they were recorded on.
    """
    _, d = road.to_road(values["x_m"], -values["y_m"])
    ids = np.array([lane.lane_id for lane in road.lanes])
    lane = road.lane_index(d)
    is_inside = (lane >= 0) & (lane < road.num_lanes)
    agrees = is_inside & (ids[np.clip(lane, 0, road.num_lanes - 1)] == values["lane_id"])
    counts = is_inside | np.isin(values["lane_id"], ids)
    return float(agrees.sum() / max(counts.sum(), 0.5 * len(lane)))


def examine_vehicles(
    source: Path,
    table: pa.Table,
    values: dict[str, NDArray[Any]],
    frames: Frames,
    interval_ms: int,
) -> ExaminedStates:
    """The states of all vehicles of all simulations, examined.

    States of an ego are reported where they are faulty, and kept: the table's frames are the ego's.
    Rows beside a contact that the table records are exempt.

    Args:
        source: The file.
        table: Its content.
        values: As of `vehicle_values`.
        frames: As of `frames_of`.
        interval_ms: Time between frames [ms].

    Raises:
        ImportFormatError: Gaps split most of the vehicles into short pieces.
    """
    is_new = (np.diff(values["simulation"]) != 0) | (np.diff(values["id"]) != 0)
    vehicle = np.append(0, np.cumsum(is_new))
    first_row = np.append(0, np.flatnonzero(is_new) + 1)
    line = values["line"]
    partner = frames.partner[line]
    is_touching = np.convolve(partner > 0, [1, 1, 1, 1, 1], "same") > 0
    is_ego = values["id"] == frames.ego[line]
    states = {
        "x": _float64(values["x_m"]),
        "y": -_float64(values["y_m"]),
        "speed": _float64(mps_from_kmh(values["speed_kmh"].astype(np.float64))),
        "heading": -_float64(rad_from_deg(values["yaw_deg"])),
        "wheel_angle": -_float64(rad_from_deg(values["wheel_deg"])),
    }
    return examine_states(
        vehicle,
        values["frame"].astype(np.float64),
        states,
        names=values["id"][first_row].astype(str).astype(np.object_),
        interval_ms=interval_ms,
        file_name=str(source),
        seconds=table["TS"].to_numpy()[frames.line][line],
        motion_interval_ms=interval_ms * _clock_ratio(vehicle, states, interval_ms),
        is_exempt=is_touching,
        is_unchanged=is_ego,
    )


def _clock_ratio(vehicle: I64, states: dict[str, F64], interval_ms: int) -> float:
    """Speed measured from positions over stated speed, 1 unless the clock was scaled."""
    distance = np.hypot(np.diff(states["x"]), np.diff(states["y"]))
    speed = states["speed"][1:]
    moves = (np.diff(vehicle) == 0) & (speed > mps_from_kmh(SLOW_KMH))
    if not moves.any():
        return 1.0
    ratio = float(np.median(distance[moves] / speed[moves])) / (interval_ms * 1e-3)
    scales = [scale for scale in SCALES.values() if abs(ratio / scale - 1.0) <= NEAR_SCALE]
    return scales[0] if scales else 1.0


def tracks_of(
    examined: ExaminedStates, values: dict[str, NDArray[Any]], road: Road, interval_ms: int
) -> Tracks:
    """All vehicles of all simulations, each simulation on a carriageway of its own."""
    is_new = (np.diff(values["simulation"]) != 0) | (np.diff(values["id"]) != 0)
    begins = np.append(0, np.flatnonzero(is_new) + 1)[examined.vehicle]
    start, states = examined.start, examined.values
    x, y = states["x"], states["y"]
    s, d = road.to_road(x, y)
    length = values["length_m"][begins]
    nobody = np.zeros(len(begins), np.bool_)
    return Tracks(
        names=examined.names,
        kind=kinds_by_length(length, is_truck=nobody, is_car=nobody),
        is_kind_known=~nobody,  # No kind is: "kinds" is unknown for all of them.
        length=length,
        width=values["width_m"][begins],
        carriageway=values["simulation"][begins],
        file_row=values["line"][begins],
        first=examined.first,
        start=start,
        x=x,
        y=y,
        s=s,
        d=d,
        speed=states["speed"],
        heading=states["heading"],
        accel_lon=slope(slope(s, start, interval_ms), start, interval_ms),
        accel_lat=slope(slope(d, start, interval_ms), start, interval_ms),
        yaw_rate=np.zeros_like(s),
        wheel_angle=states["wheel_angle"],
        lane=lane_codes(road, d),
    )


def _float64(values: NDArray[np.floating[Any]]) -> F64:
    return values.astype(np.float64)


def limits_of(table: pa.Table) -> F64:
    """The speed limits that occur, the most frequent one first [m/s]."""
    limits, count = np.unique(table["MV"].to_numpy(), return_counts=True)
    ordered: F64 = limits[np.argsort(-count, kind="stable")]
    return _float64(mps_from_kmh(ordered))


def weather_of(table: pa.Table, frames: Frames, count: int) -> tuple[Weather, bool]:
    """The weather of each simulation, and whether all of it is that of presets.

    The paper's own presets go before others. Where several fit, as for nights that differ in their
    clouds alone, none is named and the first gives what the table does not have.
    """
    first = frames.line[np.searchsorted(frames.simulation, np.arange(count))]
    given = {name: table[name].to_numpy()[first] for name in ("Prec", "Fog", "Wind")}
    night = np.asarray(table["DN"].to_pylist())[first] == "Night"
    glare = np.asarray(table["HL"].to_pylist())[first] == "Yes"
    presets = weather_presets()
    fits = np.stack([
        (given["Prec"] == preset.precipitation_percent)
        & (given["Fog"] == preset.fog_density_percent)
        & (given["Wind"] == preset.wind_intensity_percent)
        & (night == (preset.sun_altitude_deg < 0.0))
        & (glare == (name == _GLARING))
        for name, preset in presets.items()
    ])  # fmt: skip
    from_paper = np.array([preset.in_pinto2023 for preset in presets.values()])[:, None]
    fits &= from_paper | ~(fits & from_paper).any(axis=0)
    best, num_fitting = fits.argmax(axis=0), fits.sum(axis=0)

    def of_best(name: str, otherwise: F32) -> F32:
        values = np.array([getattr(preset, name) for preset in presets.values()], np.float32)[best]
        return np.where(num_fitting > 0, values, otherwise)

    assumed = default_weather(count)
    sun = np.where(night, np.float32(-90.0), np.float32(45.0))  # As most presets have it.
    weather = assumed.replace(
        preset=np.where(num_fitting == 1, best, NO_PRESET).astype(np.uint8),
        cloudiness=of_best("cloudiness_percent", assumed.cloudiness),
        rain=given["Prec"].astype(np.float32),
        puddles=of_best("precipitation_deposits_percent", assumed.puddles),
        wind=given["Wind"].astype(np.float32),
        fog=given["Fog"].astype(np.float32),
        sun_altitude=of_best("sun_altitude_deg", sun) * np.float32(rad_from_deg(1.0)),
        sun_azimuth=np.where(glare, np.float32(0.0), assumed.sun_azimuth),
        night=night,
        low_sun=glare,
    )
    return weather, bool((num_fitting > 0).all())
