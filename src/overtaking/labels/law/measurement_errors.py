"""Standard errors of margins, from standard errors of measured positions and speeds.

A margin is a function of positions and speeds. By the law of propagation of uncertainty its
variance is the sum of the squared contributions of these inputs. The contribution of an input is
half the change of the margin as the input moves by its standard deviation to either side (JCGM
100:2008, 5.1.2 and the note to 5.1.3). So a rule needs no derivatives, only its margin as a
function of errors in the frame that decides.
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
"""Largest standard deviation of a position that is accepted [m], a choice."""

MAX_SPEED_STD = 100.0
"""Largest standard deviation of a speed that is accepted [m/s], a choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasurementErrors:
    """Standard deviations of the positions and speeds of a recording.

    A rule is undecidable where its margin is nearer to 0 than two standard errors.

    The errors of a vehicle are assumed to be the same in all frames of a simulation: the error of a
    track comes mostly from calibration and from the size of the detected box. They are assumed to
    be independent of the errors of other vehicles, and so are the errors along the road, across it
    and of the speed of each other.

    Args:
        position_std: Standard deviation of a position, along and across the road, 0 to 100 [m].
        speed_std: Standard deviation of a speed, 0 to 100 [m/s].

    Raises:
        ConfigError: A standard deviation is out of its range.
    """

    position_std: Annotated[float, FieldSpec(unit="m", low=0.0, high=MAX_POSITION_STD)] = 0.0
    speed_std: Annotated[float, FieldSpec(unit="m/s", low=0.0, high=MAX_SPEED_STD)] = 0.0

    def __post_init__(self) -> None:
        """Refuse a standard deviation that is out of its range."""
        check_batch(self, "MeasurementErrors")

    def __str__(self) -> str:
        """Suffix for the version of findings, such as `+-0.5m+-0.2mps`; empty without errors."""
        if not (self.position_std or self.speed_std):
            return ""
        return f"+-{self.position_std:g}m+-{self.speed_std:g}mps"


def propagated_error(margin: Callable[..., F32], *stds: float) -> F32:
    """Standard deviation of a margin.

    Args:
        margin: The margin as a function of one error for each input.
        stds: Standard deviation of each input.

    Source:
        JCGM 100:2008, 5.1.2 and the note to 5.1.3.
    """
    variance = np.float32(0.0)
    for i, std in enumerate(stds):
        errors = [np.float32(0.0)] * len(stds)
        errors[i] = np.float32(std)
        margin_above = margin(*errors)
        errors[i] = -errors[i]
        half_change = (margin_above - margin(*errors)) * np.float32(0.5)
        variance = variance + half_change * half_change
    return np.sqrt(variance)


@dataclass(frozen=True, slots=True, kw_only=True)
class StateError:
    """Errors of one vehicle.

    Attributes:
        position: Error of the position along the road [m].
        speed: Error of the speed [m/s].
    """

    position: F32
    speed: F32


def error_from_vehicles(
    margin: Callable[..., F32], num_vehicles: int, errors: MeasurementErrors
) -> F32:
    """Standard deviation of a margin that depends on positions and speeds of several vehicles.

    Args:
        margin: The margin as a function of one `StateError` for each vehicle.
        num_vehicles: Number of vehicles.
        errors: Standard deviations of positions and speeds.
    """

    def margin_with(*state_errors: F32) -> F32:
        positions, speeds = state_errors[:num_vehicles], state_errors[num_vehicles:]
        pairs = zip(positions, speeds, strict=True)
        return margin(*(StateError(position=position, speed=speed) for position, speed in pairs))

    # All positions before all speeds: another order could change the last bits of the sum.
    stds = [errors.position_std] * num_vehicles + [errors.speed_std] * num_vehicles
    return propagated_error(margin_with, *stds)


def deciding_frame(
    span: FrameSpan, margin: Callable[[IndexArray, IndexArray], F32], finding: Finding
) -> I32:
    """First frame of a span in which a margin is nearest to the margin of a finding.

    The two need not be equal: recomputed margins may differ in the last bits.

    Args:
        span: The frames that the rule judges.
        margin: Function from simulation and frame of each instant to its margin.
        finding: The finding.

    Returns:
        Shape (simulation,). For an empty span it is `span.first`, but at least 0.
    """
    simulation, frames = span.instants()
    deciding = np.maximum(span.first, 0).astype(np.int32)
    if not simulation.size:
        return deciding
    deviation = np.abs(margin(simulation, frames) - finding.margin[simulation])
    # Sort by simulation, then by deviation, then by frame; `first` is the index of the first
    # instant of each simulation in this order.
    order = np.lexsort((frames, deviation, simulation))
    first = order[np.append(True, np.diff(simulation[order]) != 0)]
    deciding[simulation[first]] = frames[first]
    return deciding


