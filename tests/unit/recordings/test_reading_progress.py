"""While a recording is read and examined, the share of the work is reported in bytes."""

from __future__ import annotations

import gzip
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.feather as feather
import pyarrow.ipc as ipc
import pytest

import overtaking as ot
from overtaking.core.errors import ImportFormatError
from overtaking.recordings import formats
from overtaking.recordings.formats import read_recording
from overtaking.recordings.reading_progress import (
    NUM_PASSES,
    STAGES,
    count_bytes,
    open_counted,
    report_reading,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

COLUMNS: dict[str, Any] = {
    "recording": {"length_m": 4.4, "width_m": 1.8},
    "columns": {"vehicle": "id", "time": "t [s]", "x": "x [m]", "y": "y [m]"},
}


def table(seconds: float = 200.0) -> pd.DataFrame:
    """Vehicle 1 overtakes vehicle 2, and both drive on."""
    time = np.round(np.arange(0.0, seconds, 0.1), 1)
    aside = np.clip((time - 2.0) / 3.0, 0.0, 1.0) - np.clip((time - 14.0) / 3.0, 0.0, 1.0)
    paths = {1: (30.0 * time, 3.5 * aside), 2: (40.0 + 24.0 * time, 0.0 * time)}
    return pd.concat(
        pd.DataFrame({"id": number, "t": time, "x": x, "y": y}) for number, (x, y) in paths.items()
    )


def write_stream(path: Path) -> None:
    arrow = pa.Table.from_pandas(table(), preserve_index=False)
    with ipc.new_stream(path, arrow.schema) as writer:
        writer.write_table(arrow, max_chunksize=500)


WRITERS: dict[str, Callable[[Path], object]] = {
    "table.csv": lambda path: table().to_csv(path, index=False),
    "table.csv.gz": lambda path: path.write_bytes(
        gzip.compress(table().to_csv(index=False).encode())
    ),
    "table.parquet": lambda path: table().to_parquet(path, index=False, row_group_size=500),
    "table.feather": lambda path: feather.write_feather(
        table(), path, chunksize=500, compression="uncompressed"
    ),
    "table.arrows": write_stream,
}


@pytest.mark.parametrize("name", WRITERS)
def test_reports_grow_to_all_bytes_in_all_passes(name: str, tmp_path: Path):
    path = tmp_path / name
    WRITERS[name](path)
    calls: list[tuple[int, int]] = []
    with report_reading(lambda done, total: calls.append((done, total))):
        read_recording("table", path, {"columns": COLUMNS})
    size = path.stat().st_size
    done = [call[0] for call in calls]
    assert {call[1] for call in calls} == {3 * size}
    assert done == sorted(set(done))
    assert done[-1] == 3 * size
    assert any(number <= size for number in done), "the hash is computed first"
    assert any(size < number < 2 * size for number in done) or name.endswith((".csv", ".gz"))
    stages = [round(2 * size + share * size) for share in STAGES.values()]
    assert [number for number in done if number > 2 * size][: len(stages)] == pytest.approx(
        stages, abs=1
    )


def test_a_large_file_is_reported_in_small_steps(tmp_path: Path):
    path = tmp_path / "large"
    path.write_bytes(b"0" * 2_000_000)
    calls: list[int] = []
    with (
        report_reading(lambda done, _: calls.append(done)),
        count_bytes([path]),
        open_counted(path, "table") as file,
    ):
        assert len(file.read(200_000)) == 200_000
        assert calls[-1] == pytest.approx(200_000, abs=50_000)
        while file.read(1000):
            pass
        file.seek(0)
        file.read(1000)
    assert calls == sorted(set(calls))
    assert calls[-2] == pytest.approx(2_000_000, abs=50_000)
    assert calls[-1] == NUM_PASSES * 2_000_000, "nothing is examined here"
    assert max(np.diff(calls[:-1])) < 50_000
    assert len(calls) <= 500


def test_nothing_is_counted_outside_the_context(tmp_path: Path):
    path = tmp_path / "table.csv"
    WRITERS[path.name](path)
    calls: list[tuple[int, int]] = []
    with report_reading(lambda done, total: calls.append((done, total))):
        pass
    read_recording("table", path, {"columns": COLUMNS})
    with report_reading(None):
        read_recording("table", path, {"columns": COLUMNS})
    assert calls == []


def test_an_error_while_reading_ends_the_reports(tmp_path: Path):
    path = tmp_path / "table.csv"
    path.write_text("id,t,x,y\n1,0,a,0\n", encoding="utf-8")
    calls: list[tuple[int, int]] = []
    with report_reading(lambda done, total: calls.append((done, total))):
        with pytest.raises(ImportFormatError, match=r"table\.csv"):
            read_recording("table", path, {"columns": COLUMNS})
        num_calls = len(calls)
        with open_counted(path, "table") as file:
            file.read()
    assert len(calls) == num_calls


def test_an_import_reports_bytes_and_then_simulations(tmp_path: Path):
    path = tmp_path / "table.csv"
    WRITERS[path.name](path)
    size = path.stat().st_size
    calls: list[tuple[int, int]] = []
    data = ot.import_recording(
        "table",
        path,
        tmp_path / "data",
        columns=COLUMNS,
        progress=lambda done, total: calls.append((done, total)),
    )
    first = [total for _, total in calls].index(len(data))
    assert {total for _, total in calls[:first]} == {3 * size}
    assert {total for _, total in calls[first:]} == {len(data)}
    assert calls[-1] == (len(data), len(data))


def test_an_import_reports_bytes_apart_where_that_is_asked_for(tmp_path: Path):
    path = tmp_path / "table.csv"
    WRITERS[path.name](path)
    simulations: list[tuple[int, int]] = []
    read: list[tuple[int, int]] = []
    data = ot.import_recording(
        "table",
        path,
        tmp_path / "data",
        columns=COLUMNS,
        progress=lambda done, total: simulations.append((done, total)),
        on_read=lambda done, total: read.append((done, total)),
    )
    assert {total for _, total in simulations} == {len(data)}
    assert read[-1] == (3 * path.stat().st_size,) * 2


@pytest.mark.ci
def test_a_folder_reports_the_bytes_of_each_recording(tmp_path: Path):
    folder = tmp_path / "recordings"
    folder.mkdir()
    for number in range(2):
        table(200.0 + number).to_csv(folder / f"{number}.csv", index=False)
    recordings: list[tuple[int, int]] = []
    read: list[tuple[int, int]] = []
    result = ot.label_recordings(
        "table",
        folder,
        tmp_path / "out",
        columns=COLUMNS,
        executor="threads",
        progress=lambda done, total: recordings.append((done, total)),
        on_read=lambda done, total: read.append((done, total)),
    )
    sizes = [3 * path.stat().st_size for path in sorted(folder.iterdir())]
    assert [total for done, total in read if done == total] == sizes
    assert recordings[-1] == (2, 2)
    assert result["failed"] == {}


def test_the_bytes_of_all_files_of_a_recording_count(tmp_path: Path):
    """Such as those of highD, whose tracks lie beside two small tables."""
    paths = [tmp_path / "a", tmp_path / "b", tmp_path / "missing"]
    for path, size in zip(paths[:2], (3000, 1000), strict=True):
        path.write_bytes(b"0" * size)
    calls: list[tuple[int, int]] = []
    with (
        report_reading(lambda done, total: calls.append((done, total))),
        count_bytes(paths),
    ):
        for path in paths[:2]:
            assert formats._sha256(path)
    assert calls == [(3000, 12_000), (4000, 12_000), (12_000, 12_000)]
