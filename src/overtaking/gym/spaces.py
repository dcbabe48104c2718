"""Names, units, bounds and scales of observations and actions, and Gymnasium's spaces of them.

At each step an agent, which drives the ego (the vehicle under study), gets one row of numbers for
each environment: columns about the ego, about its neighbours (such as `leader`, the vehicle ahead)
and about a pass in the opposing lane. `model.driver_interface` declares the columns; this module
adds the bounds that a Gymnasium `Box` needs, and the scales by which a network may want them
divided. `environments` clips observations and actions with the functions below.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from gymnasium import spaces

from overtaking.core.arrays import F32
from overtaking.core.errors import ConfigError
from overtaking.model.driver_interface import (
    EGO_COLUMNS,
    NEIGHBOUR_COLUMNS,
    NEIGHBOUR_ROLES,
    PASSING_COLUMNS,
    Move,
)
from overtaking.model.trajectories import Stage
from overtaking.sim.action_spaces import ACTION_SPACES, ClippedAnswers, clip_to_limits
from overtaking.sim.ego_observation import EgoObservation


@dataclass(frozen=True, slots=True)
class ObservationColumn:
    """One column of an observation.

    Attributes:
        name: Group and column, as attributes of an `Observation`: `ego.speed`, `leader.gap`.
        unit: Unit, such as `m/s`; `flag` for 0 or 1.
        low: Lower bound [unit]; smaller values are clipped to it.
        high: Upper bound [unit]; larger values are clipped to it.
        scale: Divisor of the value in normalized observations [unit].
    """

    name: str
    unit: str
    low: float
    high: float
    scale: float


# Lower bound, upper bound and scale, in SI units. A choice: the bounds are wider than the values
# that drivers meet, so clipping is rare; with the scale, normalized values are about 1.
_ZERO_TO_ONE = (0.0, 1.0, 1.0)
_SIDE = (-1.0, 1.0, 1.0)  # 1 is the overtaking side, -1 the kerb side.
_SPEED = (-100.0, 100.0, 30.0)
_ACCEL = (-20.0, 20.0, 5.0)
_TIME = (0.0, 600.0, 10.0)
_GAP = (-100.0, 300.0, 50.0)  # Without a vehicle the observed gap is 1000 m, which becomes 300 m.
_SIGHT = (-100.0, 1000.0, 200.0)
_RANGES: Final = {
    "speed": _SPEED,
    "requested_accel": _ACCEL,
    "s": (-1e5, 1e5, 1000.0),
    "lateral_position": (-100.0, 100.0, 10.0),
    "lane_offset": (-20.0, 20.0, 2.0),
    "heading": (-4.0, 4.0, 0.1),  # A little more than pi.
    "yaw_rate": (-20.0, 20.0, 0.1),
    "lane": (0.0, 8.0, 1.0),  # Lane index, 0 at the kerb.
    "stage": (0.0, float(max(Stage)), 1.0),
    "time_in_stage": _TIME,
    "time_waiting": _TIME,
    "time_indicating": _TIME,
    "wanted_side": _SIDE,
    "time_since_lane_change": _TIME,
    "gap": _GAP,
    "closing_speed": (-100.0, 100.0, 10.0),
    "accel": _ACCEL,
    "lateral_distance": (-100.0, 100.0, 5.0),
    "indicator": _SIDE,
    "length": (0.0, 50.0, 10.0),
    "oncoming.gap": _SIGHT,
    "second_oncoming.gap": _SIGHT,
    "sight_distance": _SIGHT,
    "expected_closing_speed": _SPEED,
    "gap_ahead_of_leader": _GAP,
    # Factor on the ego's gaps to the vehicle that it follows or passes on two-way roads: 2.2 for a
    # truck or van, which hides the road ahead, else 1.
    "tall_vehicle_gap_factor": (0.0, 5.0, 1.0),
    "return_urgency": _ZERO_TO_ONE,
    "abort_state": _ZERO_TO_ONE,
}
"""Lower bound, upper bound and scale by column name, or by group and name where groups differ.

