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
from overtaking.sim.reference.car_following import acc_accel
from overtaking.sim.reference.decision_context import Beliefs
from overtaking.sim.reference.lane_change import is_safe_lane_change, mobil_incentives
from overtaking.sim.reference.state import (
    LEADER,
    LEFT_FOLLOWER,
    LEFT_LEADER,
    RIGHT_FOLLOWER,
    RIGHT_LEADER,
)
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
        accel = self.behind_leader(observation, believed)
        # It decides when it checks the mirrors, and keeps indicating in between.
        ego, side = observation.ego, self.side(observation, believed, accel)
        side = np.where(ego.checks_mirrors > 0, side, ego.wanted_side)
        return np.stack([accel, side], axis=1)

    def behind_leader(self, observation: ot.Observation, believed: Beliefs) -> F32:
        """Acceleration behind the leader [m/s^2]."""
        p, near = observation.vehicle, (believed.gap[LEADER], believed.closing_speed[LEADER])
        c, speed = self.given.constants, observation.ego.speed
        return acc_accel(c, p, speed, p.desired_speed, *near, p.time_gap, believed.accel[LEADER])

    def side(self, observation: ot.Observation, believed: Beliefs, accel: F32) -> F32:
        """1 towards the fast side, -1 towards the slow side, where it pays and is safe; else 0."""
        given, p, ego = self.given, observation.vehicle, observation.ego
        speed = ego.speed
        to_fast, to_slow = mobil_incentives(given, p, speed, believed, accel)
        rested = ego.time_since_lane_change >= given.constants.cooldown
        fast = rested & (ego.can_pull_out > 0) & (to_fast > p.lane_change_threshold)
        fast &= is_safe_lane_change(given, p, speed, believed, LEFT_LEADER, LEFT_FOLLOWER)
        slow = rested & (ego.can_return > 0) & (to_slow > p.lane_change_threshold) & ~fast
        slow &= is_safe_lane_change(given, p, speed, believed, RIGHT_LEADER, RIGHT_FOLLOWER)
        slow &= believed.gap[RIGHT_LEADER] > given.constants.free_ahead_time * speed
        return np.where(fast, np.float32(1.0), np.where(slow, np.float32(-1.0), np.float32(0.0)))


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
