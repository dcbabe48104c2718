"""Reads an OpenDRIVE file of unknown origin with CARLA's own reader, in a separate process.

The reader is C++ that was not made for hostile files; the server survives its crashes.
Run as `python -m overtaking.simulators.carla_server.survey`, it reads the text from its standard
input and writes the samples of all lanes to its standard output, as NumPy's .npz.
"""

import io
import math
import os
import signal
import subprocess
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.errors import ConfigError, check_extra
from overtaking.core.process_limits import limit_process
from overtaking.core.units import mps_from_kmh
from overtaking.model.road import DrivingSide, Lane, Road, RoadMark
from overtaking.simulators.carla_server.maps import Lanes, Map, cells_of, drawn_mark
from overtaking.simulators.carla_server.motion import GroundFrame

SPACING = 2.0
"""Distance of two samples of a lane [m]."""

MAX_SAMPLES = 400_000
MEMORY_MIB, PROCESSOR_S = 2048, 60
"""A file that takes more is refused [MiB, s of a processor]."""

PATIENCE_S = 600.0
"""So is one that takes longer by the clock, where the system does not bound the other [s]."""

ANY_LIMIT = mps_from_kmh(90.0)
"""Speed limit where vehicles are on a map of which the server knows no limits [m/s]."""

_FIELDS = ("x", "y", "z", "yaw", "slope", "width", "left", "right", "station", "open")
_OPEN_GROUND = 5000.0


def survey(name: str, opendrive: str) -> Map:
    """A map from an OpenDRIVE text.

    Args:
        name: What clients shall call it.
        opendrive: The text.

    Raises:
        MissingExtraError: CARLA's wheel, which reads it, is not installed.
        ConfigError: The reader finds no lanes in it, fails, or takes too long.
    """
    check_extra(
        "carla",
        "carla",
        what="the wheel of CARLA 0.9.16",
        where="an OpenDRIVE file as a map",
        otherwise="use a road of the package",
    )
    rows = _in_own_process(name, opendrive)
    lanes = _lanes(rows)
    ground = GroundFrame(_open_ground(name), shelters_wind=False)
    return Map(name, opendrive, ground, lanes, is_flat=False, _cells=cells_of(lanes))


def _in_own_process(name: str, opendrive: str) -> NDArray[np.float64]:
    """Samples of all lanes, shape (sample, field)."""
    command = [sys.executable, "-m", __name__]
    try:
        done = subprocess.run(
            command,
            input=opendrive.encode(),
            capture_output=True,
            timeout=PATIENCE_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise _unusable(name, f"none after {PATIENCE_S:g} s") from None
    if done.returncode == -getattr(signal, "SIGXCPU", math.inf):
        raise _unusable(name, f"none after {PROCESSOR_S} s of a processor")
    if done.returncode:
        lines = done.stderr.decode(errors="replace").split("\n")
        said = next((line for line in reversed(lines) if line.strip()), "nothing")
        raise _unusable(name, f"status {done.returncode}: {said}")
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as found:
        rows: NDArray[np.float64] = found["rows"]
    if not len(rows):
        raise _unusable(name, "a map without driving lanes")
    return rows


def _unusable(name: str, got: str) -> ConfigError:
    return ConfigError(
        what="OpenDRIVE file",
        where=f"map {name}",
        expected="lanes that CARLA's own reader understands",
        got=got,
        next_step="check the file with another OpenDRIVE program",
    )


def _lanes(rows: NDArray[np.float64]) -> Lanes:
    x, y, z, yaw, slope, width, left, right, station, is_open = rows.T
    return Lanes(
        position=np.stack([x, y, z], axis=1),
        yaw=yaw,
        slope=slope,
        width=width,
        length=np.full(len(rows), SPACING),
        marks=np.stack([left, right], axis=1).astype(np.int64),
        station=station,
        driving=is_open > 0,
    )


def _open_ground(name: str) -> Road:
    """A road whose frame is that of the map: everything stands on its one lane."""
    lane = Lane(lane_id=-1, width=3.5, right_mark=RoadMark.NONE, left_mark=RoadMark.NONE)
    return Road(
        name=name,
        kind="unknown",
        driving_side=DrivingSide.RIGHT,
        lanes=(lane,),
        kerb_edge_d=0.0,
        length=_OPEN_GROUND,
        x0=0.0,
        y0=0.0,
        heading=0.0,
        speed_limit=ANY_LIMIT,
    )


def _sampled(opendrive: str) -> NDArray[np.float64]:
    """Samples of all driving lanes, lane after lane."""
    import carla

    found = carla.Map("map", opendrive).generate_waypoints(SPACING)
    if len(found) > MAX_SAMPLES:
        raise SystemExit(f"more than {MAX_SAMPLES} pieces of lane of {SPACING:g} m")
    found.sort(key=lambda one: (one.road_id, one.section_id, one.lane_id, _station(one)))
    return np.array([_row(one) for one in found], np.float64).reshape(-1, len(_FIELDS))


def _station(point: Any) -> float:
    """Distance along the lane, growing in the direction of travel [m]."""
    return point.s if point.lane_id < 0 else -point.s


def _row(point: Any) -> list[float]:
    """One waypoint as numbers; the station grows in the direction of travel."""
    where, turned = point.transform.location, point.transform.rotation
    marks = [
        drawn_mark(str(mark.type)) for mark in (point.left_lane_marking, point.right_lane_marking)
    ]
    # CARLA's reader takes the rise for each metre for an angle, and adds a turn in left lanes.
    slope = math.remainder(math.radians(turned.pitch), math.tau)
    row = [where.x, where.y, where.z, math.radians(turned.yaw), slope]
    return [*row, point.lane_width, *marks, _station(point), not point.is_junction]


def main() -> None:
    """Read a map from standard input and write its samples to standard output."""
    result = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # The reader prints its warnings there.
    limit_process(MEMORY_MIB, processor_s=PROCESSOR_S)
    rows = _sampled(sys.stdin.buffer.read().decode("utf-8"))
    buffer = io.BytesIO()
    np.savez(buffer, rows=rows)
    result.write(buffer.getvalue())
    result.close()


if __name__ == "__main__":
    main()
