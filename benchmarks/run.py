"""Runs every benchmark and prints each number beside its target.

    make bench
    python benchmarks/run.py --json

About three minutes. Exits with 0 whatever the numbers are: a missed target is a finding, not a
failure. The longer ones are run by hand: `identity.py` at full size, `kill_resume.py`,
`ablations.py`, `mutations.py`.
"""

import subprocess
import sys

import cold_start
import engine
from measure import ROOT, Measure, parser, report

SCRIPTS = (
    ("Engine and reference, bit by bit", ("identity.py", "--simulations", "576")),
    ("States to disk", ("writer.py",)),
)
"""Benchmarks with a report of their own."""


def main() -> int:
    """Run everything, quickest last."""
    arguments = parser(__doc__).parse_args()
    found: list[Measure] = [*engine.measures(), *cold_start.measures()]
    report(found, as_json=arguments.json)
    if arguments.json:
        return 0
    for title, script in SCRIPTS:
        print(f"\n{title}", flush=True)
        path = ROOT / "benchmarks" / script[0]
        subprocess.run([sys.executable, str(path), *script[1:]], check=False)
    return 0


if __name__ == "__main__":
    sys.exit(main())
