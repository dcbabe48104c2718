"""The result of an evaluation: rates, differences, margins, and the worst scenes."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from overtaking.analysis.evaluation.bootstrap import FEW, LEVEL
from overtaking.analysis.evaluation.endpoints import POLICY
from overtaking.analysis.result_methods import Plottable, Reportable
from overtaking.core.equality import ContentEquality
from overtaking.core.representation import CompactRepr, json_values

if TYPE_CHECKING:
    from overtaking.analysis.evaluation.endpoints import Endpoint
    from overtaking.labels.labelling import LabelledTrajectories

TOO_FEW = "too few"

LEAST_EFFECTIVE = 10.0
"""Effective scenes below which tables and figures do not show a rate by weather."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rate(ContentEquality):
    """An endpoint of one driver in one kind of weather.

    Attributes:
        driver: Name of the driver.
        endpoint: What is measured.
        weather: Name of the stratum.
        value: The ratio, in the unit of the endpoint; NaN without anything to divide by.
        low: Lower limit of its 95 % interval.
        high: Upper limit.
        scenes: Scenes in which something is counted.
        effective: Effective number of scenes in the whole.
        largest: Share of the scene with the largest weight in the whole.
    """

    driver: str
    endpoint: Endpoint
    weather: str
    value: float
    low: float
    high: float
    scenes: int
    effective: float
    largest: float

    def values(self) -> dict[str, Any]:
        """The rate for JSON."""
        return {
            "endpoint": self.endpoint.name,
            "weather": self.weather,
            "driver": self.driver,
            "value": json_values(self.value),
            "low": json_values(self.low),
            "high": json_values(self.high),
            "unit": self.endpoint.unit,
            "scenes": self.scenes,
            "effective_scenes": round(self.effective, 1),
            "largest_weight_share": json_values(self.largest),
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Contrast(ContentEquality):
    """The difference of a policy and a reference in one endpoint.

    Attributes:
        reference: Name of the reference.
        endpoint: What is measured.
        weather: Name of the stratum.
        difference: Policy minus reference, in the unit of the endpoint.
        low: Lower limit of its 95 % interval.
        high: Upper limit.
        pairs: Scenes in which the two differ.
        p: p-value of no difference; NaN with too few pairs.
        adjusted: The same for an endpoint that is not primary, corrected for their number.
        is_primary: Whether it was fixed beforehand.
    """

    reference: str
    endpoint: Endpoint
    weather: str
    difference: float
    low: float
    high: float
    pairs: int
    p: float
    adjusted: float
    is_primary: bool

    @property
    def verdict(self) -> str:
        """What may be said of it."""
        if self.pairs < FEW or math.isnan(self.p):
            return TOO_FEW
        is_shown = self.low > 0.0 or self.high < 0.0
        if not (is_shown if self.is_primary else self.adjusted < LEVEL):
            return "no difference shown"
        if self.endpoint.is_good is None:
            return "more" if self.difference > 0.0 else "less"
        return "better" if (self.difference > 0.0) == self.endpoint.is_good else "worse"

    def values(self) -> dict[str, Any]:
        """The difference for JSON."""
        return {
            "endpoint": self.endpoint.name,
            "weather": self.weather,
            "reference": self.reference,
            "difference": json_values(self.difference),
            "low": json_values(self.low),
            "high": json_values(self.high),
            "unit": self.endpoint.unit,
            "differing_pairs": self.pairs,
            "p": json_values(self.p),
            "p_adjusted": json_values(self.adjusted),
            "primary": self.is_primary,
            "verdict": self.verdict,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Margin(ContentEquality):
    """Weighted quantiles of a margin of one driver's attempts.

    Attributes:
        driver: Name of the driver.
        title: What is measured.
        unit: Its unit.
        count: Attempts that have it.
        fifth: 5 % quantile.
        median: Median.
        last: 95 % quantile.
    """

    driver: str
    title: str
    unit: str
    count: int
    fifth: float
    median: float
    last: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Worst(ContentEquality):
    """One of the worst scenes of the policy.

    Attributes:
        scene: Its number.
        what: What happened.
        rank: The larger, the worse.
        labelled: A batch of this one scene.
    """

    scene: int
    what: str
    rank: tuple[float, ...]
    labelled: LabelledTrajectories


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation(CompactRepr, ContentEquality, Plottable, Reportable):
    """A policy beside references in the same scenes.

    Attributes:
        policy: Name of the policy.
        references: Names of the references.
        profile: Profile of the scenes.
        simulations: Number of scenes.
        seed: Seed of their random numbers.
        source: The words that name the policy, such as its file.
        digest: SHA-256 of the policy's file, empty if unknown.
        observe: What the policy observes, in a word.
        action: What it answers, empty for the built-in driver.
        model_version: Version of the simulated model.
        effective: Effective number of scenes.
        largest: Share of the scene with the largest weight.
        rates: Every endpoint of every driver; the primary ones in each kind of weather.
        contrasts: The differences to each reference.
        margins: Margins of the attempts.
        counts: Unweighted sums of every column, by driver.
        worst: The worst scenes of the policy, the worst first.
        asked_profile: The profile that the caller named, if its `-risk` profile was drawn instead;
            otherwise None.
    """

    policy: str
    references: tuple[str, ...]
    profile: str
    simulations: int
    seed: int
    source: str
    digest: str
    observe: str
    action: str
    model_version: str
    effective: float
    largest: float
    rates: tuple[Rate, ...]
    contrasts: tuple[Contrast, ...]
    margins: tuple[Margin, ...]
    counts: dict[str, dict[str, float]]
    worst: tuple[Worst, ...]
    asked_profile: str | None = None

    @property
    def drivers(self) -> tuple[str, ...]:
        """The policy and its references."""
        return self.policy, *self.references

    def rate(self, driver: str, endpoint: str, weather: str = "any weather") -> Rate:
        """One rate.

        Raises:
            KeyError: There is none of that name.
        """
        for one in self.rates:
            if (one.driver, one.endpoint.name, one.weather) == (driver, endpoint, weather):
                return one
        raise KeyError(endpoint)

    def values(self) -> dict[str, Any]:
        """Everything for JSON."""
        return {
            "policy": self.policy,
            "policy_source": self.source,
            "policy_sha256": self.digest,
            "observe": self.observe,
            "action": self.action,
            "against": list(self.references),
            "profile": self.profile,
            "asked_profile": self.asked_profile or self.profile,
            "law_policy": POLICY,
            "simulations": self.simulations,
            "seed": self.seed,
            "model_version": self.model_version,
            "effective_scenes": round(self.effective, 1),
            "largest_weight_share": json_values(self.largest),
            "rates": [one.values() for one in self.rates],
            "contrasts": [one.values() for one in self.contrasts],
            "margins": [json_values(asdict(one)) for one in self.margins],
            "counts": json_values(self.counts),
            "worst": [{"scene": one.scene, "what": one.what} for one in self.worst],
            "claims_conformity": False,
        }
