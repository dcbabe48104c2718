"""A recipe to write down, and the manifest that it gives."""

from __future__ import annotations

import pytest

from overtaking.data.manifest import Identity, Manifest, Provenance, ShardRecord
from overtaking.data.recipe import Keep, Recipe, Simulator
from overtaking.data.tables.files import FileFacts
from overtaking.model.known_roads import known_road
from overtaking.scenarios.profiles import load_specification
from overtaking.sim.reference import simulate


@pytest.fixture
def simulator() -> Simulator:
    return Simulator(name="reference", version="1", simulate=simulate, details={"simd": "none"})


@pytest.fixture
def recipe() -> Recipe:
    profile = load_specification("pinto2023-physical")
    return Recipe(
        spec=profile,
        road=known_road(profile.road),
        seed=2**64 - 1,
        num_simulations=3,
        keep=Keep.FRAMES,
        shard_size=2,
    )


@pytest.fixture
def manifest(recipe: Recipe, simulator: Simulator) -> Manifest:
    facts = FileFacts(rows=2, size_bytes=10, sha256="ab" * 32, content="cd" * 32)
    shards = tuple(
        ShardRecord(number=n, first=2 * n, simulations=2 - n, tables={"simulations": facts})
        for n in range(2)
    )
    provenance = Provenance(
        started="2026-11-21T03:00:00+00:00",
        package="0.1.0",
        packages={"numpy": "2.4.6"},
        python="3.11.2",
        machine="Linux x86_64",
        details={"simd": "none"},
    )
    return Manifest(
        complete=True,
        content_hash="ef" * 32,
        identity=Identity.of(recipe, simulator),
        shards=shards,
        provenance=provenance,
    )
