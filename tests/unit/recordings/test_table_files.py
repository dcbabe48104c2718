"""Tables of recordings in Arrow files: the same cells as in CSV, within the same bounds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd
import pyarrow as pa
import pyarrow.feather as feather
import pyarrow.ipc as ipc
import pytest
from tests.support.recordings import OVERTAKE, states

from overtaking.core.errors import ConfigError, ImportFormatError
from overtaking.recordings.column_map import column_map
from overtaking.recordings.column_request import NUMBER, TEXT, ColumnRequest
from overtaking.recordings.formats import read_recording
from overtaking.recordings.table_files import column_names, read_columns

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

REQUEST = ColumnRequest(types={"vehicle": NUMBER, "speed": NUMBER, "class": TEXT})
TABLE = pa.table({"speed": [20.5, 30.0], "class": ["car", "truck"], "vehicle": [7, 9]})
MAP = {
    "columns": {
        "vehicle": "id",
        "time": "t [s]",
        "x": "x [m]",
        "y": "y [m]",
        "length": "length [m]",
        "width": "width [m]",
    }
}


def write_file(table: pa.Table, path: Path) -> None:
    with ipc.new_file(path, table.schema) as writer:
        writer.write_table(table, max_chunksize=1)


def write_stream(table: pa.Table, path: Path) -> None:
    with ipc.new_stream(path, table.schema) as writer:
        writer.write_table(table, max_chunksize=1)


def write_pandas(table: pa.Table, path: Path) -> None:
    frame: Any = table.to_pandas()
    frame.astype({"class": "category"}).to_feather(path)


WRITERS: dict[str, Callable[[pa.Table, Path], None]] = {
    "file.arrow": write_file,
    "stream.arrow": write_stream,
    "stream.arrows": write_stream,
    "pandas.feather": write_pandas,
    "zstd.feather": lambda table, path: feather.write_feather(table, path, compression="zstd"),
}


@pytest.mark.parametrize("name", WRITERS)
def test_columns_of_an_arrow_file_are_read_in_the_order_asked_for(tmp_path, name):
    WRITERS[name](TABLE, tmp_path / name)
    table = read_columns(tmp_path / name, REQUEST).table
    assert table.to_pydict() == {
        "vehicle": [7, 9],
        "speed": [20.5, 30.0],
        "class": ["car", "truck"],
    }
    assert column_names(tmp_path / name) == ("speed", "class", "vehicle")


def test_a_recording_is_the_same_in_an_arrow_file_as_in_csv(tmp_path):
    frame = pd.DataFrame(states(OVERTAKE))
    frame.to_csv(tmp_path / "tracks.csv", index=False)
    frame.to_feather(tmp_path / "tracks.feather")
    of_csv, of_arrow = (
        read_columns(
            tmp_path / f"tracks.{ending}",
            ColumnRequest(types=dict.fromkeys(("id", "t", "x", "y"), NUMBER)),
        ).table
        for ending in ("csv", "feather")
    )
    assert of_csv.num_rows == len(frame)
    assert of_arrow == of_csv
    imported = read_recording("table", tmp_path / "tracks.feather", {"columns": MAP})
    assert len(imported.scenes) > 0


@pytest.mark.parametrize("name", ["file.arrow", "stream.arrow", "zstd.feather"])
@pytest.mark.parametrize("num_bytes", [0, 3, 6, 100, 300])
def test_an_arrow_file_cut_short_is_refused(tmp_path, name, num_bytes):
    path = tmp_path / name
    WRITERS[name](TABLE, path)
    path.write_bytes(path.read_bytes()[:num_bytes])
    with pytest.raises(ImportFormatError, match=f"{name}: file: expected a readable Arrow file"):
        read_columns(path, REQUEST)


@pytest.mark.parametrize("name", ["file.arrow", "stream.arrow", "zstd.feather"])
def test_an_arrow_file_with_a_damaged_byte_is_refused_or_read(tmp_path, name):
    path = tmp_path / name
    WRITERS[name](TABLE, path)
    content = path.read_bytes()
    for place in range(0, len(content), 3):
        damaged = bytearray(content)
        damaged[place] ^= 0xFF
        path.write_bytes(damaged)
        try:
            read_columns(path, REQUEST)
        except ImportFormatError as error:
            assert "\n" not in str(error)  # noqa: PT017 - a damaged byte may also change nothing.


@pytest.mark.parametrize("name", ["bomb.feather", "bomb.arrow"])
def test_an_arrow_file_whose_few_bytes_stand_for_many_cells_is_refused(tmp_path, name):
    path = tmp_path / name
    table = pa.table({"vehicle": pa.array([0] * 3_000_000, pa.int64())})
    if name == "bomb.feather":
        feather.write_feather(table, path, compression="zstd")
    else:
        options = ipc.IpcWriteOptions(compression="zstd")
        with ipc.new_stream(path, table.schema, options=options) as writer:
            writer.write_table(table)
    with pytest.raises(ImportFormatError, match="expected at most 16 MB of cells"):
        read_columns(path, ColumnRequest(types={"vehicle": NUMBER}))


def test_a_dictionary_whose_few_words_stand_for_much_text_is_refused(tmp_path):
    path = tmp_path / "words.feather"
    words = pa.DictionaryArray.from_arrays(pa.array([0] * 100_000, pa.int8()), ["x" * 1000])
    feather.write_feather(pa.table({"class": words}), path, compression="zstd")
    with pytest.raises(ImportFormatError, match="expected at most 16 MB of cells"):
        read_columns(path, ColumnRequest(types={"class": TEXT}))


def test_a_cell_that_is_no_number_or_text_is_refused(tmp_path):
    path = tmp_path / "lists.arrow"
    write_file(pa.table({"vehicle": [[1], [2]]}), path)
    with pytest.raises(ImportFormatError, match="column vehicle: expected cells of numbers or te"):
        read_columns(path, ColumnRequest(types={"vehicle": NUMBER}))


def test_the_first_version_of_feather_is_refused_with_the_version_that_is_read(tmp_path):
    path = tmp_path / "old.feather"
    path.write_bytes(b"FEA1" + bytes(60) + b"FEA1")
    with pytest.raises(ImportFormatError, match="Feather of version 2"):
        read_columns(path, REQUEST)


def test_an_unknown_key_of_a_map_is_named_before_what_is_missing(tmp_path):
    path = tmp_path / "map.toml"
    path.write_bytes(b'\xef\xbb\xbf[columns]\nvehicl = "id"\nx = "x [m]"\n')
    with pytest.raises(ConfigError, match=r"columns.vehicl: .* did you mean vehicle\?"):
        column_map(path)
    path.write_text('[columns]\nx = "x [m]"\n[road]\nlane = 3\n', encoding="utf-8")
    with pytest.raises(ConfigError, match=r"road.lane: expected a known key"):
        column_map(path)
