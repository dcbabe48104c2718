"""How long a report takes: over the study's 276 simulations, and over as many as one likes.

    python benchmarks/report.py                         # 276 simulations
    python benchmarks/report.py --simulations 1000000   # a million beside them; minutes to make
    python benchmarks/report.py --data data/million     # a data set that is there already

Each report is that of a command of its own, so starting it counts: time by the clock and of the
processor, and peak memory. What is generated leaves frames out, as large data sets do.
"""

import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import overtaking as ot
from measure import Measure, parser
from measure import report as told

STUDY, MILLION = 276, 1_000_000
MUST_S, MUST_OF_A_MILLION_S = 15.0, 60.0

CHILD = """
import resource, sys
from overtaking.cli import main
assert main(["report", *sys.argv[1:], "--json"]) == 0
used = resource.getrusage(resource.RUSAGE_SELF)
lines = open("/proc/self/status").read().splitlines()
peak = next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
print(used.ru_utime + used.ru_stime, peak, file=sys.stderr)
"""
"""Writes a report as the command does, then prints processor seconds and peak memory in KiB."""


def reporting(data: Path, out: Path) -> Measure:
    """Time of a report on a data set [s]."""
    command = [sys.executable, "-c", CHILD, str(data), "--out", str(out)]
    begin = time.perf_counter()
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    seconds = time.perf_counter() - begin
    made = json.loads(done.stdout)
    processor, peak = (float(part) for part in done.stderr.split()[-2:])
    note = (
        f"{len(made['figures'])} figures, {len(made['tables'])} tables; "
        f"processor {processor:.1f} s, "
        f"peak {peak / 1024.0:,.0f} MB, page {Path(made['page']).stat().st_size / 1e6:.1f} MB"
    )
    simulations = made["simulations"]
    return Measure(
        name=f"report on {simulations:,} simulations",
        value=seconds,
        unit="s",
        at_most=MUST_S if simulations <= STUDY else MUST_OF_A_MILLION_S,
        note=note,
    )


def main() -> int:
    """Measure and print."""
    command_line = parser(__doc__)
    command_line.add_argument("--simulations", type=int, help="generate and report as many too")
    command_line.add_argument("--data", type=Path, help="report on this data set too")
    given = command_line.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="overtaking-"))
    try:
        ot.generate_dataset(
            "pinto2023-physical", num_simulations=STUDY, seed=1, out=folder / "study"
        )
        asked = [folder / "study", *([given.data] if given.data else [])]
        if given.simulations:
            ot.generate_dataset(
                "pinto2023-physical",
                num_simulations=given.simulations,
                seed=1,
                out=folder / "large",
                keep="features",
            )
            asked.append(folder / "large")
        measures = [reporting(data, folder / "report") for data in asked]
    finally:
        shutil.rmtree(folder)
    return told(measures, as_json=given.json)


if __name__ == "__main__":
    raise SystemExit(main())
