"""Groups of simulations of a data set, whose facts are measured together, in order of number."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.analysis.logic.vocabulary import CLASS, OUTCOME, POLICY
from overtaking.labels.event_detection import case_from_trajectories

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from overtaking.core.arrays import I64
    from overtaking.data.load import Dataset
    from overtaking.model.verdicts import Case

GROUP_SIZE = 64
"""Number of simulations whose facts are in memory at the same time, as columns and as text.

A choice.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationGroup:
    """Some simulations of a data set.

    Attributes:
        simulation_ids: Their numbers in the data set, shape (simulation,).
        case: Their trajectories with signals and events.
        classes: `OvertakeClass`, shape (simulation, policy); None without labels.
        outcome: `Outcome`, shape (simulation,); None without labels.
    """

    simulation_ids: I64
    case: Case
    classes: NDArray[np.integer] | None = None
    outcome: NDArray[np.integer] | None = None

    def select(self, rows: NDArray[Any]) -> SimulationGroup:
        """Some of the simulations, by a mask or by their rows."""
        return replace(
            self,
            simulation_ids=self.simulation_ids[rows],
            case=self.case.select(rows),
            classes=None if self.classes is None else self.classes[rows],
            outcome=None if self.outcome is None else self.outcome[rows],
        )


def read_groups(
    dataset: Dataset, simulation_ids: I64 | None = None, size: int = GROUP_SIZE
) -> Iterator[SimulationGroup]:
    """Read simulations in order, one group after the other.

    Args:
        dataset: The data set. Trajectories that it does not store are simulated again.
        simulation_ids: Their numbers in order; None for all.
        size: Largest number of simulations in a group.

    Raises:
        DatasetError: A file is damaged, or the simulator has changed.
    """
    for batch_ids, trajectories in dataset.batches(simulation_ids):
        classes, outcome = _read_labels(dataset, batch_ids)
        for begin in range(0, len(batch_ids), size):
            rows = np.arange(begin, min(begin + size, len(batch_ids)))
            yield SimulationGroup(
                simulation_ids=batch_ids[rows],
                case=case_from_trajectories(trajectories.select(rows)),
                classes=classes[rows],
                outcome=outcome[rows],
            )


def _read_labels(dataset: Dataset, simulation_ids: I64) -> tuple[I64, I64]:
    """Codes of the classes, shape (simulation, policy), and of the outcomes, shape (simulation,).

    The simulations are from one file, in order. The file has a row for each simulation and policy;
    the policies of a simulation are adjacent, in the order of `POLICY`. All rows from the first to
    the last number are read, and the requested ones selected at the end.
    """
    first_id, num_policies = int(simulation_ids[0]), len(POLICY.constants)
    rows = dataset.rows("labels", first_id, int(simulation_ids[-1]))
    # Constants of programs are in lower case. The file has classes such as `Success_I`, but its
    # outcomes are in lower case.
    class_codes = [CLASS.constants.index(name.lower()) for name in rows["class"].to_pylist()]
    classes = np.array(class_codes).reshape(-1, num_policies)
    names = rows["outcome"].to_pylist()[::num_policies]
    outcome = np.array([OUTCOME.constants.index(name) for name in names])
    return classes[simulation_ids - first_id], outcome[simulation_ids - first_id]
