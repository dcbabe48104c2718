"""Standard deviations of recorded positions and speeds."""

from dataclasses import dataclass
from typing import Annotated

from overtaking.model.batch import FieldSpec
from overtaking.model.checks import check_batch

MAX_POSITION_STD = 100.0
"""Largest standard deviation of a position [m]."""

MAX_SPEED_STD = 100.0
"""Largest standard deviation of a speed [m/s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasurementErrors:
    """Standard deviations of the positions and speeds of a recording.

    A rule is undecidable where its margin is less than two standard errors. The errors of a vehicle
    are the same in all frames of a simulation, and independent of those of other vehicles. The
    errors along the road, across it and of the speed are independent, too.

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