Every column has an entry, except flags.
"""


def _range_of(group: str, name: str, unit: str) -> tuple[float, float, float]:
    """Lower bound, upper bound and scale of a column."""
    if unit == "flag":
        return _ZERO_TO_ONE
    full_name = f"{group}.{name}"
    return _RANGES[full_name if full_name in _RANGES else name]


def _columns() -> tuple[ObservationColumn, ...]:
    """All columns in the order in which the simulators fill a row."""
    groups = [
        ("ego", EGO_COLUMNS),
        *((role, NEIGHBOUR_COLUMNS) for role in NEIGHBOUR_ROLES),
        ("passing", PASSING_COLUMNS),
    ]
    return tuple(
        ObservationColumn(f"{group}.{name}", unit, *_range_of(group, name, unit))
        for group, columns in groups
        for name, (unit, _meaning) in columns.items()
    )


OBSERVATION_COLUMNS: Final = _columns()
"""The columns of an observation, in their order in a row."""

_LOW, _HIGH, _SCALE = (
    np.array([getattr(column, name) for column in OBSERVATION_COLUMNS], np.float32)
    for name in ("low", "high", "scale")
)


def flatten_observation(observation: EgoObservation, *, normalize: bool = False) -> F32:
    """The numbers of an observation as environments return them.

    With them, a network that was trained in an environment can drive in `overtaking.drive`.

    Args:
        observation: Observation that a reward or a driver of `overtaking.drive` gets.
        normalize: Whether to divide each column by its scale, as the environments did in training.

    Returns:
        A float32 array of shape (simulation, column).
    """
    return clip_observation(observation.table, normalize=normalize)


def clip_observation(table: F32, *, normalize: bool) -> F32:
    """Clip observations to their bounds.

    Args:
        table: Observations, shape (simulation, column), not changed.
        normalize: Whether to divide each column by its scale.

    Returns:
        A new array of the same shape.
    """
    clipped = np.clip(table, _LOW, _HIGH)
    # In place: with thousands of environments a second array costs time in every step.
    return np.divide(clipped, _SCALE, out=clipped) if normalize else clipped


def observation_space(*, normalize: bool) -> spaces.Box:
    """Gymnasium's space of the observations of one environment, float32 as the engine computes."""
    scale = _SCALE if normalize else np.float32(1.0)
    return spaces.Box(_LOW / scale, _HIGH / scale, dtype=np.float32)


def action_space(action: str) -> spaces.Box | spaces.Discrete:
    """Gymnasium's space of the actions of one environment.

    Args:
        action: Kind of the actions, a key of `ACTION_SPACES`. `decision` is one of `Move` (such as
            to pull out) and has a space of its own; a box holds the parts of all other kinds, such
            as acceleration and lane change.
    """
    if action == "decision":
        return spaces.Discrete(len(Move))
    parts = ACTION_SPACES[action].parts
    low, high = ([getattr(part, name) for part in parts] for name in ("low", "high"))
    return spaces.Box(np.array(low, np.float32), np.array(high, np.float32), dtype=np.float32)


def clip_actions(actions: Any, action: str, num_envs: int) -> ClippedAnswers:
    """Clip the actions of all environments to their limits.

    Args:
        actions: Actions, shape (env, part), or (env,) for a kind with one part.
        action: Kind of the actions, a key of `ACTION_SPACES`.
        num_envs: Number of environments.

    Raises:
        ConfigError: The actions have another shape, or are not finite.
    """
    parts = ACTION_SPACES[action].parts
    values = np.asarray(actions, np.float64)
    if values.shape == (num_envs,) and len(parts) == 1:
        values = values[:, None]
    has_shape = values.shape == (num_envs, len(parts))
    if not has_shape or not np.isfinite(values).all():
        raise ConfigError(
            what="actions",
            where="step",
            expected=f"finite numbers of shape ({num_envs}, {len(parts)})",
            got=values.tolist() if has_shape else f"shape {values.shape}",
            next_step="correct the agent",
        )
    return clip_to_limits(values, parts)
