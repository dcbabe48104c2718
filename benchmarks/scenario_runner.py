"""Runs the OpenSCENARIO examples of ScenarioRunner on the headless CARLA server.

python benchmarks/scenario_runner.py CHECKOUT --python PYTHON --agents FOLDER --map Town01.xodr …

CHECKOUT is a clone of github.com/carla-simulator/scenario_runner at 0.9.16, PYTHON an interpreter
with its requirements and `carla==0.9.16`, FOLDER contains the package `agents` of CARLA
(`PythonAPI/carla`). An example runs only if its town is given as a `--map`. Each example gets its
own server and a second client that drives the ego along its lane, because the examples expect
that a person or another program drives it. The table shows how ScenarioRunner's process ended.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Generator

TIMEOUT_S = 600.0
"""An example that takes longer is stopped and reported as not ended [s]."""

DRIVER = """
import math, sys, carla
client = carla.Client("127.0.0.1", int(sys.argv[1]))
client.set_timeout(60.0)
speed = float(sys.argv[2])
while True:
    world = client.get_world()
    snapshot = world.wait_for_tick(600.0)
    heroes = [actor for actor in world.get_actors().filter("vehicle.*")
              if actor.attributes.get("role_name") == "hero"]
    if not heroes:
        continue
    hero, town = heroes[0], world.get_map()
    while snapshot.find(hero.id):
        pose, velocity = hero.get_transform(), hero.get_velocity().length()
        ahead = town.get_waypoint(pose.location).next(5.0 + 0.5 * velocity)
        steer = 0.0
        if ahead:
            target = ahead[0].transform.location
            angle = math.atan2(target.y - pose.location.y, target.x - pose.location.x)
            turn = math.remainder(angle - math.radians(pose.rotation.yaw), math.tau)
            steer = max(-1.0, min(1.0, turn))
        # Gap to the nearest vehicle or prop in a strip of 2 m to either side of the hero's axis.
        gap = 50.0
        for other in world.get_actors().filter("*"):
            if other.id != hero.id and other.type_id.startswith(("vehicle", "static.prop")):
                apart = other.get_location() - pose.location
                forward = pose.get_forward_vector()
                along = apart.x * forward.x + apart.y * forward.y
                across = apart.x * forward.y - apart.y * forward.x
                if 0.0 < along and abs(across) < 2.0:
                    gap = min(gap, along - 6.0)  # Half the lengths of both, with a margin.
        gain = 0.3 * (min(speed, 0.4 * max(gap, 0.0)) - velocity)
        hero.apply_control(carla.VehicleControl(
            throttle=min(max(gain, 0.0), 1.0), brake=min(max(-gain, 0.0), 1.0), steer=steer))
        snapshot = world.wait_for_tick(600.0)
"""
"""A client that drives the actor with the role name `hero` along its lane, behind other actors."""

DRIVER_SPEED = 8.0
"""Speed of the ego [m/s]."""

_TOWN = re.compile(r'LogicFile filepath="([^"]+)"')
_RESULT = re.compile(r"GLOBAL RESULT\s*│\s*(\w+)")
_FAILED = re.compile(r"(\w+) \(Req\.\)\s*│ FAILURE")


class Outcome(NamedTuple):
    """How an example ended.

    Attributes:
        name: Name of the example.
        seconds: Time until its process ended [s].
        ending: "ran to its end", or the reason why not.
        result: ScenarioRunner's own result, and the criteria of the ego's driver that failed.
        missing: Calls without effect that the server logged.
    """

    name: str
    seconds: float
    ending: str
    result: str
    missing: str


@contextmanager
def headless_server(maps: list[Path]) -> Generator[tuple[int, subprocess.Popen[str]]]:
    """Run a server with these maps on free ports for as long as the context lasts."""
    command = [sys.executable, "-m", "overtaking", "carla", "serve", "--port", "0", "--json"]
    command += [word for path in maps for word in ("--map", str(path))]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as server:
        try:
            assert server.stdout is not None
            text = ""
            while not text.rstrip().endswith("}"):
                line = server.stdout.readline()
                if not line:
                    raise RuntimeError(f"the server ended before it was ready: {text}")
                text += line
            yield json.loads(text)["port"], server
        finally:
            server.terminate()


def run_example(path: Path, arguments: argparse.Namespace, maps: list[Path]) -> Outcome:
    """Run one example to its end."""
    town = _TOWN.search(path.read_text(encoding="utf-8"))
    if town is None or town[1] not in {file.stem for file in maps}:
        return Outcome(path.stem, 0.0, f"not run: no --map {town[1] if town else '?'}", "", "")
    folders = [str(arguments.checkout), str(arguments.agents)]
    variables = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(folders),
        "SCENARIO_RUNNER_ROOT": str(arguments.checkout),
    }
    with headless_server([file for file in maps if file.stem == town[1]]) as (port, server):
        driver = subprocess.Popen(
            [arguments.python, "-c", DRIVER, str(port), str(DRIVER_SPEED)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        command = [arguments.python, "scenario_runner.py", "--openscenario", str(path), "--sync"]
        command += ["--output", "--timeout", "60", "--port", str(port)]
        command += ["--trafficManagerPort", str(port + 10)]
        start = time.monotonic()
        try:
            process = subprocess.run(
                command,
                cwd=arguments.checkout,
                env=variables,
                capture_output=True,
                text=True,
                timeout=arguments.timeout,
                check=False,
            )
            output = process.stdout + process.stderr
            ending = f"status {process.returncode}"
        except subprocess.TimeoutExpired as error:
            parts = (error.stdout, error.stderr)
            output = "".join(part.decode(errors="replace") for part in parts if part)
            ending = f"did not end within {arguments.timeout:g} s"
        finally:
            driver.kill()
            driver.wait()
        seconds = time.monotonic() - start
        server.terminate()
        log = server.stdout.read() if server.stdout else ""
    result = _RESULT.search(output)
    errors = [line for line in output.splitlines() if re.match(r"\w*(Error|Exception)", line)]
    if result and ending == "status 0":
        ending = "ran to its end"
    elif errors:
        ending += f": {errors[-1]}"
    missing = sorted({line.partition("no effect: ")[2] for line in log.splitlines()} - {""})
    verdict = " ".join([result[1] if result else "", *_FAILED.findall(output)]).strip()
    return Outcome(path.stem, seconds, ending, verdict, "; ".join(missing))


def main() -> None:
    """Print a table of all examples."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("checkout", type=Path)
    parser.add_argument("--python", default=sys.executable)
    parser.add_argument("--agents", type=Path, required=True)
    parser.add_argument("--map", type=Path, action="append", default=[], dest="maps")
    parser.add_argument("--only", help="name of one example")
    parser.add_argument("--timeout", type=float, default=TIMEOUT_S)
    arguments = parser.parse_args()
    arguments.checkout = arguments.checkout.resolve()
    arguments.agents = arguments.agents.resolve()
    examples = sorted((arguments.checkout / "srunner" / "examples").glob("*.xosc"))
    maps = [path.resolve() for path in arguments.maps]
    print("| example | seconds | end | result | not offered |\n|---|--:|---|---|---|", flush=True)
    for path in examples:
        if arguments.only in (None, path.stem):
            row = run_example(path, arguments, maps)
            print(
                f"| {row.name} | {row.seconds:.0f} | {row.ending} | {row.result} | {row.missing} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
