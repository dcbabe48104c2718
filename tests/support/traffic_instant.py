"""Traffic at one decision, stated vehicle by vehicle, and the beliefs of its drivers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from overtaking.sim.reference import perception
from overtaking.sim.reference.decision_context import DecisionContext
from overtaking.sim.reference.neighbour_search import find_neighbours
from overtaking.sim.reference.state import State
from overtaking.world.constants import EnabledEffects
from overtaking.world.step_parameters import StepParameters, VehicleParameters, step_parameters

from .worlds import Vehicle, scenario, wide_road

if TYPE_CHECKING:
    from overtaking.model.road import Road
    from overtaking.sim.reference.decision_context import Beliefs, Neighbours
    from overtaking.world.weather_parameters import SimulationParameters

PERFECT_PERCEPTION = EnabledEffects(
    gusts=False, wake=False, range=False, delay=False, distance_error=False, looming=False,
    occlusion=False,
)  # fmt: skip
"""Drivers detect all vehicles at once and believe the truth; gusts and wind shelter are off."""


@dataclass(slots=True, kw_only=True)
class TrafficInstant:
    """The state of a batch at a decision.

    Attributes:
        params: Parameters of the batch.
        state: State, changed by `perceive`.
        vehicles: Vehicle parameters by name, as in `params`.
        simulations: Simulation parameters by name, as in `params`.
        decision: Number of the next decision.
    """

    params: StepParameters
    state: State
    vehicles: VehicleParameters
    simulations: SimulationParameters
    decision: int = 0

    def neighbours(self) -> Neighbours:
        """The neighbours of each vehicle."""
        return find_neighbours(self.state, self.params)

    def perceive(self) -> Beliefs:
        """The beliefs of all drivers at the next decision; all check their mirrors."""
        perception.record_history(self.state, self.decision)
        checks_mirrors = np.ones(self.state.motion.s.shape, np.bool_)
        beliefs = perception.form_beliefs(
            self.state, self.params, self.neighbours(), self.decision, checks_mirrors
        )
        self.decision += 1
        return beliefs

    def context(self) -> DecisionContext:
        """Perception at one decision; all drivers check their mirrors, and none gives way."""
        checks_mirrors, neighbours = np.ones(self.state.motion.s.shape, np.bool_), self.neighbours()
        beliefs = self.perceive()
        return DecisionContext(
            neighbours=neighbours,
            beliefs=beliefs,
            checks_mirrors=checks_mirrors,
            gives_way=~checks_mirrors,
            oncoming=None,
            decision_index=self.decision - 1,
        )

    def advance(self, decisions: int = 1) -> None:
        """Move all vehicles straight on at constant speed until a later decision."""
        step = np.float32(0.05 * decisions)
        self.state.motion.s = self.state.motion.s + step * self.state.motion.vx


def traffic_instant(
    *simulations: list[Vehicle],
    effects: EnabledEffects = PERFECT_PERCEPTION,
    road: Road | None = None,
    weather: dict[str, float] | None = None,
    num_slots: int = 8,
) -> TrafficInstant:
    """Put vehicles on a road; the first of each list is the ego."""
    world = scenario(*simulations, road=road or wide_road(), weather=weather, num_slots=num_slots)
    params = step_parameters(world, effects)
    state, vehicles = State.at_start(params), params.vehicles
    perception.draw_shoulder_check(state, params, vehicles.valid > 0, 0)
    return TrafficInstant(
        params=params, state=state, vehicles=vehicles, simulations=params.simulations
    )
