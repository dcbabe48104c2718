"""A data set whose checksums are right and whose tables are not is refused in one line."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import overtaking as ot

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

pytestmark = pytest.mark.ci


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    ot.generate("pinto2023-physical", 2, 1, tmp_path / "data")
    return tmp_path / "data"


def rewrite(folder: Path, table: str, change: Callable[[pa.Table], pa.Table]) -> None:
    """Change a table, and write the checksum of the new file into the manifest."""
    file, manifest_file = folder / table / "part-00000.parquet", folder / "dataset.json"
    changed = change(pq.read_table(file))
    pq.write_table(changed, file)
    manifest: dict[str, Any] = json.loads(manifest_file.read_text())
    manifest["shards"][0]["tables"][table] |= {
        "rows": changed.num_rows,
        "size_bytes": file.stat().st_size,
        "sha256": hashlib.sha256(file.read_bytes()).hexdigest(),
    }
    manifest_file.write_text(json.dumps(manifest))


@pytest.mark.parametrize("table", ["simulations", "labels", "vehicles", "features", "safety"])
def test_more_rows_than_the_simulations_can_have_are_refused_before_they_are_read(folder, table):
    rewrite(folder, table, lambda rows: rows.take(pa.array([0] * 1000)))
    with pytest.raises(ot.OvertakingError, match=f"rows of table {table}: expected at most"):
        ot.load(folder).table(table)


def test_a_missing_column_is_refused_where_other_columns_are_read(folder):
    rewrite(folder, "vehicles", lambda rows: rows.drop_columns([rows.column_names[-1]]))
    with pytest.raises(ot.OvertakingError, match="no such column"):
        list(ot.load(folder).columns(vehicles=["simulation"]))


@pytest.mark.parametrize("lane_id", [2**31, -(2**15) - 1, 2**15])
def test_a_lane_id_that_tables_cannot_hold_is_refused(folder, lane_id):
    manifest = json.loads((folder / "dataset.json").read_text())
    manifest["identity"]["road"]["lanes"][0]["lane_id"] = lane_id
    (folder / "dataset.json").write_text(json.dumps(manifest))
    with pytest.raises(ot.OvertakingError, match="lane_id"):
        ot.load(folder)
