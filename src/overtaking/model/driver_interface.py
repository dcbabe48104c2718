"""Observations and actions of a driver: names, units, order."""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Final, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, I32, I64
from overtaking.model.batch import Batch, Constraint, FieldSpec
from overtaking.model.neighbours import NeighbourRole


class ObservedValue(NamedTuple):
    """Declaration of one column of an observation.

    Attributes:
        unit: Unit; "flag" for 0 or 1, "1" for other plain numbers, "Stage" for its codes.
        meaning: A phrase without full stop.
    """

    unit: str
    meaning: str


class EgoColumns(NamedTuple):
    """Observed columns of the ego.

    Sides are 1 for the overtaking side and -1 for the kerb side, and positions across the road,
    headings and yaw rates grow towards the overtaking side, also in left-hand traffic.
    """

    speed: Annotated[F32, ObservedValue("m/s", "Speed along its longitudinal axis")]
    requested_accel: Annotated[F32, ObservedValue("m/s^2", "Acceleration that its driver requests")]
    s: Annotated[F32, ObservedValue("m", "Position of its centre along the road")]
    lateral_position: Annotated[F32, ObservedValue("m", "Position of its centre across the road")]
    lane_offset: Annotated[
        F32, ObservedValue("m", "Distance from the centre of the lane `lane` to its centre")
    ]
    heading: Annotated[F32, ObservedValue("rad", "Heading relative to the road")]
    yaw_rate: Annotated[F32, ObservedValue("rad/s", "Yaw rate")]
    lane: Annotated[
        F32, ObservedValue("1", "Lane in which it drives or to which it changes; 0 at the kerb")
    ]
    stage: Annotated[F32, ObservedValue("Stage", "Stage of its overtake")]
    time_in_stage: Annotated[F32, ObservedValue("s", "Time since this stage began")]
    time_waiting: Annotated[F32, ObservedValue("s", "Time behind a slower leader so far")]
    time_indicating: Annotated[
        F32, ObservedValue("s", "Time for which it has indicated the next lane change")
    ]
    wanted_side: Annotated[
        F32, ObservedValue("1", "Side to which its driver wants to change; 0 for neither")
    ]
    time_since_lane_change: Annotated[
        F32, ObservedValue("s", "Time since its last lane change began")
    ]
    has_finished_lane_change: Annotated[
        F32, ObservedValue("flag", "The last lane change is finished")
    ]
    checks_mirrors: Annotated[F32, ObservedValue("flag", "Its driver checks the mirrors now")]
    gives_way: Annotated[
        F32,
        ObservedValue("flag", "Another vehicle indicates a change to the same gap and goes first"),
    ]
    has_passed_target: Annotated[
        F32, ObservedValue("flag", "The target, which it overtakes, is behind it")
    ]
    is_behind_target: Annotated[F32, ObservedValue("flag", "The target is ahead of it")]
    can_pull_out: Annotated[
        F32, ObservedValue("flag", "It can change to the next lane on the overtaking side")
    ]
    can_return: Annotated[
        F32, ObservedValue("flag", "It can change to the next lane on the kerb side")
    ]
    can_cancel_lane_change: Annotated[
        F32, ObservedValue("flag", "It can cancel the lane change that it has begun")
    ]


class NeighbourColumns(NamedTuple):
    """Observed columns of one neighbour.

    Without a vehicle all columns are zero except the gap, which is large. Sides are as
    seen by the ego, also for oncoming vehicles.
    """

    is_detected: Annotated[
        F32, ObservedValue("flag", "The driver or sensor detects a vehicle in this role")
    ]
    gap: Annotated[F32, ObservedValue("m", "Gap between the bumpers; negative alongside")]
    closing_speed: Annotated[F32, ObservedValue("m/s", "Speed at which the gap shrinks")]
    accel: Annotated[
        F32,
        ObservedValue(
            "m/s^2",
            "Acceleration; a human driver observes only the braking of a vehicle ahead",
        ),
    ]
    lateral_distance: Annotated[
        F32, ObservedValue("m", "Position of its centre across the road minus the ego's")
    ]
    indicator: Annotated[F32, ObservedValue("1", "Side that it indicates; 0 for neither")]
    stop_lamp: Annotated[
        F32,
        ObservedValue("flag", "Its stop lamps are on; always 0 for oncoming vehicles"),
    ]
    length: Annotated[F32, ObservedValue("m", "Length")]
    is_truck: Annotated[F32, ObservedValue("flag", "It is a truck")]
    is_two_wheeler: Annotated[F32, ObservedValue("flag", "It is a motorcycle or bicycle")]


