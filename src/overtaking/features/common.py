"""What both readings of the paper's features share."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

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
