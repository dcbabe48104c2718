"""Criteria about ego and target side by side: side, lateral distance, speed of the target.

A `Case` is a batch of simulations with one ego each; the target is the vehicle that it overtakes. A
`BreachContext` has the one simulation of its breach, at index 0. `alongside(case)` has all frames
in which ego and target overlap along the road, with the row of the simulation, the lane and the
acceleration of the target, and the gap between the sides. Its `finding` takes the smallest margin
of each simulation. The attempt is the frame in which the ego begins to move left. Lane 0 is the
slowest, and left is the overtaking side, also in left-hand traffic. In `ERROR_FORMULA`, sp and sv
are the standard deviations of a position and of a speed. The docstring of the package `criteria`
explains these terms in full, `rule.Criterion` describes the methods.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from overtaking.core.arrays import F32, F64, IndexArray, Mask
from overtaking.core.float32_math import HALF
from overtaking.knowledge.quantities import Quantity
from overtaking.labels.law.case import Alongside, alongside, signed_lane, target_may_be
from overtaking.labels.law.margins import UNCONSTRAINED
from overtaking.labels.law.measurement_errors import MeasurementErrors, lane_margin_error
from overtaking.labels.law.numbers import quantity
from overtaking.labels.law.remedies import (
    BreachContext,
    Remedy,
    RemedyQuantity,
    change_by_margin,
    single_change,
)
from overtaking.labels.law.rule import Criterion
from overtaking.labels.snapshots import (
    VehicleInstants,
    at_frame,
    lateral_position_and_gap,
    num_slow_vehicles,
    slot_or_ego,
    vehicle_snapshot,
)
from overtaking.model.verdicts import Case, Finding

_SPEED_RESOLUTION = np.float32(1e-3)
"""One step of recorded speed [m/s], the smallest divisor of a share: an ego at rest has speed 0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PassingSide(Criterion):
    """While ego and target overlap, the ego is in a lane to the left of the target's lane.

    Queues that drive side by side at different speeds do not overtake each other: frames in them do
    not count. All numbers of queues but `queue_reach` come from rule R_I2 (passing on the right) of
    the published monitor `stl-monitor`.

    Attributes:
        max_lanes_left: Largest lawful number of lanes from the target's lane to the ego's; None for
            no limit.
        queue_min_vehicles: Smallest number of slow vehicles in queues.
        queue_reach: Largest distance from the ego at which they count.
        queue_max_speed: Speed below which a vehicle is slow.
        queue_max_speed_gain: Largest difference of the speeds of ego and target in queues.
    """

    max_lanes_left: int | None = None
    queue_min_vehicles: Quantity = quantity(
        3.0, "vehicle", "stl-monitor", why="Rule R_I2: fewer slow vehicles are no queue"
    )
    queue_reach: Quantity = quantity(
        100.0, "m", why="A choice; slow vehicles farther off do not excuse the ego"
    )
    queue_max_speed: Quantity = quantity(8.33, "m/s", "stl-monitor", why="30 km/h, rule R_I2")
    queue_max_speed_gain: Quantity = quantity(5.55, "m/s", "stl-monitor", why="20 km/h, rule R_I2")
    unit: str = "lanes"

    def predicate(self) -> str:
        """The lawful lanes, and the exception for queues."""
        lanes = ""
        if self.max_lanes_left is not None:
            number = "one lane" if self.max_lanes_left == 1 else f"{self.max_lanes_left} lanes"
            lanes = (
                f", and at most {number} left of it, or of the lane from which the overtake began "
                "if the target has moved to the right of that lane"
            )
        return (
            f"While ego and target overlap: lane(ego) is left of lane(target){lanes}. "
            f"Not where at least {self.queue_min_vehicles.bare()} others within "
            f"{self.queue_reach} are slower than {self.queue_max_speed.in_unit('km/h')} and the "
            f"ego is at most {self.queue_max_speed_gain.in_unit('km/h')} faster than the target."
        )

    def check(self, case: Case) -> Finding:
        """The frame with the fewest lanes to spare decides."""
        frames_alongside = alongside(case)
        simulation, frame = frames_alongside.simulation, frames_alongside.frame
        ego_lane = signed_lane(case.signals.lane)[simulation, frame]
        target_lane = signed_lane(frames_alongside.lane)
        # Lanes are whole numbers, -1 beyond the slow edge. The half makes the margin 0.5 in the
        # next lane and -0.5 in the same lane, so that no margin is 0.
        margin = (ego_lane - target_lane - HALF).astype(np.float32)
        if self.max_lanes_left is not None:
            # A target that makes room to the right causes no breach.
            original_lane = signed_lane(case.events.original_lane)[simulation]
            reference_lane = np.maximum(target_lane, original_lane)
            lanes_to_spare = reference_lane + (np.float32(self.max_lanes_left) + HALF) - ego_lane
            margin = np.minimum(margin, lanes_to_spare)
        # The search for queues is slow, so it is made only where the margin is negative.
        # `UNCONSTRAINED` is larger than any margin, so the frames in queues never decide.
        breaches = np.flatnonzero(margin < 0)
        is_exempt = self._is_in_queue(case, simulation[breaches], frame[breaches])
        margin[breaches[is_exempt]] = UNCONSTRAINED
        return frames_alongside.finding(case, margin)

    ERROR_FORMULA: ClassVar[str] = (
        "0.5 sp / distance from the nearer centre to a lane border, in the frame that decides"
    )

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error that is half a lane where a centre is `sp` from a lane border [lanes].

        The centres of ego and target determine their lanes, so the number of lanes between them is
        uncertain where a centre is near a border. For a breach, one frame with certain lanes
        suffices: the largest distance to a border in the frames of the breach decides. Without a
        breach, the lanes must be certain in all frames, and the smallest distance decides.
        """
        frames_alongside = alongside(case)
        simulation, frame = frames_alongside.simulation, frames_alongside.frame
        distance = _distance_to_border(case, frames_alongside)
        smallest = np.full(len(finding.margin), UNCONSTRAINED)
        np.minimum.at(smallest, simulation, distance)
        is_in_breach = frame >= finding.first_frame[simulation]
        is_in_breach &= frame <= finding.last_frame[simulation]
        largest_in_breach = np.zeros(len(finding.margin), np.float32)
        np.maximum.at(largest_in_breach, simulation[is_in_breach], distance[is_in_breach])
        is_breach = finding.margin < 0
        return lane_margin_error(np.where(is_breach, largest_in_breach, smallest), errors)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """The nearest lawful lane, in the frame in which the ego was farthest from it."""
        frames = _frames_alongside(breach)
        ego_lane, target_lane = (
            signed_lane(signals.lane)[0, frames].astype(int)
            for signals in (breach.case.signals, breach.case.target)
        )
        # Positive where the ego is left of the target. Right of the target's lane or in it, the ego
        # must be farther to the left.
        lanes_left = ego_lane - target_lane
        needed = np.ones_like(lanes_left)
        lacking = needed - lanes_left
        if self.max_lanes_left is not None:
            # Too far left, it must be farther to the right, counted from the reference of `check`.
            original_lane = signed_lane(breach.case.events.original_lane)[0]
            lanes_from_reference = ego_lane - np.maximum(target_lane, original_lane)
            is_too_far = lanes_from_reference > self.max_lanes_left
            lanes_left = np.where(is_too_far, lanes_from_reference, lanes_left)
            needed = np.where(is_too_far, self.max_lanes_left, needed)
            lacking = np.where(is_too_far, lanes_left - needed, lacking)
        # A frame in queues needs no change, however the lanes lie.
        is_exempt = self._is_in_queue(breach.case, np.zeros_like(frames), frames)
        worst = int(np.where(is_exempt, 0, lacking).argmax())
        return single_change(
            RemedyQuantity.LANES_LEFT,
            actual=lanes_left[worst],
            needed=float(needed[worst]),
            frame=frames[worst],
            slot=breach.target_slot,
        )

    def _is_in_queue(self, case: Case, simulation: IndexArray, frame: IndexArray) -> Mask:
        """Whether ego and target drive in queues at listed frames, shape (instant,)."""
        num_slow = num_slow_vehicles(
            case.trajectories,
            simulation,
            frame,
            below=float(self.queue_max_speed.f32),
            reach=float(self.queue_reach.f32),
        )
        target_slot = case.target.slot[simulation]
        target = vehicle_snapshot(case.trajectories, target_slot, simulation, frame)
        speed_gain = case.signals.speed[simulation, frame] - target.speed
        is_slow_traffic = num_slow >= self.queue_min_vehicles.f32
        return is_slow_traffic & (speed_gain <= self.queue_max_speed_gain.f32)


def _distance_to_border(case: Case, frames_alongside: Alongside) -> F32:
    """Distance from the nearer centre of ego and target to a lane border, shape (instant,) [m]."""
    simulation, frame = frames_alongside.simulation, frames_alongside.frame
    road = case.trajectories.road
    # Lateral positions of signals grow to the overtaking side, positions of the road to the
    # geometric left. The sign, -1 in left-hand traffic, converts these.
    borders = (road.overtaking_sign * road.lane_boundaries).astype(np.float32)
    # `slot_or_ego` gives the ego without a target; such simulations have no frames alongside.
    target_slot = slot_or_ego(case.target.slot)[simulation]
    ego_position = case.signals.lateral_position[simulation, frame]
    target = VehicleInstants(simulation, target_slot, frame)
    target_position, _ = lateral_position_and_gap(case.trajectories, case.signals, target)
    ego_distance, target_distance = (
        np.abs(position[:, None] - borders).min(axis=1)
        for position in (ego_position, target_position)
    )
    return np.minimum(ego_distance, target_distance)


@dataclass(frozen=True, slots=True, kw_only=True)
class LateralDistance(Criterion):
    """While ego and target overlap, the distance between their sides is large enough.

    Attributes:
        min_outside: Smallest lawful distance outside built-up areas, and inside them unless
            `min_in_town` is stated.
        min_in_town: Smallest lawful distance inside built-up areas.
        is_for_bicycles: Whether the duty is towards targets that are bicycles, or towards all
            others.
    """

    min_outside: Quantity
    min_in_town: Quantity | None = None
    is_for_bicycles: bool = False
    unit: str = "m"

    @property
    def required_inputs(self) -> frozenset[str]:
        """The kind of the target; with a distance for towns also the kind of the road."""
        return frozenset(["kinds"] if self.min_in_town is None else ["kinds", "road_kind"])

    def predicate(self) -> str:
        """The sentence with the distances of this law."""
        target = "a bicycle" if self.is_for_bicycles else "no bicycle"
        in_town = "" if self.min_in_town is None else f", in towns {self.min_in_town}"
        return (
            f"While ego and target overlap, the target being {target}: distance between their "
            f"sides >= {self.min_outside}{in_town}."
        )

    def check(self, case: Case) -> Finding:
        """The smallest distance over all frames alongside decides."""
        frames_alongside = alongside(case)
        margin = frames_alongside.lateral_gap - self._min_gap(case)
        # A target of unknown kind may be either. The verdict is then undecidable, because `kinds`
        # is a required input.
        applies = target_may_be(case, bicycle=self.is_for_bicycles)
        return frames_alongside.finding(case, margin, applies)

    ERROR_FORMULA: ClassVar[str] = "sqrt(2) sp"

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of two independent lateral positions; widths are taken as exact [m]."""
        del case
        return np.full_like(finding.margin, np.sqrt(2.0) * errors.position_std)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """More distance in the frame in which ego and target were nearest."""
        return _more_lateral_gap(breach, self._min_gap(breach.case))

    def margins_by_frame(self, case: Case) -> F64:
        """Margins of the frames alongside, for charts; the batch has one simulation."""
        frames_alongside = alongside(case)
        margins = np.full(case.signals.num_frames, np.nan)
        margins[frames_alongside.frame] = frames_alongside.lateral_gap - self._min_gap(case)
        return margins

    def _min_gap(self, case: Case) -> np.float32:
        """Smallest lawful distance on the road of the batch [m].

        A road of unknown kind gets the distance outside built-up areas. The verdict is then
        undecidable, because `road_kind` is a required input.
        """
        in_town = case.trajectories.road.kind == "town"
        is_known = "road_kind" not in case.trajectories.unknown
        if self.min_in_town is not None and in_town and is_known:
            return self.min_in_town.f32
        return self.min_outside.f32


