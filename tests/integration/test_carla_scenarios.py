"""Twenty scenarios of the study with each driver, from the command line to labels and films."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.carla import needs_wheel

import overtaking as ot
from overtaking.cli import main
from overtaking.model.verdicts import OvertakeClass
from overtaking.simulators.carla.library import SERVER_VARIABLE

if TYPE_CHECKING:
    from pathlib import Path

    from overtaking.data.load import Dataset

pytestmark = [pytest.mark.ci, needs_wheel]

COUNT, SEED, AGAIN = 12, 5, 3
SHORT = {"time.horizon_s": 3.0, "time.attempt_deadline_s": 3.0}
SIMULATORS = {"own": "carla", "traffic-manager": "carla-traffic-manager"}


def films_of(data: Dataset, folder: Path) -> dict[str, int]:
    """Films of two simulations, and how many pictures each has."""
    import av

    words = ["--simulations", f"0,{COUNT - 1}", "--size", "160x90", "--out", str(folder), "--quiet"]
    assert main(["carla", "replay", str(data.path), *words]) == 0
    lengths: dict[str, int] = {}
    for path in sorted(folder.iterdir()):
        with av.open(str(path)) as film:
            lengths[path.name] = sum(1 for _ in film.decode(video=0))
    return lengths


@pytest.mark.parametrize("driver", SIMULATORS)
def test_scenarios_go_from_the_command_to_labels_and_films(
    driver: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv(SERVER_VARIABLE, "headless")
    words = [
        "carla",
        "run",
        "pinto2023-physical",
        "-n",
        str(COUNT),
        "--seed",
        str(SEED),
        "--driver",
        driver,
    ]
    short = [f"--set={key}={value}" for key, value in SHORT.items()]
    assert main([*words, *short, "--out", str(tmp_path / "data"), "--quiet"]) == 0
    data = ot.load_dataset(tmp_path / "data")
    data.verify()
    runs = data.simulations().set_index("scenario_index")
    assert runs.index.tolist() == list(range(COUNT))
    assert runs["num_frames"].between(20, 61).all()
    classes = data.labels().query("policy == 'paper'")
    assert len(classes) == COUNT
    assert set(classes["class"]) <= {one.title for one in OvertakeClass}

    # The second time a few of them, in a batch and on a server of their own.
    given = ot.sample("pinto2023-physical", num_simulations=COUNT, seed=SEED, overrides=SHORT)
    again = ot.simulate(given.select(slice(COUNT - AGAIN, COUNT)), simulator=SIMULATORS[driver])
    hashes = [data.trajectory(number).trace_hash[0].tolist() for number in range(COUNT)]
    assert again.trace_hash.tolist() == hashes[-AGAIN:]
    assert len({tuple(one) for one in hashes}) == COUNT

    assert films_of(data, tmp_path / "films") == {
        f"{number:06d}-{view}.mp4": runs["num_frames"][number]
        for number in (0, COUNT - 1)
        for view in ("above", "behind")
    }
    moved = np.diff(data.trajectory(0).states.s[0, 0, :20])
    assert (moved > 0).all()
