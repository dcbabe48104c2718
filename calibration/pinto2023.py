"""Fits the drivers of the profile `pinto2023` to the study, and says how well they fit.

    python calibration/pinto2023.py                # the fitted numbers, with frozen parameters
    python calibration/pinto2023.py --search       # rounds of steps on each fitted parameter
    python calibration/pinto2023.py --freeze       # write pinto2023.json anew

Fitted on are the numbers that `knowledge/data/paper.toml` calls calibrated: the sizes of the
classes, and the printed means of SE, SP and D. Nothing else is looked at. Parameters stay within
`SEARCHED`, outside of which a driver could not be defended, so that not every number is met.
"""

import argparse
import copy
import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from overtaking import scenarios
from overtaking.analysis.reproduction.measures import measured
from overtaking.analysis.reproduction.replicates import replicates
from overtaking.analysis.reproduction.run import parameter_hash
from overtaking.api.choices import simulator_of
from overtaking.knowledge import quantities
from overtaking.knowledge.paper import Measure, Standing, Statement, calibration, statements
from overtaking.knowledge.reader import load
from overtaking.recordings.roads import load_road
from overtaking.scenarios import populations

FROZEN = Path(__file__).with_name("pinto2023.json")
PROFILE = POPULATION = "pinto2023"
CAREFUL, RECKLESS = "careful", "reckless"
SEARCH_SEED, CHECK_SEED = (int(seed) for seed in calibration().seeds)

TOLERANCE = {"count": 8.0, "SE": 2.0, "SP": 2.0, "D": 4.0}
"""What a distance is measured in: simulations of 276, km/h, km/h, m. About the standard deviation
of 276 simulations, and of the mean of a class among them."""


@dataclass(frozen=True)
class Searched:
    """A parameter of the population, or of the profile, that the search may move.

    Attributes:
        name: Trait of a driver, or dotted key of the profile.
        end: `careful` or `reckless`; empty for a key of the profile.
        key: What of the distribution: median, mean, value or probability.
        low: Least value that can be defended.
        high: Largest.
        step: First step of the search, halved in each round.
    """

    name: str
    end: str
    key: str
    low: float
    high: float
    step: float


SEARCHED = (
    Searched("traffic.lead_speed_exponent", "", "", 1.5, 4.0, 0.4),
    Searched("starts.min_gap_m", "", "", 5.0, 20.0, 4.0),
    Searched("speed_over_leader", CAREFUL, "median", 0.5, 4.5, 0.6),
    Searched("speed_over_leader", RECKLESS, "median", 0.5, 7.5, 0.8),
    Searched("passing_gain", CAREFUL, "median", 0.5, 3.0, 0.5),
    Searched("passing_gain", RECKLESS, "median", 0.2, 1.0, 0.2),
    Searched("pull_out_time", CAREFUL, "median", 8.0, 30.0, 5.0),
    Searched("pull_out_time", RECKLESS, "median", 3.0, 15.0, 3.0),
    Searched("signal_time", CAREFUL, "mean", 0.5, 2.0, 0.5),
    Searched("caution", CAREFUL, "value", 0.0, 0.95, 0.25),
    Searched("caution", RECKLESS, "value", 0.0, 0.1, 0.1),
    Searched("limit_respect", CAREFUL, "mean", 0.0, 1.0, 0.25),
    Searched("gap_acceptance", CAREFUL, "median", 0.7, 1.3, 0.2),
    Searched("gap_acceptance", RECKLESS, "median", 0.35, 0.6, 0.1),
    Searched("time_gap", CAREFUL, "median", 1.0, 1.9, 0.3),
    Searched("time_gap", RECKLESS, "median", 0.45, 0.9, 0.15),
    Searched("return_time_gap", CAREFUL, "median", 0.6, 1.5, 0.3),
    Searched("return_time_gap", RECKLESS, "median", 0.2, 0.4, 0.08),
    Searched("lane_change_duration", CAREFUL, "median", 5.0, 7.1, 0.8),
    Searched("lane_change_duration", RECKLESS, "median", 2.8, 3.48, 0.4),
    Searched("checks_blind_spot", CAREFUL, "value", 0.6, 1.0, 0.2),
    Searched("checks_blind_spot", RECKLESS, "value", 0.1, 0.93, 0.3),
    Searched("patience", CAREFUL, "median", 8.0, 30.0, 8.0),
)
"""What may be moved, and within which limits; everything else is as in the population `mixed`."""

Point = tuple[float, ...]
"""A value for each of `SEARCHED`."""


