"""Observations and actions of a driver: names, units, order."""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, I32, I64
from overtaking.model.batch import Batch, Constraint, FieldSpec

EGO_COLUMNS: Final = {
    "speed": ("m/s", "Speed along its axis"),
    "accel": ("m/s^2", "Acceleration that it asks for"),
    "position": ("m", "Position along the road"),
    "lateral": ("m", "Position across the road"),
    "offset": ("m", "Offset from the centre of the lane it drives in or changes to"),
    "heading": ("rad", "Heading from the road"),
    "yaw_rate": ("rad/s", "Turning rate"),
    "lane": ("1", "Lane it drives in or changes to, 0 is the slowest"),
    "stage": ("Stage", "Stage of its overtake"),
    "stage_time": ("s", "Time in this stage"),
    "waited": ("s", "Time behind a slower leader so far"),
    "signalled": ("s", "For how long it has signalled the next lane change"),
    "wanted": ("1", "Side that it signals"),
    "since_change": ("s", "Time since its last lane change began"),
    "arrived": ("flag", "The last lane change is over"),
    "looks": ("flag", "It looks into the mirrors now"),
    "contested": ("flag", "Another signals for the same place and goes first"),
    "passed": ("flag", "The vehicle that is overtaken is behind"),
    "behind_target": ("flag", "The vehicle that is overtaken is ahead"),
    "can_go_out": ("flag", "It can change to a faster lane"),
    "can_go_back": ("flag", "It can change to a slower lane"),
    "can_abort": ("flag", "It can give up the lane change that has begun"),
}
"""Unit and meaning of each number of the ego; sides and angles grow towards the fast side."""

NEIGHBOUR_COLUMNS: Final = {
    "detected": ("flag", "The driver sees a vehicle in this role"),
    "gap": ("m", "Gap between the bumpers, negative alongside; far without a vehicle"),
    "closing": ("m/s", "Speed of approach"),
    "accel": ("m/s^2", "Acceleration; in percepts the braking of a vehicle ahead, never positive"),
    "aside": ("m", "Distance of the centres across the road"),
    "indicator": ("1", "Side that it signals"),
    "brake_lamp": ("flag", "Its stop lamps are on"),
    "length": ("m", "Length"),
    "truck": ("flag", "It is a truck"),
    "two_wheeler": ("flag", "It is a motorcycle or bicycle"),
}
"""Unit and meaning of each number of a neighbour. Without a vehicle all but the gap are zero.

Sides are those as the ego sees them. The ego sees no stop lamps of oncoming vehicles.
"""

NEIGHBOUR_ROLES: Final = (
    "lead",
    "rear",
    "fast_lead",
    "fast_rear",
    "slow_lead",
    "slow_rear",
    "oncoming",
    "behind_oncoming",
)
"""Neighbours ahead and behind in the ego's lane, in the next faster and in the next slower lane;
then the nearest oncoming vehicle and the one behind it, which one-way roads do not have."""

PASSING_COLUMNS: Final = {
    "sight": (
        "m",
        "Distance at which it sees an oncoming vehicle, by road and weather, past the leader",
    ),
    "sure": ("flag", "It has looked long enough to know whether a vehicle comes, and its speed"),
    "expected": (
        "m/s",
        "Expected speed of approach of an oncoming vehicle that it cannot judge yet",
    ),
    "room": ("m", "Gap between the leader and the next vehicle ahead of it"),
    "room_left": (
        "1",
        "Factor on the gap that it leaves at its return, larger for a truck than a car",
    ),
    "solid": ("flag", "The line between the directions must not be crossed here, or soon"),
    "hurries": (
        "1",
        "Its pedals and lane changes are hasty: 1 where little time would be left, 0.5 "
        "where the line would be solid at its return",
    ),
    "yields": (
        "1",
        "It would not be past in time, and its pedals fall back: 1 where it fits in behind the "
        "vehicle that is overtaken, 0.5 while it is too fast or too near for that",
    ),
    "can_fall_in": ("flag", "It is behind the vehicle that is overtaken, and can give up the pass"),
}
"""Unit and meaning of each number about a pass against oncoming traffic, zero on one-way roads.

They are always beliefs of the model driver, also where a sensor measures the neighbours."""

OBSERVATION_SIZE: Final = (
    len(EGO_COLUMNS) + len(NEIGHBOUR_ROLES) * len(NEIGHBOUR_COLUMNS) + len(PASSING_COLUMNS)
)
"""Numbers in the observation of one simulation."""


class SplitObservation(NamedTuple):
    """The three parts of observations, as views of their table.

    Attributes:
        ego: Numbers of the ego, shape (..., `EGO_COLUMNS`).
        neighbours: Numbers of each neighbour, shape (..., `NEIGHBOUR_ROLES`, `NEIGHBOUR_COLUMNS`).
        passing: Numbers about a pass against oncoming traffic, shape (..., `PASSING_COLUMNS`).
    """

    ego: F32
    neighbours: F32
    passing: F32


def split_observation(table: F32) -> SplitObservation:
    """Observations by their three parts.

    Args:
        table: Observations, shape (..., `OBSERVATION_SIZE`).
    """
    ego_end, passing_start = len(EGO_COLUMNS), OBSERVATION_SIZE - len(PASSING_COLUMNS)
    neighbours = table[..., ego_end:passing_start].reshape(
        *table.shape[:-1], len(NEIGHBOUR_ROLES), len(NEIGHBOUR_COLUMNS)
    )
    return SplitObservation(table[..., :ego_end], neighbours, table[..., passing_start:])


class Move(IntEnum):
    """A decision of the ego. Impossible moves have no effect."""

    KEEP = 0
    """Go on as before; an indicator that is on fades."""
    SHOW_OUT = 1
    """Signal towards the faster lane."""
    PULL_OUT = 2
    """Signal, and move over now."""
    SHOW_BACK = 3
    """Signal towards the slower lane."""
    RETURN = 4
    """Signal, and move over now."""
    ABORT = 5
    """Give up the lane change that has begun."""


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
