"""Facts as text for clingo (ASP) and Prolog: requested facts, their lines, and folders of files.

A fact is a predicate with values, such as `event(7,attempt,120)`. Functions measure facts for a
group of simulations, as one column of integers for each argument of a predicate. The integer of a
constant such as `attempt` is its code.
"""

# pyarrow ships no types, and it makes its compute functions when it is imported.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import os
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from overtaking.analysis.logic.fact_declaration import measure_facts
from overtaking.analysis.logic.fact_source import FactSource
from overtaking.analysis.logic.law_facts import LAW_FACTS
from overtaking.analysis.logic.road_facts import ROAD_FACTS
from overtaking.analysis.logic.simulation_facts import EVENT_FACTS, SIMULATION_FACTS
from overtaking.analysis.logic.simulation_groups import read_groups
from overtaking.analysis.logic.vehicle_facts import MOTION_FACTS, VEHICLE_FACTS
from overtaking.analysis.logic.vocabulary import INT_BITS, ROLE
from overtaking.core.errors import SchemaError, check_in_range
from overtaking.core.files import atomic_folder, write_new_file

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from numpy.typing import NDArray

    from overtaking.analysis.logic.fact_declaration import Fact, FactColumns
    from overtaking.analysis.logic.simulation_groups import SimulationGroup
    from overtaking.analysis.logic.vocabulary import Predicate
    from overtaking.core.arrays import I64
    from overtaking.core.progress import ProgressCallback
    from overtaking.data.load import Dataset

_RECORDED_FACTS = SIMULATION_FACTS | VEHICLE_FACTS | EVENT_FACTS | MOTION_FACTS
"""Facts of each simulation that queries and programs of users read."""

FACTS: dict[str, Fact] = ROAD_FACTS | _RECORDED_FACTS | LAW_FACTS
"""Every predicate of facts by name, in the order in which files list facts."""

ArgumentPattern = tuple[str | None, ...]
"""The required constant of each argument of a predicate; None for any value."""

DEFAULT_FRAME_STEP = 10
"""Interval between the frames with positions [frames]: a choice, 0.1 s in simulations."""

FILE_ENDINGS = {"asp": ".lp", "prolog": ".pl"}
"""The languages of facts, and the endings of their files."""

PROGRAM_FOLDER = Path(__file__).with_name("programs")

SIMULATIONS_PER_FILE = 1000
"""Range of simulation numbers in one file, a choice; a reasoner loads a file at a time."""

# The law is written for clingo only: for Prolog, `with_law` adds the facts that it reads.
_PROGRAMS_OF_LANGUAGE = {"asp": ("theory.lp", "law.lp"), "prolog": ("theory.pl",)}

_FACTS_PER_STATEMENT = 100
"""Largest number of facts in one pool such as `night(3;7).`, a choice.

clingo reads a pool faster than single facts.
"""

_STRING = pa.large_string()


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestedFacts:
    """The facts that a file, a query or a law needs.

    Attributes:
        patterns: For each predicate, the patterns of arguments of which a fact must match one.
    """

    patterns: Mapping[str, frozenset[ArgumentPattern]]

    @property
    def roles(self) -> frozenset[str]:
        """The roles, such as `leader`, of which `spacing` or `forced_braking` is requested.

        These facts exist for every frame, so they are measured for the requested roles only.
        """
        patterns = [*self.patterns.get("spacing", ()), *self.patterns.get("forced_braking", ())]
        # The role is the second argument, after the number of the simulation.
        roles = {pattern[1] for pattern in patterns}
        # None, any value, requests all roles.
        return frozenset(ROLE.constants) if None in roles else frozenset(ROLE.constants) & roles

    def matching(self, columns: Mapping[str, FactColumns]) -> dict[str, FactColumns]:
        """The facts that match a pattern, in the order of `FACTS`."""
        matching: dict[str, FactColumns] = {}
        for name, fact in FACTS.items():
            if name in columns:
                is_match = self._matches(fact, columns[name])
                matching[name] = tuple(column[is_match] for column in columns[name])
        return matching

    def _matches(self, fact: Fact, columns: FactColumns) -> NDArray[np.bool_]:
        """Which facts of a predicate match a pattern.

        Only constants are compared. A pattern with a number also selects facts with other numbers,
        which the rules then do not match.
        """
        matches_any = np.zeros(len(columns[0]), np.bool_)
        for pattern in self.patterns[fact.name]:
            matches = np.ones(len(matches_any), np.bool_)
            for column, constant, argument_type in zip(columns, pattern, fact.types, strict=True):
                constants = argument_type.constants
                if constant is not None and constants:
                    # A constant of another type has code -1, which no fact has.
                    code = constants.index(constant) if constant in constants else -1
                    matches &= column == code
            matches_any |= matches
        return matches_any


