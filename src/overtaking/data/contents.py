"""All tables of some simulations: recordings and labels."""

from collections.abc import Collection, Sequence

import pyarrow as pa

from overtaking.data.tables.encode import Numbers, encode
from overtaking.data.tables.encode_labels import Weights, encode_labels
from overtaking.data.tables.label_schemas import LABEL_TABLES
from overtaking.labels.label import label
from overtaking.model.trajectory import Trajectories


def contents(
    trajectories: Trajectories,
    numbers: Numbers,
    tables: Collection[str],
    sources: Sequence[str] | None = None,
    class_weight: Weights | None = None,
) -> dict[str, pa.Table]:
    """The tables of a batch, by the names of their folders.

    Args:
        trajectories: The recorded simulations.
        numbers: Number of each simulation in its data set, growing, shape (simulation,).
        tables: Which tables.
        sources: Where in a recording each simulation comes from; None for what was simulated.
        class_weight: As in `encode_labels`.
    """
    recorded = [name for name in tables if name not in LABEL_TABLES]
    made = encode(trajectories, numbers, recorded, sources)
    if len(recorded) < len(tables):
        said = encode_labels(label(trajectories), numbers, class_weight)
        made |= {name: said[name] for name in tables if name in LABEL_TABLES}
    return made
