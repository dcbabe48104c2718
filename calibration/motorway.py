"""Fits the drivers of the profile `motorway` to published figures, and says how well they fit.

    python calibration/motorway.py                # figures of the frozen parameters, and their hash
    python calibration/motorway.py --search       # one round of factors on each fitted parameter
    python calibration/motorway.py --freeze       # write motorway.json anew

The standing of each figure in `knowledge/data/validation.toml` says which figures are fitted; the
seeds are those of `plan.toml`. The frozen parameters are those of `knowledge/data/drivers.toml`
(`motorway`), of the profile, and one constant of the step; `motorway.json` has their hash and the
figures that they gave.
"""

import argparse
import hashlib
import json
import sys
import tomllib
from pathlib import Path
from typing import Any

from overtaking.analysis.validation.figures import Figure
from overtaking.analysis.validation.run import Validation, validate
from overtaking.analysis.validation.targets import TargetRole, targets
from overtaking.knowledge.toml_reader import number, numbers_below
from overtaking.recordings.roads import load_road
from overtaking.scenarios import profiles

PLAN = tomllib.loads(Path(__file__).with_name("plan.toml").read_text("utf-8"))
FROZEN = Path(__file__).with_name(PLAN["frozen"])
PROFILE = PLAN["profile"]
SEARCH_SEED, CHECK_SEED = PLAN["fitted_with"], PLAN["judged_with"]

FITTED = (
    "time_gap",
    "gap_demand_factor",
    "min_speed_gain",
    "pull_out_ttc",
    "return_time_gap",
    "lane_change_duration",
    "keep_right_bias",
)
"""Parameters of drivers that were fitted by a factor; beside them the spread of `cruise_factor`,
the spacing of the profile and the constant `lane_change.free_ahead_time`."""

FITTED_ON = frozenset(name for name, one in targets().items() if one.standing is TargetRole.FITTED)

FACTORS = (0.9, 1.0, 1.1)


def parameters() -> dict[str, Any]:
    """Everything that decides how the traffic behaves, as JSON types."""
    return {
        "population": numbers_below("drivers.toml", PROFILE),
        "profile": profiles.load_specification(PROFILE).to_dict(),
        "free_ahead_time": number("model.lane_change.free_ahead_time"),
    }


def parameter_hash() -> str:
    """SHA-256 over `parameters`, in hexadecimal."""
    text = json.dumps(parameters(), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def run(simulations: int, seed: int, scale: dict[str, float] | None = None) -> Validation:
    """The figures of the profile, with factors on what is drawn for everyone."""
    spec = profiles.load_specification(PROFILE, {"drivers.scale": scale} if scale else None)
    return validate(spec, load_road(spec.road), simulations, seed)


def distance(found: Validation) -> float:
    """Sum of the squares of the fitted figures' distances from the middle of their targets."""
    total = 0.0
    for figure in found.figures:
        if figure.name in FITTED_ON and figure.target_low is not None and not figure.needs_km:
            assert figure.target_high is not None
            middle = 0.5 * (figure.target_low + figure.target_high)
            total += ((figure.value - middle) / (figure.target_high - middle)) ** 2
    return total


def search(simulations: int) -> None:
    """Print the distance for factors on one parameter after the other, keeping the best."""
    best: dict[str, float] = {}
    for name in FITTED:
        tried = {
            factor: distance(run(simulations, SEARCH_SEED, best | {name: factor}))
            for factor in FACTORS
        }
        best[name] = min(tried, key=lambda factor: tried[factor])
        row = "  ".join(f"x {factor:g}: {value:.3f}" for factor, value in tried.items())
        print(f"{name:<22} {row}   -> {best[name]:g}")
    print("multiply the medians of the population by these factors and freeze anew:", best)


def show(figures: tuple[Figure, ...]) -> None:
    """Print the figures that have limits, by standing."""
    for standing in TargetRole:
        print(f"{standing}: {standing.meaning}")
        for figure in figures:
            if figure.standing is standing and figure.met is not None:
                interval = f"{figure.low:.3g} .. {figure.high:.3g}"
                verdict = "within the limits" if figure.met else "OUTSIDE the limits"
                print(f"  {figure.title:<72} {figure.value:8.3g}  ({interval}) {verdict}")


def main() -> int:
    """Do what the command line says; 1 if a target is missed or the parameters have changed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("-n", "--simulations", type=int, default=1000)
    parser.add_argument("--search", action="store_true")
    parser.add_argument("--freeze", action="store_true")
    given = parser.parse_args()
    if given.search:
        search(given.simulations)
        return 0
    found = run(given.simulations, CHECK_SEED)
    show(found.figures)
    if given.freeze:
        kept = {"parameters_sha256": parameter_hash(), "validation": found.values()}
        FROZEN.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    frozen = json.loads(FROZEN.read_text(encoding="utf-8"))["parameters_sha256"]
    print(
        "parameters are", "the frozen ones" if frozen == parameter_hash() else "NOT the frozen ones"
    )
    return 0 if found.is_met and frozen == parameter_hash() else 1


if __name__ == "__main__":
    sys.exit(main())
