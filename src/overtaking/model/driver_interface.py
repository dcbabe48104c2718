"""What a driver observes and answers: names, units, order."""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Final

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
    "stage": ("Stage", "What it is doing"),
    "stage_time": ("s", "For how long"),
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
    "detected": ("flag", "Somebody is seen there"),
    "gap": ("m", "Gap between the bumpers, negative alongside; far where nobody is seen"),
    "closing": ("m/s", "Speed of approach"),
    "accel": ("m/s^2", "Acceleration; of percepts how hard somebody ahead brakes, never positive"),
    "aside": ("m", "Distance of the centres across the road"),
    "indicator": ("1", "Side that it signals"),
    "brake_lamp": ("flag", "Its stop lamps are on"),
    "length": ("m", "Length"),
    "truck": ("flag", "It is a truck"),
    "two_wheeler": ("flag", "It is a motorcycle or bicycle"),
}
"""Unit and meaning of each number of a neighbour, zero where none is seen, but for the gap.

Sides are the ego's. Stop lamps of who comes towards it are not seen.
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
"""Neighbours: ahead and behind in its lane, in the next faster and slower one; who comes the other
way, and the next one behind that, where no vehicle is on roads that run one way."""

PASSING_COLUMNS: Final = {
    "sight": ("m", "How far it sees who comes: by the road, the weather and past the leader"),
    "sure": ("flag", "It has looked for long enough to know who comes, if anybody"),
    "expected": ("m/s", "Speed of approach that it expects of who comes, before it can tell"),
    "room": ("m", "Gap ahead of the leader, to whoever is next there"),
    "room_left": ("1", "Times the room that it leaves to a car at its return: to a truck more"),
    "solid": ("flag", "The line between the directions is not to be crossed here, or soon"),
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
"""Unit and meaning of each number about a pass against oncoming traffic, zero on roads that run one
way. They are the model driver's own, whatever is observed of others; a sensor measures no room."""

OBSERVATION_SIZE: Final = (
    len(EGO_COLUMNS) + len(NEIGHBOUR_ROLES) * len(NEIGHBOUR_COLUMNS) + len(PASSING_COLUMNS)
)
"""Numbers that a simulation has."""


def split_observation(table: F32) -> tuple[F32, F32, F32]:
    """The numbers of `OWN`, of each of `ROLES`, and of `MEETING`, as views of a whole table.

    Args:
        table: Shape (..., `WIDTH`).

    Returns:
        Shapes (..., `OWN`), (..., `ROLES`, `AROUND`) and (..., `MEETING`).
    """
    own, meeting = len(EGO_COLUMNS), OBSERVATION_SIZE - len(PASSING_COLUMNS)
    around = table[..., own:meeting].reshape(
        *table.shape[:-1], len(NEIGHBOUR_ROLES), len(NEIGHBOUR_COLUMNS)
    )
    return table[..., :own], around, table[..., meeting:]


class Move(IntEnum):
    """A decision of the ego; what is not possible is not done."""

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

Of the last two the indicator is a part: a `Move` shows the side that it names, and beside a wheel
angle the wish for a lane is what is shown and nothing else.
"""

MAX_ACTION_PARTS: Final = max(len(parts) for parts in ACTION_KINDS.values())
"""Numbers that the longest action has."""

_HASHED: Final = 2
"""Numbers in a hash at least, zero where an action has fewer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Actions(Batch):
    """What another driver did with the ego.

    Attributes:
        values: Steps of each number of the action at each decision, 20 a second; zero where the
            action has fewer and once the simulation is over. Shape (simulation, action,
            `MAX_ACTION_PARTS`).
        kind: A name in `ACTION_KINDS`.
        num_clipped: Answers that were beyond the limits of a part, shape (simulation,); None where
            it is not known, as in a data set, which holds what acted.
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
        """Where an action is not that of the decision before, shape (simulation, action)."""
        differs = np.ones(self.values.shape[:2], np.bool_)
        differs[:, 1:] = (np.diff(self.values, axis=1) != 0).any(axis=2)
        return differs

    @property
    def hashes(self) -> list[str]:
        """A hash over kind and changes of each simulation, 32 hexadecimal digits."""
        found: list[str] = []
        hashed = max(_HASHED, len(self.parts))
        for values, changed in zip(self.values, self.is_change, strict=True):
            at = np.flatnonzero(changed)
            rows = np.column_stack([at, values[at, :hashed]]).astype("<i4")
            content = self.kind.encode() + rows.tobytes()
            found.append(hashlib.blake2b(content, digest_size=16).hexdigest())
        return found

    @property
    def parts(self) -> tuple[ActionPart, ...]:
        """The numbers of each action."""
        return ACTION_KINDS[self.kind]

    def constraints(self) -> Iterable[Constraint]:
        """A known kind, and numbers within the limits of their parts."""
        unknown = np.array(self.kind not in ACTION_KINDS)
        yield Constraint("kind", f"one of {', '.join(ACTION_KINDS)}", unknown, np.array(self.kind))
        if unknown:
            return
        for k, part in enumerate(self.parts):
            numbers = self.values[:, :, k]
            least, most = round(part.low / part.resolution), round(part.high / part.resolution)
            wrong = (numbers < least) | (numbers > most)
            yield Constraint("values", f"{part.name} of {least} to {most} steps", wrong, numbers)
