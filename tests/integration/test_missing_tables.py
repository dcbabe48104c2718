"""A data set whose manifest lacks tables of labels."""

from __future__ import annotations

import json
import shutil

import pytest

import overtaking as ot
from overtaking.cli import main
from overtaking.core.errors import DatasetError

SIZE = 6
LACKING = ("attempts", "safety")


@pytest.fixture
def incomplete(tmp_path):
    """A data set without two of its tables."""
    made = ot.generate_dataset(
        "pinto2023-physical", num_simulations=SIZE, seed=5, out=tmp_path / "data"
    )
    file = made.path / "dataset.json"
    manifest = json.loads(file.read_text(encoding="utf-8"))
    for name in LACKING:
        shutil.rmtree(made.path / name)
        for shard in manifest["shards"]:
            del shard["tables"][name]
    file.write_text(json.dumps(manifest), encoding="utf-8")
    return made.path


def test_a_missing_table_is_one_line_with_the_way_to_make_it(incomplete):
    data = ot.load_dataset(incomplete)
    for read in (data.attempts, data.safety):
        with pytest.raises(DatasetError, match=r"run: overtaking label .*data") as caught:
            read()
        assert "\n" not in str(caught.value).strip()


def test_all_else_is_as_it_was(incomplete):
    data = ot.load_dataset(incomplete)
    data.verify()
    assert len(data.labels()) == 3 * SIZE
    assert main(["info", str(incomplete)]) == 0


def test_labelling_it_makes_the_tables(incomplete):
    ot.relabel_dataset(incomplete)
    data = ot.load_dataset(incomplete)
    data.verify()
    assert len(data.attempts()) == SIZE
    assert set(data.safety()["simulation"]) == set(range(SIZE))
    assert "## safety" in (incomplete / "README.md").read_text(encoding="utf-8")
