"""What a rule and a pack of rules are, and what they say of a batch."""

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum, StrEnum
from typing import Self

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, U8, Mask
from overtaking.knowledge import toml_reader
from overtaking.labels.law.measurement_errors import MeasurementErrors
from overtaking.model.overtake_events import NEVER
from overtaking.model.vehicles import VehicleKind, may_be_kind
from overtaking.model.verdicts import Belief, Case, Finding, Findings, Severity, Verdict


class Text(StrEnum):
    """How the wording of a provision is known."""

    READ = "read", "the provision itself, officially published or reprinted in full"
    SECONDARY = "secondary", "as others quote or describe it; the text was not read"
    RECALLED = "recalled", "from memory; the text was not read"

    meaning: str

    def __new__(cls, value: str, meaning: str) -> Self:
        """A way of knowing and what it means."""
        one = str.__new__(cls, value)
        one._value_, one.meaning = value, meaning
        return one


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
        formula: What is computed; sp and sv are the standard deviations of `Errors`.
        of: The standard deviation of the margins of a `Check`, shape (simulation,).
    """

    formula: str
    of: Callable[[Case, Finding, MeasurementErrors], F32]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """One rule of law.

    Attributes:
        id: Versioned id: jurisdiction, code of law, article, `@` and the year of the text.
        code: Short name, the column of every table.
        law: Article and paragraph.
        title: A few words.
        gloss: What the law asks, in English, in our words.
        predicate: What is checked; times in frames of `model.overtake_events`.
        unit: Of the margin.
        grade: How severe a breach is.
        source: Id of the source of the text.
        needs: Names of `UNKNOWNS` without which the rule is undecidable.
        partly: Names of `UNKNOWNS` without which it is undecidable in some simulations.
        without_attempt: Whether it also judges a recording without an attempt, all of it.
        of_ego: Whether the duty is the ego's; no policy requires the others' duties.
        check: The rule itself, for recordings that know all that it needs.
        spread: The error of its margin; None if errors of positions and speeds that stay the same
            do not change it.
        text: How the wording of the law is known.
        where: Where it was read, and in which edition.
        border: What a breach misses by its margin, for the sentence "missed ... by 2 m".
        fine: What a breach costs, with where that is said; empty if no source was read.
        two_way: Whether it is about roads with oncoming traffic alone.
        limit: What the measured value is compared with, (simulation,), in the unit of the margin;
            None for rules of which no policy tolerates a share.
    """

    id: str
    code: str
    law: str
    title: str
    gloss: str
    predicate: str
    unit: str
    grade: Grade
    source: str = "pt-highway-code-2013"
    needs: frozenset[str] = frozenset()
    partly: frozenset[str] = frozenset()
    without_attempt: bool = False
    of_ego: bool = True
    check: Callable[[Case], Finding]
    spread: Spread | None = None
    text: Text = Text.READ
    where: str = ""
    border: str = "its border"
    fine: str = ""
    two_way: bool = False
    limit: Callable[[Case], F32] | None = None


def adopt(
    rule: Rule,
    *,
    id: str,  # noqa: A002 - The name of the field.
    code: str,
    law: str,
    title: str,
    gloss: str,
    predicate: str,
    grade: Grade,
    source: str,
    fine: str = "",
    unit: str | None = None,
    needs: frozenset[str] | None = None,
    check: Callable[[Case], Finding] | None = None,
    spread: Spread | None = None,
    limit: Callable[[Case], F32] | None = None,
) -> Rule:
    """Make a rule for another law with the check of an existing rule.

    The other law gives texts, article, severity, fine and source. `rule` gives the check with its
    error and limit, and the data that the check needs.

    Args:
        rule: The existing rule.
        id: Id of the new rule, as in `Rule`.
        code: Code of the new rule.
        law: Article of the other law.
        title: Title in a few words.
        gloss: The duty in plain words.
        predicate: Condition that the check tests, without codes and articles of the law of `rule`.
        grade: How severe a breach is by the other law.
        source: Id of the source of the text.
        fine: Fine for a breach by the other law.
        unit: Unit of the margin; None for the unit of `rule`.
        needs: Names of `UNKNOWNS` that the check needs; None for `rule.needs`.
        check: Check with the numbers of the other law; None for the check of `rule`. With a new
            check, `spread` and `limit` of `rule` are not taken over.
        spread: Error of the margin of `check`; ignored without a check.
        limit: Limit of `check`, as in `Rule`; ignored without a check.
    """
    has_same_check = check is None
    return Rule(
        id=id,
        code=code,
        law=law,
        title=title,
        gloss=gloss,
        predicate=predicate,
        unit=rule.unit if unit is None else unit,
        grade=grade,
        source=source,
        needs=rule.needs if needs is None else needs,
        partly=rule.partly,
        without_attempt=rule.without_attempt,
        of_ego=rule.of_ego,
        check=rule.check if check is None else check,
        spread=rule.spread if has_same_check else spread,
        fine=fine,
        two_way=rule.two_way,
        limit=rule.limit if has_same_check else limit,
    )


def decided(
    applies: Mask,
    margin: F32,
    first: NDArray[np.integer],
    last: NDArray[np.integer],
    *,
    longest: NDArray[np.integer] | None = None,
    doubtful: Mask | None = None,
    belief: U8 | None = None,
) -> Finding:
    """A check from margins.

    Args:
        applies: Whether the rule is about this simulation at all, shape (simulation,).
        margin: Negative in a breach, same shape.
        first: First frame of the breach, read where there is one.
        last: Last frame of the breach.
        longest: Number of frames of its longest unbroken part; None if it has no break.
        doubtful: Whether what is unknown could still break the rule.
        belief: `Belief`, read where the rule applies.
    """
    broken, known = applies & (margin < 0), applies
    decision = broken.view(np.uint8)  # Legal is 0, illegal 1.
    if longest is None:
        longest = last - first + 1
    if doubtful is not None:
        known = applies & (broken | ~doubtful)
        decision = np.where(known, decision, np.uint8(Verdict.UNDECIDABLE))
    return Finding(
        verdict=np.where(applies, decision, np.uint8(Verdict.NOT_APPLICABLE)),
        # The sum makes a negative zero positive.
        margin=np.where(known, margin, np.float32(0.0)) + np.float32(0.0),
        first_frame=np.where(broken, first, NEVER).astype(np.int32, copy=False),
        last_frame=np.where(broken, last, NEVER).astype(np.int32, copy=False),
        longest_run=np.where(broken, longest, 0).astype(np.int32, copy=False),
        severity=np.zeros(len(applies), np.uint8),
        belief=np.zeros(len(applies), np.uint8)
        if belief is None
        else np.where(applies, belief, np.uint8(Belief.NONE)),
    )


def inapplicable(num_simulations: int) -> Finding:
    """The check of a rule that says nothing of any simulation."""
    never = np.full(num_simulations, NEVER)
    nothing = np.zeros(num_simulations, np.float32)
    return decided(np.zeros(num_simulations, np.bool_), nothing, never, never)


def judge(rule: Rule, case: Case, errors: MeasurementErrors | None = None) -> Finding:
    """What a rule says of a batch, with severity, and undecidable where it lacks what it needs.

    Args:
        rule: The rule.
        case: The batch.
        errors: Of its measurement; a margin within its own is undecidable.
    """
    found = _judged(rule, case)
    if errors is None or rule.spread is None:
        return found
    is_decided = (found.verdict == Verdict.LEGAL) | (found.verdict == Verdict.ILLEGAL)
    if not is_decided.any():
        return found
    error = toml_reader.constant("law.errors.coverage") * rule.spread.of(case, found, errors)
    return _doubted(found, is_decided & (np.abs(found.margin) < error))


def _doubted(found: Finding, inside: Mask) -> Finding:
    """The same check, undecidable in the simulations of a mask."""
    return found.replace(
        verdict=np.where(inside, np.uint8(Verdict.UNDECIDABLE), found.verdict),
        margin=np.where(inside, np.float32(0.0), found.margin),
        first_frame=np.where(inside, NEVER, found.first_frame),
        last_frame=np.where(inside, NEVER, found.last_frame),
        longest_run=np.where(inside, np.int32(0), found.longest_run),
        severity=np.where(inside, np.uint8(Severity.NONE), found.severity),
    )


def _judged(rule: Rule, case: Case) -> Finding:
    """Check a rule on a batch without errors of measurement.

    If some kinds of vehicles are unknown and the rule depends on them, it is undecidable where the
    possible kinds lead to different verdicts.
    """
    is_known = case.trajectories.is_kind_known
    if is_known is None or "kinds" not in rule.needs | rule.partly:
        return _judged_as_stated(rule, case)
    return _agreed_check(
        [_judged_as_stated(rule, possible_case) for possible_case in _possible_kinds(case)]
    )


def _possible_kinds(case: Case) -> Iterator[Case]:
    """Yield the batch once for each kind, which vehicles of unknown kind have if their length fits.

    A vehicle whose length does not fit is a car. Every vehicle is a truck once, whatever its
    length: where kind and length of a recording contradict each other, the length may be wrong.
    """
    run = case.trajectories
    vehicles = run.scenario.vehicles
    car = np.uint8(VehicleKind.MEDIUM_CAR)
    for kind in (
        car,
        VehicleKind.TRUCK,
        VehicleKind.VAN,
        VehicleKind.MOTORCYCLE,
        VehicleKind.BICYCLE,
    ):
        may_be = may_be_kind(kind, vehicles.length) | (kind == VehicleKind.TRUCK)
        possible = np.where(may_be, np.uint8(kind), car)
        kinds = np.where(run.known_kinds, vehicles.kind, possible)
        scenario = run.scenario.replace(vehicles=vehicles.replace(kind=kinds))
        yield case.replace(trajectories=run.replace(scenario=scenario))


def _agreed_check(checks: Sequence[Finding]) -> Finding:
    """Combine checks of the same batch: undecidable in simulations in which the verdicts differ.

    Where they agree, the check with the smallest absolute margin counts.
    """
    margins = np.stack([np.abs(check.margin) for check in checks])
    choice = margins.argmin(axis=0)
    names = [field.name for field in dataclasses.fields(Finding)]
    stacked = {name: np.stack([getattr(check, name) for check in checks]) for name in names}
    columns = np.arange(len(choice))
    nearest = Finding(**{name: values[choice, columns] for name, values in stacked.items()})
    return _doubted(nearest, (stacked["verdict"] != stacked["verdict"][0]).any(axis=0))


def _judged_as_stated(rule: Rule, case: Case) -> Finding:
    """Check a rule with every vehicle of the kind that the batch states."""
    found = rule.check(case)
    if rule.needs & case.trajectories.unknown:
        return _undecided(found)
    if rule.grade is Grade.BY_BREACH:
        return found
    broken = found.verdict == Verdict.ILLEGAL
    severity = broken.view(np.uint8) * np.uint8(_severity(rule.grade, case))
    return found.replace(severity=severity)


def _severity(grade: Grade, case: Case) -> Severity:
    """Severity of any breach of a rule with this grade."""
    if grade is Grade.LIGHT:
        return Severity.LIGHT
    trajectories = case.trajectories
    motorway = trajectories.road.kind == "motorway" and "road_kind" not in trajectories.unknown
    return Severity.VERY_SERIOUS if grade is Grade.BY_ROAD and motorway else Severity.SERIOUS


def _undecided(found: Finding) -> Finding:
    """The same check where nothing can be said of simulations that the rule is about."""
    about = found.verdict != Verdict.NOT_APPLICABLE
    n = len(about)
    nothing = np.zeros(n, np.float32)
    never = np.full(n, NEVER)
    return decided(about, nothing, never, never, doubtful=np.ones(n, np.bool_))


def lacking(pack: "Pack", unknown: Iterable[str]) -> dict[str, list[str]]:
    """The rules that a recording cannot decide.

    Args:
        pack: The rules.
        unknown: What the recording does not tell, names of `UNKNOWNS`.

    Returns:
        Codes of the rules that are undecidable wherever they apply, under `always`, and of those
        that are in some simulations, under `sometimes`.
    """
    missing = frozenset(unknown)
    always = [rule.code for rule in pack.rules if rule.needs & missing]
    partly = [
        rule.code for rule in pack.rules if rule.partly & missing and not rule.needs & missing
    ]
    return {"always": always, "sometimes": partly}


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
        trusts_hearsay: Whether a rule whose text was not read decides; else it is undecidable.
    """

    name: str
    version: str
    rules: tuple[Rule, ...]
    edition: str = ""
    severities: str = ""
    trusts_hearsay: bool = True
    two_way_version: str = ""

    @property
    def codes(self) -> tuple[str, ...]:
        """The codes of the rules, in order."""
        return tuple(rule.code for rule in self.rules)

    @property
    def deciding_rules(self) -> tuple[Rule, ...]:
        """The rules whose text is known well enough to decide; others are always undecidable."""
        if self.trusts_hearsay:
            return self.rules
        return tuple(rule for rule in self.rules if rule.text is Text.READ)

    def rule(self, code: str) -> Rule:
        """The rule of a code.

        Raises:
            KeyError: There is none.
        """
        return {rule.code: rule for rule in self.rules}[code]


def check(pack: Pack, case: Case, errors: MeasurementErrors | None = None) -> Findings:
    """What each rule of a pack says of each simulation.

    Args:
        pack: The rules.
        case: Recordings of any source, with their signals and events.
        errors: Of their measurement; None if there are none.

    Returns:
        Arrays of shape (simulation, rule).
    """
    deciding = frozenset(rule.code for rule in pack.deciding_rules)
    found = [
        judge(rule, case, errors) if rule.code in deciding else _undecided(rule.check(case))
        for rule in pack.rules
    ]
    columns = {
        field.name: np.stack([getattr(one, field.name) for one in found], axis=1)
        for field in dataclasses.fields(Finding)
    }
    version = pack.version
    if case.trajectories.road.is_two_way:
        version += pack.two_way_version
    if errors is not None:
        version += str(errors)
    return Findings(rule_codes=pack.codes, version=version, **columns)
