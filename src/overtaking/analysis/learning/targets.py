"""Targets of prediction: legal, collision, do not start now."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from overtaking.core.arrays import Mask
from overtaking.core.errors import check_choice
from overtaking.model.verdicts import OvertakeClass

if TYPE_CHECKING:
    import pandas as pd


_OPEN = (OvertakeClass.CENSORED.title, OvertakeClass.SUCCESS_U.title)


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """A yes-or-no question about the outcome of an overtake.

    Attributes:
        name: Its name on the command line.
        title: The head of a rule about it.
        question: The question in a sentence.
        classes: The classes in which it is true.
        of_attempts: Whether it asks about attempts only, or also about instants at which one might
            have begun.
        over_limit_means: The prediction for a speed over the limit, by the speed limit alone.
    """

    name: str
    title: str
    question: str
    classes: tuple[str, ...]
    of_attempts: bool
    over_limit_means: bool


TARGETS = {
    "legal": Target(
        name="legal",
        title="legal",
        question="Will the overtake that begins now be completed, and be legal?",
        classes=(OvertakeClass.SUCCESS_L.title,),
        of_attempts=True,
        over_limit_means=False,
    ),
    "collision": Target(
        name="collision",
        title="collision",
        question="Will the overtake that begins now end in a collision?",
        classes=(OvertakeClass.UNSUCCESS_COL.title,),
        of_attempts=True,
        over_limit_means=True,
    ),
    "start": Target(
        name="start",
        title="do not start now",
        question="Is this no time to begin: does the driver not begin, or does it go wrong?",
        classes=(
            OvertakeClass.NO_ATTEMPT.title,
            OvertakeClass.UNSUCCESS_COL.title,
            OvertakeClass.UNSUCCESS_NCOL.title,
            OvertakeClass.UNSUCCESS_DEP.title,
        ),
        of_attempts=False,
        over_limit_means=True,
    ),
}
"""The targets of rules, by name."""


def target_of(name: str, others: tuple[str, ...] = ()) -> Target:
    """A target by its name.

    Args:
        name: The name.
        others: Other names that the command knows, for the message.

    Raises:
        ConfigError: There is no such target.
    """
    check_choice(name, (*others, *TARGETS), what="--about", where="learn")
    return TARGETS[name]


def is_asked(classes: "pd.Series[str]", attempted: Mask, seen: Mask, target: Target) -> Mask:
    """Which simulations a target asks about, shape (simulation,).

    Args:
        classes: Class of each simulation.
        attempted: Whether an overtake was begun.
        seen: Whether there is a vehicle ahead at the instant.
        target: The target.

    Returns:
        Those with a vehicle to overtake and a known end; only attempts if the target asks about
        these.
    """
    known = is_ended(classes, seen)
    return known & attempted if target.of_attempts else known


def is_ended(classes: "pd.Series[str]", seen: Mask) -> Mask:
    """Whether there was a vehicle to overtake and the end is known, shape (simulation,)."""
    return seen & ~classes.isin(_OPEN).to_numpy()
