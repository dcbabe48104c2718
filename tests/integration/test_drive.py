"""A policy makes a data set like any other, and the data set does not need it any more."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

import overtaking as ot
from overtaking.cli import main
from overtaking.core.errors import DatasetError, DriverError
from overtaking.sim.action_spaces import ACTION_SPACES

if TYPE_CHECKING:
    from pathlib import Path

SHORT = {"time.horizon_s": 8.0, "time.attempt_deadline_s": 8.0}
POLICY = """
import numpy as np

def steady(observation):
    brakes = observation.leader.closing_speed.clip(0.0, 4.0)
    return np.stack([-0.5 * brakes, np.ones(len(brakes))], axis=1)
"""


def wants_to_pass(observation: ot.Observation) -> np.ndarray:
    """Accelerate a little, and change to the fast side as long as there is a vehicle ahead."""
    ahead = observation.leader.is_detected
    return np.stack([0.3 * observation.uniform_numbers()[:, 0], ahead], axis=1)


def driver(**changes: object) -> ot.Driver:
    return ot.Driver(function=wants_to_pass, observation="human", **changes)


def made(out: Path, keep: str, **given: object) -> ot.Dataset:
    return ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=20,
        seed=3,
        out=out,
        keep=keep,
        overrides=SHORT,
        driver=driver(),
        shard_size=8,
        **given,
    )


@pytest.mark.ci
def test_a_data_set_of_a_policy_is_one_like_any_other(tmp_path):
    data = made(tmp_path / "frames", "frames")
    few = made(tmp_path / "features", "features")
    scenario = ot.sample("pinto2023-physical", num_simulations=20, seed=3, overrides=SHORT)
    run = ot.drive(scenario, wants_to_pass, observation="human")
    for one in (0, 7, 19):
        for kept in (data[one], few[one]):  # Of the second only what was done is kept.
            np.testing.assert_array_equal(kept.trace_hash[0], run.trace_hash[one])
            assert kept.actions
            assert run.actions
            assert kept.actions.hashes[0] == run.actions.hashes[one]
    np.testing.assert_array_equal(few.states(5), data.states(5))
    rows = data.actions()
    assert list(rows.simulation.unique()) == list(range(20))
    assert rows.accel_mps2.between(0.0, 0.3).all()
    assert rows.move.isna().all()
    policy = data.manifest.identity.policy
    assert policy
    assert policy.name.endswith("test_drive:wants_to_pass")
    assert set(data.labels().policy) == {"paper", "default", "strict"}
    assert ot.load_dataset(few.path).content_hash == few.content_hash


@pytest.mark.ci
@pytest.mark.parametrize("action", ACTION_SPACES)
def test_every_action_is_restored_from_its_table(tmp_path, action):
    """By the columns that it fills; the same bits act again."""
    parts = ACTION_SPACES[action].parts

    def draws(observation: ot.Observation) -> np.ndarray:
        least, most = np.array([(max(one.low, -3.0), min(one.high, 3.0)) for one in parts]).T
        return (
            least
            + (most - least) * observation.uniform_numbers()[:, [k % 4 for k in range(len(parts))]]
        )

    one = ot.Driver(function=draws, observation="truth", action=action, action_repeat=5)
    data = ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=3,
        seed=3,
        out=tmp_path / "data",
        keep="features",
        overrides=SHORT,
        driver=one,
    )
    scenario = ot.sample("pinto2023-physical", num_simulations=3, seed=3, overrides=SHORT)
    run = ot.drive(scenario, draws, observation="truth", action=action, action_repeat=5)
    assert run.actions
    for number in range(3):
        again = data[number]  # Simulated with what the table holds.
        assert again.actions
        assert again.actions.kind == ACTION_SPACES[action].kind
        assert again.actions.hashes[0] == run.actions.hashes[number]
        np.testing.assert_array_equal(again.trace_hash[0], run.trace_hash[number])


@pytest.mark.ci
def test_clipped_answers_are_counted_in_the_manifest(tmp_path):
    """Through every shard, an interruption and new labels."""
    calls = {"left": 2}

    def brutal(observation: ot.Observation) -> np.ndarray:
        calls["left"] -= observation.decision_index == 0
        if calls["left"] < 0:
            raise RuntimeError("tired")
        return np.full((len(observation.is_running), 2), 99.0)

    one = ot.Driver(function=brutal, observation="truth", action_repeat=10)
    given = {"keep": "features", "overrides": SHORT, "shard_size": 8, "driver": one}
    with pytest.raises(DriverError):
        ot.generate_dataset(
            "pinto2023-physical", num_simulations=20, seed=3, out=tmp_path / "data", **given
        )
    calls["left"] = 9
    data = ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=20,
        seed=3,
        out=tmp_path / "data",
        resume=True,
        **given,
    )
    scenario = ot.sample("pinto2023-physical", num_simulations=20, seed=3, overrides=SHORT)
    run = ot.drive(scenario, brutal, observation="truth", action_repeat=10)
    assert run.actions
    assert run.actions.num_clipped is not None
    parts = [run.actions.num_clipped[first : first + 8].sum() for first in (0, 8, 16)]
    assert [shard.clipped for shard in data.manifest.shards] == parts
    assert min(parts) > 0
    assert ot.relabel_dataset(data.path).manifest.clipped == sum(parts)


def test_data_sets_without_a_policy_have_no_actions(tmp_path):
    data = ot.generate_dataset(
        "pinto2023-physical", num_simulations=3, seed=3, out=tmp_path / "own", overrides=SHORT
    )
    assert data[1].actions is None
    assert "actions" not in data.kept_tables
    assert not (tmp_path / "own" / "actions").exists()
    assert "clipped" not in (tmp_path / "own" / "dataset.json").read_text()


@pytest.mark.ci
def test_a_policy_that_fails_loses_nothing_that_was_written(tmp_path):
    failing = {"left": 2}

    def tired(observation: ot.Observation) -> np.ndarray:
        if observation.decision_index == 0:
            failing["left"] -= 1
        if failing["left"] < 0:
            raise RuntimeError("tired")
        return wants_to_pass(observation)

    given = {"keep": "features", "overrides": SHORT, "shard_size": 8}
    tiring = ot.Driver(function=tired, observation="human")
    with pytest.raises(DriverError, match=r"simulation 16 .*at 0.00 s.*RuntimeError in .*: tired"):
        ot.generate_dataset(
            "pinto2023-physical",
            num_simulations=20,
            seed=3,
            out=tmp_path / "data",
            driver=tiring,
            **given,
        )
    written = sorted(path.name for path in (tmp_path / "data" / "simulations").iterdir())
    assert len(written) == 2
    failing["left"] = 9
    data = ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=20,
        seed=3,
        out=tmp_path / "data",
        driver=tiring,
        resume=True,
        **given,
    )
    assert failing["left"] == 8  # Two of the three files were there already.
    assert data.content_hash == made(tmp_path / "again", "features").content_hash


@pytest.mark.ci
def test_another_driver_does_not_complete_it(tmp_path):
    made(tmp_path / "data", "features")
    with pytest.raises(DatasetError, match="policy"):
        ot.generate_dataset(
            "pinto2023-physical",
            num_simulations=20,
            seed=3,
            out=tmp_path / "data",
            keep="features",
            overrides=SHORT,
            shard_size=8,
            driver=driver(action_repeat=2),
            resume=True,
        )
    with pytest.raises(DatasetError, match="overtaking drive --resume"):
        ot.resume_dataset(tmp_path / "data")


def test_the_command_drives(tmp_path, capsys):
    (tmp_path / "mine.py").write_text(POLICY, encoding="utf-8")
    words = ["drive", "pinto2023-physical", "--driver", f"{tmp_path / 'mine.py'}:steady", "-n", "4"]
    words += ["--observation", "truth", "--out", str(tmp_path / "data")]
    words += [word for pair in SHORT.items() for word in ("--set", "{}={}".format(*pair))]
    assert main([*words, "--json", "--quiet"]) == 0
    assert json.loads(capsys.readouterr().out)["simulations"] == 4
    policy = json.loads((tmp_path / "data" / "dataset.json").read_text())["identity"]["policy"]
    assert policy["name"].endswith("mine.py:steady")
    assert (policy["observe"], policy["action"], policy["hold"]) == ("truth", "accel_lane", 1)
    assert len(policy["digest"]) == 64
    (tmp_path / "mine.py").unlink()
    assert main(["show", str(tmp_path / "data"), "2"]) == 0


@pytest.mark.parametrize(
    ("policy", "observe", "says"),
    [
        ("nothing_here:policy", "human", "module:name"),
        ("json:nothing", "human", "json has no nothing"),
        ("json:dmps", "human", "expected json:dumps, "),
        ("broken.py:policy", "human", "SyntaxError"),
        ("late.py:policy", "human", "ZeroDivisionError: at once"),
        ("json:dumps", "everything", "human or truth"),
        ("json:dumps", "missing.toml", "a TOML file"),
        ("json:dumps", "human", "an answer, got TypeError in "),
    ],
)
def test_words_that_cannot_be_used_are_one_line(tmp_path, workdir, capsys, policy, observe, says):
    (workdir / "broken.py").write_text("def policy(:")
    (workdir / "late.py").write_text("raise ZeroDivisionError('at once')")
    words = ["drive", "--driver", policy, "--observation", observe, "-n", "2"]
    assert main([*words, "--out", str(tmp_path / "data")]) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
