"""What removing wind, rain, fog, night or glare changes: the same simulations twice.

Both simulations of a pair have the same vehicles, drivers and random numbers; only the weather
differs, so most of what is random cancels out. Printed are the changes of the share of each class,
with intervals, and those that are none.

    python benchmarks/twins.py --pairs 20000 --markdown
"""

import argparse
import sys
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.labels.labelling import label
from overtaking.model.scenario import Scenario
from overtaking.model.verdicts import OvertakeClass
from overtaking.model.weather import REMOVABLE_FACTORS
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.scenarios.specification import Specification
from overtaking.sim import engine

POLICY = "default"
CHUNK = 512
Z_95 = 1.96


@dataclass(frozen=True, slots=True)
class Change:
    """The change of one class's share."""

    share: float
    difference: float
    half_width: float
    changed: int

    @property
    def is_clear(self) -> bool:
        """Whether the interval excludes zero."""
        return abs(self.difference) > self.half_width


def classes_of(scenario: Scenario) -> NDArray[np.uint8]:
    """Class of each simulation under the policy."""
    found = label(engine.simulate(scenario)).labels
    return found.classes[:, found.policies.index(POLICY)]


def twins(given: Specification, pairs: int, seed: int) -> dict[str, NDArray[np.uint8]]:
    """Classes as they are, under "", and with each thing removed."""
    road = load_road(given.road)
    parts: dict[str, list[NDArray[np.uint8]]] = {"": [], **{name: [] for name in REMOVABLE_FACTORS}}
    for first in range(0, pairs, CHUNK):
        index = np.arange(first, min(first + CHUNK, pairs), dtype=np.uint64)
        scenario = ScenarioSource(given, road, seed).sample(index)
        parts[""].append(classes_of(scenario))
        for name in REMOVABLE_FACTORS:
            weather = scenario.weather.without(name)
            parts[name].append(classes_of(scenario.replace(weather=weather)))
        print(f"\r{len(index) + first:,} of {pairs:,} pairs", end="", file=sys.stderr)
    print(file=sys.stderr)
    return {name: np.concatenate(each) for name, each in parts.items()}


def change(before: NDArray[np.uint8], after: NDArray[np.uint8], code: int) -> Change:
    """How the share of a class changes from twin to twin."""
    step = (after == code).astype(float) - (before == code).astype(float)
    spread = step.std(ddof=1) / np.sqrt(len(step))
    return Change(
        share=float((before == code).mean()),
        difference=float(step.mean()),
        half_width=float(Z_95 * spread),
        changed=int((step != 0).sum()),
    )


def table(found: dict[str, NDArray[np.uint8]]) -> list[list[str]]:
    """A row for each class: its share, and its change with each thing removed."""
    rows = []
    for one in OvertakeClass:
        if not any((codes == one).any() for codes in found.values()):
            continue
        changes = [change(found[""], found[name], one) for name in REMOVABLE_FACTORS]
        rows.append([one.title, f"{100 * changes[0].share:.2f}", *map(cell, changes)])
    return rows


def cell(one: Change) -> str:
    text = f"{100 * one.difference:+.2f} ± {100 * one.half_width:.2f}"
    return text if one.is_clear else f"{text} (none)"


def main() -> None:
    parser = argparse.ArgumentParser(description="What removing one thing from the weather changes")
    parser.add_argument("--pairs", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=77)
    parser.add_argument("--profile", default="pinto2023-physical")
    parser.add_argument("--markdown", action="store_true", help="print a table for the docs")
    given = parser.parse_args()
    found = twins(load_specification(given.profile), given.pairs, given.seed)
    head = ["class", "share [%]", *(f"without {name}" for name in REMOVABLE_FACTORS)]
    rows = [head, *table(found)]
    if given.markdown:
        rows.insert(1, ["---"] * len(head))
        print("\n".join(f"| {' | '.join(row)} |" for row in rows))
    else:
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        for row in rows:
            print("  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)))


if __name__ == "__main__":
    main()
