"""Every simulation belongs to exactly one shard and one chunk, whatever the numbers."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from overtaking.data.plan import (
    CHUNK_SIZE,
    CHUNK_STATES,
    LARGE_CHUNK_SIZE,
    SHARD_SIZE,
    batch_size,
    chunk_size,
    chunks,
    shards,
)
from overtaking.scenarios.profiles import load_specification

COUNT = st.integers(1, 5000)


@pytest.mark.ci
@given(num_simulations=COUNT, shard_size=st.integers(1, 6000), size=st.integers(1, 700))
def test_every_simulation_comes_once_and_in_order(num_simulations, shard_size, size):
    planned = shards(num_simulations, shard_size)
    numbers = [n for shard in planned for chunk in chunks(shard, size) for n in chunk]
    assert numbers == list(range(num_simulations))
    assert [shard.number for shard in planned] == list(range(len(planned)))
    assert all(0 < shard.num_simulations <= shard_size for shard in planned)


@given(num_simulations=COUNT, more=COUNT, shard_size=st.integers(1, 6000))
def test_a_larger_data_set_begins_with_the_full_shards_of_a_smaller_one(
    num_simulations, more, shard_size
):
    small, large = (shards(n, shard_size) for n in (num_simulations, num_simulations + more))
    full = [shard for shard in small if shard.num_simulations == shard_size]
    assert list(large[: len(full)]) == full


def test_large_worlds_come_in_smaller_chunks():
    study = load_specification("pinto2023-physical").to_dict()
    assert chunk_size(study) == CHUNK_SIZE
    crowded = {"traffic.vehicles": [32, 32], "time.horizon_s": 120.0}
    large = load_specification(
        "pinto2023-physical", crowded | {"time.attempt_deadline_s": 60.0}
    ).to_dict()
    assert 32 * 2401 * chunk_size(large) <= CHUNK_STATES < 32 * 2401 * (chunk_size(large) + 1)


def test_chunks_are_larger_where_no_frames_are_kept_and_nobody_minds():
    study = load_specification("pinto2023-physical").to_dict()
    assert batch_size(study, CHUNK_SIZE) == CHUNK_SIZE
    assert batch_size(study, CHUNK_SIZE, keeps_frames=False) == LARGE_CHUNK_SIZE > CHUNK_SIZE
    assert batch_size(study, 4, keeps_frames=False) == 4


def test_the_papers_276_simulations_fit_into_one_file():
    assert len(shards(276)) == 1
    assert len(shards(SHARD_SIZE + 1)) == 2


def test_files_are_named_so_that_they_sort():
    names = [shard.file_name for shard in shards(20, 1)]
    assert names == sorted(names)
    assert names[7] == "part-00007.parquet"
