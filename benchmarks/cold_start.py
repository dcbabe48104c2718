"""Times what a user waits for: an import, the study's data set, and memory at two sizes.

    python benchmarks/cold_start.py

Every number is that of a process of its own; the median of several counts.
"""

import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from measure import Measure, parser, report
from scale import watched

ROUNDS = 5
SIZES = (8192, 32_768)
A_MILLION, SECONDS_FOR_IT = 1e6, 120.0

IMPORT = "import time; t = time.perf_counter(); import overtaking; print(time.perf_counter() - t)"


def seconds(*arguments: str) -> float:
    """Wall time of a process [s]."""
    begin = time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, capture_output=True)
    return time.perf_counter() - begin


def generation(folder: Path) -> float:
    """Median time of `overtaking generate -n 276`, all tables, from a cold start [s]."""
    shared = ["-m", "overtaking", "generate", "-n", "276", "--seed", "1", "--quiet"]
    return statistics.median(
        seconds(*shared, "--profile", "pinto2023-physical", "--out", str(folder / f"set{k}"))
        for k in range(ROUNDS)
    )


def importing() -> float:
    """Median time of `import overtaking` [s]."""
    told = [
        subprocess.run([sys.executable, "-c", IMPORT], check=True, capture_output=True, text=True)
        for _ in range(ROUNDS)
    ]
    return statistics.median(float(one.stdout) for one in told)


def peak(simulations: int, executor: str, folder: Path) -> float:
    """Most memory of all processes that generate a data set without frames [MiB]."""
    out = folder / f"peak-{executor}-{simulations}"
    shared = [sys.executable, "-m", "overtaking", "generate", "--json", "--keep", "features"]
    options = ["-n", str(simulations), "--executor", executor, "--out", str(out)]
    return watched([*shared, *options]).peak


def flatness(executor: str, folder: Path) -> list[Measure]:
    """Memory at two sizes that keep every worker busy."""
    small, large = (peak(size, executor, folder) for size in SIZES)
    few, many = (f"{size:,}" for size in SIZES)
    return [
        Measure(name=f"memory of {few} simulations, {executor}", value=small, unit="MiB"),
        Measure(
            name=f"memory of {many} over {few}, {executor}",
            value=large / small,
            unit="times",
            at_most=1.2,
        ),
    ]


def rate(folder: Path) -> Measure:
    """Simulations a second without frames, sampling and all small tables included."""
    import overtaking as ot

    count = 32_768
    begin = time.perf_counter()
    data = ot.generate_dataset(
        "pinto2023-physical", num_simulations=count, seed=2, out=folder / "rate", keep="features"
    )
    taken = time.perf_counter() - begin
    frames = data.simulations()["num_frames"].mean()
    note = f"{count:,} simulations of {frames:.0f} frames on average"
    return Measure(
        name="generate, no frames kept",
        value=count / taken,
        unit="simulations/s",
        at_least=A_MILLION / SECONDS_FOR_IT,
        note=note,
    )


def measures() -> list[Measure]:
    """What a user waits for."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        return [
            Measure(name="import overtaking", value=importing(), unit="s", at_most=0.1),
            Measure(name="generate -n 276, cold", value=generation(folder), unit="s", at_most=2.0),
            rate(folder),
            *flatness("threads", folder),
            *flatness("processes", folder),
        ]


if __name__ == "__main__":
    arguments = parser(__doc__).parse_args()
    sys.exit(report(measures(), as_json=arguments.json))
