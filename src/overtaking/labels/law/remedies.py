"""Changes that would have kept a broken rule, and the breach from which they are computed.

`Criterion.remedies` returns a tuple of alternatives. So a function here that makes one remedy
returns it in a tuple. The margin of a rule is the distance from its limit, negative in a breach.
The ego is the vehicle under study, the target the vehicle that it overtakes; left is the overtaking
side.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Self

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, IndexArray
from overtaking.core.float32_math import TWO, as_f32
from overtaking.labels.law.numbers import ABRUPT_BRAKING, REACTION_TIME
from overtaking.labels.law.safe_distance import GapMargin, decel_for_safe_distance
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.model.verdicts import Case
from overtaking.world.road_surface import stoppable_speed

NO_SPEED = np.float32(-1.0)
"""Stands for a lawful speed where no speed is lawful [m/s]."""


class RemedyQuantity(StrEnum):
    """Quantities that a remedy changes, with the unit of their values."""

    GAP_AHEAD = "gap_ahead", "m"  # Between the bumpers of the ego and a vehicle ahead.
    GAP_BEHIND = "gap_behind", "m"  # Between the bumpers of the ego and a vehicle behind.
    GAP_ONCOMING = "gap_oncoming", "m"  # Between the ego and an oncoming vehicle.
    GAP_TO_RETURN = "gap_to_return", "m"  # Between the vehicles that the ego returns between.
    LATERAL_GAP = "lateral_gap", "m"  # Between the sides of ego and target.
    # From the side of a vehicle to the line that it must not cross; negative beyond the line.
    CLEARANCE = "clearance", "m"
    SPEED = "speed", "m/s"  # Of the ego.
    LANES_LEFT = "lanes_left", "lanes"  # Lanes by which the ego is left of the target.
    LANE = "lane", "lanes"  # Index of the ego's lane, 0 the slowest.
    TIME_OUT = "time_out", "s"  # Time outside the original lane while the return was due.
    ARRIVAL = "arrival", "s"  # Time until the next vehicle on the left is beside the ego.
    SIGHT = "sight", "m"  # Sight distance of the driver.
    PLACE = "place", "m"  # From the ego, where it must not overtake, to the nearer end.
    WIDTH = "width", "m"  # Of the lane on the left.
    UNSIGNALLED = "unsignalled", "s"  # Time without the indicator that is due.
    WRONG_LAMPS = "wrong_lamps", "s"  # Time with lamps that are wrong.
    TARGET_DRIFT = "target_drift", "m/s"  # Speed of the target to the left.
    TARGET_ACCEL = "target_accel", "m/s^2"  # Acceleration of the target.
    EVASION = "evasion", "m"  # How far an oncoming vehicle leaves its lane.
    ONCOMING_BRAKING = "oncoming_braking", "m/s^2"  # Of an oncoming vehicle.

    unit: str

    def __new__(cls, value: str, unit: str) -> Self:
        """A quantity and its unit."""
        member = str.__new__(cls, value)
        member._value_, member.unit = value, unit
        return member


@dataclass(frozen=True, slots=True, kw_only=True)
class RequiredChange:
    """One quantity as it was, and as it would have been lawful.

    Attributes:
        quantity: The quantity.
        actual: As it was.
        needed: The nearest lawful value.
        frame: Where it was farthest from lawful; None where no single frame has the values, as for
            a time summed over the breach.
        slot: Slot of the other vehicle, None for a change without another vehicle.
    """

    quantity: RemedyQuantity
    actual: float
    needed: float
    frame: int | None = None
    slot: int | None = None

    @property
    def unit(self) -> str:
        """Unit of both values."""
        return self.quantity.unit

    @property
    def by(self) -> float:
        """How much more would have been lawful; less, if negative."""
        return self.needed - self.actual


Remedy = tuple[RequiredChange, ...]
"""Changes that together would have kept a rule, everything else being as it was."""


def single_change(
    quantity: RemedyQuantity,
    actual: float | np.floating,
    needed: float | np.floating,
    frame: int | np.integer | None = None,
    slot: int | None = None,
) -> tuple[Remedy]:
    """One remedy of one change; the arguments are the fields of `RequiredChange`."""
    change = RequiredChange(
        quantity=quantity,
        actual=float(actual),
        needed=float(needed),
        frame=None if frame is None else int(frame),
        slot=slot,
    )
    return ((change,),)


@dataclass(frozen=True, slots=True, kw_only=True)
class BreachContext:
    """One breach, from which its remedies are computed.

    Attributes:
        case: The batch reduced to the simulation of the breach, so all arrays are read at index 0.
        margin: Margin of the finding, below 0, in the unit of the criterion.
        first_frame: First frame of the breach.
        last_frame: Last frame of the breach.
    """

    case: Case
    margin: float
    first_frame: int
    last_frame: int

    @property
    def frames(self) -> IndexArray:
        """All frames from the first to the last one of the breach, shape (frame,)."""
        return np.arange(self.first_frame, self.last_frame + 1)

    def frames_with_neighbour(self, neighbour: NeighbourRole) -> IndexArray:
        """Frames of the breach in which the ego has this neighbour, shape (frame,)."""
        vehicle = self.case.signals.neighbour_slot[0, neighbour, self.frames]
        return self.frames[vehicle != NO_VEHICLE]

    def frames_within_breach(self, frames: IndexArray) -> IndexArray:
        """Keep the frames that lie within the breach."""
        return frames[(frames >= self.first_frame) & (frames <= self.last_frame)]

    def frame_of_margin(self, margins: NDArray[np.floating]) -> int:
        """The frame of the breach at which the margin has the value of the finding.

        The nearest margin is taken, because recomputed margins may differ in the last bits. The
        smallest margin may belong to a frame that the criterion leaves out.

        Args:
            margins: Margin in each of `frames`, shape (frame,).
        """
        return int(self.frames[np.abs(margins - self.margin).argmin()])

    def remedy_ego_speed(
        self, frame: int | np.integer, needed: float | np.floating
    ) -> tuple[Remedy]:
        """The ego at another speed."""
        return single_change(RemedyQuantity.SPEED, self.case.signals.speed[0, frame], needed, frame)

    def remedy_slower_ego(self, frames: IndexArray, allowed: F32) -> tuple[Remedy, ...]:
        """The ego slowed down to the lawful speed in the frame in which it exceeded it most.

        Args:
            frames: Frames of the breach, shape (frame,).
            allowed: Highest lawful speed in each frame, `NO_SPEED` where none is lawful [m/s].

        Returns:
            One remedy; none if there is a frame in which no speed is lawful.
        """
        if (allowed < 0).any():
            return ()
        worst = int((self.case.signals.speed[0, frames] - allowed).argmax())
        return self.remedy_ego_speed(frames[worst], allowed[worst])

    @property
    def target_slot(self) -> int:
        """Slot of the vehicle that is overtaken."""
        return int(self.case.target.slot[0])


def change_by_margin(
    breach: BreachContext,
    quantity: RemedyQuantity,
    limit: float | np.floating,
    frame: int | np.integer | None = None,
    slot: int | None = None,
) -> tuple[Remedy]:
    """One remedy: a quantity at its limit, which it exceeded by the size of the negative margin.

    Args:
        breach: The breach.
        quantity: The quantity that the margin measures.
        limit: The largest lawful value, in the unit of `quantity`.
        frame: As in `RequiredChange`.
        slot: As in `RequiredChange`.
    """
    return single_change(quantity, float(limit) - breach.margin, limit, frame, slot)


def more_gap(
    breach: BreachContext,
    neighbour: NeighbourRole,
    frame: int | np.integer,
    margin: float | np.floating,
) -> tuple[Remedy]:
    """One remedy: a gap to a neighbour that is larger by the size of a negative margin.

    Args:
        breach: The breach.
        neighbour: The neighbour.
        frame: Frame in which the gap is too small.
        margin: Margin of the gap in that frame [m].
    """
    signals = breach.case.signals
    leaders = (NeighbourRole.LEADER, NeighbourRole.LEFT_LEADER, NeighbourRole.RIGHT_LEADER)
    is_ahead = neighbour in leaders
    quantity = RemedyQuantity.GAP_AHEAD if is_ahead else RemedyQuantity.GAP_BEHIND
    gap = float(signals.gap[0, neighbour, frame])
    slot = int(signals.neighbour_slot[0, neighbour, frame])
    return single_change(quantity, gap, gap - float(margin), frame, slot)


def gap_and_closing_speed(
    breach: BreachContext, neighbour: NeighbourRole, frames: IndexArray
) -> tuple[F32, F32]:
    """Gap to a neighbour [m] and closing speed [m/s], each of shape (frame,)."""
    signals = breach.case.signals
    return signals.gap[0, neighbour, frames], signals.closing_speed[0, neighbour, frames]


def margins_to_neighbour(
    breach: BreachContext, neighbour: NeighbourRole, frames: IndexArray, margin: GapMargin
) -> F32:
    """Margins of the gap to a neighbour, shape (frame,) [m]."""
    gap, closing_speed = gap_and_closing_speed(breach, neighbour, frames)
    decel = decel_for_safe_distance(breach.case.signals.friction[0, frames])
    return margin(gap, breach.case.signals.speed[0, frames], closing_speed, decel)


def max_following_speed(gap: F32, leader_speed: F32, decel: F32) -> F32:
    """Highest speed v at which a gap to the leader is lawful by `safe_distance.lawful_gap` [m/s].

    It solves gap + u^2 / (2 b) = v t + v^2 / (2 b), with u the speed of the leader, b `decel` and t
    the reaction time.

    Args:
        gap: Gap to the leader [m].
        leader_speed: Speed of the leader [m/s].
        decel: `decel_for_safe_distance` [m/s^2].
    """
    distance = np.maximum(gap, np.float32(0.0)) + leader_speed * leader_speed / (TWO * decel)
    return stoppable_speed(distance, as_f32(REACTION_TIME.f32), decel)


def min_speed_before_follower(gap: F32, follower_speed: F32, decel: F32) -> F32:
    """Lowest speed v at which a gap to a follower is lawful by `entry_margin_behind` [m/s].

    Two conditions on v, of which the stricter counts, with u the speed of the follower, b `decel`
    and t the reaction time: gap >= u t + u^2 / (2 b) - v^2 / (2 b), its safe distance, and
    (u - v)^2 / (2 gap) <= `ABRUPT_BRAKING`, the braking that is forced on it.

    Args:
        gap: Gap to the follower, 0 or more: no speed is lawful for overlapping vehicles [m].
        follower_speed: Speed of the follower [m/s].
        decel: `decel_for_safe_distance` [m/s^2].
    """
    reaction_time = REACTION_TIME.f32
    square = follower_speed * follower_speed + TWO * decel * (follower_speed * reaction_time - gap)
    speed_without_hard_braking = follower_speed - np.sqrt(TWO * ABRUPT_BRAKING.f32 * gap)
    return np.maximum(np.sqrt(np.maximum(square, np.float32(0.0))), speed_without_hard_braking)
