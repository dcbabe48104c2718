"""Waiting times until drivers begin to overtake; those who never begin are censored."""

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd

from overtaking.analysis.stats.columns import CLASS, NO_ATTEMPT
from overtaking.analysis.stats.sample import Sample
from overtaking.analysis.stats.weighted_statistics import Z95, sums
from overtaking.core.arrays import F64, Mask
from overtaking.core.equality import ContentEquality


@dataclass(frozen=True, slots=True, kw_only=True)
class Survival(ContentEquality):
    """A Kaplan-Meier curve; arrays have shape (instant,), one for each time at which drivers began.

    Attributes:
        time: The instants, growing [s].
        at_risk: Weight of the drivers that still waited just before.
        events: Weight of the drivers that began then.
        survival: Share that still waits just after.
        error: Standard error of `survival`.
        low: Lower limit of its 95 % confidence interval.
        high: Upper limit.
        num_events: Number of drivers who began.
        num_censored: Number of drivers who had not begun when the recording ended.
    """

    time: F64
    at_risk: F64
    events: F64
    survival: F64
    error: F64
    low: F64
    high: F64
    num_events: int
    num_censored: int

    @property
    def median(self) -> float:
        """Time at which half of all have begun [s]; NaN if that was not observed."""
        return self.quantile(0.5)

    def quantile(self, share: float) -> float:
        """Time at which a share of all have begun [s]; NaN if that was not observed."""
        begun = np.flatnonzero(self.survival <= 1.0 - share + 1e-12)
        return float(self.time[begun[0]]) if len(begun) else math.nan

    def rows(self) -> pd.DataFrame:
        """The curve as a table, one row per instant."""
        names = ("at_risk", "events", "survival", "error", "low", "high")
        return pd.DataFrame({"time_s": self.time} | {name: getattr(self, name) for name in names})


def kaplan_meier(time: F64, is_event: Mask, weight: F64 | None = None) -> Survival:
    """Estimate the share that still waits.

    Args:
        time: Waiting time, at least 0, without gaps, shape (simulation,) [s].
        is_event: Whether the driver began, same shape; else the time is censored.
        weight: Weight of each simulation, all ones by default.

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
    stay[stay < 1e-12] = 0.0  # The last ones began: the rest is rounding error.
    survival = np.cumprod(stay, dtype=np.float64)
    effective = at_risk**2 / squares
    with np.errstate(divide="ignore", invalid="ignore"):
        error = survival * np.sqrt(np.cumsum((1.0 - stay) / (stay * effective)))
    error = np.where(survival > 0.0, error, 0.0)
    low, high = _limits(survival, error)
    return Survival(
        time=instants[shown],
        at_risk=at_risk,
        events=events,
        survival=survival,
        error=error,
        low=low,
        high=high,
        num_events=int(is_event.sum()),
        num_censored=int((~is_event).sum()),
    )


def _limits(survival: F64, error: F64) -> tuple[F64, F64]:
    """95 % confidence limits on the scale of log(-log), where they stay between 0 and 1.

    Source:
        J. D. Kalbfleisch and R. L. Prentice, The Statistical Analysis of Failure Time Data, 2nd
        edition, 2002, section 1.4.
    """
    inside = (survival > 0.0) & (survival < 1.0)
    safe = np.where(inside, survival, 0.5)
    reach = np.exp(Z95 * error / (safe * np.abs(np.log(safe))))
    return np.where(inside, safe**reach, survival), np.where(inside, safe ** (1 / reach), survival)


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
