"""Simulates five vehicles on many five-lane roads with libsumo, in its fastest arrangement.

    python benchmarks/sumo.py --roads 50 --rounds 8

One process: a network of disjoint roads, stepped together 200 times at 20 Hz, the state of every
vehicle read by getters after each step. `engine.py` runs one such process on each core. Fewer or
more roads are no faster (25 to 100 differ by less than the noise), subscriptions are a third slower
than getters, and without reading anything it would be half as fast again. Prints as JSON the
vehicle-frames that were read and the time that took: on the clock, and of the processor; starting
and loading, which an engine for millions of scenarios would have to pay as well, is not counted.
"""

import argparse
import importlib
import json
import random
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

LENGTH, LANES, WIDTH = 2000.0, 5, 3.5
FRAMES, STEP = 200, 0.05
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
        '<vType id="car" length="4.6" maxSpeed="40" speedDev="0" lcSpeedGain="5"/>'
        '<vType id="truck" vClass="truck" length="12" maxSpeed="24" speedDev="0"/>'
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


def run(roads: int, rounds: int) -> dict[str, float]:
    """Vehicle-frames read, and what that took.

    Raises:
        RuntimeError: A vehicle was missing in a frame.
    """
    libsumo: Any = importlib.import_module("libsumo")  # only `make bench` installs it
    read, wall, core = 0, 0.0, 0.0
    with tempfile.TemporaryDirectory() as folder:
        net, routes = Path(folder, "net.xml"), Path(folder, "routes.xml")
        net.write_text(network(roads), encoding="utf-8")
        options = ["-n", str(net), "-r", str(routes), "--step-length", str(STEP), "--no-step-log"]
        options += ["--no-warnings", "--duration-log.disable", "--time-to-teleport", "-1"]
        options += ["--lanechange.duration", "3", "--collision.action", "none"]
        for seed in range(rounds):
            routes.write_text(demand(roads, seed), encoding="utf-8")
            if seed:
                libsumo.load(options)
            else:
                libsumo.start(["sumo", *options])
            wall, core = wall - time.perf_counter(), core - time.process_time()
            read += _step(libsumo)
            wall, core = wall + time.perf_counter(), core + time.process_time()
        libsumo.close()
    if read != rounds * roads * len(STARTS) * FRAMES:
        raise RuntimeError(f"libsumo: expected 5 vehicles in every frame, read {read} in all")
    return {"vehicle_frames": read, "seconds": wall, "core_seconds": core}


def _step(libsumo: Any) -> int:
    vehicle, step = libsumo.vehicle, libsumo.simulationStep
    read = 0
    for _ in range(FRAMES):
        step()
        for name in vehicle.getIDList():
            vehicle.getPosition(name)
            vehicle.getSpeed(name)
            vehicle.getLaneIndex(name)
            vehicle.getAngle(name)
            vehicle.getAcceleration(name)
            read += 1
    return read


def main() -> int:
    """Run and print what was done."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--roads", type=int, default=50)
    options.add_argument("--rounds", type=int, default=8)
    given = options.parse_args()
    print(json.dumps(run(given.roads, given.rounds)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
