"""Classes of a law: rules, criteria, packs of rules, tolerances, and how well a text is known."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum, StrEnum
from types import MappingProxyType
from typing import ClassVar, Self

from overtaking.core.arrays import F32, F64
from overtaking.labels.law.measurement_errors import MeasurementErrors
from overtaking.labels.law.remedies import BreachContext, Remedy
from overtaking.labels.law.safe_distance import GapMargin
from overtaking.model.trajectories import ManoeuvreKind, PerceivedVehicle
from overtaking.model.verdicts import Case, Finding

EVERY_POLICY = frozenset(["paper", "default", "strict", "serious", "enforced"])
"""Policies that require the rules of the paper, or rules of the same weight."""

DEFAULT_AND_STRICTER = EVERY_POLICY - {"paper"}
"""Policies that require the rules which the paper does not have."""

ALL_BUT_STRICT = EVERY_POLICY - {"strict"}
"""Policies that require a reading which `strict` replaces by a stricter one."""

STRICT_ONLY = frozenset(["strict"])
"""The policy that also requires the rules with an uncertain reading."""

NO_POLICY = frozenset[str]()
"""For a rule that is judged and never required."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerance:
    """How far beyond the letter of a rule a policy looks away; a breach exceeds all of it.

    Attributes:
        margin: Margin beyond the limit, in the unit of the rule, 0 or more.
        share: Share of the measured value, 0 to 1; only of rules that have a `limit`.
        duration: Time of the longest unbroken part of the breach [s].
        source: Id of the source of these numbers; empty without a source.
    """

    margin: float = 0.0
    share: float = 0.0
    duration: float = 0.0
    source: str = ""


class TextSource(StrEnum):
    """How the wording of a provision is known."""

    READ = "read", "the provision itself, officially published or reprinted in full"
    SECONDARY = "secondary", "as others quote or describe it; the text was not read"
    RECALLED = "recalled", "from memory; the text was not read"

    meaning: str

    def __new__(cls, value: str, meaning: str) -> Self:
        """A way of knowing and what it means."""
        member = str.__new__(cls, value)
        member._value_, member.meaning = value, meaning
        return member


class Grade(Enum):
    """How severe a breach is; `Pack.severities` names the provisions that say so."""

    BY_ROAD = "very serious on a motorway, serious elsewhere"
    LIGHT = "light"
    SERIOUS = "serious"
    BY_BREACH = "as the breach is, see the rule"


