"""Two Traffic Managers on the headless CARLA server, for a long time: does anything hang or grow?

    python benchmarks/carla_soak.py --minutes 10

One client drives a dozen vehicles with two managers over the road again and again: every 500 ticks
all are taken away, new ones are put in and registered, lane changes are forced, and the weather
changes. A client that says nothing for long is ended, and a line says at which tick. Exits with 1
then, or if the server grows by more than its limit.
"""

import argparse
import importlib
import json
import queue
import subprocess
import sys
import threading
import time
from typing import Any

from measure import ROOT, load_note

sys.path.insert(0, str(ROOT))
support: Any = importlib.import_module("tests.support.carla")

SILENCE = 60.0
"""A client that says nothing for longer hangs [s]."""

MOST_GROWTH_KB = 30_000
"""A server that grows by more after the first tenth of the time leaks [KiB]."""

SCRIPT = """
import itertools, time
END = time.monotonic() + float(sys.argv[3])
synchronous()
managers = [client.get_trafficmanager(int(sys.argv[2]) + k) for k in (0, 1)]
for each in managers:
    each.set_synchronous_mode(True)
    each.set_random_device_seed(7)
NAMES = ["vehicle.tesla.model3", "vehicle.mini.cooper_s", "vehicle.carlamotors.european_hgv",
         "vehicle.yamaha.yzf", "vehicle.diamondback.century", "vehicle.mercedes.sprinter"]
SKIES = ["ClearNoon", "HardRainNoon", "WetNight"]
ticks = 0
for lap in itertools.count():
    world.set_weather(getattr(carla.WeatherParameters, SKIES[lap % 3]))
    cars = [spawn(NAMES[k % 6], 120.0 + 25.0 * k, 237.65 + 3.5 * (k % 5)) for k in range(12)]
    world.tick()
    for k, car in enumerate(cars):
        manager = managers[(k + lap) % 2]
        car.set_autopilot(True, manager.get_port())
        manager.set_desired_speed(car, 25.0 + 3.0 * k)
        manager.auto_lane_change(car, k % 2 == 0)
    for step in range(500):
        if step % 100 == 50:
            managers[lap % 2].force_lane_change(cars[step // 100], True)
        world.tick()
        ticks += 1
    print(ticks, flush=True)
    for k, car in enumerate(cars):
        car.set_autopilot(False, managers[(k + lap) % 2].get_port())
        car.destroy()
    world.tick()
    if time.monotonic() > END:
        break
for each in managers:
    each.shut_down()
print("done", flush=True)
"""


def said(process: "subprocess.Popen[str]") -> "queue.Queue[str]":
    """What a process prints, line by line; an empty line at its end."""
    lines: queue.Queue[str] = queue.Queue()

    def read() -> None:
        assert process.stdout is not None
        for line in process.stdout:
            lines.put(line.strip())
        lines.put("")

    threading.Thread(target=read, daemon=True).start()
    return lines


def soak(address: Any, seconds: float) -> tuple[int, list[int], str]:
    """Ticks, memory of the server after each lap [KiB], and how it ended."""
    command = [sys.executable, "-c", support.PROLOGUE + SCRIPT, str(address.port)]
    command += [str(support.free_port()), str(seconds)]
    sizes, ticks, shown = list[int](), 0, time.monotonic()
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        lines = said(process)
        while True:
            try:
                line = lines.get(timeout=SILENCE)
            except queue.Empty:
                process.kill()
                return ticks, sizes, f"hung after tick {ticks}"
            if not line.isdigit():
                return ticks, sizes, line or f"the client ended after tick {ticks}"
            ticks = int(line)
            sizes.append(support.memory_kb(address.process))
            if time.monotonic() - shown > 60.0:
                shown = time.monotonic()
                print(f"{ticks:8d} ticks, {sizes[-1] / 1024:.1f} MB", flush=True)


def main() -> int:
    """Soak, and say what came of it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=10.0)
    arguments = parser.parse_args()
    begin = time.monotonic()
    with support.headless_server() as address:
        ticks, sizes, end = soak(address, 60.0 * arguments.minutes)
    seconds = time.monotonic() - begin
    settled = sizes[len(sizes) // 10]
    found = {"end": end, "ticks": ticks, "seconds": round(seconds), "load": load_note()}
    memory = {"settled_mb": round(settled / 1024, 1), "last_mb": round(sizes[-1] / 1024, 1)}
    print(json.dumps({**found, "ticks_per_s": round(ticks / seconds, 1), **memory}))
    return int(end != "done" or sizes[-1] - settled > MOST_GROWTH_KB)


if __name__ == "__main__":
    sys.exit(main())
