"""What weather does to the classes by physics and by the study's pushes, for both kinds of drivers.

    python benchmarks/pushes.py

The same scenes, drawn from one seed, are driven by egos that are told to overtake and by drivers
who decide for themselves; each without weather, with pushes and with physical weather.
"""

from __future__ import annotations

import argparse
import copy
from typing import TYPE_CHECKING, Any

from overtaking.analysis.reproduction.replicates import Replicates, members, replicates
from overtaking.analysis.stats.columns import PAPER_CLASSES
from overtaking.api.simulator_registry import get_simulator
from overtaking.recordings.roads import load_road
from overtaking.scenarios import profiles

if TYPE_CHECKING:
    from overtaking.core.arrays import Mask

PROFILES = {"told": "pinto2023", "decide": "pinto2023-physical"}
HARD_RAIN = 1.0


def weathers() -> dict[str, dict[str, Any] | None]:
    """The pushes of each kind of weather; None for physics."""
    pushes = profiles.load_specification("pinto2023").to_dict()["weather"]["pushes"]
    return {
        "none": pushes | {"accel_mps2": 0.0, "sight_m": 1000.0},
        "pushes": pushes,
        "physics": None,
    }


def run(profile: str, pushes: dict[str, Any] | None, sets: int, seed: int) -> Replicates:
    """Replicates of a profile with another kind of weather."""
    resolved = copy.deepcopy(profiles.load_specification(profile).to_dict())
    resolved["weather"].pop("pushes", None)
    if pushes is not None:
        resolved["weather"]["pushes"] = pushes
    spec = profiles.load_specification(resolved)
    return replicates(spec, load_road(spec.road), seed, sets, get_simulator("engine"))


def row(found: Replicates, which: Mask) -> str:
    """Shares of the classes of some simulations [%]."""
    classes = found.classes["paper"]
    shares = (100.0 * float(members(classes, name)[which].mean()) for name in PAPER_CLASSES)
    return " | ".join(f"{share:.1f}" for share in shares)


def main() -> None:
    """Print a table for a page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--sets", type=int, default=20, help="replicates of 276 simulations")
    parser.add_argument("--seed", type=int, default=2024)
    given = parser.parse_args()
    print(f"| egos | weather | presets | {' | '.join(PAPER_CLASSES)} |")
    print(f"|---|---|---|{'--:|' * len(PAPER_CLASSES)}")
    for drivers, profile in PROFILES.items():
        for name, pushes in weathers().items():
            found = run(profile, pushes, given.sets, given.seed)
            rain = found.columns["PREC"]
            for label, which in (("all", rain >= 0.0), ("hard rain", rain >= HARD_RAIN)):
                print(f"| {drivers} | {name} | {label} | {row(found, which)} |", flush=True)


if __name__ == "__main__":
    main()