@dataclass(frozen=True, slots=True, kw_only=True)
class Criterion(ABC):
    """How a duty is measured: which quantity is compared with which limit, and in which frames.

    A subclass is one way of measuring. Its own fields are the numbers of the law, as `Quantity`, so
    two laws can share a criterion and differ in its fields. The criterion reads only the case, so
    the same case always has the same finding.

    Attributes:
        unit: Unit of the margin.
        applies_without_attempt: Whether the criterion also judges a recording without an attempt.
        only_two_way_roads: Whether tables of one-way roads leave it out.
    """

    unit: str
    applies_without_attempt: bool = False
    only_two_way_roads: bool = False

    ERROR_FORMULA: ClassVar[str] = "0"
    """`standard_error` in words. sp and sv are the standard deviations of positions and speeds; a
    number of the law stands by the name of its field."""

    @property
    def required_inputs(self) -> frozenset[str]:
        """Names of `UNKNOWNS` without which the duty is undecidable."""
        return frozenset()

    @property
    def conditional_inputs(self) -> frozenset[str]:
        """Names of `UNKNOWNS` without which the duty is undecidable in some simulations."""
        return frozenset()

    @property
    def believed_margins(self) -> Mapping[tuple[ManoeuvreKind, PerceivedVehicle], GapMargin]:
        """Margins that the driver judges by its beliefs, by kind of decision and vehicle."""
        return MappingProxyType({})

    @abstractmethod
    def predicate(self) -> str:
        """The condition that `check` tests, in one sentence with the numbers of this law."""

    @abstractmethod
    def check(self, case: Case) -> Finding:
        """Judge each simulation of a batch as if it had been measured without error."""

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32 | None:
        """Standard deviation of the margins of a finding.

        Args:
            case: The batch.
            finding: Result of `check` for this batch.
            errors: Standard deviations of positions and speeds.

        Returns:
            Shape (simulation,), in the unit of the margin; None if these errors do not change it.
        """
        del case, finding, errors
        return None

    def limit(self, case: Case) -> F32 | None:
        """Limit of the measured value, for policies that tolerate a share of it.

        Returns:
            Shape (simulation,), in the unit of the margin; None if no policy tolerates a share.
        """
        del case
        return None

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """Alternative changes, each sufficient to keep the rule, all else unchanged.

        Returns:
            The first remedy has the size of the margin. Empty where no change is known.
        """
        del breach
        return ()

    def margins_by_frame(self, case: Case) -> F64 | None:
        """Margins of a batch of one simulation, frame by frame, for charts.

        Returns:
            Shape (time,), NaN in frames that are not judged; None for a criterion that judges
            single instants or durations.
        """
        del case
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """One rule of law: a duty, how it is measured, and how it counts.

    Attributes:
        id: Versioned id: jurisdiction, code of law, article, `@` and the year of the text.
        code: Short name, the column of every table.
        article: Article and paragraph.
        title: A few words.
        gloss: The duty in English, paraphrased.
        criterion: How the duty is measured, with the numbers of the law.
        grade: How severe a breach is.
        required_by: Names of the policies that require the rule.
        tolerances: By name of a policy, how far it tolerates a breach.
        source: Id of the source of the text; a pack fills in its own where this is empty.
        is_duty_of_ego: Whether the duty is the ego's; no policy requires the others' duties.
        text_source: How the wording of the law is known.
        consulted_source: Where it was read, and in which edition.
        limit_phrase: The limit in words, for the sentence "missed ... by 2 m".
        fine: Fine for a breach, with its source; empty without a source.
    """

    id: str
    code: str
    article: str
    title: str
    gloss: str
    criterion: Criterion
    grade: Grade
    required_by: frozenset[str] = NO_POLICY
    tolerances: Mapping[str, Tolerance] = field(default_factory=dict[str, Tolerance], hash=False)
    source: str = ""
    is_duty_of_ego: bool = True
    text_source: TextSource = TextSource.READ
    consulted_source: str = ""
    limit_phrase: str = "its limit"
    fine: str = ""

    @property
    def predicate(self) -> str:
        """The condition that the criterion tests, as `Criterion.predicate`."""
        return self.criterion.predicate()

    @property
    def unit(self) -> str:
        """Unit of the margin."""
        return self.criterion.unit

    @property
    def required_inputs(self) -> frozenset[str]:
        """Names of `UNKNOWNS` without which the rule is undecidable."""
        return self.criterion.required_inputs

    @property
    def conditional_inputs(self) -> frozenset[str]:
        """Names of `UNKNOWNS` without which the rule is undecidable in some simulations."""
        return self.criterion.conditional_inputs

    @property
    def only_two_way_roads(self) -> bool:
        """Whether tables of one-way roads leave the rule out."""
        return self.criterion.only_two_way_roads


@dataclass(frozen=True, slots=True, kw_only=True)
class Pack:
    """The rules of one law.

    Attributes:
        name: Short name.
        version: Changes whenever a verdict may.
        two_way_version: The same for roads with oncoming traffic, added to `version` there.
        rules: The rules, in the order of every table.
        source: Id of the source of the texts, for rules that state none.
        edition: Of the law, with the day on which it was read.
        severities: Provisions that make a breach light, serious or very serious.
        accepts_unread_articles: Whether a rule decides although its text was not read; otherwise
            the rule is undecidable.
    """

    name: str
    version: str
    rules: tuple[Rule, ...]
    source: str = ""
    edition: str = ""
    severities: str = ""
    accepts_unread_articles: bool = True
    two_way_version: str = ""

    def __post_init__(self) -> None:
        """Fill in the source of rules that state none."""
        rules = tuple(
            rule if rule.source else replace(rule, source=self.source) for rule in self.rules
        )
        object.__setattr__(self, "rules", rules)

    @property
    def codes(self) -> tuple[str, ...]:
        """The codes of the rules, in order."""
        return tuple(rule.code for rule in self.rules)

    @property
    def deciding_rules(self) -> tuple[Rule, ...]:
        """The rules whose text is known well enough to decide; others are always undecidable."""
        if self.accepts_unread_articles:
            return self.rules
        return tuple(rule for rule in self.rules if rule.text_source is TextSource.READ)

    def rule(self, code: str) -> Rule:
        """The rule of a code.

        Raises:
            KeyError: No rule has this code.
        """
        return {rule.code: rule for rule in self.rules}[code]
