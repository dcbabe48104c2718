"""The random processes of a drive: Ornstein-Uhlenbeck, of unit variance, independent of each other.

Stationary moments and the autocorrelation exp(-t / tau) are the textbook's (Gardiner, Stochastic
Methods, section 3.8.4). Sampling errors are three standard deviations.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.stats import kurtosis, skew
from tests.support.worlds import Vehicle, scenario, wide_road

from overtaking.sim.reference import road_conditions
from overtaking.sim.reference.state import State
from overtaking.world.step_parameters import StepParameters, step_parameters

DECISION = 0.05
NAMES = ("gust", "distance_error", "speed_error", "lane_wander")
SPEED, WIND = 25.0, 15.0

AIR_SPEED = math.hypot(SPEED, WIND)
TIMES = {"gust": 100.0 / AIR_SPEED, "distance_error": 20.0, "speed_error": 20.0, "lane_wander": 4.0}
"""Correlation times [s]; a moving vehicle meets eddies of 100 m."""

SIMULATIONS, SLOTS = 2000, 8
SAMPLES = SIMULATIONS * SLOTS


@dataclass(frozen=True, kw_only=True)
class Runs:
    """Values of each process at a few decisions, (vehicle, simulation)."""

    values: dict[int, dict[str, np.ndarray]]

    def process_values(self, decision: int, name: str) -> np.ndarray:
        """Values of one process at a decision, flattened over vehicles and simulations."""
        return self.values[decision][name].ravel().astype(np.float64)


DECISIONS = (0, 20, 40, 80, 160, 400)


def gusty_parameters(index: list[int], seed: int = 5) -> StepParameters:
    vehicles = [Vehicle(kind="M", s=30.0 * k, speed=SPEED) for k in range(SLOTS)]
    world = scenario(
        *[vehicles] * len(index), road=wide_road(), index=index, seed=seed,
        weather={"wind": 5.0 * WIND, "wind_direction": math.pi / 2.0},
    )  # fmt: skip
    parameters = step_parameters(world)
    return parameters


@pytest.fixture(scope="module")
def runs() -> Runs:
    parameters = gusty_parameters(list(range(SIMULATIONS)))
    state = State.at_start(parameters)
    values = {}
    for decision in range(DECISIONS[-1] + 1):
        road_conditions.update_random_processes(state, parameters, decision)
        if decision in DECISIONS:
            values[decision] = {name: getattr(state.noise, name).copy() for name in NAMES}
    return Runs(values=values)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("decision", DECISIONS)
def test_the_variance_is_one_from_the_first_decision_on(runs: Runs, name: str, decision: int):
    values = runs.process_values(decision, name)
    assert abs(values.mean()) < 3.0 / math.sqrt(SAMPLES)
    assert values.var() == pytest.approx(1.0, abs=3.0 * math.sqrt(2.0 / SAMPLES))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("early", "late"), [(0, 20), (20, 40), (0, 80), (80, 160), (160, 400)])
def test_the_autocorrelation_falls_exponentially(runs: Runs, name: str, early: int, late: int):
    value = float(np.mean(runs.process_values(early, name) * runs.process_values(late, name)))
    expected = math.exp(-(late - early) * DECISION / TIMES[name])
    assert value == pytest.approx(expected, abs=3.0 * math.sqrt(2.0 / SAMPLES))


@pytest.mark.parametrize("name", ["gust", "lane_wander"])
def test_after_a_few_correlation_times_the_values_are_normal(runs: Runs, name: str):
    # 20 s are five correlation times and more. The innovations are uniform, whose excess kurtosis
    # of -1.2 is left to the part (1 - k^2) / (1 + k^2), below 2 %; k: the correlation over 50 ms.
    values = runs.process_values(400, name)
    keep = math.exp(-DECISION / TIMES[name])
    expected = -1.2 * (1.0 - keep**2) / (1.0 + keep**2)
    assert kurtosis(values) == pytest.approx(expected, abs=3.0 * math.sqrt(24.0 / SAMPLES))
    assert abs(skew(values)) < 3.0 * math.sqrt(6.0 / SAMPLES)


@pytest.mark.parametrize("name", ["distance_error", "speed_error"])
def test_slow_processes_begin_bounded_and_become_normal(runs: Runs, name: str):
    # The first draw is uniform: no error begins at more than sqrt(3) standard deviations. Its
    # excess kurtosis of -1.2 fades with the fourth power of the correlation, to 2 % after 20 s.
    assert np.abs(runs.process_values(0, name)).max() < math.sqrt(3.0)
    correlation = math.exp(-20.0 / TIMES[name])
    values = runs.process_values(400, name)
    assert kurtosis(values) == pytest.approx(
        -1.2 * correlation**4, abs=0.01 + 3.0 * math.sqrt(24.0 / SAMPLES)
    )


def test_processes_vehicles_and_simulations_are_independent(runs: Runs):
    bound = 4.0 / math.sqrt(SAMPLES)
    columns = [runs.process_values(160, name) for name in NAMES]
    table = np.corrcoef(columns)
    assert np.abs(table - np.eye(len(NAMES))).max() < bound
    for name in NAMES:
        rows = runs.values[160][name].astype(np.float64)
        slots = np.corrcoef(rows)
        # 28 pairs of 2000 samples each.
        assert np.abs(slots - np.eye(SLOTS)).max() < 4.0 / math.sqrt(SIMULATIONS)
        assert abs(np.mean(rows[:, 1:] * rows[:, :-1])) < bound


def test_a_simulation_has_the_same_gusts_in_any_batch():
    alone, together = gusty_parameters([77]), gusty_parameters([3, 77, 500])
    states = [State.at_start(parameters) for parameters in (alone, together)]
    for decision in range(30):
        for state, parameters in zip(states, (alone, together), strict=True):
            road_conditions.update_random_processes(state, parameters, decision)
    for name in NAMES:
        single, batch = (getattr(state.noise, name) for state in states)
        np.testing.assert_array_equal(single[:, 0], batch[:, 1])
        assert (single[:, 0] != batch[:, 0]).all()


def test_another_seed_gives_other_gusts():
    states = []
    for seed in (5, 6):
        parameters = gusty_parameters([1], seed)
        state = State.at_start(parameters)
        road_conditions.update_random_processes(state, parameters, 0)
        states.append(state)
    assert (states[0].noise.gust != states[1].noise.gust).all()
