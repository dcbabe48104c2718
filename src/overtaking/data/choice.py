"""Which simulations of a data set are meant, by number and by class."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from overtaking.core.errors import ConfigError, check_choice
from overtaking.data.tables.names import CLASSES, POLICY_NAMES
from overtaking.labels.law.judging import choose_policy

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from overtaking.data.load import Dataset

    I64 = NDArray[np.int64]

_WHERE = "choice of simulations"

_FAR = 64
"""Least distance between the numbers of two simulations that are read separately."""


def chosen(
    data: Dataset,
    numbers: Iterable[int] | None = None,
    label: str | None = None,
    policy: str | None = None,
) -> I64 | None:
    """The numbers of the simulations that are meant.

    Args:
        data: The data set.
        numbers: Numbers of simulations, None for all.
        label: A class that they must have, in any case of letters, None for any.
        policy: The policy that decides about the class; None for the default of the profile.

    Returns:
        Their numbers in order, each once, shape (chosen,); None for all.

    Raises:
        ConfigError: There is no such simulation, class or policy.
        DatasetError: A file of labels is damaged.
    """
    found = None if numbers is None else np.unique(np.fromiter(numbers, np.int64))
    if found is not None and found.size and not 0 <= found[0] <= found[-1] < len(data):
        wrong = int(found[0] if found[0] < 0 else found[-1])
        raise ConfigError.out_of_range(
            what="simulation", where=_WHERE, low=0, high=len(data) - 1, got=wrong
        )
    policy = choose_policy(policy, data.profile)
    check_choice(policy, POLICY_NAMES, what="policy", where=_WHERE)
    if label is None:
        return found
    names = {name.lower(): name for name in CLASSES}
    if label.lower() not in names:
        raise ConfigError.unknown_choice(what="class", where=_WHERE, choices=CLASSES, got=label)
    members = _members(data, names[label.lower()], policy)
    return members if found is None else np.intersect1d(found, members)


def stretches(numbers: I64) -> list[I64]:
    """Numbers in order, split where so many are left out that reading them does not pay."""
    if not numbers.size:
        return []
    return np.split(numbers, np.flatnonzero(np.diff(numbers) > _FAR) + 1)


def _members(data: Dataset, label: str, policy: str) -> I64:
    """The simulations of a class."""
    parts: list[I64] = []
    for _first, tables in data.columns(labels=("simulation", "policy", "class")):
        rows = tables["labels"].to_pandas()
        is_meant = (rows["class"] == label) & (rows["policy"] == policy)
        parts.append(rows["simulation"][is_meant].to_numpy(np.int64))
    return np.concatenate(parts)
