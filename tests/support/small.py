"""A data set of twenty short simulations, and how what cannot be made of it is refused."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest

import overtaking as ot

if TYPE_CHECKING:
    from pathlib import Path

    from overtaking.core.errors import OvertakingError

NUM_SIMULATIONS = 20
HORIZON = {"time.horizon_s": 1.0, "time.attempt_deadline_s": 1.0}
SETTINGS = {"overrides": HORIZON, "shard_size": 8}


def generate(out: Path, simulations: int = NUM_SIMULATIONS, seed: int = 1, **changes):
    return ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=simulations,
        seed=seed,
        out=out,
        **{**SETTINGS, **changes},
    )


def refused(error: type[OvertakingError], *parts: str):
    """Expect an error of one line with these parts."""
    pattern = ".*".join(re.escape(part) for part in parts)
    return pytest.raises(error, match=rf"\A[^\n]*{pattern}[^\n]*\Z")
