"""The features of some simulations, checked once when they are given."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from overtaking.analysis.stats.columns import (
    ALL_CLASSES,
    CENSORED,
    CLASS,
    FEATURES,
    NOMINAL,
    NUMERIC,
    PAPER_CLASSES,
    WEIGHT,
)
from overtaking.core.arrays import F64, Mask
from overtaking.core.equality import ContentEquality
from overtaking.core.errors import SchemaError
from overtaking.data.tables.names import choose_reading

_WHERE = "features"
_MAX_SHOWN = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample(ContentEquality):
    """The features of some simulations.

    Attributes:
        frame: One row per simulation. Numeric features are float64, NaN: missing; nominal features
            and CLASS are categorical, with all their levels in order.
        weight: Weight of each simulation, mean 1; all ones unless weights were asked for.
        policy: The policy that decided on the classes.
        reading: The definition of the features, `paper` or `matched`.
        is_weighted: Whether `weight` holds the importance weights.
        classes: The classes to show: the paper's five, and others that occur.
    """

    frame: pd.DataFrame
    weight: F64
    policy: str
    reading: str
    is_weighted: bool
    classes: tuple[str, ...]

    def __len__(self) -> int:
        """Number of simulations."""
        return len(self.frame)

    def values(self, feature: str) -> F64:
        """A numeric feature, shape (simulation,), NaN where there is none."""
        return self.frame[feature].to_numpy(dtype=np.float64)

    def codes(self, column: str) -> NDArray[np.int64]:
        """Number of the level of a nominal feature or of CLASS, -1 where there is none."""
        return self.frame[column].cat.codes.to_numpy().astype(np.int64)

    def members(self, name: str) -> Mask:
        """Which simulations are of a class, shape (simulation,)."""
        return self.codes(CLASS) == ALL_CLASSES.index(name)

    def groups(self) -> Iterator[tuple[str, Mask]]:
        """Each class to show with its members."""
        codes = self.codes(CLASS)
        for name in self.classes:
            yield name, codes == ALL_CLASSES.index(name)

    @property
    def is_rated(self) -> Mask:
        """Which simulations count in rates: all that are not censored."""
        return ~self.members(CENSORED)

    @property
    def num_effective(self) -> float:
        """Effective sample size.

        Source: L. Kish, Survey Sampling, 1965, section 11.7.
        """
        return effective_size(self.weight)


def effective_size(weight: F64) -> float:
    """Effective number of weighted observations, 0 for none."""
    squares = float((weight**2).sum())
    return float(weight.sum()) ** 2 / squares if squares > 0 else 0.0


def prepare(
    frame: pd.DataFrame,
    *,
    policy: str,
    reading: str | None = None,
    weighted: bool = False,
) -> Sample:
    """Check a frame of features.

    Args:
        frame: One row per simulation, with the paper's features and CLASS, and `weight` if
            `weighted`. Other columns are left out.
        policy: The policy that decided about the classes.
        reading: How it was measured; `paper` for the policy of that name, else `matched`.
        weighted: Whether to count each simulation by its importance weight.

    Raises:
        SchemaError: A column is missing or holds something that it must not.
    """
    names = [one.name for one in FEATURES] + [CLASS] + [WEIGHT] * weighted
    missing = [name for name in names if name not in frame.columns]
    if missing:
        raise _error("columns", f"all of {', '.join(names)}", f"none named {', '.join(missing)}")
    columns = {one.name: _numeric(frame, one.name) for one in NUMERIC}
    columns |= {one.name: _nominal(frame, one.name, one.levels) for one in NOMINAL}
    columns[CLASS] = _nominal(frame, CLASS, ALL_CLASSES)
    if columns[CLASS].isna().any():
        raise _error(f"column {CLASS}", "a class in every row", "rows without one")
    ordered = {one.name: columns[one.name] for one in FEATURES} | {CLASS: columns[CLASS]}
    present = set(columns[CLASS].cat.categories[np.unique(columns[CLASS].cat.codes)])
    return Sample(
        frame=pd.DataFrame(ordered, index=frame.index),
        weight=_weights(frame) if weighted else np.ones(len(frame)),
        policy=policy,
        reading=choose_reading(reading, policy),
        is_weighted=weighted,
        classes=tuple(one for one in ALL_CLASSES if one in PAPER_CLASSES or one in present),
    )


def _numeric(frame: pd.DataFrame, name: str) -> pd.Series:
    """A numeric column as float64."""
    try:
        values = pd.to_numeric(frame[name]).astype(np.float64)
    except (TypeError, ValueError):
        raise _error(f"column {name}", "numbers", f"values of type {frame[name].dtype}") from None
    if np.isinf(values).any():
        raise _error(f"column {name}", "finite numbers, or none", "an infinite one")
    return values


def _nominal(frame: pd.DataFrame, name: str, levels: tuple[str, ...]) -> pd.Series:
    """A column of names as a categorical with all its levels."""
    column = frame[name]
    is_known = column.isin(levels) | column.isna()
    if not is_known.all():
        found = ", ".join(sorted({str(one) for one in column[~is_known].unique()})[:_MAX_SHOWN])
        raise _error(f"column {name}", f"one of {', '.join(levels)}", found)
    return column.astype(pd.CategoricalDtype(list(levels)))


def _weights(frame: pd.DataFrame) -> F64:
    """The importance weights, scaled to a mean of 1."""
    weight = _numeric(frame, WEIGHT).to_numpy()
    if len(weight) and not (np.all(weight >= 0.0) and weight.sum() > 0.0):
        raise _error(f"column {WEIGHT}", "weights of 0 or more, not all 0", "others")
    return weight / weight.mean() if len(weight) else weight


def _error(what: str, expected: str, got: str) -> SchemaError:
    return SchemaError(
        what=what,
        where=_WHERE,
        expected=expected,
        got=got,
        next_step="pass what Dataset.features returns",
    )
