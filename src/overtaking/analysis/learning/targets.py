"""What is to be foretold: legal, collision, do not start now; and the class itself."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from overtaking.core.errors import ConfigError
from overtaking.model.labels import OvertakeClass

if TYPE_CHECKING:
    import pandas as pd

Mask = NDArray[np.bool_]

_OPEN = (OvertakeClass.CENSORED.title, OvertakeClass.SUCCESS_U.title)


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """Something that may come of an overtake.

    Attributes:
        name: What it is asked for as.
        title: The head of a rule about it.
        question: What is asked, in a sentence.
        classes: The classes in which it is so.
        of_attempts: Whether only overtakes that were begun are asked about; else also the instants
            at which one might have begun.
        over_limit_means: What a speed over the limit alone foretells.
    """

    name: str
    title: str
    question: str
    classes: tuple[str, ...]
    of_attempts: bool
    over_limit_means: bool


TARGETS = {
    one.name: one
    for one in (
        Target(
            name="legal",
            title="legal",
            question="Will the overtake that begins now be completed, and be legal?",
            classes=(OvertakeClass.SUCCESS_L.title,),
            of_attempts=True,
            over_limit_means=False,
        ),
        Target(
            name="collision",
            title="collision",
            question="Will the overtake that begins now end in a collision?",
            classes=(OvertakeClass.UNSUCCESS_COL.title,),
            of_attempts=True,
            over_limit_means=True,
        ),
        Target(
            name="start",
            title="do not start now",
            question="Is this no time to begin: does the driver not begin, or does it go wrong?",
            classes=tuple(
                one.title
                for one in (
                    OvertakeClass.NO_ATTEMPT,
                    OvertakeClass.UNSUCCESS_COL,
                    OvertakeClass.UNSUCCESS_NCOL,
                )
            ),
            of_attempts=False,
            over_limit_means=True,
        ),
    )
}
"""What rules can be learned about, by name."""


def target_of(name: str, others: tuple[str, ...] = ()) -> Target:
    """A target by its name.

    Args:
        name: The name.
        others: What else could have been asked for, for the message.

    Raises:
        ConfigError: There is none.
    """
    if name not in TARGETS:
        raise ConfigError.of(
            what="--about",
            where="learn",
            expected=" or ".join((*others, *TARGETS)),
            got=name,
            next_step="choose one of them",
        )
    return TARGETS[name]


def is_asked(classes: "pd.Series[str]", attempted: Mask, seen: Mask, target: Target) -> Mask:
    """Which simulations a target asks about, shape (simulation,).

    Args:
        classes: Class of each simulation.
        attempted: Whether an overtake was begun.
        seen: Whether there is a vehicle ahead at the instant.
        target: The target.

    Returns:
        Those with somebody to overtake whose end is known, and if it is about attempts, begun.
    """
    known = is_ended(classes, seen)
    return known & attempted if target.of_attempts else known


def is_ended(classes: "pd.Series[str]", seen: Mask) -> Mask:
    """Where there was somebody to overtake, and it is known how it ended, shape (simulation,)."""
    return seen & ~classes.isin(_OPEN).to_numpy()
