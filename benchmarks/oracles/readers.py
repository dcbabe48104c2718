"""Reads data sets with what others use: the library of Hugging Face, Polars and DuckDB.

They have an environment of their own, and this script imports nothing of the package:

    overtaking generate -n 20 --seed 1 --out data/small
    python -m venv build/oracle
    build/oracle/bin/python -m pip install datasets==5.2.0 polars==2.1.0 duckdb==2.0.0
    build/oracle/bin/python benchmarks/oracles/readers.py data/small

Every table is read as a folder of Parquet files, and by the library of Hugging Face also by the
name that the head of README.md gives it. The script ends with an error where a table is not read,
or where its columns, its rows or a value are not those that PyArrow finds. Tables without rows are
left out: the library of Hugging Face refuses them, and README.md does not name them.
"""

from __future__ import annotations

import argparse
import importlib
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

Rows = list[dict[str, Any]]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path, help="data sets")
    folders = parser.parse_args().folders
    os.environ["HF_HUB_OFFLINE"] = "1"  # Nothing here is on a hub.
    with tempfile.TemporaryDirectory() as cache:
        readers = all_readers(cache)
        for folder in folders:
            tables = tables_of(folder)
            for name, read in readers.items():
                for table, rows in tables.items():
                    compare(read(folder, table), rows, f"{folder}: {name}: {table}")
                total = sum(map(len, tables.values()))
                print(f"{folder}: {name}: {total} rows of {len(tables)} tables, all equal")


def all_readers(cache: str) -> dict[str, Callable[[Path, str], Rows]]:
    """Functions that read a table of a folder, by name; what they keep goes into `cache`."""
    datasets, polars, duckdb = map(importlib.import_module, ("datasets", "polars", "duckdb"))
    datasets.disable_progress_bars()

    def hugging_face_files(folder: Path, table: str) -> Rows:
        files = str(folder / table / "*.parquet")
        read = datasets.load_dataset("parquet", data_files=files, split="train", cache_dir=cache)
        return read.to_list()

    def hugging_face_card(folder: Path, table: str) -> Rows:
        return datasets.load_dataset(str(folder), table, split="train", cache_dir=cache).to_list()

    def polars_files(folder: Path, table: str) -> Rows:
        return polars.read_parquet(folder / table / "*.parquet").to_dicts()

    def duckdb_files(folder: Path, table: str) -> Rows:
        found = duckdb.sql(f"select * from '{folder / table}/*.parquet'")
        return [dict(zip(found.columns, row, strict=True)) for row in found.fetchall()]

    return {
        "Hugging Face, by files": hugging_face_files,
        "Hugging Face, by README.md": hugging_face_card,
        "Polars": polars_files,
        "DuckDB": duckdb_files,
    }


def tables_of(folder: Path) -> dict[str, Rows]:
    """The rows that PyArrow finds in each table that has any."""
    parquet = importlib.import_module("pyarrow.parquet")
    names = sorted(path.parent.name for path in folder.glob("*/part-00000.parquet"))
    if not names:
        raise SystemExit(f"{folder}: no tables")
    found = {name: parquet.read_table(folder / name).to_pylist() for name in names}
    return {name: rows for name, rows in found.items() if rows}


def compare(given: Rows, expected: Rows, where: str) -> None:
    """End with an error unless both are the same."""
    if len(given) != len(expected):
        raise SystemExit(f"{where}: {len(given)} rows instead of {len(expected)}")
    for number, (one, other) in enumerate(zip(given, expected, strict=True)):
        if one != other:
            raise SystemExit(f"{where}: row {number} differs")


if __name__ == "__main__":
    main()
