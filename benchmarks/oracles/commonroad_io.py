"""Opens CommonRoad scenarios with CommonRoad's own library, and counts what it finds in them.

commonroad-io pins a protobuf that other libraries here cannot live with, so it has an environment
of its own, and this script imports nothing of the package:

    overtaking export data/pinto --format commonroad --out build/scenes
    python -m venv build/oracle
    build/oracle/bin/python -m pip install commonroad-io==2026.1
    build/oracle/bin/python benchmarks/oracles/commonroad_io.py build/scenes

It ends with an error if a file cannot be opened, a vehicle has no lanelet in its first state, or
its states are not evenly spaced. Lane changes are those of the centres, by the library's look-up.
"""

from __future__ import annotations

import argparse
import importlib
from itertools import pairwise
from pathlib import Path
from typing import Any


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path, help="files, or folders with files")
    arguments = parser.parse_args()
    reader = importlib.import_module("commonroad.common.file_reader").CommonRoadFileReader
    files = [
        file
        for folder in arguments.folders
        for file in (sorted(folder.glob("*.xml")) if folder.is_dir() else [folder])
    ]
    total = {"files": 0, "lanelets": 0, "vehicles": 0, "states": 0, "lane_changes": 0}
    for file in files:
        for name, count in counts(reader(str(file)).open()[0]).items():
            total[name] += count
    print(", ".join(f"{count} {name.replace('_', ' ')}" for name, count in total.items()))


def counts(scene: Any) -> dict[str, int]:
    """What is in a scenario."""
    found = {"files": 1, "lanelets": len(scene.lanelet_network.lanelets), "vehicles": 0}
    found |= {"states": 0, "lane_changes": 0}
    for vehicle in scene.dynamic_obstacles:
        states = [vehicle.initial_state, *vehicle.prediction.trajectory.state_list]
        steps = [state.time_step for state in states]
        if steps != list(range(steps[0], steps[0] + len(steps))):
            raise SystemExit(f"{scene.scenario_id}: vehicle {vehicle.obstacle_id}: uneven steps")
        lanelets = scene.lanelet_network.find_lanelet_by_position([s.position for s in states])
        if not lanelets[0]:
            raise SystemExit(f"{scene.scenario_id}: vehicle {vehicle.obstacle_id}: on no lanelet")
        single = [one[0] for one in lanelets if len(one) == 1]
        found["vehicles"] += 1
        found["states"] += len(states)
        found["lane_changes"] += sum(a != b for a, b in pairwise(single))
    return found


if __name__ == "__main__":
    main()
