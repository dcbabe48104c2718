"""Validates the `croissant.json` of data sets with MLCommons' own library, and reads records by it.

mlcroissant brings a library of graphs and pins of its own, so it has an environment of its own, and
this script imports nothing of the package:

    overtaking generate -n 20 --seed 1 --out data/small
    python -m venv build/oracle
    build/oracle/bin/python -m pip install mlcroissant==1.1.1 pyarrow
    build/oracle/bin/python benchmarks/oracles/croissant.py data/small

It ends with an error if the library finds one, if a checksum is not that of its file, or if a
record set gives other values than its Parquet files.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib
import itertools
import math
from pathlib import Path
from typing import Any

RECORDS = 500
"""Records of each table that are compared; the library takes about a second for some thousands."""


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path, help="data sets")
    for folder in parser.parse_args().folders:
        data = importlib.import_module("mlcroissant").Dataset(str(folder / "croissant.json"))
        files = [check_file(folder, one) for one in data.metadata.file_objects]
        records = [check_records(folder, data, one) for one in data.metadata.record_sets]
        print(f"{folder}: {len(files)} files, {len(records)} tables, {sum(records)} records")


def check_file(folder: Path, file: Any) -> None:
    """Compare a file with what is said of it."""
    content = (folder / file.content_url).read_bytes()
    found = (hashlib.sha256(content).hexdigest(), f"{len(content)} B")
    if found != (file.sha256, file.content_size):
        raise SystemExit(f"{file.content_url}: {found} is not what croissant.json says")


def check_records(folder: Path, data: Any, record_set: Any) -> int:
    """Compare the first records of a table with its files; returns how many there were."""
    parquet = importlib.import_module("pyarrow.parquet")
    name = record_set.id
    rows = parquet.read_table(folder / name).slice(0, RECORDS).to_pylist()
    given = list(itertools.islice(data.records(name), RECORDS))
    if len(given) != len(rows):
        raise SystemExit(f"{name}: {len(given)} records instead of {len(rows)}")
    for number, (record, row) in enumerate(zip(given, rows, strict=True)):
        values = {key.partition("/")[2]: in_parquet(value) for key, value in record.items()}
        expected = {key: in_croissant(value) for key, value in row.items()}
        if values != expected:
            different = [key for key in expected if values.get(key) != expected[key]]
            raise SystemExit(f"{name}: record {number} differs in {', '.join(different)}")
    return len(given)


def in_parquet(value: Any) -> Any:
    """A value of the library, in which what is missing is no number."""
    return None if isinstance(value, float) and math.isnan(value) else value


def in_croissant(value: Any) -> Any:
    """A value of Parquet as the library gives it: texts as bytes."""
    return value.encode() if isinstance(value, str) else value


if __name__ == "__main__":
    main()