def all_facts(*, with_law: bool) -> RequestedFacts:
    """Every fact; facts that only the law reads are included on request."""
    facts = FACTS if with_law else ROAD_FACTS | _RECORDED_FACTS
    return RequestedFacts(
        patterns={name: frozenset([(None,) * len(fact.arguments)]) for name, fact in facts.items()}
    )


def measure_road_facts(group: SimulationGroup, requested: RequestedFacts) -> dict[str, FactColumns]:
    """The facts that every simulation of a data set shares.

    Args:
        group: Any simulations of the data set.
        requested: The facts that are needed.

    Returns:
        For each predicate the columns of its arguments; constants as their codes.
    """
    # Facts of the road do not depend on the frame step.
    return _measure_requested(ROAD_FACTS, group, requested, DEFAULT_FRAME_STEP)


def measure_simulation_facts(
    group: SimulationGroup, requested: RequestedFacts, *, frame_step: int = DEFAULT_FRAME_STEP
) -> dict[str, FactColumns]:
    """The facts of a group of simulations, without the facts of the road.

    Args:
        group: The simulations.
        requested: The facts that are needed.
        frame_step: As in `FactSource`.

    Returns:
        As `measure_road_facts`.
    """
    return _measure_requested(_RECORDED_FACTS | LAW_FACTS, group, requested, frame_step)


def _measure_requested(
    facts: Mapping[str, Fact], group: SimulationGroup, requested: RequestedFacts, frame_step: int
) -> dict[str, FactColumns]:
    source = FactSource(group=group, frame_step=frame_step, roles=requested.roles)
    requested_facts = [fact for name, fact in facts.items() if name in requested.patterns]
    return requested.matching(measure_facts(requested_facts, source))


def check_frame_step(frame_step: int) -> None:
    """Refuse a step below one frame.

    The commands `ask` and `export` share the option, so the error names `logic` as its place.

    Raises:
        ConfigError: The step is not positive.
    """
    check_in_range(frame_step, 1, what="--frame-step", where="logic", unit="frame")


def count_facts(columns: Mapping[str, FactColumns]) -> int:
    """Number of facts."""
    return sum(len(arguments[0]) for arguments in columns.values())


def fact_lines(columns: Mapping[str, FactColumns]) -> bytes:
    """Facts as lines that clingo and Prolog both read.

    Raises:
        SchemaError: A value is outside the range of its type, so that sums of it could wrap.
    """
    parts: list[bytes] = []
    for name, arguments in columns.items():
        lines = _join_arguments(FACTS[name], arguments, prefix=f"{name}(", suffix=").\n")
        # The buffers of an array of strings are validity, offsets and the joined text.
        parts.append(lines.buffers()[2].to_pybytes() if len(lines) else b"")
    return b"".join(parts)


def pooled_facts(group: SimulationGroup, requested: RequestedFacts, frame_step: int) -> bytes:
    """The facts of a group and its road, as pools such as `night(3;7).`, for clingo.

    Raises:
        SchemaError: A value is outside the range of its type.
    """
    columns = measure_road_facts(group, requested)
    columns |= measure_simulation_facts(group, requested, frame_step=frame_step)
    lines: list[str] = []
    for name, arguments in columns.items():
        facts = _join_arguments(FACTS[name], arguments, prefix="", suffix="").to_pylist()
        lines += [
            f"{name}({';'.join(facts[first : first + _FACTS_PER_STATEMENT])})."
            for first in range(0, len(facts), _FACTS_PER_STATEMENT)
        ]
    return "\n".join(lines).encode()


def _join_arguments(fact: Fact, columns: FactColumns, prefix: str, suffix: str) -> Any:
    """An array of strings, one for each fact: prefix, arguments with commas between, suffix."""
    parts: list[Any] = []
    for column, (label, argument_type) in zip(columns, fact.arguments.items(), strict=True):
        parts.append(pa.scalar("," if parts else prefix, _STRING))
        if argument_type.constants:
            constants = pa.array(argument_type.constants, _STRING)
            parts.append(constants.take(pa.array(column.astype(np.int64))))
        else:
            _check_range(fact, label, column)
            parts.append(pc.cast(pa.array(column), _STRING))
    # The last argument of the function is the separator of the parts.
    return pc.binary_join_element_wise(*parts, pa.scalar(suffix, _STRING), pa.scalar("", _STRING))


