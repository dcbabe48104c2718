"""Spaces of observations and actions: names, units, bounds and scales of their numbers."""

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from overtaking.core.arrays import F32, Mask
from overtaking.core.errors import ConfigError
from overtaking.model.driver_interface import (
    EGO_COLUMNS,
    NEIGHBOUR_COLUMNS,
    NEIGHBOUR_ROLES,
    PASSING_COLUMNS,
    Move,
)
from overtaking.model.trajectories import Stage
from overtaking.sim.controls import CONTROLS
from overtaking.sim.driving import limited
from overtaking.sim.observation import EgoObservation


@dataclass(frozen=True, slots=True)
class ObservationColumn:
    """One column of an observation.

    Attributes:
        name: Where an `Observation` has it: `ego.speed`, `leader.gap`, `passing.abort_state`.
        unit: Unit.
        low: Smallest value; smaller ones are clipped to it.
        high: Largest value; larger ones are clipped to it.
        scale: Divisor of normalized numbers.
    """

    name: str
    unit: str
    low: float
    high: float
    scale: float


_FLAG = (0.0, 1.0, 1.0)
_SIDE = (-1.0, 1.0, 1.0)
_SPEED = (-100.0, 100.0, 30.0)
_ACCEL = (-20.0, 20.0, 5.0)
_TIME = (0.0, 600.0, 10.0)
_SIGHT = (-100.0, 1000.0, 200.0)
_RANGES: Final = {
    "speed": _SPEED,
    "requested_accel": _ACCEL,
    "s": (-1e5, 1e5, 1000.0),
    "lateral_position": (-100.0, 100.0, 10.0),
    "lane_offset": (-20.0, 20.0, 2.0),
    "heading": (-4.0, 4.0, 0.1),
    "yaw_rate": (-20.0, 20.0, 0.1),
    "lane": (0.0, 8.0, 1.0),
    "stage": (0.0, float(max(Stage)), 1.0),
    "time_in_stage": _TIME,
    "time_waiting": _TIME,
    "time_indicating": _TIME,
    "wanted_side": _SIDE,
    "time_since_lane_change": _TIME,
    "gap": (-100.0, 300.0, 50.0),
    "closing_speed": (-100.0, 100.0, 10.0),
    "accel": _ACCEL,
    "lateral_distance": (-100.0, 100.0, 5.0),
    "indicator": _SIDE,
    "length": (0.0, 50.0, 10.0),
    "oncoming.gap": _SIGHT,
    "second_oncoming.gap": _SIGHT,
    "sight_distance": _SIGHT,
    "expected_closing_speed": _SPEED,
    "gap_ahead_of_leader": (-100.0, 300.0, 50.0),
}
"""Bounds and scale of each column, with its role where that matters; all others are 0 to 1.

A choice: wider than the values that drivers meet.
"""


def _columns() -> tuple[ObservationColumn, ...]:
    groups = [
        ("ego", EGO_COLUMNS),
        *((role, NEIGHBOUR_COLUMNS) for role in NEIGHBOUR_ROLES),
        ("passing", PASSING_COLUMNS),
    ]
    return tuple(
        ObservationColumn(
            f"{group}.{name}",
            unit,
            *_RANGES.get(f"{group}.{name}", _RANGES.get(name, _FLAG)),
        )
        for group, columns in groups
        for name, (unit, _) in columns.items()
    )


OBSERVATION_COLUMNS: Final = _columns()
"""The columns of an observation, in order."""

_LOW, _HIGH, _SCALE = (
    np.array([getattr(column, name) for column in OBSERVATION_COLUMNS], np.float32)
    for name in ("low", "high", "scale")
)


def flatten_observation(observation: EgoObservation, *, normalize: bool = False) -> F32:
    """The numbers of an observation for a network, shape (simulation, `OBSERVATION_COLUMNS`).

    Args:
        observation: Observation of environments, or of the drivers of `overtaking.drive`.
        normalize: Whether to divide each by its scale.
    """
    return clip_observation(observation.table, normalize=normalize)


def clip_observation(table: F32, *, normalize: bool) -> F32:
    """Numbers within their bounds, shape (simulation, `OBSERVATION_COLUMNS`)."""
    numbers = np.clip(table, _LOW, _HIGH)
    return np.divide(numbers, _SCALE, out=numbers) if normalize else numbers


def observation_space(*, normalize: bool) -> spaces.Box:
    """Space of observations: a number for each of `OBSERVATION_COLUMNS`."""
    scale = _SCALE if normalize else np.float32(1.0)
    return spaces.Box(_LOW / scale, _HIGH / scale, dtype=np.float32)


def action_space(action: str) -> spaces.Box | spaces.Discrete:
    """Space of actions: a number for each part of the control, or one of `Move`."""
    if action == "decision":
        return spaces.Discrete(len(Move))
    parts = CONTROLS[action].parts
    low, high = ([getattr(part, name) for part in parts] for name in ("low", "high"))
    return spaces.Box(np.array(low, np.float32), np.array(high, np.float32), dtype=np.float32)


class ClippedActions(NamedTuple):
    """Actions within their limits.

    Attributes:
        values: The actions, shape (env, part).
        was_clipped: Whether an action was outside its limits, shape (env,).
    """

    values: NDArray[np.float64]
    was_clipped: Mask


def clip_actions(actions: Any, action: str, rows: int) -> ClippedActions:
    """Clip the actions of all environments to their limits.

    Args:
        actions: Actions, shape (env, part), or (env,) for actions of one part.
        action: Kind of the actions, a name in `CONTROLS`.
        rows: Number of environments.

    Raises:
        ConfigError: They have another shape, or are not finite.
    """
    parts = CONTROLS[action].parts
    values = np.asarray(actions, np.float64)
    if values.shape == (rows,) and len(parts) == 1:
        values = values[:, None]
    if values.shape != (rows, len(parts)) or not np.isfinite(values).all():
        has_shape = values.shape == (rows, len(parts))
        raise ConfigError(
            what="actions",
            where="step",
            expected=f"finite numbers of shape ({rows}, {len(parts)})",
            got=values.tolist() if has_shape else f"shape {values.shape}",
            next_step="correct the agent",
        )
    return ClippedActions(*limited(values, parts))
