"""Measures of criticality of a few scenes by CommonRoad-CriMe, for a test of ours to agree with.

CommonRoad-CriMe needs other versions of libraries than this package, so it has an environment of
its own, and this script imports nothing of the package:

    python -m venv build/crime
    build/crime/bin/python -m pip install commonroad-crime==0.4.5
    build/crime/bin/python -P benchmarks/oracles/commonroad_crime.py tests/data/commonroad_crime.csv

(-P, because the script bears the name of what it imports.)

In each scene one vehicle follows another along a lane, both at constant accelerations. Some traits
of version 0.4.5 limit what can be compared:

- TTC is that at constant accelerations; it takes the magnitude of the leader's, so leaders do not
  brake here. It rounds to 0.01 s, and TET and TIT, which sum over it, leave out the last frame.
- The required deceleration is 0 wherever the heading of the lane is 0, so the lane is turned by
  0.1 mrad. It squares the difference of speeds, also where the gap opens.
- THW is the time of the ego's own way to where the leader's rear is, in whole frames.
- PET is defined at intersections only, and RSS is not there yet.
"""

from __future__ import annotations

import argparse
import csv
import importlib
import math
from pathlib import Path
from typing import Any

import numpy as np

STEP_S = 0.1
STEPS = 40
THRESHOLD_S = 3.0
HEADING = 1e-4
EGO, LEADER = 1, 2

SCENES = (
    # gap, speeds and accelerations of ego and leader, their lengths
    (30.0, 30.0, 25.0, 0.0, 0.0, 4.5, 4.5),
    (60.0, 33.0, 22.0, 0.0, 0.0, 4.5, 12.0),
    (20.0, 25.0, 25.0, 0.0, 0.0, 4.5, 4.5),
    (45.0, 28.0, 18.0, 0.0, 0.0, 5.0, 7.0),
    (12.0, 26.0, 24.0, 0.0, 0.0, 4.0, 4.0),
    (40.0, 20.0, 25.0, 0.0, 0.0, 4.5, 4.5),
    (40.0, 25.0, 25.0, 1.0, 0.0, 4.5, 4.5),
    (30.0, 25.0, 22.0, 0.5, 0.0, 4.5, 16.5),
    (40.0, 30.0, 25.0, -1.0, 0.0, 4.5, 4.5),
    (60.0, 30.0, 22.0, -0.2, 0.0, 4.5, 4.5),
    (25.0, 22.0, 25.0, 1.5, 0.0, 4.5, 4.5),
    (35.0, 30.0, 25.0, 0.0, 0.5, 4.5, 4.5),
    (35.0, 30.0, 25.0, 1.0, 0.25, 2.0, 4.5),
    (80.0, 15.0, 5.0, -0.5, 0.0, 12.0, 4.5),
)
SCENE_NAMES = (
    *("gap_m", "ego_speed_mps", "leader_speed_mps", "ego_accel_mps2", "leader_accel_mps2"),
    *("ego_length_m", "leader_length_m"),
)
MEASURES = {
    "gap": "distance.hw.HW",
    "ttc": "time.ttc.TTC",
    "required_accel": "acceleration.a_long_req.ALongReq",
    "time_gap": "time.thw.THW",
    "time_exposed": "time.tet.TET",
    "time_integrated": "time.tit.TIT",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path)
    out: Path = parser.parse_args().out
    with out.open("w", newline="\n", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*SCENE_NAMES, *MEASURES])
        for scene in SCENES:
            writer.writerow([*scene, *values(scene)])


def values(scene: tuple[float, ...]) -> list[float]:
    """Every measure of the ego to its leader in the first frame."""
    configuration = _module("commonroad_crime.data_structure.configuration").CriMeConfiguration()
    configuration.update(ego_id=EGO, sce=scenario(scene))
    configuration.time.tau = THRESHOLD_S
    found = []
    for name in MEASURES.values():
        module, _, kind = name.rpartition(".")
        measure = getattr(_module(f"commonroad_crime.measure.{module}"), kind)(configuration)
        if kind == "HW":
            measure.validate_update_states_log(LEADER, 0, verbose=False)
            found.append(round(float(measure.cal_headway(verbose=False)), 4))
        else:
            found.append(float(measure.compute(LEADER, 0, verbose=False)))
    return found


def scenario(scene: tuple[float, ...]) -> Any:
    """A scenario of one lane and two vehicles."""
    gap, ego, leader, ego_accel, leader_accel, ego_length, leader_length = scene
    made = _module("commonroad.scenario.scenario").Scenario(dt=STEP_S)
    made.add_objects(lane())
    start = 100.0
    made.add_objects(vehicle(EGO, start, ego, ego_accel, ego_length))
    ahead = start + gap + 0.5 * (ego_length + leader_length)
    made.add_objects(vehicle(LEADER, ahead, leader, leader_accel, leader_length))
    made.assign_obstacles_to_lanelets()
    return made


def lane() -> Any:
    """A straight lane of 1,500 m, wide enough for the half lengths that HW adds to y as well."""
    along = np.linspace(0.0, 1500.0, 301)
    left, centre, right = (np.column_stack(at(along, d)) for d in (10.0, 0.0, -10.0))
    kind = _module("commonroad.scenario.lanelet").Lanelet
    return kind(left, centre, right, 100)


def at(along: Any, across: float = 0.0) -> tuple[Any, Any]:
    """Coordinates of points of the lane."""
    sine, cosine = math.sin(HEADING), math.cos(HEADING)
    return along * cosine - across * sine, along * sine + across * cosine


def vehicle(number: int, start: float, speed: float, accel: float, length: float) -> Any:
    """A vehicle of constant acceleration along the lane."""
    state, obstacle = (_module(f"commonroad.scenario.{name}") for name in ("state", "obstacle"))
    states = []
    for step in range(STEPS + 1):
        time = step * STEP_S
        known = {
            "time_step": step,
            "position": np.array(at(start + speed * time + 0.5 * accel * time * time)),
            "orientation": HEADING,
            "velocity": speed + accel * time,
        }
        if step == 0:
            known |= {"acceleration": accel, "yaw_rate": 0.0, "slip_angle": 0.0}
        states.append((state.CustomState if step else state.InitialState)(**known))
    shape = _module("commonroad.geometry.shape").Rectangle(length, 1.8)
    path = _module("commonroad.scenario.trajectory").Trajectory(1, states[1:])
    prediction = _module("commonroad.prediction.prediction").TrajectoryPrediction(path, shape)
    kind = obstacle.ObstacleType.CAR
    return obstacle.DynamicObstacle(number, kind, shape, states[0], prediction)


def _module(name: str) -> Any:
    return importlib.import_module(name)


if __name__ == "__main__":
    main()
