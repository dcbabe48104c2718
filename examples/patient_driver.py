r"""A driver of one's own in twenty lines: pulls out into gaps of five seconds, returns after three.

It keeps its speed where it can:

    overtaking drive motorway --policy examples/patient_driver.py:patient \
        --observe human --action speed_lane -n 100 --out data/patient
"""

import numpy as np
from numpy.typing import NDArray

import overtaking as ot

CRUISE = 33.0  # [m/s]


def patient(seen: ot.Observation) -> NDArray[np.float64]:
    """Speed [m/s] and side of the lane to change to, for each simulation."""
    own, gap = seen.of("speed"), seen.of("gap", "lead")
    follows = np.maximum(own - seen.of("closing", "lead") + (gap - 2.0 * own) / 4.0, 0.0)
    speed = np.where(seen.of("detected", "lead") > 0, np.minimum(CRUISE, follows), CRUISE)
    behind = seen.of("gap", "fast_rear") - 5.0 * np.maximum(seen.of("closing", "fast_rear"), 0.0)
    out = (speed < CRUISE - 3.0) & (behind > 50.0) & (seen.of("gap", "fast_lead") > gap)
    clear = (seen.of("gap", "slow_lead") > 3.0 * own) & (seen.of("gap", "slow_rear") > own)
    side = np.where(out, 1.0, np.where(clear & (seen.of("lane") > 0), -1.0, 0.0))
    return np.stack([speed, side], axis=1)


def main() -> None:
    """Say how it fares beside the built-in ego in the same scenes."""
    scenes = ot.sample("pinto2023-physical", num_simulations=200, seed=1)
    runs = ot.drive(scenes, patient, observe="human", action="speed_lane")
    print("200 scenes of pinto2023-physical   patient  built-in")
    labels = [ot.label(each).labels for each in (runs, ot.simulate(scenes))]
    for outcome in ot.Outcome:
        counts = [int((each.outcome == outcome).sum()) for each in labels]
        print(f"  {outcome.name.lower():<22} {counts[0]:>8} {counts[1]:>9}")


if __name__ == "__main__":
    main()
