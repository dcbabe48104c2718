"""How well does `motorway-risk` know rare rates, at the cost of simulating traffic as it is met?

Drivers who react late and forget looks over the shoulder have contacts often enough for brute force
to count them. The same drivers are drawn as they are met and with the proposal of the profile,
with fixed seeds; each seed gives a weighted rate and its 95 % interval. Printed are the error of
the rates relative to the rate of all simulations as they are met, the same scaled to equal cost
(vehicle-seconds), and the share of the intervals that hold the rate of the other seeds.

    python benchmarks/rare.py                            # 50 seeds of 1,000: 8 minutes of a core
    python benchmarks/rare.py --seeds 10 --simulations 200
"""

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from conflicts import Conflicts, conflicts, gamma_interval
from measure import Measure, parser, report
from overtaking.core.arrays import Buffers
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine

WORSE: dict[str, Any] = {
    "time.horizon_s": 60.0,
    "time.attempt_deadline_s": 30.0,
    "drivers.scale.reaction_time": 1.8,
    "drivers.scale.checks_blind_spot": 0.9,
}
"""Drivers whose contacts can be counted, and no longer simulations than that takes."""

FIRST_SEED = 1000
PIECE = 250
RATES: dict[str, Callable[[Conflicts], NDArray[np.float64]]] = {
    "contact of anybody": lambda found: found.contact,
    "contact of the ego": lambda found: found.ego_contact,
    "near-crash of anybody": lambda found: (found.near > 0).astype(np.float64),
}
"""What is counted of each simulation."""

Values = NDArray[np.float64]


def rates(profile: str, seed: int, simulations: int) -> tuple[dict[str, Any], float, Values]:
    """Rate and interval of each event, the cost of the simulations [s], and their weights."""
    given, buffers = load_specification(profile, WORSE), Buffers()
    road = load_road(given.road)
    parts: list[Conflicts] = []
    weights: list[Values] = []
    for first in range(0, simulations, PIECE):
        index = np.arange(first, min(first + PIECE, simulations), dtype=np.uint64)
        drawn = ScenarioSource(given, road, seed).sample(index)
        weights.append(drawn.weight)
        parts.append(conflicts(engine.simulate(drawn, buffers=buffers)))
    weight = np.concatenate(weights)
    found = {
        name: gamma_interval(weight, np.concatenate([count(part) for part in parts]))
        for name, count in RATES.items()
    }
    return found, float(sum(part.vehicle_seconds.sum() for part in parts)), weight


def judged(name: str, profile: str, found: list[Any], truth: Values, cost: float) -> list[Measure]:
    """The error and the coverage of the rates of all seeds.

    Args:
        name: The event.
        profile: What was drawn.
        found: Rate, lower and upper limit of each seed.
        truth: What each seed is held against: the rate as met, of the other seeds.
        cost: Cost over that of traffic as it is met.
    """
    rate, low, high = np.array(found).T
    error = float(np.sqrt(((rate - truth) ** 2).mean()) / truth.mean())
    inside = float(((low <= truth) & (truth <= high)).mean())
    here = f"{profile}, {name}"
    return [
        Measure(name=f"{here}: rate", value=float(rate.mean()), unit="1"),
        Measure(name=f"{here}: relative error", value=error, unit="1"),
        Measure(name=f"{here}: at equal cost", value=error * cost**0.5, unit="1"),
        Measure(name=f"{here}: coverage", value=inside, unit="1"),
    ]


def main() -> int:
    """Measure and print."""
    options = parser(__doc__)
    options.add_argument("--seeds", type=int, default=50)
    options.add_argument("--simulations", type=int, default=1000, help="of each seed")
    given = options.parse_args()
    measures: list[Measure] = []
    truths: dict[str, Values] = {}
    usual = 0.0
    for profile in ("motorway", "motorway-risk"):
        runs = [rates(profile, FIRST_SEED + seed, given.simulations) for seed in range(given.seeds)]
        cost = float(np.mean([one[1] for one in runs]))
        usual = usual or cost
        weight = np.concatenate([one[2] for one in runs])
        measures += [
            Measure(name=f"{profile}: cost", value=cost / usual, unit="1"),
            Measure(name=f"{profile}: mean weight", value=float(weight.mean()), unit="1"),
            Measure(
                name=f"{profile}: weights below 1e-6", value=float((weight < 1e-6).mean()), unit="1"
            ),
        ]
        for name in RATES:
            found = [one[0][name] for one in runs]
            own = np.array([rate for rate, _, _ in found])
            # No seed is held against itself.
            others = (own.sum() - own) / max(len(own) - 1, 1)
            truth = truths.setdefault(name, others)
            truth = truth if profile == "motorway" else np.full_like(truth, truth.mean())
            measures += judged(name, profile, found, truth, cost / usual)
        print(f"{profile}: {given.seeds} seeds of {given.simulations}", file=sys.stderr)
    return report(measures, as_json=given.json)


if __name__ == "__main__":
    raise SystemExit(main())