def _check_range(fact: Fact, label: str, column: NDArray[np.integer]) -> None:
    """Refuse values outside the range of their type, with which a term could leave 32 bits."""
    argument_type = fact.arguments[label]
    invalid = column[(column < argument_type.low) | (column > argument_type.high)]
    if len(invalid):
        raise SchemaError(
            what=f"argument {label} of {fact.signature_text}",
            where="facts",
            expected=f"{argument_type.low} to {argument_type.high}, so that no sum leaves "
            f"{INT_BITS} bits",
            got=int(invalid[0]),
            next_step="leave that simulation out",
        )


def file_header(title: str, requested: RequestedFacts, language: str) -> str:
    """The beginning of a file of facts: predicates with types, units and ranges of arguments.

    Args:
        title: One line on the source of the facts.
        requested: The facts that follow.
        language: A key of `FILE_ENDINGS`.
    """
    facts = [fact for name, fact in FACTS.items() if name in requested.patterns]
    types = {argument_type.name: argument_type for fact in facts for argument_type in fact.types}
    lines = [f"% {title}", "%", "% Every argument is an integer or a constant:", "%"]
    for argument_type in types.values():
        values = " ".join(argument_type.constants) or f"{argument_type.low}..{argument_type.high}"
        lines.append(f"%     {argument_type.name:<10} {argument_type.meaning}: {values}")
    lines += ["%", f"% No sum or product of a program leaves integers of {INT_BITS} bits.", ""]
    for fact in facts:
        arguments = (f"{label}: {of_type.name}" for label, of_type in fact.arguments.items())
        lines.append(f"%: {fact.name}({', '.join(arguments)})  {fact.meaning}")
        lines += _directives(fact, language)
    return "\n".join(lines) + "\n\n"


def _directives(predicate: Predicate, language: str) -> list[str]:
    """Directives by which a predicate without facts is empty, not an error."""
    name, arity = predicate.signature
    if language == "asp":
        return [f"#defined {name}/{arity}."]
    directives = ("multifile", "dynamic", "discontiguous")
    return [f":- {directive}({name}/{arity})." for directive in directives]


def write_facts(
    dataset: Dataset,
    out: Path,
    *,
    language: str,
    simulation_ids: I64 | None = None,
    frame_step: int = DEFAULT_FRAME_STEP,
    with_law: bool = False,
    progress: ProgressCallback | None = None,
) -> int:
    """Write simulations as facts: one file for each thousand numbers, and the programs.

    Args:
        dataset: The data set.
        out: Folder for the files, new or empty. The files appear when all are complete.
        language: A key of `FILE_ENDINGS`.
        simulation_ids: Numbers of its simulations in order; None for all.
        frame_step: Interval between written positions and speeds [frames], 1 or more.
        with_law: Whether to write the law, and the facts of every frame that only the law reads.
        progress: Called with the numbers of written and of requested simulations.

    Returns:
        Number of facts written.

    Raises:
        ConfigError: The folder is not empty, or the step is not positive.
        DatasetError: The data set is damaged.
        OSError: A file cannot be written.
    """
    check_frame_step(frame_step)
    requested, num_facts, num_written = all_facts(with_law=with_law), 0, 0
    num_requested = len(dataset) if simulation_ids is None else len(simulation_ids)
    title = f"Simulations of {dataset.profile}, data set {dataset.content_hash}"
    header = file_header(title, requested, language).encode()
    with atomic_folder(out) as folder:
        groups = _split_at_files(read_groups(dataset, simulation_ids))
        for file_number, groups_of_file in groupby(groups, key=_file_number):
            path = folder / f"facts-{file_number:05d}{FILE_ENDINGS[language]}"
            with path.open("xb") as file:
                file.write(header)
                for index, group in enumerate(groups_of_file):
                    # All simulations share the road, so its facts are written once in each file.
                    columns = {} if index else measure_road_facts(group, requested)
                    columns |= measure_simulation_facts(group, requested, frame_step=frame_step)
                    file.write(fact_lines(columns))
                    num_facts += count_facts(columns)
                    num_written += len(group.simulation_ids)
                    if progress is not None:
                        progress(num_written, num_requested)
                file.flush()
                os.fsync(file.fileno())
        for name in _PROGRAMS_OF_LANGUAGE[language]:
            if with_law or name != "law.lp":
                write_new_file(folder / name, (PROGRAM_FOLDER / name).read_text(encoding="utf-8"))
    return num_facts


def _split_at_files(groups: Iterable[SimulationGroup]) -> Iterator[SimulationGroup]:
    """The groups, split so that each has the simulations of one file only."""
    for group in groups:
        file_numbers = group.simulation_ids // SIMULATIONS_PER_FILE
        for file_number in np.unique(file_numbers):
            yield group.select(file_numbers == file_number)


def _file_number(group: SimulationGroup) -> int:
    return int(group.simulation_ids[0]) // SIMULATIONS_PER_FILE
