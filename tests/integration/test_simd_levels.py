"""Another process with other threads or another SIMD level records the same bits."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

import overtaking as ot
from overtaking import _core
from overtaking.core.errors import ConfigError
from overtaking.sim import engine

if TYPE_CHECKING:
    from pathlib import Path

LEVELS = dict(_core.simd_levels())


@pytest.fixture(scope="module")
def expected(repository) -> list[str]:
    """What a process records that was asked for nothing in particular."""
    return simulated_elsewhere(repository)


def simulated_elsewhere(repository: Path, **environment: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-m", "tests.reference.situations", "1"],
        cwd=repository,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert not done.stderr
    assert len(done.stdout.splitlines()) == 6
    return done.stdout.splitlines()


def test_this_cpu_has_the_portable_level_and_the_chosen_one():
    assert LEVELS["portable"]
    assert LEVELS[_core.default_simd_level()]
    assert set(LEVELS) == {"avx512", "avx2", "portable"}


@pytest.mark.ci
@pytest.mark.parametrize("threads", ["1", "2"])
@pytest.mark.parametrize("level", sorted(LEVELS))
def test_every_level_and_number_of_threads_records_the_same(level, threads, expected, repository):
    if not LEVELS[level]:
        pytest.skip(f"this CPU lacks {level}")
    environment = {"OVERTAKING_SIMD": level, "RAYON_NUM_THREADS": threads}
    assert simulated_elsewhere(repository, **environment) == expected


@pytest.mark.ci
def test_threads_are_those_that_were_asked_for(repository):
    program = "from overtaking import _core; print(_core.num_threads())"
    for threads in ("1", "2"):
        environment = {**os.environ, "RAYON_NUM_THREADS": threads}
        done = subprocess.run(
            [sys.executable, "-c", program],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout.strip() == threads


def test_an_unknown_level_is_refused_with_the_known_ones(monkeypatch):
    scenario = ot.sample("pinto2023-physical", num_simulations=1, seed=1)
    with pytest.raises(ConfigError, match=r"portable.*sse9"):
        engine.simulate(scenario, level="sse9")
    monkeypatch.setenv("OVERTAKING_SIMD", "avx1024")
    with pytest.raises(ConfigError, match="avx1024"):
        engine.simulate(scenario)
    assert engine.simulate(scenario, level="portable").num_frames[0] > 0


def test_a_level_that_this_cpu_lacks_is_refused(monkeypatch):
    lacking = [name for name, available in LEVELS.items() if not available]
    for level in lacking or ["avx512-of-another-cpu"]:
        monkeypatch.setenv("OVERTAKING_SIMD", level)
        with pytest.raises(ConfigError, match=level):
            engine.simulate(ot.sample("pinto2023-physical", num_simulations=1, seed=1))
