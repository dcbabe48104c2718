"""The simulations of a data set as examples: what was known, what came of it, what is kin."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from overtaking.analysis.learning.attributes import ATTRIBUTES, BY_NAME, Attribute
from overtaking.analysis.learning.derived import DERIVED
from overtaking.analysis.learning.targets import Target, is_asked
from overtaking.core.errors import DatasetError
from overtaking.data.load import Dataset

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Mask = NDArray[np.bool_]

_PART = r"(?: frames \d+ to \d+)? vehicles [\d ]*$"
"""Which part of a recording a simulation is: the end of its `source_recording`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Examples:
    """Examples to learn from, one per simulation.

    Attributes:
        simulations: Their numbers, shape (simulation,).
        attributes: What the columns of `values` are.
        values: Each attribute [SI], finite, shape (simulation, attribute).
        classes: Name of the class of each, shape (simulation,).
        attempted: Whether an overtake was begun, same shape.
        groups: Number of the root scenario or recording that each comes from, same shape.
        policy: The policy that decided about the classes.
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
        """Some of them, by a mask or by their places."""
        return replace(
            self,
            simulations=self.simulations[chosen],
            values=self.values[chosen],
            classes=self.classes.iloc[np.flatnonzero(chosen) if chosen.dtype == bool else chosen],
            attempted=self.attempted[chosen],
            groups=self.groups[chosen],
        )

    def with_attributes(self, names: tuple[str, ...]) -> "Examples":
        """The same with some of the attributes."""
        places = [n for n, one in enumerate(self.attributes) if one.name in names]
        return replace(
            self,
            attributes=tuple(self.attributes[n] for n in places),
            values=self.values[:, places],
        )

    def column(self, name: str) -> F64:
        """One attribute, shape (simulation,)."""
        return self.values[:, [one.name for one in self.attributes].index(name)]

    def about(self, target: Target) -> tuple["Examples", Mask]:
        """Those that a target asks about, and in which of them it is so."""
        asked = is_asked(self.classes, self.attempted, self.is_seen, target)
        chosen = self.where(asked)
        return chosen, chosen.classes.isin(target.classes).to_numpy()

    @property
    def is_seen(self) -> Mask:
        """Whether there is a vehicle ahead, shape (simulation,)."""
        # A gap that is cut off at its longest is nobody: everybody nearer is seen.
        return self.column("ahead_gap_m") < BY_NAME["ahead_gap_m"].absent


def examples_of(data: Dataset, policy: str = "paper") -> Examples:
    """The examples of a data set.

    Args:
        data: The data set.
        policy: Which rules decide about the class.

    Raises:
        ConfigError: There is no such policy.
        DatasetError: It was made before there was a table of decisions, or has too few rows.
    """
    decisions = data.decisions().set_index("simulation").sort_index()
    classes = data.features(policy)["CLASS"].reindex(decisions.index)
    events = data.events()
    begun = events.loc[events["event"] == "attempt", "simulation"]
    return Examples(
        simulations=decisions.index.to_numpy(dtype=np.int64),
        attributes=ATTRIBUTES,
        values=values_of(decisions),
        classes=classes,
        attempted=decisions.index.isin(begun),
        groups=groups_of(data.simulations().set_index("simulation").reindex(decisions.index)),
        policy=policy,
    )


def values_of(decisions: pd.DataFrame) -> F64:
    """Every attribute of each row of `decisions` [SI], shape (row, attribute)."""
    columns = [_column(decisions, one) for one in ATTRIBUTES]
    return np.column_stack(columns) if len(decisions) else np.zeros((0, len(columns)))


def _column(decisions: pd.DataFrame, attribute: Attribute) -> F64:
    """One attribute: numbers of names, and what is absent at its harmless end."""
    if attribute.name in DERIVED:
        values = DERIVED[attribute.name](lambda name: _plain(decisions[name]))
    else:
        values = _plain(decisions[attribute.name])
    values = np.where(np.isnan(values), attribute.absent, values)
    return np.clip(values, attribute.low, attribute.high)


def _plain(column: pd.Series) -> F64:
    """A column as numbers, NaN where there is none."""
    if isinstance(column.dtype, pd.CategoricalDtype):
        codes = column.cat.codes.to_numpy(dtype=np.float64)
        return np.where(codes < 0.0, np.nan, codes)
    return column.to_numpy(dtype=np.float64, na_value=np.nan)


def groups_of(simulations: pd.DataFrame) -> I64:
    """Number of the root of each simulation.

    All that comes from one recording belongs together, whoever is the ego in it. What is simulated
    belongs together if seed and index are the same: twins and branches of one scenario are.

    Args:
        simulations: Rows of the table of that name.
    """
    recording = simulations["source_recording"].astype("object")
    is_recorded = recording.notna().to_numpy()
    of_recording = recording.where(is_recorded, "").astype(str).str.replace(_PART, "", regex=True)
    roots = simulations["seed"].astype(str) + ":" + simulations["index"].astype(str)
    keys = np.where(is_recorded, of_recording.to_numpy(dtype=object), roots.to_numpy(dtype=object))
    return np.unique(keys.astype(str), return_inverse=True)[1].astype(np.int64)


def refuse_too_few(positive: Mask, groups: I64, *, where: str, what: str, least: int) -> None:
    """Refuse what nobody could learn from.

    Args:
        positive: In which examples the target is so, shape (example,).
        groups: Group of each, same shape.
        where: Who asks.
        what: The target.
        least: Examples of each kind, and groups, that are needed.

    Raises:
        DatasetError: There are fewer.
    """
    fewest = min(int(positive.sum()), int((~positive).sum()))
    if fewest >= least and len(np.unique(groups)) >= least:
        return
    raise DatasetError.of(
        what=f"examples of {what}",
        where=where,
        expected=f"at least {least} in which it is so, {least} in which it is not, and as many "
        "scenarios or recordings",
        got=f"{int(positive.sum())}, {int((~positive).sum())} and {len(np.unique(groups))}",
        next_step="make a larger data set, or use --balance",
    )
