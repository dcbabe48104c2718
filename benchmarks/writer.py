"""Writes every column of `states` as a data set does, and as pyarrow does by itself.

    python benchmarks/writer.py

From arrays in memory to a file that is safe on the disk (encode, compress, hash, fsync), then read
back by pyarrow and DuckDB and compared. Prints rows a second and bytes a row beside those of
pyarrow's defaults for the same rows in SI floats, the table that most people would write.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import overtaking as ot
from overtaking.data.tables.decode import decode
from overtaking.data.tables.encode import encode
from overtaking.data.tables.files import TableWriter, read_table
from overtaking.model.trajectories import Trajectories

PIECE = 512
"""Simulations in memory at a time, as in `data.plan`."""


def ours(pieces: list[Trajectories], path: Path) -> None:
    """As a data set writes it: a piece is written while the next one is encoded."""
    with TableWriter(path, "states") as writer, ThreadPoolExecutor(1) as pool:
        underway = None
        for number, piece in enumerate(pieces):
            numbers = np.arange(number * PIECE, (number + 1) * PIECE)
            table = encode(piece, numbers, ["states"])["states"]
            if underway is not None:
                underway.result()
            underway = pool.submit(writer.write, table)
        pool.shutdown()
        writer.finish()


def defaults(tables: list[pa.Table], path: Path) -> None:
    """As pyarrow writes tables if it is left alone, and forced to the disk."""
    with path.open("wb") as file:
        with pq.ParquetWriter(file, tables[0].schema) as writer:
            for table in tables:
                writer.write_table(table)
        os.fsync(file.fileno())


def best(action: Callable[[], None], repeats: int) -> float:
    """The shortest of some runs [s]."""
    times: list[float] = []
    for _ in range(repeats):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return min(times)


def check(path: Path, pieces: list[Trajectories]) -> int:
    """Read the file with pyarrow and DuckDB and compare it with memory; the number of rows."""
    read = read_table(path, "states")
    expected = np.concatenate([rows_of(piece) for piece in pieces])
    query = f"select x_mm from '{path}' order by simulation, vehicle, frame"
    by_duckdb = duckdb.connect().execute(query).fetchnumpy()["x_mm"]
    if not (np.array_equal(read["x_mm"].to_numpy(), expected) and (by_duckdb == expected).all()):
        sys.exit("what was read is not what was written")
    return read.num_rows


def rows_of(piece: Trajectories) -> np.ndarray:
    """The recorded x of a batch, row for row [mm]."""
    valid = piece.scenario.vehicles.valid[:, :, None] & piece.frame_mask[:, None, :]
    return piece.states.x[valid]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Measure how fast states are written.")
    parser.add_argument("--pieces", type=int, default=8, help=f"times {PIECE} simulations")
    parser.add_argument("--repeats", type=int, default=3)
    given = parser.parse_args()
    pieces = [
        ot.simulate(
            ot.sample(
                "pinto2023-physical", num_simulations=PIECE, seed=1, first_scenario=number * PIECE
            )
        )
        for number in range(given.pieces)
    ]
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as folder:
        path, other = Path(folder) / "ours.parquet", Path(folder) / "defaults.parquet"
        mine = best(lambda: ours(pieces, path), given.repeats)
        rows = check(path, pieces)
        floats = [pa.Table.from_pandas(decode(read_table(path, "states")))]
        theirs = best(lambda: defaults(floats, other), given.repeats)
        for name, seconds, file in (("ours", mine, path), ("pyarrow defaults", theirs, other)):
            size = file.stat().st_size / rows
            print(f"{name:17} {rows / seconds / 1e6:6.1f} M rows/s {size:6.2f} bytes a row")
    print(f"{rows} rows; {theirs / mine:.1f} times as fast as the defaults")


if __name__ == "__main__":
    main()
