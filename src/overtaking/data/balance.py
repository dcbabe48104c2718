"""Balanced data sets: cells, quotas, and the weights that restore the natural shares."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F64, I64, Mask
from overtaking.core.errors import ConfigError, convert_integers
from overtaking.labels.law.judging import stored_policy as known_policy
from overtaking.model.batch import FieldSpec
from overtaking.model.checks import check_batch
from overtaking.model.verdicts import OvertakeClass

BY = (("class",), ("class", "day-night"))
"""The variables that can define the cells."""

CLASSES = tuple(one for one in OvertakeClass if one <= OvertakeClass.UNSUCCESS_NCOL)
"""The paper's five classes. They have quotas, the others have none."""

OUTSIDE = -1
"""Cell of a simulation whose class has no quota."""

CANDIDATES_PER_SIMULATION = 200
"""Candidates for each simulation wanted, if nothing else is asked for: a class of 1 in 1,000 fills
a fifth of the data set."""

MIN_CANDIDATES = 10_000
"""The same for small data sets, in which a rare class may be late by chance."""

MAX_CANDIDATES = 10**12
"""A larger number is a typing error."""

_LIGHT = ("Day", "Night")


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassBalance:
    """How a data set is balanced: equal shares for all cells, in the order of the candidates.

    Candidates are the simulations that an ordinary data set of the same profile and seed has, one
    after the other. A candidate is kept while its cell has room.

    Attributes:
        by: What defines the cells, one of `BY`.
        policy: Which rules decide about the class: `paper`, `default` or `strict`; None for the
            default of the profile.
        candidates: How many candidates to look at before giving up; None for 200 for each
            simulation that is wanted, at least 10,000.
        allows_missing: Whether to be content with fewer simulations if a cell is not full by then.

    Raises:
        ConfigError: One of them is none of that.
    """

    by: tuple[str, ...] = ("class",)
    policy: str | None = None
    candidates: Annotated[int | None, FieldSpec(low=1, high=MAX_CANDIDATES)] = None
    allows_missing: bool = False

    def __post_init__(self) -> None:
        """Refuse what cannot be carried out, before anything is made."""
        check_batch(self, "balance")
        convert_integers(self, "candidates")
        if self.policy is not None:
            known_policy(self.policy)
        if self.by not in BY:
            choices = [",".join(names) for names in BY]
            raise ConfigError.unknown_choice(
                what="cells", where="balance", choices=choices, got=",".join(self.by)
            )

    def __str__(self) -> str:
        """The settings in one line."""
        end = "fewer simulations if that is not enough" if self.allows_missing else "no fewer"
        policy = f"policy {self.policy}" if self.policy else "the policy of the profile"
        return (
            f"equal numbers by {','.join(self.by)} under {policy} "
            f"from at most {self.candidates} candidates, {end}"
        )

    @property
    def cells(self) -> tuple[str, ...]:
        """Names of the cells, by number."""
        if "day-night" not in self.by:
            return tuple(one.title for one in CLASSES)
        return tuple(f"{one.title}/{light}" for one in CLASSES for light in _LIGHT)

    def limit(self, num_simulations: int) -> int:
        """Largest number of candidates."""
        usual = max(MIN_CANDIDATES, CANDIDATES_PER_SIMULATION * num_simulations)
        return min(usual, MAX_CANDIDATES) if self.candidates is None else self.candidates

    def quotas(self, num_simulations: int) -> I64:
        """Simulations wanted of each cell: as many of each, and one more of the first ones.

        Raises:
            ConfigError: There are more cells than simulations.
        """
        cells = len(self.cells)
        if num_simulations < cells:
            raise ConfigError(
                what="simulations",
                where="balance",
                expected=f"at least {cells}, one a cell",
                got=num_simulations,
                next_step="ask for more simulations or fewer cells",
            )
        each, left = divmod(num_simulations, cells)
        return np.where(np.arange(cells) < left, each + 1, each).astype(np.int64)

    def cell_of(self, classes: NDArray[np.uint8], night: Mask) -> I64:
        """Number of the cell of each simulation, or `OUTSIDE`; every shape is (simulation,).

        Args:
            classes: Values of `OvertakeClass` under the policy.
            night: Whether it is night.
        """
        cell = classes.astype(np.int64)
        if "day-night" in self.by:
            cell = cell * len(_LIGHT) + night
        return np.where(classes < len(CLASSES), cell, OUTSIDE)


def selection_weights(seen: I64, kept: I64) -> F64:
    """For each cell, how many natural simulations one that was kept stands for, shape (cell,).

    The first `kept` of `seen` exchangeable candidates were kept, each with the probability
    kept / seen; its inverse is the weight. The weights of all that were kept have the mean 1, and
    sum up, cell by cell, to the shares that the cells had among the candidates.

    Args:
        seen: Candidates of each cell.
        kept: Those that were kept; not 0 unless `seen` is.

    Returns:
        seen / kept, times sum(kept) / sum(seen); 0 for cells without candidates.

    Source: D. G. Horvitz and D. J. Thompson, A generalization of sampling without replacement from
    a finite universe, Journal of the American Statistical Association 47, 1952, 663-685.
    """
    all_seen, all_kept = int(seen.sum()), int(kept.sum())
    # Of integers, which are exact, so that the quotient is rounded once.
    pairs = zip(seen.tolist(), kept.tolist(), strict=True)
    return np.array([s * all_kept / (k * all_seen) if k else 0.0 for s, k in pairs])
