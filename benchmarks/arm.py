"""Compares 256 simulations on ARM with those of this machine, by their trace hashes.

    python benchmarks/arm.py
    python benchmarks/arm.py --here       # only the processor of this machine

The engine is cross-compiled to aarch64, where its portable level is NEON, and runs under an
emulator:

    rustup target add aarch64-unknown-linux-gnu
    apt-get install gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user

There is no Python on ARM in this: Python prepares what the engine is given and writes it to files,
and a program of the crate `overtaking-portable` (`examples/replay.rs`) reads them, simulates, and
prints the hashes. The same program runs here at every SIMD level of this processor. Expected is
what the package computes here. The situations are those of `tests/reference/situations.py`, which
make the model do everything that it can do, and full slots of 16 and 32 vehicles. Exits with 1 at
the first difference.
"""

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import engine as peers
import identity
from measure import ROOT, Measure, parser, report
from overtaking import _core
from overtaking.model.scenario import SLOT_CAPACITIES
from overtaking.sim import engine
from overtaking.world.constants import engine_constants
from overtaking.world.step_parameters import StepParameters

FOLDER = ROOT / "target" / "arm"
CROWDED = 8  # Simulations of each size of slots that the situations lack.
TARGET = "aarch64-unknown-linux-gnu"
EMULATOR = ("qemu-aarch64", "-L", "/usr/aarch64-linux-gnu")
LINKER = {"CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER": "aarch64-linux-gnu-gcc"}


def write(
    path: Path, given: StepParameters, later: Sequence[tuple[int, StepParameters]] = ()
) -> None:
    """Write what the engine is given, in the order in which `replay.rs` reads it.

    Args:
        path: The file.
        given: Parameters at the start.
        later: The step of a change and the parameters from then on; one at most.
    """
    [(switch, changed)] = later or [(0, None)]
    road, constants = engine.road_inputs(given), engine_constants(given.constants)
    slots, simulations = given.vehicle_table.shape[1:]
    room = -(-given.num_frames // _core.SIMD_LANES) * _core.SIMD_LANES
    header = [simulations, slots, room, given.steps_per_frame, road["num_lanes"]]
    whole = [*header, int(changed is not None), switch, given.seed]
    parts = [
        *constants.values(),
        *(road[name] for name in ("boundaries", "film_path", "overtaking_sign", "pose")),
        *(road[name] for name in ("num_own_lanes", "has_oncoming_traffic", "length", "edge_sum")),
        *(road[name] for name in ("sight", "solid_line")),
    ]
    for each in (given, changed) if changed else (given,):
        parts += [each.vehicle_table, each.simulation_table]
    with path.open("wb") as file:
        file.write(np.array(whole, "<u8").tobytes() + given.scenario_index.astype("<u8").tobytes())
        for part in parts:
            file.write(np.asarray(part, "<f4").tobytes())


def batches(folder: Path) -> tuple[list[Path], list[str]]:
    """Files of all batches, and the trace hashes that the package computes for them."""
    files, expected = list[Path](), list[str]()

    def run(scenario: Any, given: StepParameters, *later: Any) -> Any:
        files.append(folder / f"{len(files)}.bin")
        write(files[-1], given, *later)
        runs = engine.run(scenario, given, *later)
        expected.extend("".join(f"{word:08x}" for word in row) for row in runs.trace_hash)
        return runs

    for situation in identity.situations.SITUATIONS:
        situation.run(situation.scenario(situation.share), run)
    for vehicles in SLOT_CAPACITIES[1:]:
        scenario = peers.crowd(vehicles, CROWDED)
        run(scenario, peers.endless(scenario))
    return files, expected


def build(*options: str) -> Path:
    """Compile the program; where it lies."""
    command = ["cargo", "build", "--release", "--locked", "--package", "overtaking-portable"]
    subprocess.run(
        [*command, "--example", "replay", *options],
        cwd=ROOT,
        env={**os.environ, **LINKER},
        check=True,
    )
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    return target.joinpath(*options[1:], "release", "examples", "replay")


def replay(*command: str | Path, files: list[Path]) -> list[str]:
    """Trace hashes that a program prints."""
    done = subprocess.run([*command, *files], stdout=subprocess.PIPE, text=True, check=True)
    return done.stdout.split()


def measures(folder: Path, *, here: bool) -> list[Measure]:
    """How many hashes differ, for each processor and SIMD level."""
    folder.mkdir(parents=True, exist_ok=True)
    files, expected = batches(folder)
    program = build()
    found = {
        level: replay(program, "--level", level, files=files) for level in identity.levels()[0]
    }
    if not here:
        arm = build("--target", TARGET)
        found[f"{TARGET}, emulated"] = replay(*EMULATOR, arm, "--level", "portable", files=files)
    return [
        Measure(
            name=f"{name}: differences",
            value=sum(one != other for one, other in zip(hashes, expected, strict=True)),
            unit="",
            at_most=0,
            note=f"of {len(expected)} trace hashes",
        )
        for name, hashes in found.items()
    ]


if __name__ == "__main__":
    options = parser(__doc__)
    options.add_argument("--here", action="store_true", help="only the processor of this machine")
    given = options.parse_args()
    sys.exit(report(measures(FOLDER, here=given.here), as_json=given.json))
