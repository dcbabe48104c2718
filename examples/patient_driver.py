r"""A driver of one's own in twenty lines: pulls out into gaps of five seconds, returns after three.

It keeps its speed where it can:

    overtaking drive motorway --driver examples/patient_driver.py:patient \
        --observation human --action speed_lane -n 100 --out data/patient
"""

import numpy as np
from numpy.typing import NDArray

import overtaking as ot

CRUISE = 33.0  # [m/s]


def patient(observation: ot.Observation) -> NDArray[np.float64]:
    """Speed [m/s] and side of the lane to change to, for each simulation."""
    ego, leader, right_leader = observation.ego, observation.leader, observation.right_leader
    left_leader, left_follower = observation.left_leader, observation.left_follower
    leader_speed = ego.speed - leader.closing_speed
    follow = np.maximum(leader_speed + (leader.gap - 2.0 * ego.speed) / 4.0, 0.0)
    speed = np.where(leader.is_detected > 0, np.minimum(CRUISE, follow), CRUISE)
    gap_in_5_s = left_follower.gap - 5.0 * np.maximum(left_follower.closing_speed, 0.0)
    pulls_out = (speed < CRUISE - 3.0) & (gap_in_5_s > 50.0) & (left_leader.gap > leader.gap)
    is_clear = right_leader.gap > 3.0 * ego.speed
    is_clear &= observation.right_follower.gap > ego.speed
    side = np.where(pulls_out, 1.0, np.where(is_clear & (ego.lane > 0), -1.0, 0.0))
    return np.stack([speed, side], axis=1)


def main() -> None:
    """Say how it fares beside the built-in ego in the same scenes."""
    scenario = ot.sample("pinto2023-physical", num_simulations=200, seed=1)
    trajectories = ot.drive(scenario, patient, observation="human", action="speed_lane")
    print("200 scenes of pinto2023-physical   patient  built-in")
    labels = [ot.label(each).labels for each in (trajectories, ot.simulate(scenario))]
    for outcome in ot.Outcome:
        counts = [int((each.outcome == outcome).sum()) for each in labels]
        print(f"  {outcome.name.lower():<22} {counts[0]:>8} {counts[1]:>9}")


if __name__ == "__main__":
    main()