class PassingColumns(NamedTuple):
    """Observed columns of a pass against oncoming traffic.

    The columns are zero on one-way roads. They are always beliefs of the model driver, also where a
    sensor measures the neighbours.
    """

    sight_distance: Annotated[
        F32,
        ObservedValue(
            "m",
            "Distance at which it sees an oncoming vehicle past the leader, by road and weather",
        ),
    ]
    is_certain: Annotated[
        F32,
        ObservedValue(
            "flag",
            "It has watched long enough to know whether a vehicle is oncoming, and how fast",
        ),
    ]
    expected_closing_speed: Annotated[
        F32,
        ObservedValue("m/s", "Closing speed that it expects of an oncoming vehicle not judged yet"),
    ]
    gap_ahead_of_leader: Annotated[
        F32, ObservedValue("m", "Gap between the leader and the next vehicle ahead of it")
    ]
    tall_vehicle_gap_factor: Annotated[
        F32,
        ObservedValue("1", "Factor on the gap that it leaves at its return, above 1 for trucks"),
    ]
    line_is_solid: Annotated[
        F32,
        ObservedValue("flag", "The centre line must not be crossed here, or not soon after here"),
    ]
    return_urgency: Annotated[
        F32,
        ObservedValue(
            "1",
            "Haste of pedals and lane changes: 1 if little time would be left, 0.5 if the line "
            "would be solid at its return",
        ),
    ]
    abort_state: Annotated[
        F32,
        ObservedValue(
            "1",
            "Above 0 if it would not be past in time and falls back: 1 if it fits in behind the "
            "target, 0.5 while it is too fast or too near for that",
        ),
    ]
    can_abort_pass: Annotated[
        F32, ObservedValue("flag", "It is behind the target and can abort the pass")
    ]


ObservedColumns = type[EgoColumns] | type[NeighbourColumns] | type[PassingColumns]


def _declared_columns(columns: ObservedColumns) -> dict[str, ObservedValue]:
    """Unit and meaning of each column, by name in the order of the observation."""
    annotations = get_type_hints(columns, include_extras=True)
    return {name: annotations[name].__metadata__[-1] for name in columns._fields}


EGO_COLUMNS: Final = _declared_columns(EgoColumns)
"""Unit and meaning of each column of the ego, in order."""

NEIGHBOUR_COLUMNS: Final = _declared_columns(NeighbourColumns)
"""Unit and meaning of each column of a neighbour, in order."""

PASSING_COLUMNS: Final = _declared_columns(PassingColumns)
"""Unit and meaning of each column about a pass, in order."""

NEIGHBOUR_ROLES: Final = (
    *(role.name.lower() for role in NeighbourRole),
    "oncoming",
    "second_oncoming",
)
"""Roles of the observed neighbours, in order.

After the six neighbours come the nearest oncoming vehicle and the one behind it; one-way roads have
neither.
"""

OBSERVATION_SIZE: Final = (
    len(EGO_COLUMNS) + len(NEIGHBOUR_ROLES) * len(NEIGHBOUR_COLUMNS) + len(PASSING_COLUMNS)
)
"""Number of values in the observation of one simulation."""


class SplitObservation(NamedTuple):
    """The three parts of a table of observations, as views of it.

    Attributes:
        ego: Columns of the ego, shape (..., `EGO_COLUMNS`).
        neighbours: Columns of each neighbour, shape (..., `NEIGHBOUR_ROLES`, `NEIGHBOUR_COLUMNS`).
        passing: Columns about a pass against oncoming traffic, shape (..., `PASSING_COLUMNS`).
    """

    ego: F32
    neighbours: F32
    passing: F32


def split_observation(table: F32) -> SplitObservation:
    """Split a table of observations into ego, neighbours and pass.

    Args:
        table: Observations, shape (..., `OBSERVATION_SIZE`).

    Returns:
        Views of the table.
    """
    ego_end, passing_start = len(EGO_COLUMNS), OBSERVATION_SIZE - len(PASSING_COLUMNS)
    neighbours = table[..., ego_end:passing_start].reshape(
        *table.shape[:-1], len(NEIGHBOUR_ROLES), len(NEIGHBOUR_COLUMNS)
    )
    return SplitObservation(table[..., :ego_end], neighbours, table[..., passing_start:])


class Move(IntEnum):
    """A decision of the ego. Impossible moves have no effect."""

    KEEP = 0
    """Go on as before; an indicator that is on goes off."""
    INDICATE_PULL_OUT = 1
    """Indicate a lane change to the overtaking side."""
    PULL_OUT = 2
    """Indicate and begin it now."""
    INDICATE_RETURN = 3
    """Indicate a lane change to the kerb side."""
    RETURN = 4
    """Indicate and begin it now."""
    CANCEL = 5
    """Turn back within the lane change, or abort a pass while still behind the target."""


