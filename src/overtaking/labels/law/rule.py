"""Classes of a law: rules, criteria, packs of rules, tolerances, and how well a text is known.

A rule judges a `Case`, a batch of recorded simulations, and gives a `Finding`: a verdict and a
margin for each simulation. A margin is the distance from the limit of the rule, negative in a
breach. A policy selects the rules that an overtake must not break to be legal. The study is Pinto,
Dutra and Fonseca (2023), which this package reproduces: the policy `paper` has its rules, and the
study's columns are the ones in its data.
"""

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
"""All policies. They require the rules that the study's columns suffice to decide and, by choice,
rules of other laws that we consider as important as these. `serious` and `enforced` count fewer
breaches than the others."""

DEFAULT_AND_STRICTER = EVERY_POLICY - {"paper"}
"""All policies but `paper`, for rules that need more than the study's columns."""

ALL_BUT_STRICT = EVERY_POLICY - {"strict"}
"""All policies but `strict`, for rules that `strict` replaces by a stricter variant."""

STRICT_ONLY = frozenset(["strict"])
"""The policy that adds signals, lamps, keeping right, and rules with an uncertain reading."""

NO_POLICY = frozenset[str]()
"""For a rule that is judged and never required, such as a duty of another vehicle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerance:
    """Size of a breach up to which a policy ignores it.

    A breach counts only if it exceeds `margin`, `share` and `duration`, each of them.

    Attributes:
        margin: Excess over the limit, in the unit of the rule, 0 or more.
        share: Excess over the limit as a share of the measured value, 0 to 1; ignored for a rule
            whose `Criterion.limit` is None.
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
    """`standard_error` as a formula for readers. sp and sv are the standard deviations of positions
    and speeds; the name of a field of the criterion stands for its value."""

    @property
    def required_inputs(self) -> frozenset[str]:
        """Inputs that the criterion needs; the duty is undecidable if a recording omits one.

        The names are in `model.trajectories.UNKNOWNS`, such as "weather" or "kinds".
        """
        return frozenset()

    @property
    def conditional_inputs(self) -> frozenset[str]:
        """Inputs, named as in `required_inputs`, that only some simulations need."""
        return frozenset()

    @property
    def believed_margins(self) -> Mapping[tuple[ManoeuvreKind, PerceivedVehicle], GapMargin]:
        """Margins of gaps about which the driver decides, by kind of decision and other vehicle.

        Each is computed from true gaps and speeds, and from those that the driver believed.
        """
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
        """Limit of the measured value, for policies that tolerate a share of the measured value.

        Returns:
            Shape (simulation,), in the unit of the margin; None if no policy tolerates a share.
        """
        del case
        return None

    def remedies(self, breach: BreachContext) -> tuple[Remedy, ...]:
        """Alternative changes, each sufficient to keep the rule, all else unchanged.

        Returns:
            Where the first remedy changes the measured value, in the unit of the margin, its
            largest change must be as large as the margin. Empty where no change is known.
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
        """`Criterion.required_inputs` of its criterion."""
        return self.criterion.required_inputs

    @property
    def conditional_inputs(self) -> frozenset[str]:
        """`Criterion.conditional_inputs` of its criterion."""
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
        version: Version of the readings; it changes whenever a verdict may change.
        two_way_version: Suffix of `version` on roads with oncoming traffic: the version of the
            rules that were added for them.
        rules: The rules, in the order of every table.
        source: Id of the source of the texts, for rules that state none.
        edition: Edition of the law, with the day on which it was read.
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
