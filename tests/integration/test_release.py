"""A small release has what a large one has, and is checked."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
SIZE = "300"


@pytest.fixture(scope="module")
def script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the command with expected hashes of its own."""
    folder = tmp_path_factory.mktemp("release")
    for name in ("release.py", "release.md"):
        shutil.copy(BENCHMARKS / name, folder)
    (folder / "release.json").write_text("{}", encoding="utf-8")
    return folder / "release.py"


def run(script: Path, *more: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(script), "--out", str(script.parent / "out"), "-n", SIZE]
    command += ["--profiles", "pinto2023", *more]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.ci
def test_a_release_is_made_once_written_down_and_checked(script: Path):
    written = run(script, "--write")
    assert written.returncode == 0, written.stderr
    expected = script.with_suffix(".json")
    (found,) = json.loads(expected.read_text(encoding="utf-8"))[SIZE].values()
    expected.write_text(json.dumps({SIZE: {"pinto2023": found[::-1]}}), encoding="utf-8")
    again = run(script)
    assert again.returncode == 1
    assert f"{found}: NOT as expected: {found[::-1]}" in again.stdout
    folder = script.parent / "out" / "pinto2023"
    readme = (folder / "README.md").read_text(encoding="utf-8")
    assert readme.count("## Split and tasks") == 1
    assert "gradient boosting" in readme
    tasks = pq.read_table(folder / "tasks.parquet").to_pandas()
    assert set(tasks["part"]) == {"train", "validation", "test"}
    asked = tasks["outcome"].notna()
    assert asked.any()
    assert (tasks.loc[asked, "go"] == "go").all()
    is_legal = tasks.loc[asked, "legal"] == "legal"
    assert (is_legal == (tasks.loc[asked, "outcome"] == "Success_L")).all()
    content = json.loads((folder / "croissant.json").read_text(encoding="utf-8"))
    files = [one for one in content["distribution"] if one["@id"] == "tasks.parquet"]
    sets = [one for one in content["recordSet"] if one["@id"] == "tasks"]
    assert len(files) == len(sets) == 1
    assert [one["name"] for one in sets[0]["field"]] == list(tasks.columns)
