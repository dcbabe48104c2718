r"""The ego of this package as a function: the driver to begin with when you write your own.

    overtaking drive motorway --driver examples/human_ego.py:HumanEgo \
        --observation human --action decision -n 100 --out data/human

It decides when to indicate, pull out, cancel and return, from the beliefs of the scenario's
driver. It drives like the built-in ego, bit for bit, until you change a line.
"""

import numpy as np
from numpy.typing import NDArray

import overtaking as ot
from overtaking.core.arrays import Mask
from overtaking.core.float32_math import exp, maximum, minimum
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.gap_acceptance import (
    GapAcceptanceInputs,
    accepts_pull_out_gaps,
    accepts_return_gaps,
    accepts_urgent_return_gaps,
    has_gap_behind,
    wants_to_overtake,
)
from overtaking.sim.reference.lane_change import lane_change_is_dangerous
from overtaking.sim.reference.passing import (
    PassingOpportunity,
    accepts_oncoming_gap,
    assumed_oncoming_gap,
)
from overtaking.sim.reference.state import LEADER, LEFT_LEADER, RIGHT_LEADER
from overtaking.world.step_parameters import StepParameters, step_parameters

FITS_INTO_LANE = 0.5  # Above this `abort_state` the gap behind the target is large enough [1].
ACCEPTS_SMALL_GAP = 0.5  # Above this `return_urgency` a small gap is accepted [1].
MIN_GAP_FACTOR = np.float32(1e-6)  # Keeps the imposed braking finite without demands [1].