@dataclass(frozen=True, slots=True, kw_only=True)
class BicycleDistance(Criterion):
    """Beside a bicycle the ego keeps its distance and is no faster than as the overtake began.

    The law asks to slow down and states no speed. The mildest reading is a choice: an equal speed
    is lawful. The margin is the smaller of two shares: (gap - `min_gap`) / `min_gap`, and
    (v at the attempt - v) / (v at the attempt).

    Attributes:
        min_gap: Smallest lawful distance between the sides of ego and bicycle.
    """

    min_gap: Quantity
    unit: str = "1"

    @property
    def required_inputs(self) -> frozenset[str]:
        """The kind of the target."""
        return frozenset(["kinds"])

    def predicate(self) -> str:
        """Both conditions, and how they make one margin."""
        return (
            "While ego and target overlap, the target being a bicycle: distance between their "
            f"sides >= {self.min_gap}, and speed <= that at attempt. The margin is the smaller of "
            "the two, each as a share of its limit."
        )

    def check(self, case: Case) -> Finding:
        """The smaller share over all frames alongside decides."""
        frames_alongside = alongside(case)
        simulation, frame = frames_alongside.simulation, frames_alongside.frame
        start_speed = _speed_at_attempt(case)[simulation]
        speed_share = (start_speed - case.signals.speed[simulation, frame]) / start_speed
        margin = np.minimum(self._gap_share(frames_alongside), speed_share)
        return frames_alongside.finding(case, margin, target_may_be(case, bicycle=True))

    ERROR_FORMULA: ClassVar[str] = (
        "sqrt(2) sp / min_gap where the gap decides, else margin sv / v at attempt"
    )

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32:
        """Error of the share that decides [1]."""
        frames_alongside = alongside(case)
        gap_share = np.full(len(finding.margin), UNCONSTRAINED)
        np.minimum.at(gap_share, frames_alongside.simulation, self._gap_share(frames_alongside))
        # Both speeds of the ego have the same error, which cancels in their difference: it changes
        # only the divisor, the speed at the attempt.
        speed_error = np.abs(finding.margin) / _speed_at_attempt(case)
        speed_error = speed_error * np.float32(errors.speed_std)
        gap_error = np.float32(np.sqrt(2.0) * errors.position_std) / self.min_gap.f32
        # The margin is one of the two shares; 1e-6 is above the rounding of either.
        gap_decides = np.abs(gap_share - finding.margin) < np.float32(1e-6)
        return np.where(gap_decides, gap_error, speed_error)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """More distance, and a speed no higher than at the attempt, whichever the breach needs."""
        frames, speed = _frames_alongside(breach), breach.case.signals.speed[0]
        # Both functions return one remedy with one change.
        ((more_gap,),) = _more_lateral_gap(breach, self.min_gap.f32)
        start_speed = speed[breach.case.events.attempt[0]]
        fastest = frames[int(speed[frames].argmax())]
        ((slower,),) = breach.remedy_ego_speed(fastest, start_speed)
        # `by` is the needed value minus the actual one.
        changes = ((more_gap, more_gap.by > 0), (slower, slower.by < 0))
        return (tuple(change for change, is_lacking in changes if is_lacking),)

    def _gap_share(self, frames_alongside: Alongside) -> F32:
        """Gap beyond the smallest lawful one, as a share of it, shape (instant,) [1]."""
        return (frames_alongside.lateral_gap - self.min_gap.f32) / self.min_gap.f32


