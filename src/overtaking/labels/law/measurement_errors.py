"""Errors of measurement and what they do to margins.

A margin is a function of positions and speeds. By the law of propagation of uncertainty its
variance is the sum of the squares of what each of them contributes, and a contribution is half the
change of the margin as that one moves by its standard deviation to either side (JCGM 100:2008,
5.1.2 and the note to 5.1.3). So each rule needs only its margin as a function of errors, at the
frame that decides.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from overtaking.core.arrays import F32, I32, IndexArray
from overtaking.labels.law.case import neighbour_at, opposing_lane_span
from overtaking.labels.law.margins import MIN_RATE_OF_CHANGE
from overtaking.labels.law.numbers import ABRUPT_BRAKING
from overtaking.labels.law.safe_distance import GapMargin, decel_for_safe_distance
from overtaking.labels.snapshots import METRES_PER_MM, FrameSpan, at_frame
from overtaking.model.batch import FieldSpec
from overtaking.model.checks import check_batch
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.safety_measures import Encounter
from overtaking.model.verdicts import Case, Finding

MAX_POSITION_STD = 100.0
"""Largest standard deviation of a position [m]."""

MAX_SPEED_STD = 100.0
"""Largest standard deviation of a speed [m/s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasurementErrors:
    """Standard deviations of the positions and speeds of a recording.

    A rule is undecidable where its margin is nearer to 0 than two standard errors. The errors of a
    vehicle are the same in all frames of a simulation, and independent of the errors of others.
    The errors along the road, across it and of the speed are independent, too.

    Args:
        position_std: Of a position, along the road and across it, 0 to 100 [m].
        speed_std: Of a speed, 0 to 100 [m/s].

    Raises:
        ConfigError: A standard deviation is out of its range.
    """

    position_std: Annotated[float, FieldSpec(unit="m", low=0.0, high=MAX_POSITION_STD)] = 0.0
    speed_std: Annotated[float, FieldSpec(unit="m/s", low=0.0, high=MAX_SPEED_STD)] = 0.0

    def __post_init__(self) -> None:
        """Refuse a standard deviation that is out of its range."""
        check_batch(self, "MeasurementErrors")

    def __str__(self) -> str:
        """A part of the version of findings; empty for measurements without errors."""
        if not (self.position_std or self.speed_std):
            return ""
        return f"+-{self.position_std:g}m+-{self.speed_std:g}mps"


def propagated_error(margin: Callable[..., F32], *sizes: float) -> F32:
    """Standard deviation of a margin.

    Args:
        margin: The margin as a function of one error for each of the inputs.
        sizes: Standard deviation of each input.

    Source:
        JCGM 100:2008, 5.1.2 and the note to 5.1.3.
    """
    variance = np.float32(0.0)
    for k, size in enumerate(sizes):
        errors = [np.float32(0.0)] * len(sizes)
        errors[k] = np.float32(size)
        margin_above = margin(*errors)
        errors[k] = -errors[k]
        half_change = (margin_above - margin(*errors)) * np.float32(0.5)
        variance = variance + half_change * half_change
    return np.sqrt(variance)


def deciding_frame(
    span: FrameSpan, margin: Callable[[IndexArray, IndexArray], F32], checked: Finding
) -> I32:
    """The frame of a span at which a margin is the one that was found, shape (simulation,)."""
    simulation, frames = span.instants()
    deciding = np.maximum(span.first, 0).astype(np.int32)
    if not simulation.size:
        return deciding
    deviation = np.abs(margin(simulation, frames) - checked.margin[simulation])
    order = np.lexsort((frames, deviation, simulation))
    first = order[np.append(True, np.diff(simulation[order]) != 0)]
    deciding[simulation[first]] = frames[first]
    return deciding


def gap_error(
    case: Case, role: NeighbourRole, frame: I32, margin: GapMargin, errors: MeasurementErrors
) -> F32:
    """Error of a margin of the gap to a neighbour, from positions and speeds of both."""
    neighbour, signals = neighbour_at(case, role, frame), case.signals
    speed, decel = (
        at_frame(signals.speed, frame),
        decel_for_safe_distance(at_frame(signals.friction, frame)),
    )
    is_ahead = role in (
        NeighbourRole.LEADER,
        NeighbourRole.LEFT_LEADER,
        NeighbourRole.RIGHT_LEADER,
    )

    def margin_with(
        ego_position_error: F32,
        other_position_error: F32,
        ego_speed_error: F32,
        other_speed_error: F32,
    ) -> F32:
        moved_neighbour = encounter_with_error(
            neighbour,
            ego_position_error,
            other_position_error,
            ego_speed_error,
            other_speed_error,
            is_ahead=is_ahead,
        )
        return margin(
            moved_neighbour.gap, speed + ego_speed_error, moved_neighbour.closing_speed, decel
        )

    return propagated_error(margin_with, *errors_of_two_vehicles(errors))


def encounter_with_error(
    encounter: Encounter,
    ego_position_error: F32,
    position_error: F32,
    ego_speed_error: F32,
    speed_error: F32,
    *,
    is_ahead: bool,
) -> Encounter:
    """A neighbour as it would have been seen with errors.

    Args:
        encounter: As it was seen.
        ego_position_error: Error of the ego's position along the road [m].
        position_error: Of the neighbour's [m].
        ego_speed_error: Of the ego's speed [m/s].
        speed_error: Of the neighbour's [m/s].
        is_ahead: Whether it is ahead of the ego.
    """
    sign = np.float32(1.0 if is_ahead else -1.0)
    return encounter.replace(
        gap=encounter.gap + sign * (position_error - ego_position_error),
        closing_speed=encounter.closing_speed + sign * (ego_speed_error - speed_error),
    )


def errors_of_two_vehicles(errors: MeasurementErrors) -> tuple[float, float, float, float]:
    """Errors of two positions and two speeds."""
    return errors.position_std, errors.position_std, errors.speed_std, errors.speed_std


def lane_margin_error(distance: F32, errors: MeasurementErrors) -> F32:
    """Error of a margin in lanes: half a lane where a centre is one error from the border [lanes].

    Args:
        distance: From the border that decides, either way [m].
        errors: Of the measurement.
    """
    return np.float32(0.5 * errors.position_std) / np.maximum(np.abs(distance), METRES_PER_MM)


def zero_if_infinite(error: F32) -> F32:
    """The error, 0 where it is infinite because no vehicle is near."""
    return np.where(np.isfinite(error), error, np.float32(0.0))


GAP_ERROR_FORMULA = "sqrt(2 sp^2 + sv^2 ((t + v/b)^2 + (u/b)^2)), v behind and u ahead"

BRAKING_ERROR_FORMULA = (
    f"sqrt(2 sp^2 + 2 ((u - v)/a)^2 sv^2) where braking at a = {ABRUPT_BRAKING} decides"
)


def return_time_error(case: Case, errors: MeasurementErrors) -> F32:
    """Error of when the ego is back on its side, by its position across the road [s]."""
    across = at_frame(case.signals.lateral_speed, opposing_lane_span(case).last)
    return np.float32(errors.position_std) / np.maximum(np.abs(across), MIN_RATE_OF_CHANGE)
