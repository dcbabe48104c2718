"""File names that are not UTF-8: inputs are read and shown with escapes, outputs are refused."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.feather as feather
import pyarrow.parquet as pq
import pytest

import overtaking as ot
from overtaking.core.errors import ConfigError

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = [
    pytest.mark.ci,
    pytest.mark.skipif(sys.platform != "linux", reason="names of other systems are UTF-8"),
]

NAME = os.fsdecode(b"road\xe9")
SHOWN = "road\\xe9"

COLUMNS = {
    "recording": {"name": "two cars", "point": "centre", "y_axis": "left"},
    "columns": {
        "vehicle": "id",
        "time": "t [s]",
        "x": "x [m]",
        "y": "y [m]",
        "length": "l [m]",
        "width": "w [m]",
    },
    "road": {"kind": "motorway", "heading_deg": 0},
}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Path:
    """A data set in a folder whose name is not UTF-8."""
    folder = tmp_path_factory.mktemp("names")
    ot.generate_dataset("pinto2023-physical", num_simulations=4, seed=1, out=folder / "data")
    return (folder / "data").rename(folder / NAME)


def track_table() -> pa.Table:
    """A car that overtakes another one; a third one drives on the left lane far ahead."""
    times = np.arange(250) / 10.0
    left_share = np.interp(times, [5.0, 8.0, 15.0, 18.0], [0.0, 1.0, 1.0, 0.0])
    tracks = [
        ("1", 32.0 * times, -5.25 + 3.5 * left_share),
        ("2", 80.0 + 24.0 * times, np.full(250, -5.25)),
        ("3", 500.0 + 32.0 * times, np.full(250, -1.75)),
    ]
    parts = [
        pa.table(
            {"id": [name] * 250, "t": times, "x": x, "y": y, "l": [4.5] * 250, "w": [1.8] * 250}
        )
        for name, x, y in tracks
    ]
    return pa.concat_tables(parts)


def write_csv(table: pa.Table, path: Path) -> None:
    table.to_pandas().to_csv(path, index=False)


def overtaking(*words: str | Path) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-m", "overtaking", *map(os.fsencode, words)]
    return subprocess.run(command, check=False, capture_output=True, timeout=300)


def test_a_data_set_is_read(dataset):
    data = ot.load_dataset(dataset)
    data.verify()
    assert len(data.features()) == 4
    assert len(data.states(0))
    answer = ot.sql(dataset, "SELECT count(*) FROM simulations")
    assert answer.rows == [(4,)]


def test_commands_show_the_name_with_escapes(dataset):
    process = overtaking("info", dataset)
    assert process.returncode == 0, process.stderr
    assert SHOWN in process.stdout.decode()
    process = overtaking("info", dataset.with_name(NAME + "-missing"))
    assert process.returncode == 2
    assert f"{SHOWN}-missing: data set: expected" in process.stderr.decode()


@pytest.mark.parametrize(
    ("suffix", "write"),
    [
        (".csv", write_csv),
        (".parquet", pq.write_table),
        (".feather", lambda table, path: feather.write_feather(table, str(path))),
    ],
)
def test_a_recording_is_read(tmp_path, suffix, write):
    write(track_table(), tmp_path / f"table{suffix}")
    path = (tmp_path / f"table{suffix}").rename(tmp_path / f"{NAME}{suffix}")
    data = ot.import_recording("table", path, tmp_path / "out", columns=COLUMNS)
    source = data.manifest.identity.source
    assert source is not None
    assert f"{SHOWN}{suffix}" in source.files
    assert len(data) >= 1


def test_a_profile_and_a_map_are_read(dataset, tmp_path):
    profile = tmp_path / f"{NAME}.toml"
    profile.write_text('base = "motorway"\n')
    assert ot.sample(profile, num_simulations=2, seed=1).num_simulations == 2
    ot.export_dataset(
        ot.load_dataset(dataset), tmp_path / "out", file_format="openscenario", simulation_ids=[0]
    )
    opendrive = next((tmp_path / "out").rglob("*.xodr")).rename(tmp_path / f"{NAME}.xodr")
    assert len(ot.list_opendrive_roads(opendrive)) == 1
    with pytest.raises(ot.OvertakingError, match=r"road\\xe9-missing.xodr: "):
        ot.list_opendrive_roads(tmp_path / f"{NAME}-missing.xodr")


@pytest.mark.parametrize(
    "write",
    [
        lambda _, out: ot.generate_dataset("motorway", num_simulations=2, seed=1, out=out),
        lambda data, out: ot.export_dataset(data, out, file_format="commonroad"),
        lambda data, out: ot.write_report(data, out),
        lambda data, out: ot.write_viewer_page(data, out),
        lambda data, out: ot.film(data, out, simulation_ids=[0]),
        lambda data, out: ot.relabel_dataset(shutil.copytree(data, out)),
    ],
)
def test_an_output_is_refused_before_anything_is_written(dataset, tmp_path, write):
    out = tmp_path / NAME
    with pytest.raises(ConfigError, match=r"road\\xe9: output: expected a name in UTF-8"):
        write(dataset, out)
    assert not out.exists() or sorted(out.rglob("*")) == sorted(
        out / path.relative_to(dataset) for path in dataset.rglob("*")
    )


def test_outputs_of_commands_are_refused(dataset, tmp_path):
    for words in (["--log", tmp_path / f"{NAME}.json"], ["--plot", tmp_path / f"{NAME}.png"]):
        process = overtaking("law", "curve", dataset, *words)
        assert process.returncode == 2
        assert "output: expected a name in UTF-8" in process.stderr.decode()
    assert list(tmp_path.iterdir()) == []