def _speed_at_attempt(case: Case) -> F32:
    """Speed of the ego at the attempt, at least `_SPEED_RESOLUTION`, shape (simulation,) [m/s]."""
    return np.maximum(at_frame(case.signals.speed, case.events.attempt), _SPEED_RESOLUTION)


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetSpeed(Criterion):
    """While ego and target overlap, the target does not accelerate; the duty is the target's.

    Constant errors of positions and speeds do not change an acceleration, so there is no standard
    error.

    Attributes:
        max_accel: Largest lawful acceleration of the target.
    """

    max_accel: Quantity = quantity(
        0.3, "m/s^2", why="A choice; up to this the target counts as holding its speed"
    )
    unit: str = "m/s^2"

    def predicate(self) -> str:
        """The limit, and whose duty it is."""
        return (
            f"While ego and target overlap: acceleration of the target <= {self.max_accel}. "
            "The duty is the target's; a breach never makes the ego's overtake illegal."
        )

    def check(self, case: Case) -> Finding:
        """The largest acceleration over all frames alongside decides."""
        frames_alongside = alongside(case)
        return frames_alongside.finding(case, self.max_accel.f32 - frames_alongside.accel)

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """A target that accelerates less, in the frame of its largest acceleration."""
        limit = self.max_accel.f32
        frame = breach.frame_of_margin(limit - breach.case.target.accel[0, breach.frames])
        return change_by_margin(
            breach, RemedyQuantity.TARGET_ACCEL, limit=limit, frame=frame, slot=breach.target_slot
        )


def _frames_alongside(breach: BreachContext) -> IndexArray:
    """Frames of the breach in which ego and target overlap, shape (frame,)."""
    return breach.frames_within_breach(alongside(breach.case).frame)


def _more_lateral_gap(breach: BreachContext, needed: np.float32) -> tuple[Remedy]:
    """One remedy: the needed distance where ego and target were nearest.

    Args:
        breach: The breach.
        needed: Smallest lawful distance between their sides [m].
    """
    frames = _frames_alongside(breach)
    gaps = breach.case.target.lateral_gap[0, frames]
    nearest = int(gaps.argmin())
    return single_change(
        RemedyQuantity.LATERAL_GAP,
        actual=gaps[nearest],
        needed=needed,
        frame=frames[nearest],
        slot=breach.target_slot,
    )
