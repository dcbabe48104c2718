"""Tasks of prediction that a release of data sets poses, and its split by scene."""

import hashlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.analysis.learning.examples import Examples
from overtaking.analysis.learning.targets import TARGETS, is_ended
from overtaking.core.arrays import Mask

Names = NDArray[np.str_]

PARTS = {"train": 0.7, "validation": 0.15, "test": 0.15}
"""Share of the scenes in each part."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A question about the instant at which an overtake begins, or could have begun.

    Attributes:
        name: Its name, and that of its column.
        question: The question in a sentence.
        of_attempts: Whether it is asked of attempts only.
        answers: The answer of each example, shape (example,).
    """

    name: str
    question: str
    of_attempts: bool
    answers: Callable[[Examples], Names]

    def is_asked(self, examples: Examples) -> Mask:
        """Whether it is asked of each example: there is a vehicle to overtake and a known end."""
        known = is_ended(examples.classes, examples.is_seen)
        return known & examples.attempted if self.of_attempts else known


def _outcome(examples: Examples) -> Names:
    return examples.classes.to_numpy().astype(str)


def _legal(examples: Examples) -> Names:
    is_legal = examples.classes.isin(TARGETS["legal"].classes).to_numpy()
    return np.where(is_legal, "legal", "not legal")


def _go(examples: Examples) -> Names:
    return np.where(examples.attempted, "go", "stay")


TASKS = (
    Task(
        name="outcome",
        question="How does the overtake end that begins now?",
        of_attempts=True,
        answers=_outcome,
    ),
    Task(name="legal", question=TARGETS["legal"].question, of_attempts=True, answers=_legal),
    Task(
        name="go",
        question="Does the driver begin to overtake now, or stay?",
        of_attempts=False,
        answers=_go,
    ),
)
"""The tasks; inputs are the attributes of `attributes.toml`, known before the manoeuvre."""


def parts_of(roots: Iterable[str]) -> Names:
    """The part that each simulation belongs to, shape (simulation,).

    A hash of the scene decides, so a scene is in the same part in every data set, with its twins
    and branches, and whatever the number of simulations.

    Args:
        roots: `examples.roots_of` the simulations.
    """
    names, ends = list(PARTS), np.cumsum(list(PARTS.values()))[:-1]
    indices = np.searchsorted(ends, [_number(root) for root in roots], side="right")
    return np.array(names)[indices]


def _number(root: str) -> float:
    """A number that is uniform in [0, 1) over scenes."""
    return int.from_bytes(hashlib.sha256(root.encode()).digest()[:8], "big") / 2.0**64
