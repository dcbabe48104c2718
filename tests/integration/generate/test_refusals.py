"""What a data set refuses, in one line, before anything is lost."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from tests.support.small import NUM_SIMULATIONS, generate, refused

import overtaking as ot
from overtaking.core.errors import ConfigError, DatasetError, SchemaError
from overtaking.data.load import load
from overtaking.data.recipe import Simulator
from overtaking.data.tables.files import facts_of
from overtaking.data.tables.schemas import SCHEMAS, VERSION
from overtaking.sim.engine import simulate


def test_a_complete_data_set_is_not_overwritten(data):
    with refused(DatasetError, str(data.path), "got one that is complete; choose another"):
        generate(data.path)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"seed": 2}, "seed of the data set: expected 2, got 1"),
        ({"simulations": 21}, "simulations of the data set: expected 21, got 20"),
        ({"keep": "features"}, "keep of the data set: expected features, got frames"),
        ({"road": "motorway"}, "road of the data set: expected motorway, got town06"),
        ({"overrides": None}, "spec of the data set"),
    ],
)
def test_a_folder_with_another_data_set_is_refused(changes, said: str, data):
    for resume in (False, True):
        with refused(DatasetError, str(data.path), said, "choose another folder"):
            generate(data.path, resume=resume, **changes)


def test_a_folder_with_something_else_is_left_alone(tmp_path: Path):
    (tmp_path / "thesis.txt").write_text("precious")
    with refused(DatasetError, str(tmp_path), "got a folder with thesis.txt; choose another"):
        generate(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_a_file_in_the_place_of_the_folder_is_left_alone(tmp_path: Path):
    (tmp_path / "data").write_text("precious")
    with refused(DatasetError, str(tmp_path / "data"), "got a file; choose another folder"):
        generate(tmp_path / "data")
    assert (tmp_path / "data").read_text() == "precious"


def test_a_place_where_nothing_can_be_made_is_named():
    # Nobody, not even root, can make a folder there.
    with refused(DatasetError, "/proc/overtaking", "expected room and permission to write, got "):
        generate(Path("/proc/overtaking/data"))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"simulations": 0}, "simulations: expected 1 to"),
        ({"simulations": -5}, "simulations: expected 1 to"),
        ({"seed": -1}, "seed: expected 0 to"),
        ({"seed": 2**64}, "seed: expected 0 to"),
        ({"shard_size": 0}, "shard_size: expected 1 to"),
        ({"keep": "everything"}, "keep: expected frames or features, got everything"),
        ({"simulator": "carma"}, "simulator: expected engine or reference or sumo"),
        ({"road": "route66"}, "road"),
        ({"overrides": {"time.horizon_s": -1.0}}, "horizon_s"),
    ],
)
def test_what_cannot_be_made_is_said_before_anything_is_written(changes, said, tmp_path: Path):
    with refused(ConfigError, said):
        generate(tmp_path / "data", **changes)
    assert not (tmp_path / "data").exists()


def test_a_simulation_that_is_not_there_is_refused(data):
    for number in (-1, NUM_SIMULATIONS):
        with refused(ConfigError, f"simulation: expected 0 to 19, got {number}"):
            data.states(number)


def test_a_table_that_was_not_kept_is_refused(summary):
    with refused(ConfigError, "table states: expected one of weather", "--keep frames"):
        summary.table("states")


def test_a_data_set_of_a_newer_version_says_to_upgrade(copy: Path):
    manifest = json.loads((copy / "dataset.json").read_text())
    (copy / "dataset.json").write_text(json.dumps({**manifest, "version": 2}))
    with refused(
        SchemaError, "version of the manifest: expected at most 1, got 2; use the version"
    ):
        ot.load_dataset(copy)


def test_a_table_of_a_newer_version_says_to_upgrade(copy: Path):
    path = copy / "states" / "part-00000.parquet"
    newer = {**SCHEMAS["states"].metadata, b"version": str(VERSION + 1).encode()}
    pq.write_table(pq.read_table(path).replace_schema_metadata(newer), path)
    refresh(copy, path)
    with refused(SchemaError, str(path), f"at most {VERSION}, got {VERSION + 1}"):
        ot.load_dataset(copy).table("states")


def refresh(folder: Path, path: Path) -> None:
    """Let the manifest say that a file is as it should be."""
    text = (folder / "dataset.json").read_text()
    manifest = json.loads(text)
    facts = manifest["shards"][0]["tables"][path.parent.name]
    facts |= asdict(facts_of(path, facts["rows"], facts["content"]))
    (folder / "dataset.json").write_text(json.dumps(manifest))


def test_a_simulator_that_has_changed_is_noticed(summary):
    def other(scenario):
        runs = simulate(scenario)
        return runs.replace(trace_hash=runs.trace_hash ^ np.uint32(1))

    changed = load(summary.path, Simulator(name="other", version="9", simulate=other))
    with refused(DatasetError, "simulation 5, simulated again", "got another from other 9"):
        changed[5]
    with refused(DatasetError, "simulation 0, simulated again"):
        next(iter(changed.batches()))
