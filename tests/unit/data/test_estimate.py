"""How large a data set will be is known before anything is written, and asked about."""

from __future__ import annotations

import dataclasses
import shutil
from types import SimpleNamespace
from typing import TYPE_CHECKING

import pytest

from overtaking.api.simulator_registry import get_simulator
from overtaking.core.errors import ConfigError, DatasetError
from overtaking.data import plan
from overtaking.data.estimate import LARGE_SIMULATIONS, Estimate, estimate, refuse_too_large
from overtaking.data.generate import generate
from overtaking.data.location import Folder, Store
from overtaking.data.recipe import Keep, Recipe

if TYPE_CHECKING:
    from pathlib import Path

ENGINE = get_simulator("engine")


@pytest.mark.ci
@pytest.mark.parametrize("keep", Keep)
def test_an_estimate_is_near_the_truth(recipe: Recipe, keep: Keep, tmp_path: Path):
    few = dataclasses.replace(recipe, num_simulations=600, shard_size=600, keep=keep, seed=3)
    location = Folder(tmp_path / "data")
    found = estimate(few, location, ENGINE)
    assert not (tmp_path / "data").exists()
    data = generate(few, location, ENGINE)
    facts = [one for shard in data.manifest.shards for one in shard.tables.values()]
    assert found.rows == pytest.approx(sum(one.rows for one in facts), rel=0.3)
    assert found.size_bytes == pytest.approx(sum(one.size_bytes for one in facts), rel=0.3)
    assert found.free_bytes is not None
    assert found.seconds > 0.0


def test_a_store_has_no_known_room(recipe: Recipe):
    assert estimate(recipe, Store("memory://estimate"), ENGINE, 2).free_bytes is None


def large(recipe: Recipe) -> Recipe:
    return dataclasses.replace(
        recipe, num_simulations=LARGE_SIMULATIONS + 1, keep=Keep.FEATURES, shard_size=4096
    )


@pytest.mark.ci
def test_a_large_one_has_to_be_allowed(recipe: Recipe, tmp_path: Path):
    location, asked = Folder(tmp_path / "data"), list[Estimate]()

    def answer(found: Estimate) -> bool:
        asked.append(found)
        return len(asked) > 1

    with pytest.raises(ConfigError, match=r"got 1,000,001 .*; add --yes \(allow_large=True"):
        refuse_too_large(large(recipe), location, ENGINE, allowed=False)
    with pytest.raises(ConfigError, match="add --yes"):
        refuse_too_large(large(recipe), location, ENGINE, answer)
    refuse_too_large(large(recipe), location, ENGINE, answer)
    refuse_too_large(large(recipe), location, ENGINE, allowed=True)
    assert len(asked) == 2
    assert asked[0].simulations == LARGE_SIMULATIONS + 1
    assert asked[0].is_large


def test_one_that_does_not_fit_is_refused_whatever_is_allowed(
    recipe: Recipe, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=10**8))
    with pytest.raises(DatasetError, match=r"room for about [\d.]+ GB, got 0\.1 GB; ask for fewer"):
        refuse_too_large(large(recipe), Folder(tmp_path / "data"), ENGINE, allowed=True)


def test_a_small_one_is_not_looked_at(recipe: Recipe, tmp_path: Path):
    def fail(_: Estimate) -> bool:
        raise AssertionError

    refuse_too_large(recipe, Folder(tmp_path), ENGINE, fail)


def test_more_shards_than_a_manifest_holds_are_refused(recipe: Recipe, tmp_path: Path):
    many = dataclasses.replace(recipe, num_simulations=plan.MAX_SHARDS * recipe.shard_size + 1)
    with pytest.raises(ConfigError, match="expected 1 to 20000, got 20001; make several data sets"):
        generate(many, Folder(tmp_path / "data"), ENGINE, allow_large=True)
    assert not (tmp_path / "data").exists()
