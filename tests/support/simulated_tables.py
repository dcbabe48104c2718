"""Tables of states, as a recording of real traffic has them, from clean simulations."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

import overtaking as ot
from overtaking.model.trajectories import STATE_RESOLUTION
from overtaking.model.vehicles import VehicleKind

if TYPE_CHECKING:
    from collections.abc import Mapping

    from overtaking.model.trajectories import Trajectories

PROFILES = ("pinto2023-physical", "motorway", "rural")
SEED = 20
PAUSE_S = 500.0  # Between the starts of two simulations of a table, longer than any of them [s].
NUM_TOGETHER = {"pinto2023-physical": 5, "motorway": 2, "rural": 2}
"""Simulations of a table; those of the paper have three vehicles, the others some thirty."""

MAP: Mapping[str, Any] = {
    "columns": {
        "vehicle": "id",
        "time": "t [s]",
        "x": "x [m]",
        "y": "y [m]",
        "length": "length [m]",
        "width": "width [m]",
        "type": "kind",
        "speed": "v [m/s]",
        "vx": "vx [m/s]",
        "vy": "vy [m/s]",
        "heading": "heading [rad]",
        "accel_lon": "a [m/s^2]",
    },
    "types": {
        "car": ["car"],
        "van": ["van"],
        "truck": ["truck"],
        "motorcycle": ["motorcycle"],
        "bicycle": ["bicycle"],
    },
}
"""The map of columns of `table_of`."""

_WORDS = {
    VehicleKind.VAN: "van",
    VehicleKind.TRUCK: "truck",
    VehicleKind.MOTORCYCLE: "motorcycle",
    VehicleKind.BICYCLE: "bicycle",
}
"""The type of a vehicle in the table; other kinds are cars."""


@cache
def simulate_profile(profile: str, count: int, seed: int = SEED) -> Trajectories:
    """Simulate some scenarios of a profile; some end with a collision or a departure."""
    return ot.simulate(ot.sample(profile, num_simulations=count, seed=seed))


def table_of(run: Trajectories, simulations: range) -> pd.DataFrame:
    """A table of the vehicles of some simulations, one after the other.

    A single simulation has too few vehicles to show the course of the road.
    """
    parts = [_simulation_table(run, number % len(run.num_frames)) for number in simulations]
    shifted = [
        part.assign(id=part.id + 100 * number, t=part.t + PAUSE_S * number)
        for number, part in enumerate(parts)
    ]
    return pd.concat(shifted, ignore_index=True)


def _simulation_table(run: Trajectories, simulation: int) -> pd.DataFrame:
    bodies = run.scenario.vehicles
    slot, frame = np.nonzero(run.state_mask[simulation])
    x, y, speed, heading, accel = (
        getattr(run.states, name)[simulation, slot, frame] * STATE_RESOLUTION[name]
        for name in ("x", "y", "speed", "heading", "accel_lon")
    )
    return pd.DataFrame(
        {
            "id": slot + 1,
            "t": np.asarray(run.time_ms)[frame] * 1e-3,
            "x": x,
            "y": y,
            "length": bodies.length[simulation, slot].astype(np.float64),
            "width": bodies.width[simulation, slot].astype(np.float64),
            "kind": [
                _WORDS.get(VehicleKind(kind), "car") for kind in bodies.kind[simulation, slot]
            ],
            "v": speed,
            "vx": speed * np.cos(heading),
            "vy": speed * np.sin(heading),
            "heading": heading,
            "a": accel,
        }
    )
