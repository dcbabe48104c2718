"""A data set whose checksums are right and whose tables are not is refused in one line."""

from __future__ import annotations

import hashlib
import json
import shutil
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import overtaking as ot
from overtaking.data.tables.files import check_footer
from overtaking.data.tables.names import EVENTS, RULES
from overtaking.data.tables.schemas import SCHEMAS

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sound") / "data"
    ot.generate_dataset("pinto2023-physical", num_simulations=2, seed=1, out=folder)
    return folder


@pytest.fixture
def folder(sound: Path, tmp_path: Path) -> Path:
    return shutil.copytree(sound, tmp_path / "data")


def rewrite(
    folder: Path,
    table: str,
    change: Callable[[pa.Table], pa.Table],
    stated_rows: int | None = None,
) -> None:
    """Change a table, and write rows and checksum of the new file into the manifest."""
    file, manifest_file = folder / table / "part-00000.parquet", folder / "dataset.json"
    changed = change(pq.read_table(file))
    pq.write_table(changed, file)
    manifest: dict[str, Any] = json.loads(manifest_file.read_text())
    manifest["shards"][0]["tables"][table] |= {
        "rows": changed.num_rows if stated_rows is None else stated_rows,
        "size_bytes": file.stat().st_size,
        "sha256": hashlib.sha256(file.read_bytes()).hexdigest(),
    }
    manifest_file.write_text(json.dumps(manifest))


def with_cell(column: str, row: int, value: object) -> Callable[[pa.Table], pa.Table]:
    """A change of one cell."""

    def change(rows: pa.Table) -> pa.Table:
        index = rows.column_names.index(column)
        field, values = rows.schema.field(index), rows[column].to_pylist()
        values[row] = value
        kind = field.type.value_type if pa.types.is_dictionary(field.type) else field.type
        array = pa.array(values, kind)
        if pa.types.is_dictionary(field.type):
            array = array.dictionary_encode()
        return rows.set_column(index, field.with_nullable(True), array)

    return change


def use(folder: Path) -> None:
    """Read everything that commands read."""
    data = ot.load_dataset(folder)
    for table in data.kept_tables:
        data.table(table)
    data.verdict(1)
    data.frames(1)
    ot.dataset_statistics(data)
    for _numbers, recorded in data.batches():
        ot.label(recorded)


MOST = {
    "simulations": 2,
    "weather": 2,
    "vehicles": 64,
    "labels": 6,
    "features": 4,
    "attempts": 2,
    "events": 2 * len(EVENTS),
    "findings": 2 * len(RULES),
    # Horizon 20 s, a frame each 50 ms, and at most 32 vehicles.
    "frames": 802,
    "states": 25664,
    # At most one decision in a step of 10 ms.
    "percepts": 4002,
}


@pytest.mark.parametrize("table", MOST)
def test_more_rows_than_the_simulations_can_have_are_refused_before_they_are_read(folder, table):
    rewrite(folder, table, lambda rows: rows.take(pa.array([0] * (MOST[table] + 1))))
    with pytest.raises(
        ot.OvertakingError, match=f"rows of table {table}: expected at most {MOST[table]} "
    ):
        ot.load_dataset(folder)


def test_rows_are_as_many_as_the_manifest_states(folder):
    rewrite(folder, "events", lambda rows: rows.slice(1), stated_rows=5)
    with pytest.raises(
        ot.OvertakingError, match="rows of table events: expected 5, as the manifest"
    ):
        ot.load_dataset(folder).table("events")


def test_tables_that_no_version_has_are_refused(folder):
    manifest = json.loads((folder / "dataset.json").read_text())
    tables = manifest["shards"][0]["tables"]
    tables["../labels"] = tables["labels"]
    (folder / "dataset.json").write_text(json.dumps(manifest))
    with pytest.raises(ot.OvertakingError, match="table: expected simulations or "):
        ot.load_dataset(folder).verify()


def test_every_simulation_has_a_label_under_each_policy(folder):
    rewrite(folder, "labels", lambda rows: rows.slice(1))
    with pytest.raises(ot.OvertakingError, match="rows of table labels: expected 6, 3 for each"):
        ot.load_dataset(folder).verdict(0)


def test_a_text_that_a_file_repeats_in_every_row_is_bounded(folder):
    rewrite(folder, "labels", with_cell("rule_set", 0, "a" * 5000))
    with pytest.raises(ot.OvertakingError, match="column rule_set: expected texts of at most 4096"):
        ot.load_dataset(folder).table("labels")


