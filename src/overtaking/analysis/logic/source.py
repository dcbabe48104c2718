"""Simulations of a data set in groups, with what facts are made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.logic.facts import Classes
from overtaking.analysis.logic.vocabulary import CLASS, OUTCOME, POLICY
from overtaking.data.tables.files import read_rows
from overtaking.labels.events import case_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from overtaking.data.load import Dataset
    from overtaking.model.labels import Case

I64 = NDArray[np.int64]

GROUP_SIZE = 64
"""Simulations whose facts are in memory at a time, as columns and as text."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Some simulations.

    Attributes:
        numbers: Their numbers in the data set, shape (simulation,).
        case: Their recordings, with signals and events.
        labels: Their classes.
        done: How many simulations of the data set have been looked at, this group included.
    """

    numbers: I64
    case: Case
    labels: Classes
    done: int


def groups(data: Dataset, chosen: I64 | None = None, size: int = GROUP_SIZE) -> Iterator[Group]:
    """The chosen simulations in order, some at a time.

    Args:
        data: The data set; what it did not keep is simulated again.
        chosen: Their numbers in order, all by default.
        size: Most simulations of a group.

    Raises:
        DatasetError: A file is damaged, or the simulator has changed.
    """
    for numbers, trajectories in data.batches(chosen):
        labels = labels_of(data, int(numbers[0]), int(numbers[-1]), numbers)
        for begin in range(0, len(numbers), size):
            some = np.arange(begin, min(begin + size, len(numbers)))
            yield Group(
                numbers=numbers[some],
                case=case_of(trajectories.select(some)),
                labels=Classes(classes=labels.classes[some], outcome=labels.outcome[some]),
                done=int(numbers[some[-1]]) + 1,
            )


def labels_of(data: Dataset, first: int, last: int, numbers: I64) -> Classes:
    """The labels of simulations of one file.

    Args:
        data: The data set.
        first: The first of them.
        last: The last of them.
        numbers: Which of those between.
    """
    shard = first // data.manifest.identity.shard_size
    rows = read_rows(data.files("labels")[shard], "labels", first, last)
    classes = np.array(
        [CLASS.names.index(name.lower()) for name in rows["class"].to_pylist()]
    ).reshape(-1, len(POLICY.names))
    names = rows["outcome"].to_pylist()[:: len(POLICY.names)]
    outcome = np.array([OUTCOME.names.index(name) for name in names])
    return Classes(classes=classes[numbers - first], outcome=outcome[numbers - first])
