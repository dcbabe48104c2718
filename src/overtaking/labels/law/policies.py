"""Which rules make an overtake illegal: three readings, as data."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.checks import check_name
from overtaking.core.elementary import Mask
from overtaking.core.errors import ConfigError
from overtaking.model.batch import Batch
from overtaking.model.labels import Findings, Verdict

U8 = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class Policy:
    """Which rules count, and how undecidable ones are treated.

    Attributes:
        name: Short name, a value of the column `policy`.
        required: Codes of the rules that a legal overtake must not break.
        allows_undecided: Whether an overtake counts as legal although a rule that applies is
            undecidable; else it is `SUCCESS_U`.
        censors_open: Whether an overtake that is open at the horizon is `CENSORED`; else it counts
            as not completed.
        names_departures: Whether an ego that leaves the road or spins without a contact is
            `UNSUCCESS_DEP`; else it counts as not completed, or as no attempt if it began none.
    """

    name: str
    required: tuple[str, ...]
    allows_undecided: bool
    censors_open: bool
    names_departures: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Legality(Batch):
    """What a policy makes of findings; every array has shape (simulation,).

    Attributes:
        num_broken: Number of required rules that are broken.
        num_undecidable: Number of required rules that apply and cannot be decided.
        is_legal: Whether none is broken, as far as can be decided.
    """

    num_broken: U8
    num_undecidable: U8
    is_legal: Mask


_PAPER = ("L1", "L2", "L3", "L4", "L5", "L8", "L9", "L10", "L11", "L12", "L13", "L15", "L16")
"""What the study's 22 columns can decide."""

_DEFAULT = (*_PAPER, "L14", "L17", "L20", "L24")

_STRICT = (*(code for code in _DEFAULT if code not in ("L14", "L15")), "L14s", "L15s")

POLICIES = (
    Policy(
        name="paper",
        required=_PAPER,
        allows_undecided=True,
        censors_open=False,
        names_departures=False,
    ),
    Policy(
        name="default",
        required=_DEFAULT,
        allows_undecided=False,
        censors_open=True,
        names_departures=True,
    ),
    Policy(
        name="strict",
        required=(*_STRICT, "L6", "L7", "L18", "L19", "L21", "L23"),
        allows_undecided=False,
        censors_open=True,
        names_departures=True,
    ),
)
"""The policies, in the order of every table."""


def policy(name: str) -> Policy:
    """The policy of a name.

    Raises:
        ConfigError: There is none of that name.
    """
    known = {one.name: one for one in POLICIES}
    check_name(name, known, what="policy", where="rules")
    return known[name]


def legality(findings: Findings, policy: Policy) -> Legality:
    """Findings under a policy.

    Args:
        findings: What each rule says of each simulation.
        policy: Which of the rules count.

    Raises:
        ConfigError: The findings lack a rule that the policy requires.
    """
    missing = [code for code in policy.required if code not in findings.rules]
    if missing:
        raise ConfigError.of(
            what=f"policy {policy.name}",
            where="findings",
            expected=f"the rules {', '.join(policy.required)}",
            got=f"none called {', '.join(missing)}",
            next_step="check a pack that has them",
        )
    verdict = findings.verdict[:, [findings.rules.index(code) for code in policy.required]]
    broken = (verdict == Verdict.ILLEGAL).sum(axis=1, dtype=np.uint8)
    undecidable = (verdict == Verdict.UNDECIDABLE).sum(axis=1, dtype=np.uint8)
    return Legality(num_broken=broken, num_undecidable=undecidable, is_legal=broken == 0)