def test_a_text_that_is_no_utf8_is_refused(folder):
    index = SCHEMAS["simulations"].get_field_index("profile")
    texts = pa.array([b"\xff", b"\xff"], pa.binary()).view(pa.string())
    rewrite(folder, "simulations", lambda rows: rows.set_column(index, rows.field(index), texts))
    with pytest.raises(ot.OvertakingError, match=r"expected a readable Parquet file, got.*UTF8"):
        ot.load_dataset(folder).table("simulations")


def test_a_file_that_expands_a_thousandfold_is_refused_by_its_metadata(tmp_path):
    rows = pa.Table.from_arrays(
        [
            pa.DictionaryArray.from_arrays(pa.array([0] * 4_000_000, pa.int32()), ["a"])
            if pa.types.is_dictionary(field.type)
            else pa.array([0] * 4_000_000).cast(field.type)
            for field in SCHEMAS["events"]
        ],
        schema=SCHEMAS["events"],
    )
    file = tmp_path / "events.parquet"
    pq.write_table(rows, file, compression="zstd")
    with pytest.raises(ot.OvertakingError, match="size of table events: expected at most "):
        check_footer(file, "events")


@pytest.mark.parametrize("table", ["vehicles", "frames", "percepts", "safety"])
def test_a_missing_column_of_any_table_is_refused_when_the_data_set_is_opened(folder, table):
    rewrite(folder, table, lambda rows: rows.drop_columns([rows.column_names[-1]]))
    with pytest.raises(ot.OvertakingError, match=f"{table}/part-00000.*no such column"):
        ot.load_dataset(folder)


def test_a_missing_column_of_texts_is_refused(folder):
    rewrite(folder, "simulations", lambda rows: rows.drop_columns(["road"]))
    with pytest.raises(ot.OvertakingError, match="column road: expected type string, got no such"):
        ot.load_dataset(folder)


def test_a_column_that_is_there_twice_is_refused(folder):
    rewrite(folder, "events", lambda rows: rows.append_column(rows.schema.field(2), rows.column(2)))
    with pytest.raises(
        ot.OvertakingError, match="column frame: expected type int32, got type int32 and"
    ):
        ot.load_dataset(folder)


@pytest.mark.parametrize(
    ("table", "column", "row", "value", "message"),
    [
        ("labels", "class", 0, "no class", "column class: expected one of"),
        ("labels", "simulation", 0, 7, "row 1: expected keys"),
        ("labels", "simulation", -1, 7, "expected simulations 0 to 1, got 7"),
        ("events", "frame", 0, None, "column frame: expected a value in every row"),
        ("frames", "frame", 0, -1, "column frame: expected 0 to"),
        ("states", "frame", -1, 2**31 - 1, "states: rows: expected those of frames"),
        ("states", "frame", 3, 2**31 - 1, "row 4: expected keys"),
        ("states", "lane_id", 0, 99, "column lane_id: expected one of"),
        ("vehicles", "vehicle", 0, 200, "expected keys"),
        ("simulations", "num_frames", 0, 2**31 - 1, "column num_frames: expected"),
        ("simulations", "weather", 1, 5, "column weather: expected a key"),
        ("weather", "preset", 0, "Hail", "column preset: expected a preset"),
        ("vehicles", "mass_kg", 0, float("nan"), "mass"),
    ],
)
def test_a_value_that_no_simulation_has_is_refused_in_one_line(
    folder, table, column, row, value, message
):
    rewrite(folder, table, with_cell(column, row, value))
    with pytest.raises(ot.OvertakingError, match=message):
        use(folder)


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("frame_interval_ms", 0, "frame_interval"),
        ("frame_interval_ms", 7, "expected 50, as the manifest states, got 7"),
        ("horizon_s", 600.0, "expected at most 20, as the manifest states, got 600"),
    ],
)
def test_times_that_the_specification_does_not_give_are_not_simulated(
    tmp_path, column, value, message
):
    ot.generate_dataset(
        "pinto2023-physical", num_simulations=1, seed=1, out=tmp_path / "data", keep="features"
    )
    rewrite(tmp_path / "data", "simulations", with_cell(column, 0, value))
    with pytest.raises(ot.OvertakingError, match=message):
        ot.load_dataset(tmp_path / "data").trajectory(0)


@pytest.mark.parametrize("lane_id", [2**31, -(2**15) - 1, 2**15])
def test_a_lane_id_that_tables_cannot_hold_is_refused(folder, lane_id):
    manifest = json.loads((folder / "dataset.json").read_text())
    manifest["identity"]["road"]["lanes"][0]["lane_id"] = lane_id
    (folder / "dataset.json").write_text(json.dumps(manifest))
    with pytest.raises(ot.OvertakingError, match="lane_id"):
        ot.load_dataset(folder)