class HumanEgo:
    """A driver that observes `human` and answers `decision`."""

    params: StepParameters

    def reset(self, scenario: ot.Scenario) -> None:
        """Take the constants of the model for a new batch."""
        self.params = step_parameters(scenario)

    def __call__(self, observation: ot.Observation) -> NDArray[np.int64]:
        """A move for each simulation."""
        ego = observation.ego
        inputs, decides = self.inputs(observation), ego.checks_mirrors > 0
        pulls_out = self.wants_to_pull_out(observation, inputs, decides)
        returns = self.wants_to_return(observation, inputs, decides)
        time_indicating = ego.time_indicating + self.params.constants.decision
        has_indicated = time_indicating > observation.vehicle.indicator_lead_time
        is_urgent = (observation.passing.return_urgency > 0) & returns
        may_move_over = (decides & (ego.gives_way == 0)) | inputs.is_scripted
        moves_over = (has_indicated | is_urgent) & may_move_over
        pull_out = np.where(moves_over, ot.Move.PULL_OUT, ot.Move.INDICATE_PULL_OUT)
        return_ = np.where(moves_over, ot.Move.RETURN, ot.Move.INDICATE_RETURN)
        move = np.where(pulls_out, pull_out, np.where(returns, return_, ot.Move.KEEP))
        return np.where(self.cancels(observation, inputs, decides), ot.Move.CANCEL, move)

    def inputs(self, observation: ot.Observation) -> GapAcceptanceInputs:
        """Beliefs and demands behind all decisions; a driver that has waited demands less."""
        constants, vehicle = self.params.constants, observation.vehicle
        ego, leader = observation.ego, observation.leader
        relative_wait = ego.time_waiting * vehicle.inverse_patience
        patience_left = maximum(exp(-relative_wait), constants.patience_floor)
        gap_factor = vehicle.gap_demand_factor * patience_left
        imposed_decel = minimum(
            vehicle.safe_decel / maximum(gap_factor, MIN_GAP_FACTOR), constants.max_imposed_decel
        )
        six_neighbours = slice(len(NeighbourRole))  # Without oncoming vehicles.
        # In pinto2023 the ego changes lanes by a script, as in the study, and checks no gap.
        is_scripted = vehicle.gap_demand_factor <= 0
        has_slower_leader = leader.closing_speed > vehicle.min_speed_gain
        has_oncoming_traffic = self.params.road.has_oncoming_traffic
        return GapAcceptanceInputs(
            slots=EGO_SLOT,
            vehicle=vehicle,
            speed=ego.speed,
            gap=observation.neighbours.gap[six_neighbours],
            closing_speed=observation.neighbours.closing_speed[six_neighbours],
            is_detected=observation.neighbours.is_detected[six_neighbours] > 0,
            leader_speed=ego.speed - leader.closing_speed,
            gap_factor=gap_factor,
            acceptable_imposed_decel=minimum(imposed_decel, vehicle.max_assumed_decel),
            patience_left=patience_left,
            tall_vehicle_gap_factor=observation.passing.tall_vehicle_gap_factor
            if has_oncoming_traffic
            else np.float32(1.0),
            is_scripted=is_scripted,
            pulls_out_by_script=is_scripted & (leader.is_detected > 0) & has_slower_leader,
            forced_decision=np.zeros_like(gap_factor),
        )

    def wants_to_pull_out(
        self, observation: ot.Observation, inputs: GapAcceptanceInputs, decides: Mask
    ) -> Mask:
        """Whether to indicate a pull-out: decided at checks of the mirrors, kept in between."""
        ego, params = observation.ego, self.params
        can_pull_out = (ego.stage == ot.Stage.FOLLOW) & (ego.can_pull_out > 0)
        has_paused = ego.time_since_lane_change >= params.constants.abort_cooldown
        wants = wants_to_overtake(params, inputs) & accepts_pull_out_gaps(params, inputs)
        if params.road.has_oncoming_traffic:
            wants &= self.accepts_oncoming_gap(observation, inputs)
        wants = np.where(inputs.is_scripted, inputs.pulls_out_by_script, wants)
        wants = np.where(decides | inputs.is_scripted, wants, ego.wanted_side > 0)
        return can_pull_out & has_paused & wants

    def accepts_oncoming_gap(
        self, observation: ot.Observation, inputs: GapAcceptanceInputs
    ) -> Mask:
        """Whether the driver believes that the opposing lane is free for long enough."""
        leader, oncoming, passing = observation.leader, observation.oncoming, observation.passing
        is_detected = oncoming.is_detected > 0
        gap = np.where(is_detected, oncoming.gap, self.params.constants.oncoming_range)
        vehicle = inputs.vehicle
        opportunity = PassingOpportunity(
            leader_gap=inputs.gap[LEADER],
            leader_speed=inputs.leader_speed,
            leader_length=leader.length,
            gap_ahead_of_leader=passing.gap_ahead_of_leader,
            assumed_oncoming_gap=assumed_oncoming_gap(vehicle, gap, passing.sight_distance),
            oncoming_closing_speed=np.where(
                is_detected, oncoming.closing_speed, passing.expected_closing_speed
            ),
            is_certain=passing.is_certain > 0,
            line_is_solid=passing.line_is_solid > 0,
            tall_vehicle_gap_factor=passing.tall_vehicle_gap_factor,
        )
        accepts = accepts_oncoming_gap(
            self.params, vehicle, inputs.speed, inputs.patience_left, opportunity
        )
        return accepts & ~(leader.indicator > 0)  # The leader may be about to overtake itself.

    def wants_to_return(
        self, observation: ot.Observation, inputs: GapAcceptanceInputs, decides: Mask
    ) -> Mask:
        """Whether to indicate the return: past the target, or stuck beside it for too long."""
        params, ego = self.params, observation.ego
        can_return = (ego.stage == ot.Stage.PASS) & (ego.can_return > 0)
        has_passed = ego.has_passed_target > 0
        is_stuck = ego.is_behind_target > 0
        is_stuck &= ego.time_in_stage > params.constants.give_up_after
        has_paused = ego.time_since_lane_change >= params.constants.abort_cooldown
        accepts = accepts_return_gaps(params, inputs, inputs.tall_vehicle_gap_factor)
        accepts &= has_passed | is_stuck
        if params.road.has_oncoming_traffic:
            is_urgent = observation.passing.return_urgency > ACCEPTS_SMALL_GAP
            accepts_small_gap = is_urgent & accepts_urgent_return_gaps(params, inputs) & has_passed
            accepts, has_paused = accepts | accepts_small_gap, has_paused | accepts_small_gap
        wants = np.where(inputs.is_scripted, has_passed, accepts) & has_paused
        wants = np.where(decides | inputs.is_scripted, wants, ego.wanted_side < 0)
        return can_return & wants

    def cancels(
        self, observation: ot.Observation, inputs: GapAcceptanceInputs, decides: Mask
    ) -> Mask:
        """Whether to go back, because the new lane has become dangerous or a vehicle comes."""
        params, ego = self.params, observation.ego
        aborts = observation.passing.abort_state > FITS_INTO_LANE
        falls_back = aborts & has_gap_behind(params, inputs)
        risk_of_pull_out = inputs.lane_change_risk(old_leader_role=RIGHT_LEADER)
        risk_of_return = inputs.lane_change_risk(old_leader_role=LEFT_LEADER)
        left_is_dangerous = lane_change_is_dangerous(params.constants, risk_of_pull_out)
        right_is_dangerous = lane_change_is_dangerous(params.constants, risk_of_return)
        # In the opposing lane a driver cannot stay, so it never cancels a return.
        right_is_dangerous &= not params.road.has_oncoming_traffic
        pulls_out = ego.stage == ot.Stage.PULL_OUT
        is_dangerous = np.where(pulls_out, left_is_dangerous, right_is_dangerous)
        can_cancel = decides & ~inputs.is_scripted & (ego.can_cancel_lane_change > 0)
        return falls_back | (can_cancel & is_dangerous)


def main() -> None:
    """Compare it with the built-in ego."""
    scenario = ot.sample("pinto2023-physical", num_simulations=100, seed=1)
    built_in = ot.simulate(scenario)
    trajectories = ot.drive(scenario, HumanEgo(), observation="human", action="decision")
    is_equal = (trajectories.trace_hash == built_in.trace_hash).all(axis=1)
    print("100 scenes of pinto2023-physical, percepts to decisions")
    print(f"  same trace as the built-in ego: {is_equal.sum()}")
    print(f"  overtakes begun: {(trajectories.stage == ot.Stage.PULL_OUT).any(axis=1).sum()}")
    assert trajectories.actions is not None
    print(f"  changes of its action: {trajectories.actions.is_change.sum()}")


if __name__ == "__main__":
    main()
