"""Labels of a simulation: the verdict of each rule of the law, and a class for each policy.

`labels` fills in these batches from a `Case`; tables, films and statistics read them.

Terms:
    ego, target: the vehicle under study, and the vehicle that it overtakes.
    rule: one duty of a law as a check, such as the safe distance; a pack holds the rules of a law.
    policy: a choice of required rules and of the breaches that count, such as "strict". An overtake
        with a breach of a required rule that counts is illegal.
    margin: distance of the ego's conduct from the limit of a rule; a negative margin is a breach.
    belief: the driver's perceived distances and speeds, which can differ from the true ones.
    paper: `pinto-2023` in docs/reference/sources.md, the study that this package reproduces.

`FieldSpec` declares the table column of a field: `names` are the texts for its integers, `missing`
is the value that is null in tables, and a field with `column=None` is not written.
`with_field_docs` lists the fields in the docstring of the class.
"""

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
    NOT_APPLICABLE = 2  # The situation that the rule regulates does not occur.
    UNDECIDABLE = 3  # The recording omits a property that the rule needs, or is not exact enough.


class Belief(IntEnum):
    """Verdicts on a decision of the ego's driver: by the truth and by the driver's belief."""

    NONE = 0  # The rule does not judge beliefs, or no belief was recorded.
    LEGAL = 1  # Legal by both.
    MISTAKEN = 2  # Illegal by the truth, legal by belief.
    KNOWINGLY_ILLEGAL = 3  # Illegal by both.
    LUCKY = 4  # Legal by the truth, illegal by belief.


class Severity(IntEnum):
    """Severity of a breach, as the law grades it."""

    NONE = 0  # No breach.
    LIGHT = 1
    SERIOUS = 2
    VERY_SERIOUS = 3


class OvertakeClass(IntEnum):
    """Class of a simulation: the paper's five classes (0 to 4) and three further ones.

    A policy may omit the further classes. Then `SUCCESS_U` counts as `SUCCESS_L`, `CENSORED` as
    `UNSUCCESS_NCOL`, and `UNSUCCESS_DEP` as `UNSUCCESS_NCOL` if the ego had begun an overtake, else
    as `NO_ATTEMPT`. Data sets store the integers, so a new class gets the next one.
    """

    NO_ATTEMPT = 0  # The ego begins no overtake.
    SUCCESS_I = 1  # Completed, and illegal.
    SUCCESS_L = 2  # Completed, and legal.
    UNSUCCESS_COL = 3  # The ego collides.
    UNSUCCESS_NCOL = 4  # Begun and not completed, without a collision.
    SUCCESS_U = 5  # Completed; no required rule is broken, but one is undecidable.
    CENSORED = 6  # The recording ends during the overtake; left out of rates.
    UNSUCCESS_DEP = 7  # The ego leaves the road or spins, at any time, without a collision.

    @property
    def title(self) -> str:
        """The name in tables and statistics; the paper writes the first five in this way."""
        return _TITLES[self]


# In the order of the integers of `OvertakeClass`. Data sets hold these texts: do not change them.
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
    """All inputs of rules and features, for a batch of simulations.

    Functions cache their results per `Case` object, through weak references. So two cases are equal
    only if they are the same object: `IdentityBatch` copies such an `__eq__` into this class, and
    the decorator `dataclass` keeps it.

    Attributes:
        trajectories: The recorded states, with road, weather and vehicles.
        signals: Signals of the ego and its neighbours, frame by frame.
        events: Events of the overtake as frame numbers.
        target: Signals of the target, frame by frame; without a target `target.valid` is false.
    """

    trajectories: Trajectories
    signals: EgoSignals
    events: OvertakeEvents
    target: TargetSignals


def _enumeration_spec(meaning: str, enumeration: type[IntEnum]) -> FieldSpec:
    """Declaration of a field with the integers of an enumeration; tables show lower-case names."""
    return FieldSpec(meaning, names=[member.name.lower() for member in enumeration])


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class Finding(Batch):
    """Result of one rule; every array has shape (simulation,).

    The margin is 0 where the verdict is neither legal nor illegal. Without a breach the first and
    the last frame are `NEVER` (-1), the longest run is 0 and the severity is `NONE`. Between the
    first and the last frame the breach may be interrupted.
    """

    verdict: Annotated[U8, _enumeration_spec("Verdict of the rule", Verdict)]
    margin: Annotated[
        F32,
        FieldSpec(
            "Distance from the limit of the law where it is smallest, in the unit of the rule, "
            "negative in a breach"
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
    # For policies that tolerate a short breach.
    longest_run: Annotated[
        I32, FieldSpec("Number of frames of the longest unbroken run of the breach", column=None)
    ]
    severity: Annotated[U8, _enumeration_spec("Severity of the breach", Severity)]
    belief: Annotated[
        U8, _enumeration_spec("True verdict and verdict by the belief of the driver", Belief)
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings(Finding):
    """Results of all rules of a pack: the fields of `Finding` with shape (simulation, rule).

    Attributes:
        rule_codes: Codes of the rules, such as "L3", in the order of the last axis.
        version: Version of the pack, as recorded in data sets.
    """

    rule_codes: tuple[str, ...]
    version: str


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class Labels(Batch):
    """The class of each simulation under each policy.

    Arrays have shape (simulation, policy); `outcome` and `detail` have shape (simulation,). The
    policy states which rules are required.
    """

    policies: Annotated[
        tuple[str, ...],
        FieldSpec("Names of the policies, in the order of the last axis", column=None),
    ]
    outcome: Annotated[U8, _enumeration_spec("How the overtake ended, legality aside", Outcome)]
    detail: Annotated[U8, _enumeration_spec("Reason of the outcome", OutcomeDetail)]
    classes: Annotated[
        U8,
        FieldSpec(
            "Class of the simulation under the policy",
            column=ColumnName("class"),
            names=[overtake_class.title for overtake_class in OvertakeClass],
        ),
    ]
    is_legal: Annotated[
        Mask,
        FieldSpec(
            "Whether no required rule is broken, as far as the rules are decidable",
            column=ColumnName("legal_as_far_as_decidable"),
        ),
    ]
    num_broken: Annotated[U8, FieldSpec("Required rules that are broken")]
    num_undecidable: Annotated[U8, FieldSpec("Required rules that apply and cannot be decided")]
