"""What egos believed when they pulled out, by weather.

    python examples/believed_gaps.py

Samples and simulates 1,000 scenes in memory. Each decision to pull out is recorded with what the
ego believed of the vehicle ahead and of those in the next lane, and with the truth beside it.
"""

import numpy as np
import pandas as pd

import overtaking as ot
from overtaking.knowledge.carla_catalogue import weather_presets
from overtaking.model.trajectories import NO_VEHICLE, ManoeuvreKind

LEADER, FRONT, REAR = range(3)  # The last axis of percepts.


def pull_outs(trajectories: ot.Trajectories) -> pd.DataFrame:
    """One row for each decision to pull out; lengths in metres."""
    percepts = trajectories.percepts
    simulation, row = np.nonzero(percepts.valid & (percepts.kind == ManoeuvreKind.PULL_OUT))
    weather = trajectories.scenario.weather.preset[simulation]
    followed = percepts.slot[simulation, row, REAR] != NO_VEHICLE
    return pd.DataFrame(
        {
            "weather": np.array(list(weather_presets()))[weather],
            "gap_m": percepts.true_gap[simulation, row, LEADER] * 1e-3,
            "believed_gap_m": percepts.gap[simulation, row, LEADER] * 1e-3,
            "followed": followed,
            "unnoticed": followed & ~percepts.is_detected[simulation, row, REAR],
        }
    )


def main() -> None:
    """Print how well gaps were judged in each weather."""
    trajectories = ot.simulate(ot.sample("pinto2023-physical", num_simulations=1000, seed=1))
    decisions = pull_outs(trajectories)
    decisions["error_m"] = (decisions.believed_gap_m - decisions.gap_m).abs()
    groups = decisions.groupby("weather")
    table = pd.DataFrame(
        {
            "pull-outs": groups.size(),
            "median gap [m]": groups.gap_m.median().round(1),
            "median error [m]": groups.error_m.median().round(1),
            "followed": groups.followed.sum(),
            "by somebody unnoticed": groups.unnoticed.sum(),
        }
    )
    print(table.to_string())


if __name__ == "__main__":
    main()