def gap_error(
    case: Case, role: NeighbourRole, frame: I32, margin: GapMargin, errors: MeasurementErrors
) -> F32:
    """Error of a margin of the gap to a neighbour, from positions and speeds of both vehicles.

    Args:
        case: The batch.
        role: Role of the neighbour.
        frame: A frame of each simulation, shape (simulation,).
        margin: The margin of the gap.
        errors: Standard deviations of positions and speeds.

    Returns:
        Shape (simulation,), in the unit of the margin.
    """
    neighbour, signals = neighbour_at(case, role, frame), case.signals
    speed = at_frame(signals.speed, frame)
    decel = decel_for_safe_distance(at_frame(signals.friction, frame))
    is_ahead = role in (
        NeighbourRole.LEADER,
        NeighbourRole.LEFT_LEADER,
        NeighbourRole.RIGHT_LEADER,
    )

    def margin_with(ego_error: StateError, neighbour_error: StateError) -> F32:
        measured = encounter_with_error(neighbour, ego_error, neighbour_error, is_ahead=is_ahead)
        return margin(measured.gap, speed + ego_error.speed, measured.closing_speed, decel)

    return error_from_vehicles(margin_with, 2, errors)


def encounter_with_error(
    encounter: Encounter, ego_error: StateError, neighbour_error: StateError, *, is_ahead: bool
) -> Encounter:
    """A neighbour with errors of gap and closing speed.

    Its time gap, its times to collision and its DRAC keep the values without errors.

    Args:
        encounter: The neighbour without these errors.
        ego_error: Errors of the ego.
        neighbour_error: Errors of the neighbour.
        is_ahead: Whether the neighbour is ahead of the ego.
    """
    sign = np.float32(1.0 if is_ahead else -1.0)
    return encounter.replace(
        gap=encounter.gap + sign * (neighbour_error.position - ego_error.position),
        closing_speed=encounter.closing_speed + sign * (ego_error.speed - neighbour_error.speed),
    )


def lane_margin_error(distance: F32, errors: MeasurementErrors) -> F32:
    """Standard error of a margin in lanes [lanes].

    Such a margin jumps from half a lane to minus half a lane as the centre of a vehicle crosses a
    border. The error makes it undecidable, that is, smaller than two errors, while the centre is
    within two standard deviations of the border.

    Args:
        distance: Distance of the centre from the border that decides, of either sign [m].
        errors: Standard deviations of positions and speeds.
    """
    # At least 1 mm, the resolution of recorded positions: the error stays finite.
    return np.float32(0.5 * errors.position_std) / np.maximum(np.abs(distance), METRES_PER_MM)


def zero_if_infinite(error: F32) -> F32:
    """Replace errors that are infinite or NaN by 0: a margin to a missing vehicle has no error."""
    return np.where(np.isfinite(error), error, np.float32(0.0))


GAP_ERROR_FORMULA = "sqrt(2 sp^2 + sv^2 ((t + v/b)^2 + (u/b)^2)), v behind and u ahead"
"""Error of a gap minus `lawful_gap`, in the notation of `Criterion.ERROR_FORMULA`.

sp and sv are the standard deviations of positions and speeds, t and b reaction time and
deceleration of the safe distance, v and u the speeds of the vehicles behind and ahead.
"""

BRAKING_ERROR_FORMULA = (
    f"sqrt(2 sp^2 + 2 ((u - v)/a)^2 sv^2) where braking at a = {ABRUPT_BRAKING} decides"
)
"""Error of a gap minus the distance in which the vehicle behind, braking at `ABRUPT_BRAKING`, slows
down from its speed v to the speed u of the vehicle ahead."""


def return_time_error(case: Case, errors: MeasurementErrors) -> F32:
    """Error of the time at which the ego is back on its side of the road, (simulation,) [s].

    An error of the lateral position moves that time by the error over the lateral speed.
    """
    lateral_speed = at_frame(case.signals.lateral_speed, opposing_lane_span(case).last)
    return np.float32(errors.position_std) / np.maximum(np.abs(lateral_speed), MIN_RATE_OF_CHANGE)
