"""Which simulations become films, and the facts that each film shows."""

import operator
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from overtaking.core.errors import ConfigError
from overtaking.data.load import Dataset
from overtaking.labels.labelling import LabelledTrajectories, label
from overtaking.labels.law.judging import Policy, choose_policy, stored_policy
from overtaking.model.trajectories import Trajectories
from overtaking.model.verdicts import OvertakeClass

Source = Dataset | Trajectories | LabelledTrajectories
"""A data set, or a batch in memory; labels are computed if they are missing."""

ALL, ONE_PER_CLASS = "all", "one-per-class"
"""Choices that name no numbers."""

MIN_DURATION_S = 2.0
"""Shortest simulation that is chosen as the example of a class, if there is a longer one [s].

A lane change alone takes about 4 s, so no overtake fits into a shorter simulation. Recordings
contain simulations of a few frames.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A film to make.

    Attributes:
        number: Number of the simulation in the data set, or its place in the batch.
        labelled: A batch of this one simulation, with its labels.
        policy: Which rules count.
        label: Its class under this policy.
    """

    number: int
    labelled: LabelledTrajectories
    policy: Policy
    label: OvertakeClass


def jobs(
    source: Source, selection: Iterable[int] | str = ONE_PER_CLASS, policy_name: str | None = None
) -> Iterator[Job]:
    """Films to make, in the order of their numbers; with `ONE_PER_CLASS`, short ones come last.

    Args:
        source: The simulations; what a data set did not keep is simulated again.
        selection: Numbers of simulations, `ALL`, or `ONE_PER_CLASS`: the first simulation of each
            class that lasts `MIN_DURATION_S` or more; if all are shorter, the longest.
        policy_name: Which rules decide about the class; None for the default of the profile.

    Raises:
        ConfigError: There is no such simulation, choice or policy.
        DatasetError: The data set is damaged, or the simulator has changed.
    """
    counted = stored_policy(choose_policy(policy_name, profile_of(source)))
    candidates = _candidates(source, selection, counted)
    if isinstance(selection, str) and selection == ONE_PER_CLASS:
        candidates = _first_of_each_class(candidates)
    for candidate in candidates:
        yield candidate.job()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Candidate:
    """A simulation that may be filmed.

    It stays in its batch until it is chosen, because selecting every simulation takes long.
    """

    number: int
    batch: LabelledTrajectories
    row: int
    policy: Policy
    label: OvertakeClass

    @property
    def duration_s(self) -> float:
        trajectories = self.batch.trajectories
        return float(trajectories.time_ms[int(trajectories.num_frames[self.row]) - 1]) / 1000.0

    def job(self) -> Job:
        simulation = self.batch.select(np.array([self.row]))
        return Job(number=self.number, labelled=simulation, policy=self.policy, label=self.label)


def _candidates(
    source: Source, selection: Iterable[int] | str, counted: Policy
) -> Iterator[_Candidate]:
    for numbers, batch in _batches(source, selection):
        labelled = batch if isinstance(batch, LabelledTrajectories) else label(batch)
        codes = labelled.labels.classes[:, labelled.labels.policies.index(counted.name)]
        for row, number in enumerate(numbers):
            overtake_class = OvertakeClass(int(codes[row]))
            yield _Candidate(
                number=number, batch=labelled, row=row, policy=counted, label=overtake_class
            )


def _first_of_each_class(candidates: Iterable[_Candidate]) -> Iterator[_Candidate]:
    """The first of each class that lasts long enough, then the longest of the other classes."""
    finished, longest_short = set[OvertakeClass](), dict[OvertakeClass, _Candidate]()
    for candidate in candidates:
        if candidate.label in finished:
            continue
        longest = longest_short.get(candidate.label)
        if candidate.duration_s >= MIN_DURATION_S:
            finished.add(candidate.label)
            longest_short.pop(candidate.label, None)
            yield candidate
        elif longest is None or longest.duration_s < candidate.duration_s:
            longest_short[candidate.label] = candidate
    yield from longest_short.values()


def _batches(
    source: Source, selection: Iterable[int] | str
) -> Iterator[tuple[list[int], Trajectories | LabelledTrajectories]]:
    """The simulations to look at, with their numbers."""
    if isinstance(selection, str) and selection not in (ALL, ONE_PER_CLASS):
        raise _refused(f"numbers, {ALL} or {ONE_PER_CLASS}", repr(selection))
    if not isinstance(source, Dataset):
        size = num_simulations(source)
        if isinstance(selection, str):
            yield list(range(size)), source
        else:
            numbers = checked(selection, size)
            yield numbers, source.select(np.array(numbers))
    elif isinstance(selection, str):
        yield from ((numbers.tolist(), batch) for numbers, batch in source.batches())
    else:
        for number in checked(selection, len(source)):
            yield [number], source.trajectory(number)


def num_simulations(source: Source) -> int:
    """How many simulations there are."""
    if isinstance(source, Dataset):
        return len(source)
    runs = source.trajectories if isinstance(source, LabelledTrajectories) else source
    return runs.scenario.num_simulations


def profile_of(source: Source) -> str:
    """Name of the profile of the simulations, or of the format of a recording."""
    if isinstance(source, Dataset):
        return source.profile
    run = source.trajectories if isinstance(source, LabelledTrajectories) else source
    return run.scenario.profile


def num_films(source: Source, selection: Iterable[int] | str) -> int | None:
    """Number of films of a choice; None with `ONE_PER_CLASS`, as the classes are not known yet."""
    if not isinstance(selection, str):
        return len(set(selection))
    return num_simulations(source) if selection == ALL else None


def checked(numbers: Iterable[int], num_simulations: int) -> list[int]:
    """Numbers of simulations in order, each once.

    Raises:
        ConfigError: There is no such simulation, or none is named.
    """
    distinct = sorted(set(map(operator.index, numbers)))  # Integers of NumPy become plain ones.
    wrong = [number for number in distinct if not 0 <= number < num_simulations]
    if wrong or not distinct:
        expected = f"some of 0 to {num_simulations - 1}"
        raise _refused(expected, str(wrong[0]) if wrong else "none")
    return distinct


def _refused(expected: str, got: str) -> ConfigError:
    return ConfigError(
        what="simulations",
        where="choice",
        expected=expected,
        got=got,
        next_step="choose one of these",
    )