def fitted() -> dict[str, Statement]:
    """The numbers that parameters may be chosen by."""
    every = statements().items()
    return {name: one for name, one in every if one.standing == Standing.CALIBRATED}


def now() -> Point:
    """The values in use."""
    return tuple(_value(one) for one in SEARCHED)


def _value(one: Searched) -> float:
    if one.end:
        return float(load("drivers.toml")[POPULATION][one.end][one.name][one.key])
    found: Any = scenarios.spec(PROFILE).resolved()
    for part in one.name.split("."):
        found = found[part]
    return float(found)


def run(sets: int, seed: int, point: Point | None = None) -> dict[str, float]:
    """The fitted numbers, as means over some replicates, in the units of the paper.

    Args:
        sets: How many replicates.
        seed: Their seed.
        point: Other values for what is searched.
    """
    changes: dict[str, Any] = {}
    document = load("drivers.toml")
    before = copy.deepcopy(document[POPULATION])
    for one, value in zip(SEARCHED, point or (), strict=False):
        if one.end:
            document[POPULATION][one.end][one.name][one.key] = value
        else:
            changes[one.name] = value
    _forget()
    try:
        spec = scenarios.spec(PROFILE, changes or None)
        found = replicates(spec, load_road(spec.road), seed, sets, simulator_of("engine"))
    finally:
        document[POPULATION] = before
        _forget()
    return {name: float(measured(found, one).mean() / one.factor) for name, one in fitted().items()}


def _forget() -> None:
    """Have the population read anew."""
    quantities.cache_clear()
    populations.population.cache_clear()


def distance(found: dict[str, float]) -> float:
    """Sum of the squares of the distances from the study's numbers, in tolerances."""
    total = 0.0
    for name, one in fitted().items():
        kind = "count" if one.measure == Measure.COUNT else one.of
        total += ((found[name] - one.quoted) / TOLERANCE[kind]) ** 2
    return total


def search(sets: int, rounds: int) -> None:
    """Move one parameter after the other while it helps, by steps that get smaller."""
    best = tuple(
        min(max(value, one.low), one.high) for value, one in zip(now(), SEARCHED, strict=True)
    )
    least = distance(run(sets, SEARCH_SEED, best))
    print(f"at the beginning {least:.1f}", flush=True)
    for number in range(rounds):
        for place, one in enumerate(SEARCHED):
            best, least = _along(best, least, place, one.step * 0.5**number, sets)
            print(f"{one.name} {one.end} {best[place]:.4g}   {least:.1f}", flush=True)
    for one, value in zip(SEARCHED, best, strict=True):
        print(f"{one.name:<28} {one.end:<9} {value:.4g}")


def _along(best: Point, least: float, place: int, step: float, sets: int) -> tuple[Point, float]:
    """The best of a step down and a step up."""
    for direction in (-1.0, 1.0):
        value = best[place] + direction * step
        value = min(max(value, SEARCHED[place].low), SEARCHED[place].high)
        if value == best[place]:
            continue
        tried = (*best[:place], value, *best[place + 1 :])
        found = distance(run(sets, SEARCH_SEED, tried))
        if found < least:
            return tried, found
    return best, least


def show(found: dict[str, float]) -> None:
    """Print the fitted numbers beside the study's."""
    for name, one in fitted().items():
        print(f"{name:<24} {one.quoted:8.2f} {found[name]:8.2f} {one.unit}")
    print(f"distance {distance(found):.1f}")


def main() -> int:
    """Do what the command line says; 1 if the parameters are not the frozen ones."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--sets", type=int, default=20, help="replicates of 276 simulations")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--search", action="store_true")
    parser.add_argument("--freeze", action="store_true")
    given = parser.parse_args()
    if given.search:
        search(given.sets, given.rounds)
        return 0
    digest = parameter_hash(scenarios.spec(PROFILE))
    found = run(given.sets, CHECK_SEED)
    show(found)
    if given.freeze:
        kept = {
            "parameters_sha256": digest,
            "seeds": {"search": SEARCH_SEED, "check": CHECK_SEED},
            "sets": given.sets,
            "distance": distance(found),
            "numbers": {
                name: {"study": one.quoted, "ours": found[name], "unit": one.unit}
                for name, one in fitted().items()
            },
        }
        FROZEN.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    same = digest == calibration().parameters_sha256
    print("parameters are", "the frozen ones" if same else f"NOT the frozen ones: {digest}")
    return 0 if same else 1


if __name__ == "__main__":
    os.nice(5)
    sys.exit(main())
