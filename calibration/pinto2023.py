"""Fits the profile `pinto2023` to the study, and says how well it fits.

    python calibration/pinto2023.py                    # the fitted numbers, with frozen parameters
    python calibration/pinto2023.py --search --freeze  # fit anew, write the profile, freeze it

Fitted on are the numbers that `knowledge/data/paper.toml` calls calibrated: the sizes of the
classes, and the printed means of SE, SP and D. Nothing else is looked at. Parameters stay within
`SEARCHED`, outside of which they could not be defended, so that not every number is met.
"""

import argparse
import json
import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from overtaking import knowledge
from overtaking.analysis.reproduction.measures import measured
from overtaking.analysis.reproduction.replicates import replicates
from overtaking.analysis.reproduction.run import parameter_hash
from overtaking.analysis.reproduction.statements import (
    Statement,
    StatementRole,
    Statistic,
    calibration,
    statements,
)
from overtaking.api.simulator_registry import get_simulator
from overtaking.recordings.roads import load_road
from overtaking.scenarios import profiles
from overtaking.scenarios.profiles import PROFILE_FOLDER

FROZEN = Path(__file__).with_name("pinto2023.json")
PROFILE = "pinto2023"
TARGET = PROFILE_FOLDER / f"{PROFILE}.toml"
STATED = Path(knowledge.__file__).parent / "data" / "paper.toml"
SEARCH_SEED, CHECK_SEED = (int(seed) for seed in calibration().seeds[-2:])

TOLERANCE = {"count": 8.0, "SE": 2.0, "SP": 2.0, "D": 4.0}
"""What a distance is measured in: simulations of 276, km/h, km/h, m. About the standard deviation
of 276 simulations, and of the mean of a class among them."""


@dataclass(frozen=True)
class Searched:
    """A number of the profile that the search may move.

    Attributes:
        name: Its dotted key.
        low: Least value that can be defended.
        high: Largest.
        step: First step of the search, halved in each round.
    """

    name: str
    low: float
    high: float
    step: float


SEARCHED = (
    Searched("time.horizon_s", 10.0, 20.0, 2.0),
    Searched("traffic.leader_speed_exponent", 1.5, 6.0, 0.8),
    Searched("starts.min_gap_m", 3.0, 20.0, 4.0),
    Searched("weather.pushes.sight_m", 20.0, 120.0, 20.0),
    Searched("drivers.fixed.lane_change_duration_s", 2.0, 6.0, 0.8),
    Searched("drivers.fixed.min_speed_gain_mps", 0.0, 3.0, 0.5),
)
"""What may be moved, and within which limits; the rest of the profile and its drivers stay."""

Point = tuple[float, ...]
"""A value for each of `SEARCHED`."""


def fitted() -> dict[str, Statement]:
    """The numbers that parameters may be chosen by."""
    every = statements().items()
    return {name: one for name, one in every if one.standing == StatementRole.CALIBRATED}


def now() -> Point:
    """The values in use."""
    return tuple(_value(one) for one in SEARCHED)


def _value(one: Searched) -> float:
    found: Any = profiles.load_specification(PROFILE).to_dict()
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
    changes = {one.name: value for one, value in zip(SEARCHED, point or (), strict=False)}
    spec = profiles.load_specification(PROFILE, changes or None)
    found = replicates(spec, load_road(spec.road), seed, sets, get_simulator("engine"))
    return {name: float(measured(found, one).mean() / one.factor) for name, one in fitted().items()}


def distance(found: dict[str, float]) -> float:
    """Sum of the squares of the distances from the study's numbers, in tolerances."""
    total = 0.0
    for name, one in fitted().items():
        kind = "count" if one.measure == Statistic.COUNT else one.feature
        total += ((found[name] - one.quoted) / TOLERANCE[kind]) ** 2
    return total


def search(sets: int, rounds: int) -> None:
    """Move one parameter after the other while it helps, and write them into the profile."""
    best = tuple(
        min(max(value, one.low), one.high) for value, one in zip(now(), SEARCHED, strict=True)
    )
    least = distance(run(sets, SEARCH_SEED, best))
    print(f"at the beginning {least:.1f}", flush=True)
    for number in range(rounds):
        for place, one in enumerate(SEARCHED):
            best, least = _along(best, least, place, one.step * 0.5**number, sets)
            print(f"{one.name} {best[place]:.4g}   {least:.1f}", flush=True)
    text = TARGET.read_text(encoding="utf-8")
    for one, value in zip(SEARCHED, best, strict=True):
        print(f"{one.name:<36} {value:.4g}")
        text = with_value(text, one.name, round(value, 4))
    TARGET.write_text(text, encoding="utf-8")


def with_value(text: str, name: str, value: float) -> str:
    """A profile's text with another value at a dotted key."""
    section, _, key = name.rpartition(".")
    line = re.compile(rf"(^\[{re.escape(section)}\]\n(?:[^\[].*\n|\n)*?{key} = )\S+", re.MULTILINE)
    changed, count = line.subn(rf"\g<1>{value}", text)
    assert count == 1, name
    return changed


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
    digest = parameter_hash(profiles.load_specification(PROFILE))
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
        text = STATED.read_text(encoding="utf-8")
        before = f'parameters_sha256 = "{calibration().parameters_sha256}"'
        STATED.write_text(text.replace(before, f'parameters_sha256 = "{digest}"'), encoding="utf-8")
    same = given.freeze or digest == calibration().parameters_sha256
    print("parameters are", "the frozen ones" if same else f"NOT the frozen ones: {digest}")
    return 0 if same else 1


if __name__ == "__main__":
    os.nice(5)
    sys.exit(main())
