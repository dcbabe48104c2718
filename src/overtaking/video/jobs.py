"""Which simulations of a data set become films, and what is known of each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from overtaking.core.errors import ConfigError
from overtaking.labelling import label
from overtaking.model.labels import OvertakeClass
from overtaking.rules import POLICIES, PORTUGAL

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from overtaking.datasets.load import Dataset
    from overtaking.labelling import Labelled
    from overtaking.model.trajectory import Trajectories

ALL, ONE_PER_CLASS = "all", "one-per-class"
"""Choices that name no numbers."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A film to make.

    Attributes:
        number: Number of the simulation.
        labelled: A batch of this one simulation, with what is said of it.
        label: Its class.
        articles: For the codes of the rules whose breaches are shown, what shall be read.
    """

    number: int
    labelled: Labelled
    label: str
    articles: dict[str, str]


def jobs(
    data: Dataset, chosen: Iterable[int] | str = ONE_PER_CLASS, policy: str = POLICIES[0].name
) -> Iterator[Job]:
    """The films of a data set, in the order of their numbers.

    Args:
        data: The data set; what it did not keep is simulated again.
        chosen: Numbers of simulations, `ALL`, or `ONE_PER_CLASS`: the first of each.
        policy: Whose classes are meant.

    Raises:
        ConfigError: There is no such simulation, choice or policy.
        DatasetError: The data set is damaged, or the simulator has changed.
    """
    place, articles = _policy(policy), articles_of(policy)
    if not isinstance(chosen, str):
        for number in checked(chosen, len(data)):
            yield from _jobs(data.trajectory(number), [number], place, articles)
        return
    if chosen not in (ALL, ONE_PER_CLASS):
        expected = f"numbers, {ALL} or {ONE_PER_CLASS}"
        raise _refused("simulations", expected, repr(chosen))
    shown: set[str] = set()
    for numbers, batch in data.batches():
        for job in _jobs(batch, numbers.tolist(), place, articles):
            if chosen == ALL or job.label not in shown:
                shown.add(job.label)
                yield job


def _jobs(
    batch: Trajectories, numbers: list[int], policy: int, articles: dict[str, str]
) -> Iterator[Job]:
    """Each simulation of a batch."""
    labelled = label(batch)
    codes = labelled.labels.classes[:, policy]
    for place, number in enumerate(numbers):
        yield Job(
            number=number,
            labelled=labelled.select(np.array([place])),
            label=OvertakeClass(int(codes[place])).title,
            articles=articles,
        )


def articles_of(policy: str) -> dict[str, str]:
    """The rules whose breaches a film tells, with what it says.

    These are the ego's duties, but of rules with a stricter reading only the reading that the
    policy requires.
    """
    required = POLICIES[_policy(policy)].required
    elsewhere = {code for one in POLICIES for code in one.required} - set(required)
    return {
        rule.code: f"{rule.law}: {rule.title}"
        for rule in PORTUGAL.rules
        if rule.of_ego and not _is_other_reading(rule.code, required, elsewhere)
    }


def _is_other_reading(code: str, required: tuple[str, ...], elsewhere: set[str]) -> bool:
    """Whether a rule is one of two readings, and the policy requires the other or neither."""
    stem = code.rstrip("s")
    return code not in required and code in elsewhere and f"{stem}s" in elsewhere | set(required)


def _policy(name: str) -> int:
    """Place of a policy among all."""
    names = [policy.name for policy in POLICIES]
    if name not in names:
        raise _refused("policy", " or ".join(names), repr(name))
    return names.index(name)


def num_films(data: Dataset, chosen: Iterable[int] | str) -> int | None:
    """How many films a choice means, None if that is not known before."""
    if chosen == ALL:
        return len(data)
    return None if isinstance(chosen, str) else len(set(chosen))


def checked(numbers: Iterable[int], num_simulations: int) -> list[int]:
    """Numbers of simulations in order, each once.

    Raises:
        ConfigError: There is no such simulation, or none is named.
    """
    chosen = sorted(set(numbers))
    wrong = [number for number in chosen if not 0 <= number < num_simulations]
    if wrong or not chosen:
        expected = f"some of 0 to {num_simulations - 1}"
        raise _refused("simulations", expected, str(wrong[0]) if wrong else "none")
    return chosen


def _refused(what: str, expected: str, got: str) -> ConfigError:
    return ConfigError.of(
        what=what, where="video", expected=expected, got=got, next_step="choose one of these"
    )
