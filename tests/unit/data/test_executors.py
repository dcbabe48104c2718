"""Who makes a data set is chosen by its size, its simulator and its location."""

from __future__ import annotations

import dataclasses
import sys
from typing import TYPE_CHECKING

import pytest
from tests.support.carla import needs_wheel

from overtaking.api.simulator_registry import get_simulator
from overtaking.core import process_limits
from overtaking.core.errors import ConfigError
from overtaking.data.executors import MIN_PIECES, executor_for_recipe
from overtaking.data.location import Folder, Location
from overtaking.data.processes import ProcessExecutor
from overtaking.data.recipe import Keep, Recipe
from overtaking.data.store import Store
from overtaking.data.work import in_this_process
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification

if TYPE_CHECKING:
    from pathlib import Path

ENOUGH = MIN_PIECES * get_simulator("engine").chunk_size


@pytest.fixture(autouse=True)
def three_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process_limits, "processors_to_use", lambda: 3)


def recipe(num_simulations: int, shard_size: int = 4096) -> Recipe:
    given = load_specification("pinto2023-physical")
    return Recipe(
        spec=given,
        road=load_road(given.road),
        seed=1,
        num_simulations=num_simulations,
        keep=Keep.FEATURES,
        shard_size=shard_size,
    )


def chosen(location: Path | Location, made: Recipe, engine: str = "auto", **changes):
    simulator = dataclasses.replace(get_simulator("engine"), **changes.pop("simulator", {}))
    there = Folder(location) if not hasattr(location, "put") else location
    return executor_for_recipe(engine, made, simulator, there, **changes)


def test_much_work_is_done_by_a_process_on_each_processor(tmp_path):
    assert chosen(tmp_path, recipe(ENOUGH)) == ProcessExecutor(workers=3)


def test_threads_do_what_is_not_worth_a_start(tmp_path):
    assert chosen(tmp_path, recipe(ENOUGH - 1)) is in_this_process
    assert chosen(tmp_path, recipe(ENOUGH, shard_size=ENOUGH)) is in_this_process


def test_threads_do_what_processes_could_not(tmp_path, monkeypatch):
    store = Store("memory://data")
    assert chosen(store, recipe(ENOUGH)) is in_this_process
    assert chosen(tmp_path, recipe(ENOUGH), simulator={"shares_world": True}) is in_this_process
    monkeypatch.setattr(sys, "executable", "")
    assert chosen(tmp_path, recipe(ENOUGH)) is in_this_process


def test_one_processor_needs_no_processes(tmp_path, monkeypatch):
    monkeypatch.setattr(process_limits, "processors_to_use", lambda: 1)
    assert chosen(tmp_path, recipe(ENOUGH)) is in_this_process


def test_what_is_asked_for_is_what_there_is(tmp_path):
    assert chosen(tmp_path, recipe(ENOUGH), "threads") is in_this_process
    assert chosen(tmp_path, recipe(1), "processes") == ProcessExecutor(workers=3)
    assert chosen(tmp_path, recipe(1), "processes", workers=5) == ProcessExecutor(workers=5)
    assert chosen(tmp_path, recipe(1), workers=2) == ProcessExecutor(workers=2)


@needs_wheel
@pytest.mark.parametrize("name", ["carla", "carla-traffic-manager"])
def test_a_world_that_all_processes_share_is_left_to_one(name, tmp_path):
    with pytest.raises(ConfigError, match=f"all processes share the world of {name}"):
        executor_for_recipe("processes", recipe(9), get_simulator(name), Folder(tmp_path))
