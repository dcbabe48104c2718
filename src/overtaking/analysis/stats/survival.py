"""How long drivers wait before they begin to overtake, with those who never began as censored."""

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from overtaking.analysis.stats.columns import CLASS, NO_ATTEMPT
from overtaking.analysis.stats.moments import sums
from overtaking.analysis.stats.sample import Sample

F64 = NDArray[np.float64]
Mask = NDArray[np.bool_]

_Z95 = 1.959963984540054


@dataclass(frozen=True, slots=True, kw_only=True)
class Survival:
    """A Kaplan-Meier curve; arrays have shape (instant,), one for each time at which drivers began.

    Attributes:
        time: The instants, growing [s].
        at_risk: Weight of those who were still waiting just before.
        events: Weight of those who began then.
        survival: Share that is still waiting just after.
        error: Standard error of `survival`.
        num_events: Number of drivers who began.
        num_censored: Number of those whose waiting ended with the recording.
    """

    time: F64
    at_risk: F64
    events: F64
    survival: F64
    error: F64
    num_events: int
    num_censored: int

    @property
    def low(self) -> F64:
        """Lower limit with 95 % confidence."""
        return self._limits()[0]

    @property
    def high(self) -> F64:
        """Upper limit with 95 % confidence."""
        return self._limits()[1]

    @property
    def median(self) -> float:
        """When half of all have begun [s]; NaN if that was not observed."""
        return self.quantile(0.5)

    def quantile(self, share: float) -> float:
        """When a share of all have begun [s]; NaN if that was not observed."""
        begun = np.flatnonzero(self.survival <= 1.0 - share + 1e-12)
        return float(self.time[begun[0]]) if len(begun) else math.nan

    def _limits(self) -> tuple[F64, F64]:
        """Limits on the scale of log(-log), where they stay between 0 and 1.

        Source:
            J. D. Kalbfleisch and R. L. Prentice, The Statistical Analysis of Failure Time Data,
            2nd edition, 2002, section 1.4.
        """
        inside = (self.survival > 0.0) & (self.survival < 1.0)
        safe = np.where(inside, self.survival, 0.5)
        reach = np.exp(_Z95 * self.error / (safe * np.abs(np.log(safe))))
        low = np.where(inside, safe**reach, self.survival)
        high = np.where(inside, safe ** (1.0 / reach), self.survival)
        return low, high

    def rows(self) -> pd.DataFrame:
        """The curve as a table, one row per instant."""
        return pd.DataFrame(
            {
                "time_s": self.time,
                "at_risk": self.at_risk,
                "events": self.events,
                "survival": self.survival,
                "error": self.error,
                "low": self.low,
                "high": self.high,
            }
        )


def kaplan_meier(time: F64, is_event: Mask, weight: F64 | None = None) -> Survival:
    """Estimate which share is still waiting.

    Args:
        time: How long each waited, at least 0, without gaps, shape (simulation,) [s].
        is_event: Whether the waiting ended by itself, not with the recording, same shape.
        weight: Weight of each, all ones by default.

    Returns:
        The curve. Its error is Greenwood's; with weights the one of Xie and Liu, in which the
        number at risk is the effective one, and which is Greenwood's where all weights are equal.

    Source:
        E. L. Kaplan and P. Meier, J. Am. Stat. Assoc. 53 (1958) 457-481; J. Xie and C. Liu,
        Adjusted Kaplan-Meier estimator and log-rank test with inverse probability of treatment
        weighting for survival data, Stat. Med. 24 (2005) 3089-3110.
    """
    weight = np.ones(len(time)) if weight is None else weight
    instants, number = np.unique(time, return_inverse=True)
    size = len(instants)
    events = sums(number[is_event], weight[is_event], size)
    at_risk, squares = _remaining(sums(number, weight)), _remaining(sums(number, weight**2))
    shown = events > 0.0
    events, at_risk, squares = events[shown], at_risk[shown], squares[shown]
    stay = np.clip(1.0 - events / at_risk, 0.0, 1.0)
    stay[stay < 1e-12] = 0.0  # The last ones began: what is left is rounding.
    survival = np.cumprod(stay, dtype=np.float64)
    effective = at_risk**2 / squares
    with np.errstate(divide="ignore", invalid="ignore"):
        error = survival * np.sqrt(np.cumsum((1.0 - stay) / (stay * effective)))
    return Survival(
        time=instants[shown],
        at_risk=at_risk,
        events=events,
        survival=survival,
        error=np.where(survival > 0.0, error, 0.0),
        num_events=int(is_event.sum()),
        num_censored=int((~is_event).sum()),
    )


def _remaining(per_instant: F64) -> F64:
    """The sum over each instant and all later ones."""
    return np.cumsum(per_instant[::-1])[::-1]


def waiting_time(sample: Sample) -> Survival | None:
    """The curve of the waiting times WT.

    Returns:
        The curve, or None if no waiting time is known, or if those of No_attempt were drawn, as
        the matched reading does: how long these drivers waited cannot be told from them.
        A collision before any attempt ends the waiting without an attempt, so it is censored.
    """
    values = sample.values("WT")
    there = ~np.isnan(values) & (values >= 0.0) & (sample.weight > 0.0)
    if sample.reading != "paper" or not there.any():
        return None
    began = (sample.frame[CLASS] != NO_ATTEMPT).to_numpy() & (sample.values("OT") > 0.0)
    return kaplan_meier(values[there], began[there], sample.weight[there])
