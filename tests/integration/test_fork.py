"""A forked child simulates, labels and writes with threads of its own."""

from __future__ import annotations

import multiprocessing
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import overtaking as ot
from overtaking.model.driver_interface import MAX_ACTION_PARTS
from overtaking.sim.stepping import new_stepper
from overtaking.world.step_parameters import step_parameters

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = [
    pytest.mark.ci,
    pytest.mark.skipif(
        "fork" not in multiprocessing.get_all_start_methods(), reason="this system does not fork"
    ),
]

LONGEST_S = 300
"""Time after which a child counts as hanging."""


def call_in_forked_child(function: Any, *arguments: Any) -> Any:
    with multiprocessing.get_context("fork").Pool(1) as pool:
        return pool.apply_async(function, arguments).get(timeout=LONGEST_S)


def trace_hashes(seed: int) -> list[list[int]]:
    runs = ot.simulate(ot.sample("pinto2023-physical", num_simulations=16, seed=seed))
    assert ot.label(runs).labels.outcome.shape == (16,)
    return runs.trace_hash.tolist()


def driven_hashes(seed: int) -> list[list[int]]:
    scenarios = ot.sample("pinto2023-physical", num_simulations=4, seed=seed)

    def stay(observation: ot.Observation) -> np.ndarray:
        return np.zeros((len(observation.is_running), 2))

    return ot.drive(scenarios, stay, observation="truth").trace_hash.tolist()


def write_data_set(folder: Path) -> str:
    return ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=8,
        seed=1,
        out=folder,
        executor="threads",
        shard_size=4,
    ).content_hash


def test_children_of_a_pool_simulate_and_label_as_their_parent():
    expected = [trace_hashes(seed) for seed in (1, 2, 3)]
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.map_async(trace_hashes, (1, 2, 3)).get(timeout=LONGEST_S) == expected


def test_a_child_of_a_child_simulates():
    expected = trace_hashes(1)
    context = multiprocessing.get_context("fork")
    answers = context.SimpleQueue()

    def fork_again() -> None:
        trace_hashes(2)
        grandchild = context.Process(target=lambda: answers.put(trace_hashes(1)))
        grandchild.start()
        grandchild.join(LONGEST_S)

    child = context.Process(target=fork_again)
    child.start()
    child.join(LONGEST_S)
    assert child.exitcode == 0
    assert answers.get() == expected


def test_a_child_drives():
    assert call_in_forked_child(driven_hashes, 1) == driven_hashes(1)


def test_a_child_writes_a_data_set(tmp_path):
    expected = write_data_set(tmp_path / "parent")
    assert call_in_forked_child(write_data_set, tmp_path / "child") == expected
    assert ot.load_dataset(tmp_path / "child").content_hash == expected


def test_a_child_goes_on_with_simulations_that_its_parent_began():
    scenarios = ot.sample("pinto2023-physical", num_simulations=2, seed=1)
    stepper = new_stepper(step_parameters(scenarios), None, observes_truth=True)
    stepper.observe_start()
    actions = np.zeros((2, MAX_ACTION_PARTS), np.int32)

    def observe_later() -> list[float]:
        return stepper.step(actions, 40).table.ravel().tolist()

    context = multiprocessing.get_context("fork")
    answers = context.SimpleQueue()
    child = context.Process(target=lambda: answers.put(observe_later()))
    child.start()
    child.join(LONGEST_S)
    assert child.exitcode == 0
    in_child = answers.get()
    assert len(set(in_child)) > 1
    assert in_child == observe_later()  # The parent's own simulations have not moved meanwhile.
