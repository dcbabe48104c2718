"""The simulations of a data set as examples: attributes, classes and groups."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from overtaking.analysis.learning.attributes import ATTRIBUTES, BY_NAME, DERIVED, Attribute
from overtaking.analysis.learning.targets import Target, is_asked
from overtaking.core.arrays import F64, I64, Mask
from overtaking.core.errors import DatasetError
from overtaking.data.load import Dataset
from overtaking.labels.law.judging import choose_policy

_PART = r"(?: frames \d+ to \d+)? vehicles [\d ]*$"
"""The end of a `source_recording`: the part of the recording."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Examples:
    """Examples to learn from, one per simulation.

    Attributes:
        simulations: Their numbers, shape (simulation,).
        attributes: The columns of `values`.
        values: The attributes [SI], finite, shape (simulation, attribute).
        classes: Name of the class, shape (simulation,).
        attempted: Whether an overtake was begun, same shape.
        groups: Number of the root scenario or recording, same shape.
        policy: The policy that decided on the classes.
    """

    simulations: I64
    attributes: tuple[Attribute, ...]
    values: F64
    classes: "pd.Series[str]"
    attempted: Mask
    groups: I64
    policy: str

    def __len__(self) -> int:
        """Number of examples."""
        return len(self.simulations)

    def where(self, chosen: Mask | I64) -> "Examples":
        """Some of them, by a mask or by their indices."""
        return replace(
            self,
            simulations=self.simulations[chosen],
            values=self.values[chosen],
            classes=self.classes.iloc[chosen],
            attempted=self.attempted[chosen],
            groups=self.groups[chosen],
        )

    def with_attributes(self, names: tuple[str, ...]) -> "Examples":
        """The same with some of the attributes."""
        indices = [n for n, one in enumerate(self.attributes) if one.name in names]
        return replace(
            self,
            attributes=tuple(self.attributes[n] for n in indices),
            values=self.values[:, indices],
        )

    def column(self, name: str) -> F64:
        """One attribute, shape (simulation,)."""
        return self.values[:, [one.name for one in self.attributes].index(name)]

    def about(self, target: Target) -> tuple["Examples", Mask]:
        """The examples that a target asks about, and whether it is true, shape (example,)."""
        chosen = self.where(self.is_asked(target))
        return chosen, chosen.classes.isin(target.classes).to_numpy()

    def is_asked(self, target: Target) -> Mask:
        """Whether a target asks about each simulation, shape (simulation,)."""
        return is_asked(self.classes, self.attempted, self.is_seen, target)

    @property
    def is_seen(self) -> Mask:
        """Whether there is a vehicle ahead, shape (simulation,)."""
        # The longest gap stands for no vehicle.
        return self.column("leader_gap_m") < BY_NAME["leader_gap_m"].scale.absent


def examples_of(data: Dataset, policy: str | None = None) -> Examples:
    """The examples of a data set.

    Args:
        data: The data set.
        policy: The policy that decides on the class; None for the default of the profile.

    Raises:
        ConfigError: There is no such policy.
        DatasetError: It has no table of decisions, or one with too few rows.
    """
    policy = choose_policy(policy, data.profile)
    attempts = data.attempts().set_index("simulation").sort_index()
    classes = data.features(policy)["CLASS"].reindex(attempts.index)
    events = data.events()
    begun = events.loc[events["event"] == "attempt", "simulation"]
    attributes = tuple(one for one in ATTRIBUTES if data.road.is_two_way or not one.of_two_ways)
    return Examples(
        simulations=attempts.index.to_numpy(dtype=np.int64),
        attributes=attributes,
        values=values_of(attempts, attributes),
        classes=classes,
        attempted=attempts.index.isin(begun),
        groups=groups_of(data.simulations().set_index("simulation").reindex(attempts.index)),
        policy=policy,
    )


def values_of(decisions: pd.DataFrame, attributes: tuple[Attribute, ...]) -> F64:
    """Some attributes of each row of `attempts` [SI], shape (row, attribute)."""
    columns = [_column(decisions, one) for one in attributes]
    return np.column_stack(columns) if len(decisions) else np.zeros((0, len(columns)))


def _column(decisions: pd.DataFrame, attribute: Attribute) -> F64:
    """One attribute: codes of names; absent values at the harmless end."""
    name, scale = attribute.name, attribute.scale
    if name in DERIVED:
        values = DERIVED[name](lambda column: _numbers(decisions[column]))
    else:
        values = _numbers(decisions[name])
    return np.clip(np.where(np.isnan(values), scale.absent, values), scale.low, scale.high)


def _numbers(column: pd.Series) -> F64:
    """A column as numbers, NaN where there is no value."""
    if isinstance(column.dtype, pd.CategoricalDtype):
        codes = column.cat.codes.to_numpy(dtype=np.float64)
        return np.where(codes < 0.0, np.nan, codes)
    return column.to_numpy(dtype=np.float64, na_value=np.nan)


def groups_of(simulations: pd.DataFrame) -> I64:
    """Number of the root of each simulation: equal numbers have equal `roots_of`.

    Args:
        simulations: Rows of the table of that name.
    """
    return np.unique(roots_of(simulations), return_inverse=True)[1].astype(np.int64)


def roots_of(simulations: pd.DataFrame) -> NDArray[np.str_]:
    """Name of the root of each simulation, shape (simulation,).

    Simulations of one recording belong together, whichever vehicle is the ego. So do simulations
    with the same seed and index: twins and branches of one scenario.

    Args:
        simulations: Rows of the table of that name.
    """
    recording = simulations["source_recording"].astype("object")
    is_recorded = recording.notna().to_numpy()
    of_recording = recording.where(is_recorded, "").astype(str).str.replace(_PART, "", regex=True)
    roots = simulations["seed"].astype(str) + ":" + simulations["scenario_index"].astype(str)
    keys = np.where(is_recorded, of_recording.to_numpy(dtype=object), roots.to_numpy(dtype=object))
    return keys.astype(str)


def refuse_too_few(positive: Mask, groups: I64, *, where: str, what: str, least: int) -> None:
    """Refuse too few examples to learn from.

    Args:
        positive: Whether the target is true, shape (example,).
        groups: Group of each example, same shape.
        where: The command.
        what: The target.
        least: Examples of each kind, and groups, that are required.

    Raises:
        DatasetError: There are fewer.
    """
    numbers = int(positive.sum()), int((~positive).sum()), len(np.unique(groups))
    if min(numbers) >= least:
        return
    raise DatasetError(
        what=f"examples of {what}",
        where=where,
        expected=f"at least {least} positive and {least} negative ones, from as many scenarios or "
        "recordings",
        got=f"{numbers[0]}, {numbers[1]} and {numbers[2]}",
        next_step="make a larger data set, or use --balance",
    )
