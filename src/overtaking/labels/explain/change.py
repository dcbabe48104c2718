"""What would have had to be different for a rule to hold."""

from dataclasses import dataclass
from enum import StrEnum


class Quantity(StrEnum):
    """What would have had to be different."""

    GAP_AHEAD = "gap_ahead"  # Between the bumpers of the ego and a vehicle ahead.
    GAP_BEHIND = "gap_behind"  # Between the bumpers of the ego and a vehicle behind.
    GAP_ONCOMING = "gap_oncoming"  # Between the ego and a vehicle that comes towards it.
    LATERAL_GAP = "lateral_gap"  # Between the sides of ego and target.
    CLEARANCE = "clearance"  # Between a body and a line, negative beyond what is tolerated.
    SPEED = "speed"  # Of the ego.
    LANES_LEFT = "lanes_left"  # How many lanes to the left of the target the ego passes it.
    LANE = "lane"  # Index of the ego's lane, 0 the slowest.
    TIME_OUT = "time_out"  # Time outside the original lane while the return was due.
    ARRIVAL = "arrival"  # Time until the next vehicle on the left is beside the ego.
    SIGHT = "sight"  # How far one sees.
    WIDTH = "width"  # Of the lane on the left.
    UNSIGNALLED = "unsignalled"  # Time without the indicator that is due.
    WRONG_LAMPS = "wrong_lamps"  # Time with lamps that are wrong.
    TARGET_DRIFT = "target_drift"  # Speed of the target to the left.
    TARGET_ACCEL = "target_accel"  # Acceleration of the target.


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One quantity as it was, and as it would have been lawful.

    Attributes:
        quantity: What it is.
        unit: Of both values.
        actual: As it was.
        needed: The nearest lawful value.
        frame: Where it was farthest from lawful; None for a sum over the breach.
        vehicle: Slot of the other vehicle that it is about, None if it is about none.
    """

    quantity: Quantity
    unit: str
    actual: float
    needed: float
    frame: int | None = None
    vehicle: int | None = None

    @property
    def by(self) -> float:
        """How much more would have been lawful; less, if negative."""
        return self.needed - self.actual


Remedy = tuple[Change, ...]
"""Changes that together would have kept a rule, everything else being as it was."""
