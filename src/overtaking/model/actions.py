"""What another driver asks of the ego, as whole numbers of stated steps."""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import I32, I64
from overtaking.model.batch import Batch, Constraint
from overtaking.model.values import along


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
class Part:
    """One number of an action.

    Attributes:
        name: Its name.
        unit: Its unit.
        step: Size of a step of the number that acts and is recorded.
        least: Smallest value.
        most: Largest value.
    """

    name: str
    unit: str
    step: float
    least: float
    most: float


_ACCEL = Part("accel", "m/s^2", 1e-3, -20.0, 20.0)
_LANE = Part("lane_change", "lanes towards the fast side", 1.0, -1.0, 1.0)

_MOVE = Part("move", "Move", 1.0, min(Move), max(Move))
_WHEEL = Part("wheel_angle", "rad towards the fast side", 1e-4, -0.8, 0.8)

KINDS: Final[dict[str, tuple[Part, ...]]] = {
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

MOST_PARTS: Final = max(len(parts) for parts in KINDS.values())
"""Numbers that the longest action has."""

_HASHED: Final = 2
"""Numbers in a hash at least, zero where an action has fewer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Actions(Batch):
    """What another driver did with the ego.

    Attributes:
        values: Steps of each number of the action at each decision, 20 a second; zero where the
            action has fewer and once the simulation is over. Shape (simulation, action,
            `MOST_PARTS`).
        kind: A name in `KINDS`.
        clipped: Answers that were beyond the limits of a part, shape (simulation,); None where it
            is not known, as in a data set, which holds what acted.
    """

    values: Annotated[I32, along("simulation", "action", MOST_PARTS)]
    kind: str
    clipped: Annotated[I64 | None, along("simulation")] = None

    @classmethod
    def none(cls, simulations: int) -> "Actions":
        """No action in any simulation."""
        return cls(values=np.zeros((simulations, 0, MOST_PARTS), np.int32), kind=next(iter(KINDS)))

    @property
    def changes(self) -> NDArray[np.bool_]:
        """Where an action is not that of the decision before, shape (simulation, action)."""
        differs = np.ones(self.values.shape[:2], np.bool_)
        differs[:, 1:] = (np.diff(self.values, axis=1) != 0).any(axis=2)
        return differs

    @property
    def hashes(self) -> list[str]:
        """A hash over kind and changes of each simulation, 32 hexadecimal digits."""
        found: list[str] = []
        hashed = max(_HASHED, len(self.parts))
        for values, changed in zip(self.values, self.changes, strict=True):
            at = np.flatnonzero(changed)
            rows = np.column_stack([at, values[at, :hashed]]).astype("<i4")
            content = self.kind.encode() + rows.tobytes()
            found.append(hashlib.blake2b(content, digest_size=16).hexdigest())
        return found

    @property
    def parts(self) -> tuple[Part, ...]:
        """The numbers of each action."""
        return KINDS[self.kind]

    def constraints(self) -> Iterable[Constraint]:
        """A known kind, and numbers within the limits of their parts."""
        unknown = np.array(self.kind not in KINDS)
        yield Constraint("kind", f"one of {', '.join(KINDS)}", unknown, np.array(self.kind))
        if unknown:
            return
        for k, part in enumerate(self.parts):
            numbers = self.values[:, :, k]
            least, most = round(part.least / part.step), round(part.most / part.step)
            wrong = (numbers < least) | (numbers > most)
            yield Constraint("values", f"{part.name} of {least} to {most} steps", wrong, numbers)
