"""Ticks a second of the headless CARLA server, asked for by the genuine client.

    python benchmarks/carla_ticks.py --rounds 5

Three things take turns in one client: empty calls (which cost a round trip and nothing else, so
they are the limit), ticks with six vehicles, and ticks with two Traffic Managers that drive them.
The best round of each counts. A tick with managers is many calls, and work of the client itself.
"""

import argparse
import importlib
import json
import os
import sys
from typing import Any

from measure import ROOT

sys.path.insert(0, str(ROOT))
support: Any = importlib.import_module("tests.support.carla")

SCRIPT = """
import os, time
SERVER, ROUNDS, TICKS = {server}, {rounds}, {ticks}
NAMES = ["vehicle.tesla.model3", "vehicle.mini.cooper_s", "vehicle.carlamotors.european_hgv",
         "vehicle.yamaha.yzf", "vehicle.diamondback.century", "vehicle.mercedes.sprinter"]
BEAT = os.sysconf("SC_CLK_TCK")
def server_time():
    with open(f"/proc/{{SERVER}}/stat") as file:
        fields = file.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / BEAT
def measured(act, count):
    act()
    clock, own, theirs = time.perf_counter(), time.process_time(), server_time()
    for _ in range(count):
        act()
    clock, own = time.perf_counter() - clock, time.process_time() - own
    return [count / clock, 1e3 * own / count, 1e3 * (server_time() - theirs) / count]
found = {{"calls": [], "ticks": [], "managed": []}}
for part in range(ROUNDS):
    world = client.reload_world()
    synchronous()
    cars = [spawn(name, 200.0 + 25.0 * k, 237.65 + 3.5 * (k % 5)) for k, name in enumerate(NAMES)]
    world.tick()
    for car in cars:
        car.set_target_velocity(carla.Vector3D(x=20.0))
        car.apply_control(carla.VehicleControl(throttle=0.3))
    found["calls"].append(measured(client.get_server_version, 5 * TICKS))
    found["ticks"].append(measured(world.tick, TICKS))
    managers = [client.get_trafficmanager(int(sys.argv[2]) + 2 * part + k) for k in (0, 1)]
    for k, car in enumerate(cars):
        managers[k % 2].set_synchronous_mode(True)
        car.set_autopilot(True, managers[k % 2].get_port())
        managers[k % 2].set_desired_speed(car, 25.0 + 6.0 * k)
    found["managed"].append(measured(world.tick, TICKS))
    for each in managers:
        each.shut_down()
print(json.dumps(found))
"""

LABELS = {
    "calls": "empty calls",
    "ticks": "ticks, six vehicles",
    "managed": "ticks, two Traffic Managers",
}


def main() -> int:
    """Measure, and print a line for each."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--ticks", type=int, default=200)
    arguments = parser.parse_args()
    with support.headless_server() as address:
        values = {"server": address.process, "rounds": arguments.rounds, "ticks": arguments.ticks}
        found = support.ask(address, SCRIPT.format(**values), patience=600.0)
    best = {name: max(rounds) for name, rounds in found.items()}
    limit = best["calls"][0]
    print(f"load {os.getloadavg()[0]:.1f}, {os.cpu_count()} processors")
    print(f"{'':28s}{'a second':>9s}{'of the limit':>13s}{'client ms':>10s}{'server ms':>10s}")
    for name, label in LABELS.items():
        rate, own, theirs = best[name]
        print(f"{label:28s}{rate:9.0f}{rate / limit:13.2f}{own:10.2f}{theirs:10.2f}")
    print(json.dumps(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
