"""Questions in logic, and proofs of breaches from the law as a logic program."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from overtaking.api.datasets import load_dataset
from overtaking.core.progress import ProgressCallback
from overtaking.data.load import Dataset
from overtaking.model.checks import check_arguments

if TYPE_CHECKING:
    from overtaking.analysis.logic.ask import Answers
    from overtaking.analysis.logic.proof import Proof


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
    """Ask a data set which simulations, vehicles and frames make a condition true.

    Args:
        dataset: The data set, or its folder.
        query: A condition in clingo's language, such as `overtakes(S,ego,P,F), night(S)`. The
            reasoner gets each simulation alone; the query cannot read or write anything else.
        simulation_ids: Numbers of the simulations to ask, all of them if left out.
        overtake_class: Class of the simulations to ask, such as `Success_L`; None for every class.
        policy: Which rules decide about the class: `paper`, `default` or `strict`; None for the
            default of the profile.
        frame_step: Number of frames from one position in the facts to the next; frames in which
            something changes are always included.
        max_rows: Largest number of answers.
        timeout_s: Longest time of the reasoner [s].
        memory_mib: Most memory of the reasoner [MiB]; the answers may take an eighth of it.
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        The variables of the query as columns, and a row for each answer.

    Raises:
        ConfigError: The query is no condition, a simulation does not exist, or the time or memory
            is not enough.
        DatasetError: The data set is not complete or damaged.
        MissingExtraError: The extra `logic` is not installed.
    """
    from overtaking.analysis.logic import ask as asking
    from overtaking.data.choice import chosen

    source = load_dataset(dataset)
    return asking.ask(
        source,
        query,
        chosen=chosen(source, simulation_ids, overtake_class, policy),
        every=frame_step,
        max_rows=max_rows,
        timeout_s=timeout_s,
        memory_mib=memory_mib,
        progress=progress,
    )


@check_arguments
def prove(dataset: str | Path | Dataset, simulation_id: int) -> "tuple[Proof, ...]":
    """Prove why a simulation breaks the law: facts and instances of rules, as clingo derived them.

    Args:
        dataset: The data set, or its folder.
        simulation_id: Number of the simulation.

    Returns:
        A proof for each broken rule of those that are written as a logic program.

    Raises:
        ConfigError: The simulation does not exist.
        DatasetError: The data set is not complete or damaged.
        MissingExtraError: The extra `logic` is not installed.
    """
    from overtaking.analysis.logic.proof import proofs
    from overtaking.analysis.logic.source import groups
    from overtaking.data.choice import chosen

    source = load_dataset(dataset)
    (group,) = groups(source, chosen(source, [simulation_id]))
    return proofs(group)
