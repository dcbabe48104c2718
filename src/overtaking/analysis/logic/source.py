"""Simulations of a data set in groups, with recordings, signals, events and classes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.analysis.logic.vocabulary import CLASS, OUTCOME, POLICY
from overtaking.labels.event_detection import case_from_trajectories

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from overtaking.core.arrays import I64
    from overtaking.data.load import Dataset
    from overtaking.model.verdicts import Case


GROUP_SIZE = 64
"""Simulations whose facts are in memory at a time, as columns and as text."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Some simulations.

    Attributes:
        numbers: Their numbers in the data set, shape (simulation,).
        case: Their recordings, with signals and events.
        classes: `OvertakeClass`, shape (simulation, policy); None: not labelled.
        outcome: `Outcome`, shape (simulation,); None: not labelled.
        done: Simulations of the data set read so far, this group included.
    """

    numbers: I64
    case: Case
    classes: NDArray[np.integer] | None = None
    outcome: NDArray[np.integer] | None = None
    done: int = 0

    def select(self, chosen: NDArray[Any]) -> Group:
        """Some of them, by a mask or by their places."""
        return replace(
            self,
            numbers=self.numbers[chosen],
            case=self.case.select(chosen),
            classes=None if self.classes is None else self.classes[chosen],
            outcome=None if self.outcome is None else self.outcome[chosen],
        )


def groups(data: Dataset, chosen: I64 | None = None, size: int = GROUP_SIZE) -> Iterator[Group]:
    """The chosen simulations in order, some at a time.

    Args:
        data: The data set; recordings that it did not keep are simulated again.
        chosen: Their numbers in order, all by default.
        size: Most simulations of a group.

    Raises:
        DatasetError: A file is damaged, or the simulator has changed.
    """
    for numbers, trajectories in data.batches(chosen):
        classes, outcome = _labels(data, numbers)
        for begin in range(0, len(numbers), size):
            some = np.arange(begin, min(begin + size, len(numbers)))
            yield Group(
                numbers=numbers[some],
                case=case_from_trajectories(trajectories.select(some)),
                classes=classes[some],
                outcome=outcome[some],
                done=int(numbers[some[-1]]) + 1,
            )


def _labels(data: Dataset, numbers: I64) -> tuple[I64, I64]:
    """Classes and outcomes of simulations of one file, in the order of their numbers."""
    first, policies = int(numbers[0]), len(POLICY.names)
    rows = data.rows("labels", first, int(numbers[-1]))
    codes = [CLASS.names.index(name.lower()) for name in rows["class"].to_pylist()]
    classes = np.array(codes).reshape(-1, policies)
    names = rows["outcome"].to_pylist()[::policies]
    outcome = np.array([OUTCOME.names.index(name) for name in names])
    return classes[numbers - first], outcome[numbers - first]
