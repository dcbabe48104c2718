"""Public functions that query a data set in logic: `overtaking.logic`.

The content of each simulation is written as *facts*, such as `night(3)` (simulation 3 is at night),
and the reasoner clingo derives answers from facts and rules. The language of a query is clingo's: a
comma means "and", names with a capital letter are variables, names before brackets (`night`) are
predicates. `overtaking ask DATA --predicates` lists the predicates. 18 rules of the Portuguese law
are logic rules as well, so clingo can also prove a breach. *Ego*: the vehicle whose overtaking is
studied. *Frame*: a recorded instant. *Profile*: the named setting of road and traffic that a data
set was drawn from.

`check_arguments` raises a `ConfigError` for an argument of another type than its annotation.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from overtaking.api.datasets import load_dataset
from overtaking.core.progress import ProgressCallback
from overtaking.data.load import Dataset
from overtaking.model.checks import check_arguments

if TYPE_CHECKING:
    from overtaking.analysis.logic.proof import Proof
    from overtaking.analysis.logic.query import Answers


@check_arguments
def ask(
    dataset: str | Path | Dataset,
    query: str,
    *,
    simulation_ids: Iterable[int] | None = None,
    overtake_class: str | None = None,
    policy: str | None = None,
    frame_step: int = 10,
    max_rows: int = 10_000,
    timeout_s: float = 600.0,
    memory_mib: int = 2048,
    progress: ProgressCallback | None = None,
) -> "Answers":
    """Find the simulations, vehicles and frames that satisfy a condition.

    Args:
        dataset: The data set, or its folder or URL.
        query: A condition, such as `overtakes(S,ego,P,F), night(S)`: simulations `S` at night,
            vehicles `P` that the ego overtakes, and frames `F` in which the ego is back in its
            lane. The condition must hold within one simulation; a query cannot compare simulations,
            and cannot read or write files.
        simulation_ids: Numbers of the simulations to query, from 0; None for all.
        overtake_class: Class of the simulations to query, such as `Success_L` (completed and
            legal); None for all.
        policy: The set of rules of law that decides about the class: `paper`, `default` or
            `strict`; None for the default of the profile.
        frame_step: Interval between the positions and speeds among the facts [frames], 1 or more.
            A small step slows the reasoner down; frames in which a vehicle changes lane or the
            order of vehicles changes are always among the facts.
        max_rows: Largest number of answers, 1 to 1e9.
        timeout_s: Longest time of the reasoner [s], 0.001 to 1e9.
        memory_mib: Memory limit of the reasoner [MiB], 16 to 1e9. Answers larger than an eighth of
            it are an error (a choice: this process holds them several times).
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        `columns`, the variables of the query; `rows`, a tuple of their values for each answer; and
        `is_cut`, whether there are more answers than `max_rows`.

    Raises:
        ConfigError: The query is not a condition; a simulation, class or policy does not exist; or
            the reasoner exceeds its time or memory.
        DatasetError: The data set is not complete or damaged.
        MissingExtraError: The extra `logic` is not installed.
    """
    from overtaking.analysis.logic.query import ask as ask_reasoner
    from overtaking.data.choice import chosen as select_simulations

    source = load_dataset(dataset)
    return ask_reasoner(
        source,
        query,
        simulation_ids=select_simulations(source, simulation_ids, overtake_class, policy),
        frame_step=frame_step,
        max_rows=max_rows,
        timeout_s=timeout_s,
        memory_mib=memory_mib,
        progress=progress,
    )


@check_arguments
def prove(dataset: str | Path | Dataset, simulation_id: int) -> "tuple[Proof, ...]":
    """Prove each breach of the law in a simulation, step by step as clingo derives it.

    Args:
        dataset: The data set, or its folder or URL.
        simulation_id: Number of the simulation in the data set, from 0.

    Returns:
        A proof for each broken rule among the 18 that are logic rules; else an empty tuple.

    Raises:
        ConfigError: The simulation does not exist.
        DatasetError: The data set is not complete or damaged.
        MissingExtraError: The extra `logic` is not installed.
    """
    from overtaking.analysis.logic.proof import prove_breaches
    from overtaking.analysis.logic.simulation_groups import read_groups
    from overtaking.data.choice import chosen as select_simulations

    source = load_dataset(dataset)
    # `read_groups` splits simulations into portions for the reasoner; one simulation is one group.
    (group,) = read_groups(source, select_simulations(source, [simulation_id]))
    return prove_breaches(group)
