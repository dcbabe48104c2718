"""Labels of a simulation: the verdict of each rule, and a class for each policy."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated

from overtaking.core.arrays import F32, I32, U8, Mask
from overtaking.model.batch import Batch, ColumnName, FieldSpec, IdentityBatch, with_field_docs
from overtaking.model.ego_signals import EgoSignals, TargetSignals
from overtaking.model.overtake_events import NEVER, Outcome, OutcomeDetail, OvertakeEvents
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


def _code(meaning: str, codes: type[IntEnum]) -> FieldSpec:
    """Declaration of codes, whose names tables write in small letters."""
    return FieldSpec(meaning, names=[code.name.lower() for code in codes])


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class Finding(Batch):
    """Findings of one rule; every array has shape (simulation,).

    The margin is 0 where the verdict is neither legal nor illegal. Without a breach its first and
    last frame are `NEVER`, its longest run is 0 and its severity `NONE`.
    """

    verdict: Annotated[U8, _code("Verdict of the rule", Verdict)]
    margin: Annotated[
        F32,
        FieldSpec(
            "Distance from the limit of the law in the unit of the rule, negative in a breach"
        ),
    ]
    first_frame: Annotated[
        I32,
        FieldSpec("First frame of the breach", missing=int(NEVER)),
    ]
    last_frame: Annotated[
        I32,
        FieldSpec("Last frame of the breach", missing=int(NEVER)),
    ]
    longest_run: Annotated[
        I32, FieldSpec("Number of frames of the longest unbroken run of the breach", column=None)
    ]
    severity: Annotated[U8, _code("Severity of the breach", Severity)]
    belief: Annotated[U8, _code("Verdict by the belief of the driver", Belief)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings(Finding):
    """Findings of each rule of a pack; the arrays of `Finding` have shape (simulation, rule).

    Attributes:
        rule_codes: Codes of the rules, in the order of the last axis.
        version: Version of the pack.
    """

    rule_codes: tuple[str, ...]
    version: str


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class Labels(Batch):
    """The class of each simulation.

    Arrays have shape (simulation, policy); `outcome` and `detail` have shape (simulation,).
    """

    policies: Annotated[
        tuple[str, ...],
        FieldSpec("Names of the policies, in the order of the last axis", column=None),
    ]
    outcome: Annotated[U8, _code("How the overtake ended, legality aside", Outcome)]
    detail: Annotated[U8, _code("Reason of the outcome", OutcomeDetail)]
    classes: Annotated[
        U8,
        FieldSpec(
            "Class of the simulation under the policy",
            column=ColumnName("class"),
            names=[one.title for one in OvertakeClass],
        ),
    ]
    is_legal: Annotated[
        Mask,
        FieldSpec(
            "Whether no required rule is known to be broken",
            column=ColumnName("legal_as_far_as_decidable"),
        ),
    ]
    num_broken: Annotated[U8, FieldSpec("Required rules that are broken")]
    num_undecidable: Annotated[U8, FieldSpec("Required rules that apply and cannot be decided")]
