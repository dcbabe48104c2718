"""One broken rule, with what a remedy is worked out from."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.labels.explain.change import Remedy
from overtaking.labels.law import Rule
from overtaking.model.labels import Belief, Case, Severity
from overtaking.model.signals import Around
from overtaking.model.trajectory import NO_VEHICLE

Index = NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True)
class Breach:
    """A broken rule.

    Attributes:
        rule: The rule.
        policies: Names of the policies that require it.
        margin: How far beyond the border of the law, negative, in the unit of the rule.
        first: First frame of the breach.
        last: Last frame of the breach.
        severity: By Articles 145 and 146.
        belief: Whether the driver could know.
        remedies: Each of them alone would have kept the rule; none where nothing would.
    """

    rule: Rule
    policies: tuple[str, ...]
    margin: float
    first: int
    last: int
    severity: Severity
    belief: Belief
    remedies: tuple[Remedy, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A breach as those see it who look for remedies.

    Attributes:
        case: One simulation.
        margin: Of the finding.
        first: First frame of the breach.
        last: Last frame of the breach.
    """

    case: Case
    margin: float
    first: int
    last: int

    @property
    def frames(self) -> Index:
        """From the first to the last frame of the breach."""
        return np.arange(self.first, self.last + 1)

    def beside(self, place: Around) -> Index:
        """Frames of the breach with a neighbour in a place."""
        vehicle = self.case.signals.vehicle[0, place, self.frames]
        return self.frames[vehicle != NO_VEHICLE]

    def within(self, frames: Index) -> Index:
        """Those of some frames that belong to the breach."""
        return frames[(frames >= self.first) & (frames <= self.last)]

    def worst(self, margins: NDArray[np.floating]) -> int:
        """Which of some margins is that of the finding."""
        return int(np.abs(margins - self.margin).argmin())
