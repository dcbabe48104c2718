"""The traffic of a profile on a ring road, for the rate of lane changes.

The published rates are of traffic at 15 to 25 vehicles per kilometre and lane. Between two open
ends dense traffic does not stay dense; on a ring it does. The vehicles and drivers are the
profile's; it is dry and day, as in the published measurements.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.validation.changes import count_rate
from overtaking.analysis.validation.traffic import Batch
from overtaking.core.arrays import Buffers
from overtaking.model.vehicles import EGO_SLOT
from overtaking.scenarios import profiles, sampler
from overtaking.sim import engine
from overtaking.world.step_parameters import StepParameters, step_parameters, with_ring

if TYPE_CHECKING:
    from collections.abc import Iterator

    from overtaking.analysis.validation.tally import Array, Tally
    from overtaking.core.arrays import F32
    from overtaking.model.road import Road
    from overtaking.model.scenario import Scenario
    from overtaking.scenarios.specification import Specification

DENSITIES = (15.0, 25.0)
"""Vehicles per kilometre and lane."""

VEHICLES = (24, 32)
"""Fewest and most vehicles on the ring."""

WARM_UP_S, COUNTED_S = 40.0, 60.0
"""Time in which traffic settles, then time in which changes are counted [s]."""

CHUNK = 48
"""Simulations at a time."""

_FIRST_S, _SLACK_M, _GAP_S = 50.0, 8.0, 1.8
_NEVER_S = 1e4

_DRY_DAY = {
    "weather.rain_probability": 0.0,
    "weather.fog_probability": 0.0,
    "weather.puddles_percent": [0.0, 0.0],
    "weather.wind_percent": [0.0, 30.0],
    "weather.sun_altitude_deg": [30.0, 60.0],
}


def count(tally: Tally, spec: Specification, road: Road, seed: int, simulations: int) -> None:
    """Add lane changes and distances on rings to a tally.

    Args:
        tally: The tally.
        spec: A specification with a flow of traffic and independent weather.
        road: Its road.
        seed: Seed of the random numbers.
        simulations: Number of rings.
    """
    steps = (np.arange(simulations) + 0.5) / simulations
    density = DENSITIES[0] + (DENSITIES[1] - DENSITIES[0]) * steps
    for batch, counted in batches(spec, road, seed, density.astype(np.float32)):
        count_rate(tally, batch, counted)


def batches(
    spec: Specification, road: Road, seed: int, density: F32
) -> Iterator[tuple[Batch, Array]]:
    """Rings with traffic of given densities.

    Args:
        spec: A specification with a flow of traffic and independent weather.
        road: Its road.
        seed: Seed of the random numbers.
        density: Vehicles per kilometre and lane of each ring, shape (simulation,).

    Yields:
        Some of the rings, and which vehicles and frames count: not the egos, not the warm-up. Both
        are valid until the next ones.
    """
    settled = profiles.load_specification(
        spec,
        _DRY_DAY
        | {
            "traffic.vehicles": list(VEHICLES),
            "time.horizon_s": WARM_UP_S + COUNTED_S,
            "time.attempt_deadline_s": WARM_UP_S + COUNTED_S,
        },
    )
    buffers = Buffers()
    for first in range(0, len(density), CHUNK):
        index = np.arange(first, min(first + CHUNK, len(density)), dtype=np.uint64)
        drawn = sampler.ScenarioSource(settled, road, seed).sample(index)
        scenario, given = on_ring(drawn, density[first : first + CHUNK])
        batch = Batch.of(engine.run(scenario, given, buffers=buffers))
        counted = batch.sound.copy()
        counted[:, EGO_SLOT] = False  # It is kept from overtaking.
        counted[:, :, : round(WARM_UP_S / batch.interval_s)] = False
        yield batch, counted


def on_ring(drawn: Scenario, density: F32) -> tuple[Scenario, StepParameters]:
    """A batch evenly spread over rings.

    Args:
        drawn: Any batch.
        density: Vehicles per kilometre and lane, shape (simulation,).

    Returns:
        The batch, and its parameters; no simulation ends early.
    """
    lanes = drawn.road.num_lanes
    length = (1e3 * drawn.num_vehicles / (lanes * density)).astype(np.float32)
    valid = drawn.vehicles.valid
    lane = np.where(valid, drawn.start_lane, lanes)
    order = np.lexsort((drawn.start_s, lane), axis=1)
    sorted_lane = np.take_along_axis(lane, order, axis=1)
    begin = (sorted_lane[:, None, :] < np.arange(lanes + 1)[None, :, None]).sum(axis=2)
    rank = np.argsort(order, axis=1) - np.take_along_axis(begin, lane.astype(np.intp), axis=1)
    inside = (lane[:, :, None] == lane[:, None, :]).sum(axis=2)
    spacing = length[:, None] / inside
    place = _FIRST_S + (rank + lane / lanes) * spacing
    pace = np.maximum((spacing - _SLACK_M) / _GAP_S, 1.0)
    never = np.full_like(drawn.attempt_deadline, _NEVER_S)
    scenario = drawn.replace(
        start_s=np.where(valid, place, 0.0).astype(np.float32),
        start_speed=np.minimum(drawn.start_speed, pace).astype(np.float32),
        attempt_deadline=never,
    )
    return scenario, _endless(with_ring(step_parameters(scenario), length))


def _endless(given: StepParameters) -> StepParameters:
    """Parameters with which neither an overtake nor a collision of the ego ends a simulation."""
    constants = given.constants.replace(after_overtake=_NEVER_S, after_collision=_NEVER_S)
    return dataclasses.replace(given, constants=constants)
