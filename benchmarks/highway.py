"""Simulates five vehicles on a five-lane road with highway-env, in its fastest arrangement.

    python -m venv target/peers
    target/peers/bin/python -m pip install highway-env==1.12.1
    target/peers/bin/python benchmarks/highway.py --seconds 2

highway-env brings libraries of its own, so it has an environment of its own, and this script
imports nothing of the package. The vehicles start like those of `sumo.py`, follow by IDM and change
lanes by MOBIL. The road is stepped 200 times at 20 Hz without the environment around it, which
would add observations and rewards, and the state of every vehicle is read after each step.
`engine.py` runs one such process on each core. Prints as JSON the simulations of five vehicles and
ten seconds, and the time that they took: on the clock, and of the processor. Creating vehicles is
not counted.
"""

import argparse
import importlib
import json
import random
import sys
import time
from typing import Any

from sumo import CAR_SPEED, FRAMES, LANES, LENGTH, STARTS, STEP, TRUCK_LENGTH, TRUCK_SPEED


def scene(seed: int) -> Any:
    """A straight road with the five vehicles of a seed."""
    roads: Any = importlib.import_module("highway_env.road.road")
    drivers: Any = importlib.import_module("highway_env.vehicle.behavior")
    draw = random.Random(seed)
    network = roads.RoadNetwork.straight_road_network(LANES, length=LENGTH, speed_limit=CAR_SPEED)
    road = roads.Road(network)
    for n, (lane, place, speed) in enumerate(STARTS):
        vehicle = drivers.IDMVehicle.make_on_lane(
            road, ("0", "1", lane), place + draw.uniform(-10, 10), speed + draw.uniform(-2, 2)
        )
        vehicle.target_speed = TRUCK_SPEED if n == 3 else CAR_SPEED
        vehicle.LENGTH = TRUCK_LENGTH if n == 3 else vehicle.LENGTH
        road.vehicles.append(vehicle)
    return road


def drive(road: Any) -> int:
    """Step through all frames and read every vehicle in each; how many that were."""
    states = list[tuple[Any, ...]]()
    for _ in range(FRAMES):
        road.act()
        road.step(STEP)
        for vehicle in road.vehicles:
            lane, accel = vehicle.lane_index[2], vehicle.action["acceleration"]
            states.append((*vehicle.position, vehicle.speed, vehicle.heading, lane, accel))
    return len(states)


def run(seconds: float) -> dict[str, Any]:
    """What was simulated in at least so much processor time, and what that took.

    Raises:
        RuntimeError: A vehicle was missing in a frame.
    """
    version = importlib.import_module("highway_env").__version__
    met, simulations, wall, core = 0, 0, 0.0, 0.0
    while core < seconds:
        road = scene(simulations)
        wall, core = wall - time.perf_counter(), core - time.process_time()
        met += drive(road)
        wall, core = wall + time.perf_counter(), core + time.process_time()
        simulations += 1
    if met != simulations * len(STARTS) * FRAMES:
        raise RuntimeError(f"highway-env: expected 5 vehicles in every frame, met {met} in all")
    version = f"highway-env {version}"
    return {"simulations": simulations, "wall": wall, "core": core, "version": version}


def main() -> int:
    """Run and print what was done."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--seconds", type=float, default=2.0, help="processor time, at least")
    print(json.dumps(run(options.parse_args().seconds)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
