"""How many completed overtakes are legal, by light, sight and rain.

A label that is impossible in a stratum says more about the stratum than about the driver. Printed
is the share of legal overtakes among those completed, for day and night, three ranges of sight and
three of rain, with Wilson's interval; a stratum fails with a share below 1 % or above 99 %.

    python benchmarks/strata.py --profile motorway-risk --simulations 10000
"""

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from measure import parser
from overtaking.exchange.roads import load_road
from overtaking.labelling import label
from overtaking.model.events import Outcome
from overtaking.model.labels import OvertakeClass
from overtaking.physics.film import rain_rate
from overtaking.physics.visibility import meteorological_range
from overtaking.scenarios import sample, spec
from overtaking.sim import engine

PIECE = 64
ENOUGH = 30
Z_95 = 1.96
SIGHTS = {
    "sight > 1000 m": (1000.0, np.inf),
    "200-1000 m": (200.0, 1000.0),
    "< 200 m": (0.0, 200.0),
}
RAINS = {"no rain": (-1.0, 0.0), "< 7.6 mm/h": (0.0, 7.6), ">= 7.6 mm/h": (7.6, np.inf)}


def gather(profile: str, simulations: int, policy: str) -> dict[str, NDArray[Any]]:
    """Light, sight, rain and verdict of every completed overtake."""
    given = spec(profile)
    road = load_road(given.road)
    parts: dict[str, list[NDArray[Any]]] = {}
    for first in range(0, simulations, PIECE):
        index = np.arange(first, min(first + PIECE, simulations), dtype=np.uint64)
        scenario = sample(given, road, 3, index)
        said = label(engine.simulate(scenario)).labels
        done = said.outcome == Outcome.COMPLETED
        legal = said.classes[:, said.policies.index(policy)] == OvertakeClass.SUCCESS_L
        found = {
            "night": scenario.weather.night,
            "sight": meteorological_range(scenario.weather.fog),
            "rain": rain_rate(scenario.weather.rain),
            "legal": legal,
        }
        for name, values in found.items():
            parts.setdefault(name, []).append(values[done])
        print(f"\r{first + len(index):,} of {simulations:,}", end="", file=sys.stderr)
    print(file=sys.stderr)
    return {name: np.concatenate(each) for name, each in parts.items()}


def wilson(hits: int, count: int) -> tuple[float, float]:
    """Wilson's interval of a share."""
    centre = (hits + Z_95**2 / 2) / (count + Z_95**2)
    half = Z_95 / (count + Z_95**2) * np.sqrt(hits * (count - hits) / count + Z_95**2 / 4)
    return centre - half, centre + half


def row(legal: NDArray[Any]) -> tuple[str, bool]:
    """What to print of a stratum, and whether it fails."""
    count, hits = len(legal), int(legal.sum())
    if count < ENOUGH:
        return f"{count:6d} completed: too few", False
    low, high = wilson(hits, count)
    share = hits / count
    fails = not 0.01 <= share <= 0.99
    interval = f"[{100 * low:.1f}, {100 * high:.1f}]"
    text = f"{count:6d} completed, {100 * share:5.1f} % legal {interval}"
    return f"{text}  OUTSIDE 1-99 %" if fails else text, fails


def main() -> int:
    """Measure and print."""
    arguments = parser(__doc__)
    arguments.add_argument("--profile", default="motorway-risk")
    arguments.add_argument("--simulations", type=int, default=8000)
    arguments.add_argument("--policy", default="default")
    given = arguments.parse_args()
    found = gather(given.profile, given.simulations, given.policy)
    failed = 0
    for light, is_night in (("day", False), ("night", True)):
        for sight, (least, most) in SIGHTS.items():
            for rain, (low, high) in RAINS.items():
                there = (
                    (found["night"] == is_night)
                    & (found["sight"] > least)
                    & (found["sight"] <= most)
                    & (found["rain"] > low)
                    & (found["rain"] <= high)
                )
                text, fails = row(found["legal"][there])
                failed += fails
                print(f"{light:6s}{sight:16s}{rain:12s}{text}")
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
