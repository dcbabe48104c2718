"""Classes of a law: rules, criteria, packs of rules, tolerances, and how well a text is known."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
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
        margin: Margin beyond the border, in the unit of the rule, 0 or more.
        share: Share of the measured value, 0 to 1; only of rules that have a `limit`.
        lasting: Time of the longest unbroken part of the breach [s].
        source: Id of the source of these numbers; empty without a source.
    """

    margin: float = 0.0
    share: float = 0.0
    lasting: float = 0.0
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
class Spread:
    """How errors of measurement become one of a rule's margin.

    Attributes:
        formula: The computation in words; sp and sv are the standard deviations of positions and
            speeds, as in `MeasurementErrors`.
        standard_error: The standard deviation of the margins of a `Check`, shape (simulation,).
    """

    formula: str
    standard_error: Callable[[Case, Finding, MeasurementErrors], F32]


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


def _check_is_missing(case: Case) -> Finding:
    del case
    raise NotImplementedError("the rule has neither a criterion nor a check")


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """One rule of law.

    A rule has a criterion, or states the parts of one itself: `predicate`, `unit`, `check`,
    `spread`, `limit`, the inputs, and where it applies. Both kinds are read in the same way.

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
        source: Id of the source of the text.
        is_duty_of_ego: Whether the duty is the ego's; no policy requires the others' duties.
        text_source: How the wording of the law is known.
        consulted_source: Where it was read, and in which edition.
        limit_phrase: The limit in words, for the sentence "missed ... by 2 m".
        fine: Fine for a breach, with its source; empty without a source.
        predicate: The condition that the check tests, with events of `model.overtake_events`.
        unit: Of the margin.
        required_inputs: Names of `UNKNOWNS` without which the rule is undecidable.
        conditional_inputs: Names of `UNKNOWNS` without which it is undecidable in some simulations.
        applies_without_attempt: Whether it also judges a recording without an attempt, all of it.
        only_two_way_roads: Whether it is about roads with oncoming traffic alone.
        check: The rule itself, for recordings that know all that it needs.
        spread: The error of its margin; None if errors of positions and speeds that stay the same
            do not change it. Rules with a criterion have `Criterion.standard_error`.
        limit: The limit of the measured value, as `Criterion.limit`.
    """

    id: str
    code: str
    article: str
    title: str
    gloss: str
    criterion: Criterion | None = None
    grade: Grade
    required_by: frozenset[str] = NO_POLICY
    tolerances: Mapping[str, Tolerance] = field(default_factory=dict[str, Tolerance], hash=False)
    source: str = "pt-highway-code-2013"
    is_duty_of_ego: bool = True
    text_source: TextSource = TextSource.READ
    consulted_source: str = ""
    limit_phrase: str = "its border"
    fine: str = ""
    predicate: str = ""
    unit: str = ""
    required_inputs: frozenset[str] = frozenset()
    conditional_inputs: frozenset[str] = frozenset()
    applies_without_attempt: bool = False
    only_two_way_roads: bool = False
    check: Callable[[Case], Finding] = _check_is_missing
    spread: Spread | None = None
    limit: Callable[[Case], F32 | None] | None = None

    def __post_init__(self) -> None:
        """Take over the parts of the criterion, which replace stated ones."""
        criterion = self.criterion
        if criterion is None:
            return
        parts = {
            "predicate": criterion.predicate(),
            "unit": criterion.unit,
            "required_inputs": criterion.required_inputs,
            "conditional_inputs": criterion.conditional_inputs,
            "applies_without_attempt": criterion.applies_without_attempt,
            "only_two_way_roads": criterion.only_two_way_roads,
            "check": criterion.check,
            "limit": criterion.limit,
        }
        for name, part in parts.items():
            object.__setattr__(self, name, part)

    @property
    def error_formula(self) -> str:
        """`standard_error` in words, as `Criterion.ERROR_FORMULA`."""
        if self.criterion is not None:
            return self.criterion.ERROR_FORMULA
        return "0" if self.spread is None else self.spread.formula

    def standard_error(self, case: Case, finding: Finding, errors: MeasurementErrors) -> F32 | None:
        """Standard deviation of the margins of a finding, as `Criterion.standard_error`."""
        if self.criterion is not None:
            return self.criterion.standard_error(case, finding, errors)
        return None if self.spread is None else self.spread.standard_error(case, finding, errors)


def adopt(
    rule: Rule,
    *,
    id: str,  # noqa: A002 - The name of the field.
    code: str,
    article: str,
    title: str,
    gloss: str,
    predicate: str,
    grade: Grade,
    source: str,
    fine: str = "",
    unit: str | None = None,
    required_inputs: frozenset[str] | None = None,
    check: Callable[[Case], Finding] | None = None,
    spread: Spread | None = None,
    limit: Callable[[Case], F32 | None] | None = None,
) -> Rule:
    """Make a rule for another law with the check of an existing rule.

    The other law gives texts, article, severity, fine and source. `rule` gives the check with its
    error and limit, and the data that the check needs.

    Args:
        rule: The existing rule.
        id: Id of the new rule, as in `Rule`.
        code: Code of the new rule.
        article: Article of the other law.
        title: Title in a few words.
        gloss: The duty in plain words.
        predicate: Condition that the check tests, without codes and articles of the law of `rule`.
        grade: How severe a breach is by the other law.
        source: Id of the source of the text.
        fine: Fine for a breach by the other law.
        unit: Unit of the margin; None for the unit of `rule`.
        required_inputs: Names of `UNKNOWNS` that the check needs; None for `rule.needs`.
        check: Check with the numbers of the other law; None for the check of `rule`. With a new
            check, `spread` and `limit` of `rule` are not taken over.
        spread: Error of the margin of `check`; ignored without a check.
        limit: Limit of `check`, as in `Rule`; ignored without a check.
    """
    has_same_check = check is None
    return Rule(
        id=id,
        code=code,
        article=article,
        title=title,
        gloss=gloss,
        predicate=predicate,
        unit=rule.unit if unit is None else unit,
        grade=grade,
        source=source,
        required_inputs=rule.required_inputs if required_inputs is None else required_inputs,
        conditional_inputs=rule.conditional_inputs,
        applies_without_attempt=rule.applies_without_attempt,
        is_duty_of_ego=rule.is_duty_of_ego,
        check=rule.check if check is None else check,
        spread=rule.spread if has_same_check else spread,
        fine=fine,
        only_two_way_roads=rule.only_two_way_roads,
        limit=rule.limit if has_same_check else limit,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Pack:
    """The rules of one jurisdiction; another one is another list.

    Attributes:
        name: Short name.
        version: Changes whenever a verdict may.
        two_way_version: The same for roads with oncoming traffic, added to `version` there.
        rules: The rules, in the order of every table.
        edition: Of the law, with the day on which it was read.
        severities: Provisions that make a breach light, serious or very serious.
        accepts_unread_articles: Whether a rule decides although its text was not read; otherwise
            the rule is undecidable.
    """

    name: str
    version: str
    rules: tuple[Rule, ...]
    edition: str = ""
    severities: str = ""
    accepts_unread_articles: bool = True
    two_way_version: str = ""

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
