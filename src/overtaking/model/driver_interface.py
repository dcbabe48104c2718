"""Observations and actions of an external driver of the ego: names, units, order and limits.

An external driver is a program of the user's, such as a Python function or a trained network. It
drives the ego, the vehicle under study, in place of the model driver, which is a part of the
simulation. At each decision (20 a second) it gets `OBSERVATION_SIZE` numbers for each simulation of
a batch, one row of a table, and answers with one action for each. Both implementations of the
model, the compiled engine and the reference in Python, fill the rows in the order of `EgoColumns`,
`NeighbourColumns` for each of `NEIGHBOUR_ROLES`, and `PassingColumns`. They carry out the kinds of
action in `ACTION_KINDS`; `Actions` is the record of the answers, from which a simulation can be
repeated. All observed values are float32, also codes and flags, so that they form one table.

The model driver continues to perceive and judge the traffic while an external driver drives. "The
driver" in the descriptions of columns is this model driver, whose beliefs the external driver
observes; only `requested_accel` and `wanted_side` follow the last action. The target is the vehicle
that the ego overtakes; the leader is the vehicle ahead in the ego's lane.
"""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Final, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, I32, I64, Mask
from overtaking.model.batch import Batch, Constraint, FieldSpec
from overtaking.model.neighbours import NeighbourRole


class ObservedValue(NamedTuple):
    """Unit and meaning of one column of an observation, for the reference page.

    Attributes:
        unit: Unit; "flag" for 0 or 1, "1" for other plain numbers, "Stage" for codes of the
            enumeration `model.trajectories.Stage`.
        meaning: A phrase without full stop.
    """

    unit: str
    meaning: str


