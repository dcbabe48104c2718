"""Labels of a simulation: the verdict of each rule, and a class for each policy."""

from dataclasses import dataclass
from enum import IntEnum

from overtaking.core.arrays import F32, I32, U8, Mask
from overtaking.model.batch import Batch, IdentityBatch
from overtaking.model.ego_signals import EgoSignals, TargetSignals
from overtaking.model.overtake_events import OvertakeEvents
from overtaking.model.trajectories import Trajectories


class Verdict(IntEnum):
    """Verdict of a rule about a simulation."""

    LEGAL = 0
    ILLEGAL = 1
    NOT_APPLICABLE = 2
    UNDECIDABLE = 3


class Belief(IntEnum):
    """The verdict at a decision beside the verdict by the driver's belief."""

    NONE = 0  # The rule does not judge beliefs, or no belief was recorded.
    LEGAL = 1  # Legal, and legal by belief.
    MISTAKEN = 2  # Illegal, and legal by belief.
    KNOWINGLY_ILLEGAL = 3  # Illegal, and illegal by belief.
    LUCKY = 4  # Legal, and illegal by belief.


class Severity(IntEnum):
    """Severity of a breach, by the law of its rule."""

    NONE = 0
    LIGHT = 1
    SERIOUS = 2
    VERY_SERIOUS = 3


class OvertakeClass(IntEnum):
    """The paper's five classes, and three that it does not have."""

    NO_ATTEMPT = 0
    SUCCESS_I = 1
    SUCCESS_L = 2
    UNSUCCESS_COL = 3
    UNSUCCESS_NCOL = 4
    SUCCESS_U = 5
    CENSORED = 6
    UNSUCCESS_DEP = 7

    @property
    def title(self) -> str:
        """The name as the paper writes it."""
        return _TITLES[self]


_TITLES = (
    "No_attempt",
    "Success_I",
    "Success_L",
    "Unsuccess_col",
    "Unsuccess_ncol",
    "Success_U",
    "censored",
    "Unsuccess_dep",
)


@dataclass(frozen=True, slots=True, kw_only=True, weakref_slot=True)
class Case(IdentityBatch):
    """All inputs of rules and features; a case equals itself alone.

    Attributes:
        trajectories: The recording, with its road, weather and vehicles.
        signals: Signals of the ego and its neighbours, frame by frame.
        events: Phases of the overtake as frame numbers.
        target: The vehicle to overtake, frame by frame.
    """

    trajectories: Trajectories
    signals: EgoSignals
    events: OvertakeEvents
    target: TargetSignals


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding(Batch):
    """Findings of one rule; every array has shape (simulation,).

    Attributes:
        verdict: `Verdict`.
        margin: Distance from the limit of the law, in the unit of the rule, negative in a breach; 0
            where the verdict is neither legal nor illegal.
        first: First frame of the breach, `NEVER` without one.
        last: Last frame of the breach, `NEVER` without one.
        longest: Number of frames of its longest unbroken part, 0 without one.
        severity: `Severity` of the breach, `NONE` without one.
        belief: `Belief`.
    """

    verdict: U8
    margin: F32
    first: I32
    last: I32
    longest: I32
    severity: U8
    belief: U8


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings(Finding):
    """Findings of each rule of a pack; the arrays of `Finding` have shape (simulation, rule).

    Attributes:
        rules: Codes of the rules, in the order of the last axis.
        version: Version of the pack.
    """

    rules: tuple[str, ...]
    version: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Labels(Batch):
    """The class of each simulation; arrays have shape (simulation,) or (simulation, policy).

    Attributes:
        policies: Names of the policies, in the order of the last axis.
        outcome: `Outcome`, shape (simulation,).
        detail: `OutcomeDetail`, shape (simulation,).
        classes: `OvertakeClass`, (simulation, policy).
        is_legal: Whether no rule that the policy requires is broken, as far as can be decided.
        num_broken: Number of required rules that are broken.
        num_undecidable: Number of required rules that apply and cannot be decided.
    """

    policies: tuple[str, ...]
    outcome: U8
    detail: U8
    classes: U8
    is_legal: Mask
    num_broken: U8
    num_undecidable: U8
