"""Simulates five vehicles on many five-lane roads with libsumo, in its fastest arrangement.

    python benchmarks/sumo.py --roads 50 --seconds 2
    python benchmarks/sumo.py --unread
    python benchmarks/sumo.py --lateral-resolution 0.8

One process: a network of disjoint roads, stepped together 200 times at 20 Hz. Getters read the
state of every vehicle after each step, or nothing is read (`--unread`). `engine.py` runs one such
process on each core. Fewer or more roads are no faster (25 to 100 differ by less than the noise),
and subscriptions are a third slower than getters. With a lateral resolution SUMO uses its sub-lane
model, in which vehicles have a place within their lane. Prints as JSON the simulations of five
vehicles and ten seconds, and the time that they took: on the clock, and of the processor. Starting
and loading, which an engine for millions of scenarios would have to pay as well, is not counted.
"""

import argparse
import importlib
import json
import random
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

LENGTH, LANES, WIDTH = 2000.0, 5, 3.5
FRAMES, STEP = 200, 0.05
CAR_SPEED, TRUCK_SPEED, TRUCK_LENGTH = 40.0, 24.0, 12.0
STARTS = ((1, 200.0, 28.0), (1, 240.0, 20.0), (2, 150.0, 30.0), (0, 300.0, 18.0), (3, 260.0, 31.0))
"""Lane, position [m] and speed [m/s] of the five vehicles; the fourth is a truck."""


def network(roads: int) -> str:
    """Disjoint straight roads, 100 m apart, as SUMO's own network format."""
    edges, nodes = [], []
    for k in range(roads):
        y = 100.0 * k
        lanes = "".join(
            f'<lane id="e{k}_{i}" index="{i}" speed="50" length="{LENGTH}" width="{WIDTH}"'
            f' shape="0,{y + WIDTH * i} {LENGTH},{y + WIDTH * i}"/>'
            for i in range(LANES)
        )
        edges.append(f'<edge id="e{k}" from="a{k}" to="b{k}" priority="-1">{lanes}</edge>')
        for name, x, arriving in (("a", 0.0, ""), ("b", LENGTH, _lanes(k))):
            nodes.append(
                f'<junction id="{name}{k}" type="dead_end" x="{x}" y="{y}" incLanes="{arriving}"'
                f' intLanes="" shape="{x},{y} {x},{y + WIDTH * LANES}"/>'
            )
    top = 100.0 * roads
    boundary = f"0,0,{LENGTH},{top}"
    place = f'<location netOffset="0,0" convBoundary="{boundary}" origBoundary="{boundary}"'
    body = "".join(edges + nodes)
    return f'<net version="1.20">{place} projParameter="!"/>{body}</net>'


def _lanes(k: int) -> str:
    return " ".join(f"e{k}_{i}" for i in range(LANES))


def demand(roads: int, seed: int) -> str:
    """Five vehicles on each road, as scattered as those of the engine."""
    draw = random.Random(seed)
    types = (
        f'<vType id="car" length="4.6" maxSpeed="{CAR_SPEED}" speedDev="0" lcSpeedGain="5"/>'
        f'<vType id="truck" vClass="truck" length="{TRUCK_LENGTH}" maxSpeed="{TRUCK_SPEED}"'
        ' speedDev="0"/>'
    )
    rows = [f'<route id="r{k}" edges="e{k}"/>' for k in range(roads)]
    for k in range(roads):
        for n, (lane, place, speed) in enumerate(STARTS):
            kind = "truck" if n == 3 else "car"
            s, v = place + draw.uniform(-10, 10), speed + draw.uniform(-2, 2)
            rows.append(
                f'<vehicle id="v{k}_{n}" type="{kind}" route="r{k}" depart="0"'
                f' departLane="{lane}" departPos="{s:.2f}" departSpeed="{v:.2f}"'
                ' insertionChecks="none"/>'  # All five from the first step on.
            )
    return f"<routes>{types}{''.join(rows)}</routes>"


def run(
    roads: int, seconds: float, step: Callable[[Any], int], resolution: float
) -> dict[str, Any]:
    """What was simulated, and what that took.

    Args:
        roads: Roads of the network.
        seconds: Processor time to spend at least.
        step: Steps through all frames; returns how many vehicles it met in them.
        resolution: Lateral resolution of the sub-lane model [m]; 0 for whole lanes.

    Raises:
        RuntimeError: A vehicle was missing in a frame.
    """
    libsumo: Any = importlib.import_module("libsumo")  # only `make bench` installs it
    met, rounds, wall, core = 0, 0, 0.0, 0.0
    with tempfile.TemporaryDirectory() as folder:
        net, routes = Path(folder, "net.xml"), Path(folder, "routes.xml")
        net.write_text(network(roads), encoding="utf-8")
        options = ["-n", str(net), "-r", str(routes), "--step-length", str(STEP), "--no-step-log"]
        options += ["--no-warnings", "--duration-log.disable", "--time-to-teleport", "-1"]
        options += ["--collision.action", "none", "--lateral-resolution", str(resolution)]
        # The sub-lane model has a lateral speed instead of a duration.
        options += ["--lanechange.duration", "0" if resolution else "3"]
        while core < seconds:
            routes.write_text(demand(roads, rounds), encoding="utf-8")
            if rounds:
                libsumo.load(options)
            else:
                libsumo.start(["sumo", *options])
            wall, core = wall - time.perf_counter(), core - time.process_time()
            met += step(libsumo)
            wall, core = wall + time.perf_counter(), core + time.process_time()
            rounds += 1
        libsumo.close()
    if met != rounds * roads * len(STARTS) * FRAMES:
        raise RuntimeError(f"libsumo: expected 5 vehicles in every frame, met {met} in all")
    version = libsumo.getVersion()[1]
    return {"simulations": rounds * roads, "wall": wall, "core": core, "version": version}


def read(libsumo: Any) -> int:
    """Step through all frames and read every vehicle in each."""
    vehicle, step = libsumo.vehicle, libsumo.simulationStep
    met = 0
    for _ in range(FRAMES):
        step()
        for name in vehicle.getIDList():
            vehicle.getPosition(name)
            vehicle.getSpeed(name)
            vehicle.getLaneIndex(name)
            vehicle.getAngle(name)
            vehicle.getAcceleration(name)
            met += 1
    return met


def leave_unread(libsumo: Any) -> int:
    """Step through all frames and only count the vehicles in each."""
    vehicle, step = libsumo.vehicle, libsumo.simulationStep
    met = 0
    for _ in range(FRAMES):
        step()
        met += vehicle.getIDCount()
    return met


def main() -> int:
    """Run and print what was done."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--roads", type=int, default=50)
    options.add_argument("--seconds", type=float, default=2.0, help="processor time, at least")
    options.add_argument("--unread", action="store_true", help="read nothing of the vehicles")
    options.add_argument(
        "--lateral-resolution", type=float, default=0.0, help="[m]; 0: whole lanes"
    )
    given = options.parse_args()
    step = leave_unread if given.unread else read
    print(json.dumps(run(given.roads, given.seconds, step, given.lateral_resolution)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
