"""Traffic of both directions at its start."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import overtaking as ot
from overtaking.model.vehicles import EGO_SLOT

if TYPE_CHECKING:
    from overtaking.core.arrays import F32


def distances_to_leader(min_headway_s: float) -> F32:
    """Distance from each held-up ego to the vehicle ahead, shape (simulation,) [m]."""
    changes = {"traffic.held_up": 1.0, "traffic.min_headway_s": min_headway_s}
    scenario = ot.sample("rural", num_simulations=50, seed=1, overrides=changes)
    lane, s = scenario.start_lane, scenario.start_s
    distance = s - s[:, EGO_SLOT, None]
    is_ahead = (lane == lane[:, EGO_SLOT, None]) & scenario.vehicles.valid & (distance > 0)
    return np.where(is_ahead, distance, np.float32(np.inf)).min(axis=1)


def test_a_held_up_ego_keeps_the_smallest_headway_where_it_exceeds_that_of_platoons():
    # One speed converts headways into distances. 4 s is the longest headway of platoons.
    expected = 4.5 / 4.0 * distances_to_leader(4.0)
    # Stations of some kilometres have steps of up to 0.5 mm in float32.
    assert distances_to_leader(4.5) == pytest.approx(expected, abs=2e-3)
