"""Runs every benchmark and prints each number beside its target.

    make bench
    python benchmarks/run.py --json

About two minutes. Exits with 0 whatever the numbers are: a missed target is a finding, not a
failure. The longer ones are run by hand: `identity.py` at full size, `flips.py`, `mutations.py`,
`ablations.py`, `kill_resume.py`. See README.md beside this file.
"""

import json
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import cold_start
import engine
import identity
import overtaking as ot
import writer
from measure import Measure, load_note, parser

PIECES, REPEATS = 4, 3
IDENTITY_SIMULATIONS = 480


def bit_identity() -> list[Measure]:
    """A quick look at engine and reference."""
    return identity.measures(IDENTITY_SIMULATIONS)


def to_disk() -> list[Measure]:
    """All states of some simulations into a file that is safe on the disk, and read back."""
    size = writer.PIECE
    pieces = [
        ot.simulate(
            ot.sample(
                "pinto2023-physical", num_simulations=size, seed=1, first_scenario=number * size
            )
        )
        for number in range(PIECES)
    ]
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as folder:
        path = Path(folder) / "states.parquet"
        seconds = writer.best(lambda: writer.ours(pieces, path), REPEATS)
        rows = writer.check(path, pieces)
        size_of_row = path.stat().st_size / rows
    return [
        Measure(name="states to disk", value=rows / seconds / 1e6, unit="M rows/s", at_least=25.0),
        Measure(name="states on disk", value=size_of_row, unit="bytes a row", at_most=16.0),
    ]


PARTS: tuple[tuple[str, Callable[[], list[Measure]]], ...] = (
    ("Speed against libsumo", engine.measures),
    ("Engine and reference, bit by bit", bit_identity),
    ("To disk, and what a user waits for", lambda: [*to_disk(), *cold_start.measures()]),
)
"""What is measured, in the order in which it is."""


def main() -> int:
    """Run everything."""
    given = parser(__doc__).parse_args()
    found = dict[str, list[Measure]]()
    for title, measure in PARTS:
        if not given.json:
            print(f"\n{title} ({load_note()})", flush=True)
        found[title] = measure()
        if not given.json:
            print("\n".join(each.line() for each in found[title]), flush=True)
    if given.json:
        values = {title: [each.values() for each in measures] for title, measures in found.items()}
        print(json.dumps({"load": load_note(), "measures": values}, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
