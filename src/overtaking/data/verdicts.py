"""Verdicts of any law and policies in a file beside a data set, which stays as it is."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from overtaking.core.files import atomic_file
from overtaking.labels.labelling import LabelledTrajectories
from overtaking.model.verdicts import OvertakeClass, Verdict

Judged = tuple[NDArray[np.int64], LabelledTrajectories]

_SCHEMA = pa.schema(
    [
        ("simulation", pa.int64()),
        ("law", pa.string()),
        ("rule_set", pa.string()),
        ("policy", pa.string()),
        ("class", pa.string()),
        ("is_legal", pa.bool_()),
        ("num_broken", pa.uint8()),
        ("num_undecidable", pa.uint8()),
        ("illegal", pa.list_(pa.string())),
        ("undecidable", pa.list_(pa.string())),
    ]
)
"""`illegal` and `undecidable` are the codes of all rules with that verdict, under any policy."""


def write_while_iterating(batches: Iterable[Judged], law: str, out: Path) -> Iterator[Judged]:
    """Write the verdicts of each batch that the caller takes.

    The file appears, complete, when the caller has taken the last batch.

    Args:
        batches: Numbers of simulations with their labels.
        law: Name of the pack.
        out: A Parquet file, replaced.

    Returns:
        The same batches.

    Raises:
        OSError: The file cannot be written.
    """
    with atomic_file(out) as partial, pq.ParquetWriter(partial, _SCHEMA) as writer:
        for numbers, labelled in batches:
            writer.write_table(_table(numbers, labelled, law))
            yield numbers, labelled


def _table(numbers: NDArray[np.int64], labelled: LabelledTrajectories, law: str) -> pa.Table:
    """One row per simulation and policy."""
    labels, findings = labelled.labels, labelled.findings
    count, policies = labels.classes.shape
    codes = np.array(findings.rule_codes, dtype=object)

    def having(verdict: Verdict) -> list[list[str]]:
        rows = [codes[row == verdict].tolist() for row in findings.verdict]
        return [row for row in rows for _ in range(policies)]

    columns = {
        "simulation": np.repeat(numbers, policies),
        "law": [law] * (count * policies),
        "rule_set": [findings.version] * (count * policies),
        "policy": list(labels.policies) * count,
        "class": [OvertakeClass(int(one)).title for one in labels.classes.reshape(-1)],
        "is_legal": labels.is_legal.reshape(-1),
        "num_broken": labels.num_broken.reshape(-1),
        "num_undecidable": labels.num_undecidable.reshape(-1),
        "illegal": having(Verdict.ILLEGAL),
        "undecidable": having(Verdict.UNDECIDABLE),
    }
    return pa.table(columns, schema=_SCHEMA)
