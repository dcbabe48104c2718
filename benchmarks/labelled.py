"""A million labelled simulations: how fast, how flat, and whether they are right.

    python benchmarks/labelled.py                       # 1,000,000 simulations, minutes
    python benchmarks/labelled.py --simulations 50000 --agree 2000

Generates `pinto2023-physical` without frames, draws some of its simulations at random, and compares
what the files say of them with what the readable reference says, which simulates and labels in
NumPy alone; then labels simulations from memory and from stored frames and compares every value.
The share of each stage is measured on pieces of their own, in processor time of all threads.
"""

import os
import shutil
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa

import overtaking as ot
from measure import Measure, parser, report
from memory import Watch
from overtaking.core.arrays import Buffers
from overtaking.data.load import Dataset
from overtaking.data.location import Folder
from overtaking.data.plan import LARGE_CHUNK_SIZE, SHARD_SIZE, shards
from overtaking.data.recipe import Keep
from overtaking.data.shards import write_shard
from overtaking.data.tables.encode_labels import contents, encode_labels
from overtaking.data.tables.schemas import LABEL_TABLES, SCHEMAS
from overtaking.labels.attempt_features import attempt_features
from overtaking.labels.event_detection import case_from_trajectories
from overtaking.labels.labelling import label
from overtaking.labels.law.judging import judge_pack
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.paper_features import matched_features, paper_features
from overtaking.labels.safety_features import safety_features
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine, reference
from overtaking.world.step_parameters import step_parameters
from readable import readable

MILLION = 1_000_000
MUST_S = 120.0
PIECE = LARGE_CHUNK_SIZE
KEPT = Keep.FEATURES.tables


def rate(folder: Path, simulations: int) -> tuple[list[Measure], Dataset]:
    """Time by the clock and memory of generating labels, findings and features."""
    begin = time.perf_counter()
    with Watch(os.getpid()) as watch:
        data = ot.generate_dataset(
            "pinto2023-physical", num_simulations=simulations, seed=5, out=folder, keep="features"
        )
    seconds = (time.perf_counter() - begin) * MILLION / simulations
    frames = data.table("simulations")["num_frames"].to_numpy().mean()
    size = f"{simulations:,} simulations of {frames:.0f} frames in the mean"
    note = f"{size}, {watch.cpu:,.0f} s of a processor, all processes {watch.peak:,.0f} MiB"
    return [
        Measure(name="a million labelled", value=seconds, unit="s", at_most=MUST_S, note=note)
    ], data


def against_the_reference(data: Dataset, count: int) -> Measure:
    """How many of some simulations drawn at random differ from what the reference says."""
    draw = np.sort(np.random.default_rng(1).choice(len(data), count, replace=False))
    given = load_specification("pinto2023-physical")
    index = draw.astype(np.uint64)
    with readable():
        runs = reference.simulate(ScenarioSource(given, load_road(given.road), 5).sample(index))
        expected = encode_labels(label(runs), draw.astype(np.int64))
    hashes = data.table("simulations")["trace_hash"].take(draw).to_pylist()
    own = [row.astype("<u4").tobytes() for row in runs.trace_hash]
    different = sum(one != other for one, other in zip(hashes, own, strict=True))
    for name in LABEL_TABLES:
        table = data.table(name)
        rows = np.isin(table["simulation"].to_numpy(), draw)
        different += not table.filter(rows).combine_chunks().equals(expected[name])
    return Measure(
        name="differ from the reference", value=different, unit=f"of {count:,}", at_most=0
    )


def from_memory_and_from_files(folder: Path, count: int) -> Measure:
    """How many tables differ between labels from memory and labels from stored frames."""
    data = ot.generate_dataset("pinto2023-physical", num_simulations=count, seed=6, out=folder)
    before = {name: data.table(name) for name in LABEL_TABLES}
    again = ot.relabel_dataset(folder)
    different = sum(not again.table(name).equals(before[name]) for name in LABEL_TABLES)
    return Measure(
        name="tables differ from stored frames",
        value=different,
        unit="of 4",
        at_most=0,
        note=f"{count:,} simulations, {len(before['findings']):,} findings",
    )


def stages() -> list[Measure]:
    """Processor time of each stage for a simulation, on pieces as `rate` worked on them."""
    given = load_specification("pinto2023-physical")
    road, index = load_road(given.road), np.arange(PIECE, dtype=np.uint64)
    scenario = ScenarioSource(given, road, 9).sample(index)
    prepared, buffers = step_parameters(scenario), Buffers()
    runs = engine.run(scenario, prepared, buffers=buffers)
    case = case_from_trajectories(runs)
    numbers = index.astype(np.int64)
    rows = contents(runs, numbers, KEPT)
    work: dict[str, Callable[[], object]] = {
        "sample": lambda: ScenarioSource(given, road, 9).sample(index),
        "parameters": lambda: step_parameters(scenario),
        "simulate": lambda: engine.run(scenario, prepared, buffers=buffers),
        "signals and events": lambda: case_from_trajectories(runs),
        # What many ask of a case is answered once, so each run of rules has a case of its own.
        "rules": lambda: judge_pack(PORTUGAL, case.replace()),
        "features": lambda: (paper_features(case), matched_features(case)),
        "attempts": lambda: attempt_features(case),
        "safety": lambda: safety_features(case),
        "label": lambda: label(runs),
        "label and tables": lambda: contents(runs, numbers, KEPT),
    }
    costs = {name: _cost(each, PIECE) for name, each in work.items()}
    costs["write"] = _cost(lambda: _write(rows), SHARD_SIZE)
    return [Measure(name=f"stage {name}", value=cost, unit="µs") for name, cost in costs.items()]


def _write(rows: Mapping[str, pa.Table]) -> None:
    """Write a shard that is full of one piece, to the disk and with `fsync`."""
    with tempfile.TemporaryDirectory(prefix="overtaking-") as name:
        folder, shard = Folder(Path(name)), shards(SHARD_SIZE)[0]
        folder.prepare(KEPT)
        pieces = [(PIECE, rows)] * (SHARD_SIZE // PIECE)
        schemas = {name: SCHEMAS[name] for name in KEPT}
        write_shard(
            folder, shard, pieces, schemas=schemas, fingerprint="none", on_piece=lambda _: None
        )


def _cost(work: Callable[[], object], simulations: int) -> float:
    """Least processor time of some calls, for each of the simulations of one [µs]."""
    costs: list[float] = []
    for _ in range(5):
        begin = time.process_time()
        work()
        costs.append((time.process_time() - begin) / simulations * 1e6)
    return min(costs)


def main() -> int:
    """Measure and print."""
    arguments = parser(__doc__)
    arguments.add_argument("--simulations", type=int, default=MILLION)
    arguments.add_argument("--reference", type=int, default=1000)
    arguments.add_argument("--agree", type=int, default=10_000)
    given = arguments.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="overtaking-"))
    try:
        measures, data = rate(folder / "labels", given.simulations)
        measures.append(against_the_reference(data, min(given.reference, given.simulations)))
        measures.append(from_memory_and_from_files(folder / "frames", given.agree))
        measures += stages()
    finally:
        shutil.rmtree(folder)
    return report(measures, as_json=given.json)


if __name__ == "__main__":
    raise SystemExit(main())
