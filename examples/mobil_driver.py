r"""The driver of the other vehicles of this package, at the ego's wheel: IIDM and MOBIL.

    overtaking drive motorway --driver examples/mobil_driver.py:MobilDriver \
        --observation human -n 100 --out data/mobil

It follows and changes lanes by the functions that the others use, from the beliefs of the
scenario's driver. Unlike the others it never cancels a lane change.
"""

import numpy as np
from numpy.typing import NDArray

import overtaking as ot
from overtaking.core.arrays import F32
from overtaking.sim.reference.car_following import Follower, Leader, acc_accel
from overtaking.sim.reference.decision_context import Beliefs
from overtaking.sim.reference.lane_change import is_safe_lane_change, mobil_incentives
from overtaking.sim.reference.state import LEADER, LEFT_LEADER, RIGHT_LEADER
from overtaking.world.step_parameters import StepParameters, step_parameters


class MobilDriver:
    """A driver that observes `human` and answers `accel_lane`."""

    params: StepParameters

    def reset(self, scenario: ot.Scenario) -> None:
        """Take the constants of the model for a new batch."""
        self.params = step_parameters(scenario)

    def __call__(self, observation: ot.Observation) -> NDArray[np.float32]:
        """Acceleration [m/s^2] and side of the lane to change to, for each simulation."""
        neighbours = observation.neighbours
        beliefs = Beliefs(
            is_detected=neighbours.is_detected > 0,
            gap=neighbours.gap,
            closing_speed=neighbours.closing_speed,
            accel=neighbours.accel,
        )
        ego, vehicle = observation.ego, observation.vehicle
        driver = Follower(
            vehicle=vehicle,
            speed=ego.speed,
            desired_speed=vehicle.desired_speed,
            time_gap=vehicle.time_gap,
        )
        leader = Leader(
            gap=beliefs.gap[LEADER],
            closing_speed=beliefs.closing_speed[LEADER],
            accel=beliefs.accel[LEADER],
        )
        accel = acc_accel(self.params.constants, driver, leader)
        side = self.side(observation, driver, beliefs, accel)
        # It decides when it checks the mirrors, and keeps indicating in between.
        side = np.where(ego.checks_mirrors > 0, side, ego.wanted_side)
        return np.stack([accel, side], axis=1)

    def side(
        self, observation: ot.Observation, driver: Follower, beliefs: Beliefs, accel: F32
    ) -> F32:
        """1 to the left, -1 to the right, where a lane change pays and is safe; else 0."""
        params, ego, threshold = self.params, observation.ego, driver.vehicle.lane_change_threshold
        incentives = mobil_incentives(params, driver, beliefs, accel)
        has_paused = ego.time_since_lane_change >= params.constants.cooldown
        left = has_paused & (ego.can_pull_out > 0) & (incentives.to_left > threshold)
        left &= is_safe_lane_change(params, driver, beliefs, LEFT_LEADER)
        right = has_paused & (ego.can_return > 0) & (incentives.to_right > threshold) & ~left
        right &= is_safe_lane_change(params, driver, beliefs, RIGHT_LEADER)
        right &= beliefs.gap[RIGHT_LEADER] > params.constants.free_ahead_time * ego.speed
        return np.where(left, np.float32(1.0), np.where(right, np.float32(-1.0), np.float32(0.0)))


def main() -> None:
    """Compare its outcomes with the built-in ego's in the same scenes."""
    scenario = ot.sample("motorway", num_simulations=40, seed=1)
    trajectories = ot.drive(scenario, MobilDriver(), observation="human")
    print("40 scenes of motorway     like the others  built-in")
    batches = (trajectories, ot.simulate(scenario))
    outcomes = [ot.label(batch).labels.outcome for batch in batches]
    for outcome in ot.Outcome:
        counts = [int((array == outcome).sum()) for array in outcomes]
        print(f"  {outcome.name.lower():<22} {counts[0]:>16} {counts[1]:>9}")


if __name__ == "__main__":
    main()
