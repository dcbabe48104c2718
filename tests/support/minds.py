"""A moment of traffic written by hand, and what the drivers in it see and believe."""

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

CLEAR_MINDED = EnabledEffects(
    gusts=False, wake=False, range=False, delay=False, distance_error=False, looming=False,
    occlusion=False,
)  # fmt: skip
"""Everything is seen at once and as it is."""


@dataclass(slots=True, kw_only=True)
class Moment:
    """The state of a batch at a decision.

    Attributes:
        given: Parameters.
        state: State, changed by `look`.
        p: Vehicle parameters by name.
        q: Simulation parameters by name.
        decision: Number of the next decision.
    """

    given: StepParameters
    state: State
    p: VehicleParameters
    q: SimulationParameters
    decision: int = 0

    def neighbours(self) -> Neighbours:
        """Who drives around whom."""
        return find_neighbours(self.state, self.given)

    def look(self) -> Beliefs:
        """One decision's worth of everybody looking around."""
        perception.record_history(self.state, self.decision)
        looks = np.ones(self.state.motion.s.shape, np.bool_)
        believed = perception.form_beliefs(
            self.state, self.given, self.neighbours(), self.decision, looks
        )
        self.decision += 1
        return believed

    def context(self) -> DecisionContext:
        """Perception at one decision; all drivers check their mirrors, and none gives way."""
        checks_mirrors, neighbours = np.ones(self.state.motion.s.shape, np.bool_), self.neighbours()
        beliefs = self.look()
        return DecisionContext(
            neighbours=neighbours,
            beliefs=beliefs,
            checks_mirrors=checks_mirrors,
            gives_way=~checks_mirrors,
            oncoming=None,
            decision_index=self.decision - 1,
        )

    def pass_time(self, decisions: int = 1) -> None:
        """Everybody drives on straight at the same speed."""
        step = np.float32(0.05 * decisions)
        self.state.motion.s = self.state.motion.s + step * self.state.motion.vx


def moment(
    *simulations: list[Vehicle],
    effects: EnabledEffects = CLEAR_MINDED,
    road: Road | None = None,
    weather: dict[str, float] | None = None,
    num_slots: int = 8,
) -> Moment:
    """Put vehicles on a road; the first of each list is the ego."""
    world = scenario(*simulations, road=road or wide_road(), weather=weather, num_slots=num_slots)
    given = step_parameters(world, effects)
    state, p = State.at_start(given), given.vehicles
    perception.draw_shoulder_check(state, given, p.valid > 0, 0)
    return Moment(given=given, state=state, p=p, q=given.simulations)
