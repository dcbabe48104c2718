"""What both readings of the paper's features share."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask
from overtaking.labels.signals.target import Along
from overtaking.model.events import NEVER
from overtaking.model.labels import Case
from overtaking.model.trajectory import NO_VEHICLE
from overtaking.model.vehicles import Role

I32 = NDArray[np.int32]


def end_of(case: Case, *events: I32) -> I32:
    """The first in the list of events that happened, else the last frame, shape (simulation,)."""
    end = case.events.last
    for event in reversed(events):
        end = np.where(event == NEVER, end, event)
    return end


def unless_under_way(case: Case, values: F32) -> F32:
    """Values that count from the attempt, NaN where the recording begins later, (simulation,)."""
    return np.where(case.events.under_way == NEVER, values, np.float32(np.nan))


def of_target(case: Case, target: Along) -> dict[str, F32]:
    """Speed, lead and gap of the target at one frame of each simulation.

    0 where there is no target; NaN where it is not recorded in that frame, and for lead and gap
    where the attempt began before the recording.
    """
    nobody = case.events.target == NO_VEHICLE

    def known(values: F32, there: Mask) -> F32:
        missing = np.where(nobody, np.float32(0.0), np.float32(np.nan))
        return np.where(there, values, missing)

    return {
        "speed": known(target.speed, target.valid),
        "lead": unless_under_way(case, known(target.lead, target.valid)),
        "gap": unless_under_way(case, known(target.gap, target.valid)),
    }


def static(case: Case) -> dict[str, NDArray[Any]]:
    """What does not change during a simulation, by field of `Features`."""
    scenario, target = case.trajectories.scenario, case.events.target
    weather, kind = scenario.weather, scenario.vehicles.kind
    has_target = target != NO_VEHICLE
    slot = np.where(has_target, target, 0).astype(np.intp)
    return {
        "night": weather.night,
        "horizon_line": weather.horizon_line,
        "ego_kind": kind[:, Role.EGO],
        "target_kind": np.where(has_target, kind[np.arange(len(slot)), slot], 0),
        "has_target": has_target,
        "num_vehicles": scenario.num_vehicles.astype(np.uint8),
        "rain": weather.rain,
        "wind": weather.wind,
        "fog": weather.fog,
    }
