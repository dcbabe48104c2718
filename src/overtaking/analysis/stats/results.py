"""The statistics of a data set: the paper's tables, the waiting time, notes and warnings."""

from dataclasses import dataclass
from typing import Any

import pandas as pd

from overtaking.analysis.result_methods import Plottable
from overtaking.analysis.stats.columns import CENSORED, COLLISION, NO_ATTEMPT, NUMERIC
from overtaking.analysis.stats.leaks import Leak, leaks
from overtaking.analysis.stats.sample import Sample, prepare
from overtaking.analysis.stats.survival import Survival, waiting_time
from overtaking.analysis.stats.table import Table
from overtaking.analysis.stats.tables import class_table, dynamic_table, static_table
from overtaking.core.equality import ContentEquality
from overtaking.core.representation import CompactRepr, json_values

_DECENT_SHARE = 0.3  # Below this share of effective simulations, weighted numbers are coarse.


@dataclass(frozen=True, slots=True, kw_only=True)
class Statistics(CompactRepr, ContentEquality, Plottable):
    """The statistics of a labelled data set.

    Attributes:
        sample: The simulations.
        classes: The frequency of each class.
        static: The paper's table of static features.
        dynamic: The paper's table of dynamic features.
        waiting: The waiting time until drivers begin; None: unknown.
        leaks: Classes that are missing where they should occur.
        notes: Remarks that a reader of the numbers needs.
    """

    sample: Sample
    classes: Table
    static: Table
    dynamic: Table
    waiting: Survival | None
    leaks: tuple[Leak, ...]
    notes: tuple[str, ...]

    @property
    def tables(self) -> tuple[Table, ...]:
        """The tables in order."""
        return self.classes, self.static, self.dynamic

    def to_pandas(self) -> dict[str, pd.DataFrame]:
        """The exact values of each table by its name, and the curve of waiting times if known."""
        frames = {table.name: table.rows.copy() for table in self.tables}
        return frames if self.waiting is None else frames | {"waiting-time": self.waiting.rows()}

    def __repr__(self) -> str:
        """The text of `overtaking stats` without the glossary."""
        from overtaking.analysis.stats.formats import to_text

        return to_text(self)

    def _repr_html_(self) -> str:
        """The same for notebooks."""
        from overtaking.analysis.stats.formats import to_html

        return to_html(self)

    def values(self) -> dict[str, Any]:
        """Everything as plain values for JSON."""
        return {
            "policy": self.sample.policy,
            "reading": self.sample.reading,
            "weighted": self.sample.is_weighted,
            "simulations": len(self.sample),
            "effective_simulations": self.sample.num_effective,
            **{table.name.replace("-", "_"): table.records() for table in self.tables},
            "waiting_time": _waiting_values(self.waiting),
            "warnings": [leak.sentence for leak in self.leaks],
            "notes": list(self.notes),
        }


def statistics(
    frame: pd.DataFrame,
    *,
    policy: str,
    reading: str | None = None,
    weighted: bool = False,
) -> Statistics:
    """Compute the statistics.

    Args:
        frame: One row per simulation: the paper's features, CLASS, and `weight` if `weighted`.
        policy: The policy that decided on the classes.
        reading: How the features were measured; `paper` for the policy of that name, else
            `matched`.
        weighted: Whether to count each simulation by its importance weight.

    Raises:
        SchemaError: A column is missing or holds something that it must not.
    """
    sample = prepare(frame, policy=policy, reading=reading, weighted=weighted)
    return Statistics(
        sample=sample,
        classes=class_table(sample),
        static=static_table(sample),
        dynamic=dynamic_table(sample),
        waiting=waiting_time(sample),
        leaks=leaks(sample),
        notes=tuple(_notes(sample)),
    )


def _notes(sample: Sample) -> list[str]:
    """Remarks that a reader of the numbers needs."""
    notes: list[str] = []
    empty = [name for name, of in sample.groups() if not of.any()]
    if empty:
        notes.append(f"No simulation is of class {', '.join(empty)}.")
    constant = [one.name for one in NUMERIC if sample.frame[one.name].nunique() < 2]
    if constant:
        notes.append(f"The same in all simulations, or missing in all: {', '.join(constant)}.")
    censored = int(sample.members(CENSORED).sum())
    if censored:
        notes.append(
            f"{censored:,} simulations were still open when they ended (censored); "
            "they are left out of every rate."
        )
    early = int((sample.members(COLLISION) & (sample.values("OT") == 0.0)).sum())
    if early:
        notes.append(
            f"{early:,} of the {int(sample.members(COLLISION).sum()):,} simulations of class "
            f"{COLLISION} hit another vehicle before any attempt; by the other reading of the "
            f"study these are {NO_ATTEMPT}."
        )
    if len(sample) < 2:
        notes.append("With fewer than two simulations there is no spread and no association.")
    if sample.is_weighted:
        notes.append(_weight_note(sample))
    if sample.reading != "paper":
        notes.append(
            f"In the {sample.reading} reading the waiting times of No_attempt are drawn, "
            "so no curve of waiting times can be estimated from them."
        )
    return notes


def _weight_note(sample: Sample) -> str:
    """The loss of precision by weights."""
    size, number = sample.num_effective, len(sample)
    coarse = " Expect coarse numbers." if size < _DECENT_SHARE * number else ""
    return f"Weighted: {number:,} simulations say as much as {size:,.0f} unweighted ones.{coarse}"


def _waiting_values(waiting: Survival | None) -> dict[str, Any] | None:
    """The curve of waiting times as plain values."""
    if waiting is None:
        return None
    return {
        "events": waiting.num_events,
        "censored": waiting.num_censored,
        "median_s": json_values(waiting.median),
        "curve": waiting.rows().to_dict(orient="list"),
    }
