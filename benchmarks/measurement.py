"""What stated errors of measurement, and smoothing, do to verdicts on recordings.

    python benchmarks/measurement.py SCENE.xml [SCENE.xml ...]

Prints, for each rule that decides anything, how many simulations it finds legal, illegal and
undecidable. Recordings do not tell their weather; here it is stated to be dry and clear.
"""

import argparse
from collections import Counter
from pathlib import Path

import overtaking as ot
from overtaking.model.verdicts import Verdict
from overtaking.recordings.formats import read_recording

ERRORS = ((0.0, 0.0), (0.1, 0.1), (0.5, 0.5), (1.0, 1.0))
"""Standard deviations of positions [m] and speeds [m/s]."""


def counted(paths: list[Path], *, smooth: bool, position: float, speed: float) -> Counter[str]:
    """Number of simulations by rule and verdict."""
    counts: Counter[str] = Counter()
    for path in paths:
        options = {"smooth": True} if smooth else {}
        found = read_recording("commonroad", path, options).scenes
        run = found.trajectories(range(len(found)))
        dry = run.replace(unknown=run.unknown - {"weather"})
        errors = ot.MeasurementErrors(position_std=position, speed_std=speed)
        said = ot.label(dry, errors=errors).findings
        for place, rule in enumerate(said.rule_codes):
            counts.update(f"{rule} {Verdict(one).name}" for one in said.verdict[:, place])
    return counts


def main() -> None:
    """Print the table in Markdown."""
    parser = argparse.ArgumentParser()
    parser.add_argument("scenes", nargs="+", type=Path)
    paths = parser.parse_args().scenes
    columns = [(smooth, *errors) for smooth in (False, True) for errors in ERRORS]
    tables = [counted(paths, smooth=s, position=p, speed=v) for s, p, v in columns]
    names = [f"{'smooth' if s else 'raw'}, {p:g} m, {v:g} m/s" for s, p, v in columns]
    print("| rule | " + " | ".join(names) + " |")
    print("|---" * (len(names) + 1) + "|")
    verdicts = ("LEGAL", "ILLEGAL", "UNDECIDABLE")
    for rule in dict.fromkeys(key.split()[0] for key in tables[0]):
        cells = [[counts[f"{rule} {one}"] for one in verdicts] for counts in tables]
        if sum(cells[0][:2]):
            print(f"| {rule} | " + " | ".join(" ".join(map(str, one)) for one in cells) + " |")


if __name__ == "__main__":
    main()
