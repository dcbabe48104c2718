"""Simulations of a data set in groups, with what facts are made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from overtaking.core.errors import ConfigError
from overtaking.labels import find_events
from overtaking.logic.facts import Classes
from overtaking.logic.vocabulary import CLASS, OUTCOME, POLICY
from overtaking.model.labels import Case
from overtaking.signals.engine import signals
from overtaking.signals.target import target_signals
from overtaking.tables.files import read_rows

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from overtaking.datasets.load import Dataset
    from overtaking.model.trajectory import Trajectories

I64 = NDArray[np.int64]

GROUP_SIZE = 64
"""Simulations whose facts are in memory at a time, as columns and as text."""

_FEW = 64
"""So many simulations are read one by one, rather than found among all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """Which simulations are meant; all of them if nothing is said.

    Attributes:
        numbers: Their numbers, None for all.
        label: A class that they must have, None for any.
        policy: Whose classes are meant.
    """

    numbers: frozenset[int] | None = None
    label: str | None = None
    policy: str = POLICY.names[0]


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


def choice(
    data: Dataset,
    numbers: Iterable[int] | None = None,
    label: str | None = None,
    policy: str = POLICY.names[0],
) -> Choice:
    """Which simulations are meant, checked.

    Raises:
        ConfigError: There is no such simulation, class or policy.
    """
    chosen = None if numbers is None else frozenset(numbers)
    for number in sorted(chosen or ()):
        if not 0 <= number < len(data):
            raise _refused("simulation", f"0 to {len(data) - 1}", str(number))
    if policy not in POLICY.names:
        raise _refused("policy", " or ".join(POLICY.names), policy)
    if label is not None and label.lower() not in CLASS.names:
        raise _refused("class", " or ".join(CLASS.names), label)
    return Choice(numbers=chosen, label=None if label is None else label.lower(), policy=policy)


def groups(data: Dataset, chosen: Choice, size: int = GROUP_SIZE) -> Iterator[Group]:
    """The chosen simulations in order, some at a time.

    Args:
        data: The data set; what it did not keep is simulated again.
        chosen: Which of its simulations.
        size: Most simulations of a group.

    Raises:
        DatasetError: A file is damaged, or the simulator has changed.
    """
    for numbers, trajectories in _batches(data, chosen):
        labels = labels_of(data, int(numbers[0]), int(numbers[-1]), numbers)
        kept = np.flatnonzero(_is_meant(numbers, labels, chosen))
        for begin in range(0, len(kept), size):
            some = kept[begin : begin + size]
            yield Group(
                numbers=numbers[some],
                case=case_of(trajectories.select(some)),
                labels=Classes(classes=labels.classes[some], outcome=labels.outcome[some]),
                done=int(numbers[some[-1]]) + 1,
            )


def case_of(trajectories: Trajectories) -> Case:
    """All that facts are made of, from recordings of any origin."""
    seen = signals(trajectories)
    events = find_events(trajectories, seen)
    target = target_signals(trajectories, seen, events)
    return Case(trajectories=trajectories, signals=seen, events=events, target=target)


def _batches(data: Dataset, chosen: Choice) -> Iterator[tuple[I64, Trajectories]]:
    if chosen.numbers is None or len(chosen.numbers) > _FEW:
        yield from data.batches()
        return
    for number in sorted(chosen.numbers):
        yield np.array([number]), data.trajectory(number)


def _is_meant(numbers: I64, labels: Classes, chosen: Choice) -> NDArray[np.bool_]:
    meant = np.ones(len(numbers), np.bool_)
    if chosen.numbers is not None:
        meant &= np.isin(numbers, np.fromiter(chosen.numbers, np.int64))
    if chosen.label is not None:
        code = CLASS.names.index(chosen.label)
        meant &= labels.classes[:, POLICY.names.index(chosen.policy)] == code
    return meant


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


def _refused(what: str, expected: str, got: str) -> ConfigError:
    return ConfigError.of(
        what=what, where="logic", expected=expected, got=got, next_step="choose one of these"
    )
