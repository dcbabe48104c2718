r"""The ego of this package as a function: the driver to begin with when you write your own.

    overtaking drive motorway --driver examples/human_ego.py:HumanEgo \
        --observation human --action decision -n 100 --out data/human

It decides when to signal, pull out, give up and return, from what the driver of the scenario
believes. So it drives like the built-in ego, bit for bit. Change a line, and it does not.
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
    lane_change_is_dangerous,
    wants_to_overtake,
)
from overtaking.sim.reference.passing import (
    PassingOpportunity,
    accepts_oncoming_gap,
    assumed_oncoming_gap,
)
from overtaking.sim.reference.state import LEADER, LEFT_LEADER, RIGHT_LEADER
from overtaking.world.step_parameters import StepParameters, step_parameters

FITTING = 0.5  # Above it there is room behind the leader; below it a driver brakes for that [1].
PRESSED = 0.5  # Above it a small gap is taken; below it a driver only wants to be back soon [1].
LEAST_DEMAND = np.float32(1e-6)  # Keeps what is imposed finite for who demands nothing [1].


class HumanEgo:
    """The built-in ego, from percepts to decisions; asks for `human` and answers `decision`."""

    given: StepParameters

    def reset(self, scenario: ot.Scenario) -> None:
        """Take the constants of the model for a new batch."""
        self.given = step_parameters(scenario)

    def __call__(self, observation: ot.Observation) -> NDArray[np.int64]:
        """A move for each simulation."""
        ego = observation.ego
        view, looks = self.view(observation), ego.checks_mirrors > 0
        start, back = self.starts(observation, view, looks), self.returns(observation, view, looks)
        time_indicating = ego.time_indicating + self.given.constants.decision
        sure = (looks & (ego.gives_way == 0)) | view.is_scripted
        shown = time_indicating > observation.vehicle.indicator_lead_time
        now = (shown | ((observation.passing.return_urgency > 0) & back)) & sure
        out = np.where(now, ot.Move.PULL_OUT, ot.Move.INDICATE_PULL_OUT)
        home = np.where(now, ot.Move.RETURN, ot.Move.INDICATE_RETURN)
        move = np.where(start, out, np.where(back, home, ot.Move.KEEP))
        return np.where(self.aborts(observation, view, looks), ot.Move.CANCEL, move)

    def view(self, observation: ot.Observation) -> GapAcceptanceInputs:
        """The beliefs behind all decisions. A driver who has waited long demands smaller gaps."""
        c, driver = self.given.constants, observation.vehicle
        ego, leader = observation.ego, observation.leader
        impatience = maximum(exp(-(ego.time_waiting * driver.inverse_patience)), c.patience_floor)
        demand = driver.gap_demand_factor * impatience
        six_neighbours = slice(len(NeighbourRole))  # Without oncoming vehicles.
        # In pinto2023 the ego is told to change lanes, as in the study, and looks at no gap.
        told = driver.gap_demand_factor <= 0
        has_oncoming_traffic = self.given.road.has_oncoming_traffic
        return GapAcceptanceInputs(
            slots=EGO_SLOT,
            vehicle=driver,
            speed=ego.speed,
            gap=observation.neighbours.gap[six_neighbours],
            closing_speed=observation.neighbours.closing_speed[six_neighbours],
            is_detected=observation.neighbours.is_detected[six_neighbours] > 0,
            leader_speed=ego.speed - leader.closing_speed,
            gap_factor=demand,
            acceptable_imposed_decel=minimum(
                minimum(driver.safe_decel / maximum(demand, LEAST_DEMAND), c.max_imposed_decel),
                driver.max_assumed_decel,
            ),
            patience_left=impatience,
            tall_vehicle_gap_factor=observation.passing.tall_vehicle_gap_factor
            if has_oncoming_traffic
            else np.float32(1.0),
            is_scripted=told,
            pulls_out_by_script=told
            & (leader.is_detected > 0)
            & (leader.closing_speed > driver.min_speed_gain),
            forced_decision=np.zeros_like(demand),
        )

    def starts(self, observation: ot.Observation, view: GapAcceptanceInputs, looks: Mask) -> Mask:
        """Whether to indicate a pull-out: decided at checks of the mirrors, kept in between."""
        ego = observation.ego
        free = (ego.stage == ot.Stage.FOLLOW) & (ego.can_pull_out > 0)
        rested = ego.time_since_lane_change >= self.given.constants.abort_cooldown
        wants = wants_to_overtake(self.given, view) & accepts_pull_out_gaps(self.given, view)
        if self.given.road.has_oncoming_traffic:
            wants &= self.may_meet(observation, view)
        wants = np.where(view.is_scripted, view.pulls_out_by_script, wants)
        return free & rested & np.where(looks | view.is_scripted, wants, ego.wanted_side > 0)

    def may_meet(self, observation: ot.Observation, view: GapAcceptanceInputs) -> Mask:
        """Whether the opposing lane is believed to be free for long enough."""
        leader, oncoming, passing = observation.leader, observation.oncoming, observation.passing
        is_seen = oncoming.is_detected > 0
        gap = np.where(is_seen, oncoming.gap, self.given.constants.oncoming_range)
        ahead = PassingOpportunity(
            leader_gap=view.gap[LEADER],
            leader_speed=view.leader_speed,
            leader_length=leader.length,
            gap_ahead_of_leader=passing.gap_ahead_of_leader,
            assumed_oncoming_gap=assumed_oncoming_gap(view.vehicle, gap, passing.sight_distance),
            oncoming_closing_speed=np.where(
                is_seen, oncoming.closing_speed, passing.expected_closing_speed
            ),
            is_certain=passing.is_certain > 0,
            line_is_solid=passing.line_is_solid > 0,
            tall_vehicle_gap_factor=passing.tall_vehicle_gap_factor,
        )
        may = accepts_oncoming_gap(self.given, view.vehicle, view.speed, view.patience_left, ahead)
        return may & ~(leader.indicator > 0)  # The leader may be about to overtake itself.

    def returns(self, observation: ot.Observation, view: GapAcceptanceInputs, looks: Mask) -> Mask:
        """Whether to indicate the return: past the target, or stuck beside it for too long."""
        c, ego = self.given.constants, observation.ego
        passes = (ego.stage == ot.Stage.PASS) & (ego.can_return > 0)
        stuck = (ego.time_in_stage > c.give_up_after) & (ego.is_behind_target > 0)
        rested = ego.time_since_lane_change >= c.abort_cooldown
        passed = ego.has_passed_target > 0
        may = accepts_return_gaps(self.given, view, view.tall_vehicle_gap_factor) & (passed | stuck)
        if self.given.road.has_oncoming_traffic:
            room = accepts_urgent_return_gaps(self.given, view)
            squeezes = (observation.passing.return_urgency > PRESSED) & room & passed
            may, rested = may | squeezes, rested | squeezes
        wants = np.where(view.is_scripted, passed, may)
        return passes & np.where(looks | view.is_scripted, wants & rested, ego.wanted_side < 0)

    def aborts(self, observation: ot.Observation, view: GapAcceptanceInputs, looks: Mask) -> Mask:
        """Whether to abort, because the new lane has become dangerous or a vehicle is oncoming."""
        ego, abort_state = observation.ego, observation.passing.abort_state
        falls_back = (abort_state > FITTING) & has_gap_behind(self.given, view)
        out = lane_change_is_dangerous(self.given, view, RIGHT_LEADER)
        home = lane_change_is_dangerous(self.given, view, LEFT_LEADER)
        home &= (
            not self.given.road.has_oncoming_traffic
        )  # A driver must not stay in the opposing lane.
        danger = np.where(ego.stage == ot.Stage.PULL_OUT, out, home)
        return falls_back | (looks & ~view.is_scripted & danger & (ego.can_cancel_lane_change > 0))


def main() -> None:
    """Compare it with the built-in ego."""
    scenario = ot.sample("pinto2023-physical", num_simulations=100, seed=1)
    ours = ot.simulate(scenario)
    trajectories = ot.drive(scenario, HumanEgo(), observation="human", action="decision")
    same = (trajectories.trace_hash == ours.trace_hash).all(axis=1)
    print("100 scenes of pinto2023-physical, percepts to decisions")
    print(f"  same trace as the built-in ego: {same.sum()}")
    print(f"  overtakes begun: {(trajectories.stage == ot.Stage.PULL_OUT).any(axis=1).sum()}")
    assert trajectories.actions is not None
    print(f"  changes of what it does: {trajectories.actions.is_change.sum()}")


if __name__ == "__main__":
    main()
