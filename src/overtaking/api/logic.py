"""Questions in logic, and proofs from the law as a logic program."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from overtaking.api.data import load_dataset
from overtaking.core.progress import ProgressCallback
from overtaking.data.load import Dataset
from overtaking.model.checks import check_arguments

if TYPE_CHECKING:
    from overtaking.analysis.logic.ask import Answers
    from overtaking.analysis.logic.proof import Proof


@check_arguments
def ask(
    data: str | Path | Dataset,
    query: str,
    *,
    simulations: Iterable[int] | None = None,
    label: str | None = None,
    policy: str | None = None,
    every: int = 10,
    max_rows: int = 10_000,
    timeout_s: float = 600.0,
    memory_mib: int = 2048,
    progress: ProgressCallback | None = None,
) -> "Answers":
    """Ask a data set which simulations, vehicles and frames make a condition true.

    Args:
        data: The data set, or its folder.
        query: A condition in clingo's language, such as `overtakes(S,ego,P,F), night(S)`. Each
            simulation is asked on its own; the query can neither read nor write anything else.
        simulations: Numbers of the simulations to ask, all of them if left out.
        label: A class that they must have.
        policy: Which rules decide about the class: `paper`, `default` or `strict`; None for the
            default of the profile.
        every: Every how many frames positions are looked at, beside those in which something
            changes.
        max_rows: How many answers to give at most.
        timeout_s: How long the reasoner may take [s].
        memory_mib: How much memory it may use [MiB]; the answers may take an eighth of it.
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        The variables of the query, and what they are.

    Raises:
        ConfigError: It is no query, there is no such simulation, or it needs more time or memory.
        DatasetError: The data set is not complete or damaged.
        MissingExtraError: The extra `logic` is not installed.
    """
    from overtaking.analysis.logic import ask as asking
    from overtaking.data.choice import chosen

    source = load_dataset(data)
    return asking.ask(
        source,
        query,
        chosen=chosen(source, simulations, label, policy),
        every=every,
        max_rows=max_rows,
        timeout_s=timeout_s,
        memory_mib=memory_mib,
        progress=progress,
    )


@check_arguments
def prove(data: str | Path | Dataset, simulation: int) -> "tuple[Proof, ...]":
    """Prove why a simulation breaks the law: facts and instances of rules, as clingo derived them.

    Args:
        data: The data set, or its folder.
        simulation: Number of the simulation.

    Returns:
        A proof for each broken rule of those that are written as a logic program.

    Raises:
        ConfigError: There is no such simulation.
        DatasetError: The data set is not complete or damaged.
        MissingExtraError: The extra `logic` is not installed.
    """
    from overtaking.analysis.logic.proof import proofs
    from overtaking.analysis.logic.source import groups
    from overtaking.data.choice import chosen

    source = load_dataset(data)
    (group,) = groups(source, chosen(source, [simulation]))
    return proofs(group)
