"""Every format of `overtaking export` writes the simulations that were chosen, and no others."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import overtaking as ot
from overtaking.api import file_formats
from overtaking.cli import main
from overtaking.recordings.pinto2023 import read_table

if TYPE_CHECKING:
    from pathlib import Path

    from overtaking.data.load import Dataset

SIMULATIONS = 1200
CHOSEN = [0, 5, 6, 290]
FORMATS = [one for one in file_formats.EXPORT_FORMATS if one != "popper"]
"""Popper's learner needs more examples than a few."""


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    out = tmp_path_factory.mktemp("data") / "pinto"
    return ot.generate_dataset(
        "pinto2023-physical", num_simulations=SIMULATIONS, seed=5, out=out, keep="features"
    )


def exported(data: Dataset, file_format: str, out: Path, *options: Any) -> set[int]:
    """The numbers of the simulations that an export holds."""
    target = out / ("table.csv" if file_format == "pinto2023" else file_format)
    words = ["export", data.path, "--format", file_format, "--out", target, *options]
    assert main([str(one) for one in [*words, "--quiet"]]) == 0
    if file_format == "pinto2023":
        return set(read_table(target).column("S").to_pylist())
    if file_format == "commonroad":
        return {
            int(re.findall(r"Overtaking-1_(\d+)_", path.name)[0]) - 1 for path in target.iterdir()
        }
    if file_format == "highd":
        return {int(path.name.partition("_")[0]) - 1 for path in target.glob("*_tracks.csv")}
    if file_format == "openscenario":
        return {int(path.stem.partition("-")[2]) for path in target.glob("*.xosc")}
    pattern = r"\(s(\d+)\)" if file_format == "popper" else r"^simulation\((\d+)"
    names = ("exs.pl",) if file_format == "popper" else ("*",)
    texts = [path.read_text() for name in names for path in target.glob(name)]
    return {int(one) for text in texts for one in re.findall(pattern, text, re.M)}


@pytest.mark.parametrize("file_format", FORMATS)
def test_only_the_chosen_simulations_are_written(data: Dataset, file_format: str, tmp_path: Path):
    chosen = ("--simulations", ",".join(map(str, CHOSEN)))
    assert exported(data, file_format, tmp_path, *chosen) == set(CHOSEN)


@pytest.mark.ci
@pytest.mark.parametrize("file_format", FORMATS)
def test_only_simulations_of_the_class_are_written(data: Dataset, file_format: str, tmp_path: Path):
    labels = data.labels().query("policy == 'strict' and simulation < 40")
    meant = set(labels["simulation"][labels["class"] == "Success_I"])
    options = ("--class", "success_i", "--policy", "strict", "--simulations", "0-39")
    assert exported(data, file_format, tmp_path, *options) == meant


def test_popper_gets_the_chosen_simulations_only(data: Dataset, tmp_path: Path):
    every = exported(data, "popper", tmp_path / "all")
    some = exported(data, "popper", tmp_path / "some", "--simulations", "50-1199")
    assert some == {one for one in every if one >= 50}


def test_what_was_not_chosen_is_not_simulated_again(data: Dataset):
    numbers = [some.tolist() for some, _ in data.batches(np.array(CHOSEN))]
    assert numbers == [[0, 5, 6], [290]]
    (_, runs), (_, last) = data.batches(np.array(CHOSEN))
    assert runs.trace_hash[1].tolist() == data.trajectory(5).trace_hash[0].tolist()
    assert last.trace_hash[0].tolist() == data.trajectory(290).trace_hash[0].tolist()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--simulations", "1200"), "0 to 1199"),
        (("--class", "Success"), "No_attempt"),
        (("--class", "Success_I", "--policy", "mine"), "strict"),
        (("--class", "censored", "--policy", "paper"), "none of class censored"),
    ],
)
def test_a_choice_that_cannot_be_is_one_line(
    data: Dataset,
    options: tuple[str, ...],
    says: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
):
    words = ["export", str(data.path), "--out", str(tmp_path / "table.csv"), *options]
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line
    assert list(tmp_path.iterdir()) == []
