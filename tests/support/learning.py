"""Examples to learn from that are made of nothing, with what decides planted in them."""

from __future__ import annotations

import numpy as np
import pandas as pd

from overtaking.analysis.learning.attributes import BY_NAME
from overtaking.analysis.learning.examples import Examples

NAMES = ("over_limit", "leader_kind", "leader_gap_m", "left_follower_gap_m", "night", "rain_mmph")


def planted(number: int = 1200, seed: int = 1, kin: int = 1) -> Examples:
    """Examples in which a short gap behind ends in a collision, and speeding is unlawful.

    Args:
        number: How many.
        seed: Of the numbers.
        kin: How many examples in a row are of one group.
    """
    draw = np.random.default_rng(seed)
    columns = {
        "over_limit": draw.normal(-2.0, 6.0, number),
        "leader_kind": draw.integers(0, 7, number).astype(float),
        "leader_gap_m": draw.uniform(2.0, 120.0, number),
        "left_follower_gap_m": draw.uniform(0.0, 300.0, number),
        "night": draw.integers(0, 2, number).astype(float),
        "rain_mmph": draw.exponential(5.0, number),
    }
    crashes = (columns["left_follower_gap_m"] < 40.0) & (columns["night"] > 0.0)
    crashes ^= draw.random(number) < 0.02
    unlawful = (columns["over_limit"] > 0.0) | (columns["leader_kind"] == 6.0)
    names = np.where(crashes, "Unsuccess_col", np.where(unlawful, "Success_I", "Success_L"))
    return Examples(
        simulations=np.arange(number) + 100,
        attributes=tuple(BY_NAME[name] for name in NAMES),
        values=np.column_stack([columns[name] for name in NAMES]),
        classes=pd.Series(names),
        attempted=np.ones(number, np.bool_),
        groups=np.arange(number) // kin,
        policy="paper",
    )