class EgoColumns(NamedTuple):
    """Observed columns of the ego, each of shape (simulation,).

    Sides are 1 for the overtaking side and -1 for the kerb side, and positions across the road,
    headings and yaw rates grow towards the overtaking side, also in left-hand traffic. Positions
    across the road are 0 on the road's reference line. A column `can_…` says that the simulator
    would carry out the corresponding action now; otherwise this action has no effect. The codes of
    `stage` are 0 follow, 1 pull out, 2 pass, 3 return, 4 done, 5 abort, 6 crashed. `time_waiting`
    goes back to 0 when an overtake ends. While ego and target are alongside each other,
    `has_passed_target` is 0, and `is_behind_target` compares their centres; without a target both
    are 0. A simulation starts as if the ego had begun a lane change 10 s before and finished it:
    `time_since_lane_change` starts at 10 s, and `has_finished_lane_change` is 1.
    """

    speed: Annotated[F32, ObservedValue("m/s", "Speed along its longitudinal axis")]
    requested_accel: Annotated[F32, ObservedValue("m/s^2", "Acceleration that its driver requests")]
    s: Annotated[F32, ObservedValue("m", "Position of its centre along the road")]
    lateral_position: Annotated[F32, ObservedValue("m", "Position of its centre across the road")]
    lane_offset: Annotated[
        F32, ObservedValue("m", "Position of its centre across the road minus the centre of `lane`")
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
        F32, ObservedValue("s", "Time since the start of its last lane change")
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
    """Observed columns of one neighbour, each of shape (simulation,).

    The values are those that the model driver believes or that a sensor measures, as the user
    chooses. Where `is_detected` is 0, because there is no vehicle in this role or because it is not
    detected, all columns are zero except the gap, which is 1000 m (`perception.unseen_gap` in
    `model.toml`). `accel` is positive if the neighbour gains speed, in whichever direction it
    drives. Sides are as seen by the ego, also for oncoming vehicles: 1 is the ego's overtaking
    side. Stop lamps are at the rear, so oncoming vehicles show none.
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
    """Observed columns about a pass in the opposing lane, each of shape (simulation,).

    The columns are zero on one-way roads. On two-way roads they are what the model driver knows and
    judges, also if a sensor measures the columns of the neighbours; in this case
    `gap_ahead_of_leader` is zero, because sensors do not measure it. A tall vehicle is a truck or a
    van, over which the driver cannot look. `line_is_solid` covers the next 150 m
    (`oncoming.line_lookahead` in `model.toml`). In `return_urgency` and `abort_state` 0.5 is the
    code of the lesser of two states.
    """

    sight_distance: Annotated[
        F32,
        ObservedValue(
            "m",
            "Distance at which the ego sees an oncoming vehicle past the leader, by road and "
            "weather",
        ),
    ]
    is_certain: Annotated[
        F32,
        ObservedValue(
            "flag",
            "The ego's driver has watched long enough to know whether a vehicle is oncoming, and "
            "how fast",
        ),
    ]
    expected_closing_speed: Annotated[
        F32,
        ObservedValue(
            "m/s",
            "Closing speed that the driver expects of an oncoming vehicle whose speed it has not "
            "judged yet",
        ),
    ]
    gap_ahead_of_leader: Annotated[
        F32, ObservedValue("m", "Gap between the leader and the next vehicle ahead of it")
    ]
    tall_vehicle_gap_factor: Annotated[
        F32,
        ObservedValue(
            "1",
            "Factor on the gap that the driver leaves to the overtaken vehicle at the return, "
            "above 1 if that is a truck or van",
        ),
    ]
    line_is_solid: Annotated[
        F32,
        ObservedValue("flag", "The centre line must not be crossed here, or not soon after here"),
    ]
    return_urgency: Annotated[
        F32,
        ObservedValue(
            "1",
            "Haste of pedals and lane changes: 1 if little time would be left before the oncoming "
            "vehicle, 0.5 if the line would be solid at the return, else 0",
        ),
    ]
    abort_state: Annotated[
        F32,
        ObservedValue(
            "1",
            "Above 0 if the ego would not be past in time and falls back: 1 if it fits in behind "
            "the target, 0.5 while it is too fast or too near for that",
        ),
    ]
    can_abort_pass: Annotated[
        F32, ObservedValue("flag", "The ego is behind the target and can abort the pass")
    ]


ObservedColumns = type[EgoColumns] | type[NeighbourColumns] | type[PassingColumns]


def _declared_columns(columns: ObservedColumns) -> dict[str, ObservedValue]:
    """Unit and meaning of each column, by name in the order of the observation."""
    annotations = get_type_hints(columns, include_extras=True)
    # `F32` is itself `Annotated` with a dtype, so the `ObservedValue` is the last metadata.
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

They are leader, follower, left_leader, left_follower, right_leader, right_follower, oncoming and
second_oncoming. The first two are in the ego's lane, the next four in the lanes beside it, where
left is the overtaking side. The last two are the nearest oncoming vehicle and the next one behind
it; one-way roads have neither.
"""

OBSERVATION_SIZE: Final = (
    len(EGO_COLUMNS) + len(NEIGHBOUR_ROLES) * len(NEIGHBOUR_COLUMNS) + len(PASSING_COLUMNS)
)
"""Number of values in the observation of one simulation: 22 + 8 * 10 + 9 = 111."""


class SplitObservation(NamedTuple):
    """The three parts of a table of observations, as views of it.

    Attributes:
        ego: Columns of the ego, shape (..., 22) in the order of `EGO_COLUMNS`.
        neighbours: Columns of each neighbour, shape (..., 8, 10) in the orders of `NEIGHBOUR_ROLES`
            and `NEIGHBOUR_COLUMNS`.
        passing: Columns about a pass, shape (..., 9) in the order of `PASSING_COLUMNS`.
    """

    ego: F32
    neighbours: F32
    passing: F32


def split_observation(table: F32) -> SplitObservation:
    """Split a table of observations into ego, neighbours and pass.

    Args:
        table: Observations, shape (..., `OBSERVATION_SIZE`).

    Returns:
        Views of the table: a simulator writes through them, an external driver reads.
    """
    ego_end, passing_start = len(EGO_COLUMNS), OBSERVATION_SIZE - len(PASSING_COLUMNS)
    neighbours = table[..., ego_end:passing_start].reshape(
        *table.shape[:-1], len(NEIGHBOUR_ROLES), len(NEIGHBOUR_COLUMNS)
    )
    return SplitObservation(table[..., :ego_end], neighbours, table[..., passing_start:])


class SteppedObservation(NamedTuple):
    """Observations of the egos of a batch after the decisions of one call of a stepper.

    Attributes:
        table: Observations of the egos, shape (simulation, `OBSERVATION_SIZE`). A simulation that
            ended during the call is observed at its end; one that ended earlier has zeros.
        is_running: Whether each simulation continues, shape (simulation,).
        num_decisions: Number of decisions that each simulation carried out in this call, shape
            (simulation,).
    """

    table: F32
    is_running: Mask
    num_decisions: NDArray[np.uint32]


class Move(IntEnum):
    """A choice of the ego's driver at a decision. A move that is impossible has no effect."""

    KEEP = 0
    """Stay in the lane, or complete the lane change.

    In the lane, an indicator that is on stays on for a while, so that a brief hesitation does not
    switch it off: `time_indicating`, which counts up while the driver indicates, now counts down,
    and the indicator goes off at 0."""
    INDICATE_PULL_OUT = 1
    """Indicate a lane change to the overtaking side."""
    PULL_OUT = 2
    """Indicate a lane change to the overtaking side and begin it now."""
    INDICATE_RETURN = 3
    """Indicate a lane change to the kerb side."""
    RETURN = 4
    """Indicate a lane change to the kerb side and begin it now."""
    CANCEL = 5
    """During a lane change, turn back to the lane that it began in. During a pass in the opposing
    lane, fall back behind the target, if the ego is still behind it."""


@dataclass(frozen=True, slots=True)
class ActionPart:
    """One number of an action.

    A driver answers with floats. They are clipped to the limits and rounded to whole steps before
    they act, and the steps are recorded as integers, so that the same record gives the same
    simulation on every machine.

    Attributes:
        name: Its name.
        unit: Its unit; "Move" for codes of that enumeration.
        resolution: Size of a step, in the unit.
        low: Smallest value, in the unit.
        high: Largest value, in the unit.
    """

    name: str
    unit: str
    resolution: float
    low: float
    high: float


# Accelerations and angles are recorded as finely as the states of vehicles (`model.trajectories`).
# Their limits are chosen: twice the acceleration that tyres transmit on a dry road, and a larger
# wheel angle than an overtake needs, so they clip only answers that a vehicle could not carry out.
_ACCEL = ActionPart("accel", "m/s^2", 1e-3, -20.0, 20.0)
_LANE_CHANGE = ActionPart("lane_change", "lanes towards the overtaking side", 1.0, -1.0, 1.0)
_MOVE = ActionPart("move", "Move", 1.0, min(Move), max(Move))
_WHEEL_ANGLE = ActionPart("wheel_angle", "rad towards the overtaking side", 1e-4, -0.8, 0.8)

ACTION_KINDS: Final[dict[str, tuple[ActionPart, ...]]] = {
    "decision": (_MOVE,),
    "accel_lane": (_ACCEL, _LANE_CHANGE),
    "accel_steer": (_ACCEL, _WHEEL_ANGLE),
    "accel_move": (_ACCEL, _MOVE),
    "accel_steer_signal": (_ACCEL, _WHEEL_ANGLE, _LANE_CHANGE),
}
"""The numbers of each kind of action that the simulators carry out, by the name of the kind.

The model driver does the rest. Without `accel` it uses the pedals. Without `wheel_angle` it steers,
also along a lane change that `lane_change` or `move` begins.

In "decision" and "accel_lane" the model driver sets the indicator to the side of the `Move` or of
`lane_change`, if that lane change is possible and the driver uses the indicator at all
(`DriverTraits.uses_indicator`). In "accel_lane" it indicates for its usual time before it begins
the lane change; if `lane_change` becomes 0 earlier, the lane change does not begin. In
"accel_steer" it indicates only during a lane change, because nothing announces one. In the other
two kinds the indicator is part of the answer, also for a driver who does not use it. In
"accel_move" a `Move` with a side sets it to that side. In "accel_steer_signal" `lane_change` sets
the indicator only, because the wheel angle changes lanes.
"""

MAX_ACTION_PARTS: Final = max(len(parts) for parts in ACTION_KINDS.values())
"""Number of parts of the longest action: 3."""

_MIN_HASHED_PARTS: Final = 2
"""Smallest number of parts that a hash takes of an action. For the kind "decision", which has one
part, the hash includes the zero beside it, because recorded hashes were computed in this way."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Actions(Batch):
    """Actions of an external driver, which drives the ego instead of the model driver.

    Attributes:
        values: Each part of the action at each decision, as a number of steps of
            `ActionPart.resolution`, shape (simulation, action, `MAX_ACTION_PARTS`). Zero for parts
            that the kind of action does not have, and after the end of a simulation. Index 0 of the
            action axis is the first decision; decisions follow every 0.05 s.
        kind: A name in `ACTION_KINDS`, the same for all simulations.
        num_clipped: Number of actions that were clipped to the limits of a part, shape
            (simulation,); None if unknown, as in a data set, which holds the clipped actions.
    """

    values: Annotated[I32, FieldSpec(axes=("simulation", "action", MAX_ACTION_PARTS))]
    kind: str
    num_clipped: Annotated[I64 | None, FieldSpec(axes=("simulation",))] = None

    @classmethod
    def empty(cls, num_simulations: int) -> "Actions":
        """A record without any action; its kind, the first one, describes no value."""
        return cls(
            values=np.zeros((num_simulations, 0, MAX_ACTION_PARTS), np.int32),
            kind=next(iter(ACTION_KINDS)),
        )

    @property
    def is_change(self) -> NDArray[np.bool_]:
        """Whether an action differs from the previous one, shape (simulation, action).

        The first action counts as a change. The table `actions` of a data set stores only changes.
        """
        is_change = np.ones(self.values.shape[:2], np.bool_)
        is_change[:, 1:] = (np.diff(self.values, axis=1) != 0).any(axis=2)
        return is_change

    @property
    def hashes(self) -> list[str]:
        """A hash over the kind and the changes of action of each simulation.

        Each hash has 128 bits, written as 32 hexadecimal digits. Simulations with equal hashes have
        the same kind and the same changes; repetitions of the last action do not count. The zeros
        after the end of a simulation count as a change, if the action axis continues beyond the
        end. This axis is as long as the longest horizon of the batch. So a simulation that runs to
        its horizon has another hash in a batch with a longer horizon. All simulations of one
        specification have the same horizon.
        """
        hashes: list[str] = []
        num_parts = max(_MIN_HASHED_PARTS, len(self.parts))
        for values, is_change in zip(self.values, self.is_change, strict=True):
            decisions = np.flatnonzero(is_change)
            # Little-endian integers give the same bytes on every machine.
            rows = np.column_stack([decisions, values[decisions, :num_parts]]).astype("<i4")
            content = self.kind.encode() + rows.tobytes()
            hashes.append(hashlib.blake2b(content, digest_size=16).hexdigest())
        return hashes

    @property
    def parts(self) -> tuple[ActionPart, ...]:
        """The declarations of the numbers of each action."""
        return ACTION_KINDS[self.kind]

    def constraints(self) -> Iterable[Constraint]:
        """Conditions for recorded actions: a known kind, and numbers within their limits."""
        is_unknown = np.array(self.kind not in ACTION_KINDS)
        expected = f"one of {', '.join(ACTION_KINDS)}"
        yield Constraint("kind", expected, is_unknown, np.array(self.kind))
        if is_unknown:
            return
        for k, part in enumerate(self.parts):
            steps = self.values[:, :, k]
            low, high = round(part.low / part.resolution), round(part.high / part.resolution)
            is_outside = (steps < low) | (steps > high)
            expected = f"{part.name} of {low} to {high} steps"
            yield Constraint("values", expected, is_outside, steps)
