"""Batches in memory as pandas tables: SI units, and names instead of codes."""

import numpy as np
import pandas as pd

from overtaking.core.process_limits import explain_refusals
from overtaking.data.tables import encode, encode_labels, names
from overtaking.data.tables.decode import decode
from overtaking.labels.labelling import LabelledTrajectories
from overtaking.model.trajectories import Trajectories


def states_frame(trajectories: Trajectories, row: int) -> pd.DataFrame:
    """The states of one simulation, one row per vehicle and frame.

    Args:
        trajectories: A batch.
        row: Position of the simulation in the batch, from 0.

    Raises:
        NoSuchSimulationError: The batch has no such row.
    """
    with explain_refusals("Trajectories.to_pandas"):
        simulation = trajectories.select(np.array([row]))
        return decode(encode.states(simulation, np.array([row])))


def labels_frame(labelled: LabelledTrajectories) -> pd.DataFrame:
    """The labels of a batch, one row per simulation and policy.

    Args:
        labelled: A batch. The column `simulation` holds positions in it, from 0.
    """
    policies = labelled.labels.policies
    # The table of a data set knows the policies of this package only; a law of the user's may have
    # others. Their names are put in afterwards.
    known_names = (names.POLICY_NAMES[0],) * len(policies)
    encodable = labelled.replace(labels=labelled.labels.replace(policies=known_names))
    numbers = np.arange(len(labelled.labels.outcome))
    with explain_refusals("LabelledTrajectories.to_pandas"):
        weight = np.ones(len(numbers))
        frame = decode(encode_labels.labels(encodable, numbers, weight))
    policy_codes = np.tile(np.arange(len(policies)), len(numbers))
    policy_names = pd.CategoricalDtype(list(policies))
    frame["policy"] = pd.Categorical.from_codes(policy_codes, dtype=policy_names)
    return frame.drop(columns="balance_weight")