@dataclass(frozen=True, slots=True)
class ActionPart:
    """One number of an action.

    Attributes:
        name: Its name.
        unit: Its unit.
        resolution: Size of a step of the number that acts and is recorded.
        low: Smallest value.
        high: Largest value.
    """

    name: str
    unit: str
    resolution: float
    low: float
    high: float


_ACCEL = ActionPart("accel", "m/s^2", 1e-3, -20.0, 20.0)
_LANE = ActionPart("lane_change", "lanes towards the fast side", 1.0, -1.0, 1.0)
_MOVE = ActionPart("move", "Move", 1.0, min(Move), max(Move))
_WHEEL = ActionPart("wheel_angle", "rad towards the fast side", 1e-4, -0.8, 0.8)

ACTION_KINDS: Final[dict[str, tuple[ActionPart, ...]]] = {
    "decision": (_MOVE,),
    "accel_lane": (_ACCEL, _LANE),
    "accel_steer": (_ACCEL, _WHEEL),
    "accel_move": (_ACCEL, _MOVE),
    "accel_steer_signal": (_ACCEL, _WHEEL, _LANE),
}
"""The numbers of each kind of action that the simulators carry out.

The last two include the indicator: a `Move` sets it to the side that it names, and beside a wheel
angle `lane_change` only sets the indicator.
"""

MAX_ACTION_PARTS: Final = max(len(parts) for parts in ACTION_KINDS.values())
"""Numbers in the longest action."""

_MIN_HASHED_PARTS: Final = 2
"""Smallest number of values that a hash takes of an action. For an action of one number the hash
includes a zero, as in earlier data sets."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Actions(Batch):
    """Actions of an external driver, which drives the ego instead of the model driver.

    Attributes:
        values: Steps of each number of the action at each decision, 20 a second; zero where the
            action has fewer and once the simulation is over. Shape (simulation, action,
            `MAX_ACTION_PARTS`).
        kind: A name in `ACTION_KINDS`.
        num_clipped: Number of actions that were clipped to the limits of a part, shape
            (simulation,); None if unknown, as in a data set, which holds the clipped actions.
    """

    values: Annotated[I32, FieldSpec(axes=("simulation", "action", MAX_ACTION_PARTS))]
    kind: str
    num_clipped: Annotated[I64 | None, FieldSpec(axes=("simulation",))] = None

    @classmethod
    def empty(cls, simulations: int) -> "Actions":
        """No action in any simulation."""
        return cls(
            values=np.zeros((simulations, 0, MAX_ACTION_PARTS), np.int32),
            kind=next(iter(ACTION_KINDS)),
        )

    @property
    def is_change(self) -> NDArray[np.bool_]:
        """Whether an action differs from the previous one, shape (simulation, action)."""
        differs = np.ones(self.values.shape[:2], np.bool_)
        differs[:, 1:] = (np.diff(self.values, axis=1) != 0).any(axis=2)
        return differs

    @property
    def hashes(self) -> list[str]:
        """A hash over kind and changes of each simulation, 32 hexadecimal digits."""
        hashes: list[str] = []
        num_parts = max(_MIN_HASHED_PARTS, len(self.parts))
        for values, is_change in zip(self.values, self.is_change, strict=True):
            actions = np.flatnonzero(is_change)
            rows = np.column_stack([actions, values[actions, :num_parts]]).astype("<i4")
            content = self.kind.encode() + rows.tobytes()
            hashes.append(hashlib.blake2b(content, digest_size=16).hexdigest())
        return hashes

    @property
    def parts(self) -> tuple[ActionPart, ...]:
        """The numbers of each action."""
        return ACTION_KINDS[self.kind]

    def constraints(self) -> Iterable[Constraint]:
        """A known kind, and numbers within the limits of their parts."""
        is_unknown = np.array(self.kind not in ACTION_KINDS)
        expected = f"one of {', '.join(ACTION_KINDS)}"
        yield Constraint("kind", expected, is_unknown, np.array(self.kind))
        if is_unknown:
            return
        for k, part in enumerate(self.parts):
            numbers = self.values[:, :, k]
            low, high = round(part.low / part.resolution), round(part.high / part.resolution)
            is_outside = (numbers < low) | (numbers > high)
            expected = f"{part.name} of {low} to {high} steps"
            yield Constraint("values", expected, is_outside, numbers)
