r"""The driver of the other vehicles of this package, at the ego's wheel: IIDM and MOBIL.

    overtaking drive motorway --driver examples/mobil_driver.py:MobilDriver \
        --observation human -n 100 --out data/mobil

It follows and changes lanes by the functions that the others use, from what the driver of the
scenario believes. What it does not do is give up a lane change that has begun.
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
    """One of the others, from percepts to actions; asks for `human` and answers `accel_lane`."""

    given: StepParameters

    def reset(self, scenario: ot.Scenario) -> None:
        """Take the constants of the model for a new batch."""
        self.given = step_parameters(scenario)

    def __call__(self, observation: ot.Observation) -> NDArray[np.float32]:
        """Acceleration [m/s^2] and side of the lane to change to, for each simulation."""
        neighbours = observation.neighbours
        believed = Beliefs(
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
            gap=believed.gap[LEADER],
            closing_speed=believed.closing_speed[LEADER],
            accel=believed.accel[LEADER],
        )
        accel = acc_accel(self.given.constants, driver, leader)
        side = self.side(observation, driver, believed, accel)
        # It decides when it checks the mirrors, and keeps indicating in between.
        side = np.where(ego.checks_mirrors > 0, side, ego.wanted_side)
        return np.stack([accel, side], axis=1)

    def side(
        self, observation: ot.Observation, driver: Follower, beliefs: Beliefs, accel: F32
    ) -> F32:
        """1 to the left, -1 to the right, where a lane change pays and is safe; else 0."""
        given, ego, threshold = self.given, observation.ego, driver.vehicle.lane_change_threshold
        incentives = mobil_incentives(given, driver, beliefs, accel)
        has_paused = ego.time_since_lane_change >= given.constants.cooldown
        left = has_paused & (ego.can_pull_out > 0) & (incentives.to_left > threshold)
        left &= is_safe_lane_change(given, driver, beliefs, LEFT_LEADER)
        right = has_paused & (ego.can_return > 0) & (incentives.to_right > threshold) & ~left
        right &= is_safe_lane_change(given, driver, beliefs, RIGHT_LEADER)
        right &= beliefs.gap[RIGHT_LEADER] > given.constants.free_ahead_time * ego.speed
        return np.where(left, np.float32(1.0), np.where(right, np.float32(-1.0), np.float32(0.0)))


def main() -> None:
    """Say how it fares beside the built-in ego in the same scenes."""
    scenario = ot.sample("motorway", num_simulations=40, seed=1)
    trajectories = ot.drive(scenario, MobilDriver(), observation="human")
    print("40 scenes of motorway     like the others  built-in")
    labels = [ot.label(each).labels for each in (trajectories, ot.simulate(scenario))]
    for outcome in ot.Outcome:
        counts = [int((each.outcome == outcome).sum()) for each in labels]
        print(f"  {outcome.name.lower():<22} {counts[0]:>16} {counts[1]:>9}")


if __name__ == "__main__":
    main()
