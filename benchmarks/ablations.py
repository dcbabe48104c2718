"""Removes one effect at a time and shows what it moves.

    python benchmarks/ablations.py                      # 20,000 simulations an arm, a minute
    python benchmarks/ablations.py --simulations 4000

Both arms simulate the same scenarios with the same random numbers; the statistic of each simulation
with the effect removed is compared with its own value in the full model, so the standard error is
that of the paired difference. Where `pinto2023-physical` as it is has too little of what an effect
needs (wind, lorries, fog), the table says which overrides were used. Exits with 1 if an effect does
not move its statistic in the stated direction by more than three standard errors.
"""

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import Buffers
from overtaking.model.trajectories import NO_VEHICLE, ManoeuvreKind, Trajectories
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine
from overtaking.world.constants import EnabledEffects
from overtaking.world.step_parameters import step_parameters

Values = NDArray[np.float64]

PIECE = 1000
"""Simulations in memory at a time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ablation:
    """One effect and what removing it should do.

    Attributes:
        effect: Name of the switch in `EnabledEffects`.
        statistic: What is compared, for people.
        measure: The statistic of each simulation; NaN where it has none.
        rises: Whether removing the effect raises it.
        overrides: Changes to `pinto2023-physical`.
    """

    effect: str
    statistic: str
    measure: Callable[[Trajectories], Values]
    rises: bool
    overrides: Mapping[str, Any] = field(default_factory=dict[str, Any])


def departures(runs: Trajectories) -> Values:
    """Share of the vehicles that leave the lanes."""
    valid = runs.scenario.vehicles.valid
    lane, filled = runs.states.lane, runs.frame_mask[:, None, :] & valid[:, :, None]
    out = ((lane == NO_VEHICLE) | (lane >= runs.road.num_lanes)) & filled
    return out.any(axis=2).sum(axis=1) / valid.sum(axis=1)


def contacts(runs: Trajectories) -> Values:
    """Share of the vehicles that touch another."""
    valid = runs.scenario.vehicles.valid
    return ((runs.contacts.partner != NO_VEHICLE) & valid).sum(axis=1) / valid.sum(axis=1)


def sway(runs: Trajectories) -> Values:
    """Standard deviation of the ego's lateral acceleration [m/s^2]."""
    values = runs.states.accel_lat[:, 0] / 1e3
    valid = runs.frame_mask
    mean = (values * valid).sum(axis=1) / runs.num_frames
    return np.sqrt((((values - mean[:, None]) ** 2) * valid).sum(axis=1) / runs.num_frames)


def held_in_lee(runs: Trajectories) -> Values:
    """Mean steering of the ego against the wind in the lee of others [mrad]; NaN below a second."""
    s, d = runs.states.s / 1e3, runs.states.d / 1e3
    bodies = runs.scenario.vehicles
    across = np.sin(runs.scenario.weather.wind_direction)[:, None]
    beside = np.abs(s[:, 1:] - s[:, :1]) < 0.5 * bodies.length[:, 1:, None]
    aside = d[:, :1] - d[:, 1:]
    upwind = (aside * across[:, None] > 0.0) & (np.abs(aside) < 5.0)
    lee = (beside & upwind & bodies.valid[:, 1:, None]).any(axis=1)
    lee &= runs.frame_mask & (runs.collided_with == NO_VEHICLE)
    count = lee.sum(axis=1)
    against = -np.sign(across) * runs.states.wheel_angle[:, 0] / 10.0
    return np.where(count >= 20, (against * lee).sum(axis=1) / np.maximum(count, 1), np.nan)


def attempts(runs: Trajectories) -> Values:
    """Whether the ego pulls out."""
    return ((runs.stage == 1) & runs.frame_mask).any(axis=1).astype(np.float64)


def lane_changes(runs: Trajectories) -> Values:
    """Times that the other vehicles enter another lane."""
    lane = runs.states.lane[:, 1:].astype(np.int64)
    both = (runs.frame_mask[:, 1:] & runs.frame_mask[:, :-1])[:, None, :]
    changed = (lane[:, :, 1:] != lane[:, :, :-1]) & both
    return changed.sum(axis=(1, 2)).astype(np.float64)


def first_percept(runs: Trajectories, column: int) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Where the first decision is to pull out past a neighbour in `column`; whether it was seen."""
    p = runs.percepts
    is_out = p.valid[:, 0] & (p.kind[:, 0] == ManoeuvreKind.PULL_OUT)
    return is_out & (p.slot[:, 0, column] != NO_VEHICLE), p.is_detected[:, 0, column]


def gap_error(runs: Trajectories) -> Values:
    """Misjudgement of the leader's gap when pulling out [m]."""
    there, seen = first_percept(runs, 0)
    p = runs.percepts
    error = np.abs(p.gap[:, 0, 0] - p.true_gap[:, 0, 0]) / 1e3
    return np.where(there & seen, error, np.nan)


def closing_error(runs: Trajectories) -> Values:
    """Misjudgement of the speed of approach to the leader when pulling out [m/s]."""
    there, seen = first_percept(runs, 0)
    p = runs.percepts
    error = np.abs(p.closing_speed[:, 0, 0] - p.true_closing_speed[:, 0, 0]) / 1e3
    return np.where(there & seen, error, np.nan)


def seen_ahead(runs: Trajectories) -> Values:
    """Whether who drives ahead in the next lane is noticed when pulling out."""
    there, seen = first_percept(runs, 1)
    return np.where(there, seen.astype(np.float64), np.nan)


STORM = {"weather.presets": ["HardRainNoon"]}
FOG = {"weather.presets": ["HardRainNight"]}
LORRIES = {"traffic.types": {"T": 1.0, "V": 1.0}}

ABLATIONS = (
    Ablation(
        effect="film",
        statistic="share of vehicles that leave the lanes, hard rain",
        measure=departures,
        rises=False,
        overrides=STORM,
    ),
    Ablation(
        effect="gusts",
        statistic="sway of the ego [m/s^2], storm",
        measure=sway,
        rises=False,
        overrides=STORM,
    ),
    Ablation(
        effect="wake",
        statistic="steering held against the wind in the lee [mrad], storm, lorries",
        measure=held_in_lee,
        rises=True,
        overrides=STORM | LORRIES,
    ),
    Ablation(
        effect="range",
        statistic="share of egos that pull out, night in fog",
        measure=attempts,
        rises=True,
        overrides=FOG,
    ),
    Ablation(
        effect="delay",
        statistic="share of vehicles that touch another",
        measure=contacts,
        rises=False,
    ),
    Ablation(
        effect="distance_error",
        statistic="misjudged gap to the leader [m]",
        measure=gap_error,
        rises=False,
    ),
    Ablation(
        effect="looming",
        statistic="misjudged closing speed to the leader [m/s]",
        measure=closing_error,
        rises=False,
    ),
    Ablation(
        effect="occlusion",
        statistic="share noticed ahead in the next lane, lorries",
        measure=seen_ahead,
        rises=True,
        overrides=LORRIES,
    ),
    Ablation(
        effect="mobil",
        statistic="lane changes of the others, per simulation",
        measure=lane_changes,
        rises=False,
    ),
)


def arms(ablation: Ablation, simulations: int, seed: int) -> tuple[Values, Values]:
    """The statistic of every simulation, in the full model and without the effect."""
    given = load_specification("pinto2023-physical", overrides=dict(ablation.overrides))
    road, buffers = load_road("town06"), Buffers()
    full, without = list[Values](), list[Values]()
    for begin in range(0, simulations, PIECE):
        index = np.arange(begin, min(begin + PIECE, simulations), dtype=np.uint64)
        scenario = ScenarioSource(given, road, seed).sample(index)
        for effects, kept in (
            (EnabledEffects(), full),
            (EnabledEffects(**{ablation.effect: False}), without),
        ):
            runs = engine.run(scenario, step_parameters(scenario, effects), buffers=buffers)
            kept.append(ablation.measure(runs))
    return np.concatenate(full), np.concatenate(without)


def row(ablation: Ablation, simulations: int, seed: int) -> dict[str, Any]:
    """One line of the table."""
    full, without = arms(ablation, simulations, seed)
    both = np.isfinite(full) & np.isfinite(without)
    change = without[both] - full[both]
    error = float(change.std(ddof=1) / np.sqrt(len(change)))
    z = float(change.mean()) / error if error > 0 else 0.0
    return {
        "effect": ablation.effect,
        "statistic": ablation.statistic,
        "full": float(full[both].mean()),
        "removed": float(without[both].mean()),
        "change": float(change.mean()),
        "standard_error": error,
        "z": z,
        "expected": "rises" if ablation.rises else "falls",
        "met": (z > 3.0) if ablation.rises else (z < -3.0),
        "pairs": len(change),
    }


HEADER = (
    "removed",
    "statistic",
    "full",
    "without",
    "change",
    "std. error",
    "z",
    "pairs",
    "expected",
)


def cells(each: Mapping[str, Any]) -> tuple[str, ...]:
    """A line of the table, as texts."""
    numbers = (f"{each[name]:.4f}" for name in ("full", "removed"))
    verdict = each["expected"] if each["met"] else f"NOT: {each['expected']}"
    change = (f"{each['change']:+.4f}", f"{each['standard_error']:.4f}", f"{each['z']:+.1f}")
    change = (*change, f"{each['pairs']:,}")
    return (each["effect"].replace("_", " "), each["statistic"], *numbers, *change, verdict)


def line(texts: Sequence[str], *, markdown: bool) -> str:
    """A line of the table."""
    if markdown:
        return f"| {' | '.join(texts)} |"
    effect, statistic, *numbers, verdict = texts
    return f"{effect:<15}{statistic:<58}{''.join(f'{text:>11}' for text in numbers)}  {verdict}"


def main() -> int:
    """Print the table; 1 if an effect does not do what it should."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--simulations", type=int, default=20_000)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--only", nargs="*", help="effects to look at")
    options.add_argument("--json", action="store_true", help="print the table for machines")
    options.add_argument("--markdown", action="store_true", help="print the table for the docs")
    given = options.parse_args()
    chosen = [each for each in ABLATIONS if not given.only or each.effect in given.only]
    if not given.json:
        print(line(HEADER, markdown=given.markdown))
    if given.markdown:
        print(line(["---"] * len(HEADER), markdown=True))
    rows = list[dict[str, Any]]()
    for ablation in chosen:
        rows.append(row(ablation, given.simulations, given.seed))
        if not given.json:
            print(line(cells(rows[-1]), markdown=given.markdown), flush=True)
    if given.json:
        print(json.dumps(rows, indent=1))
    return 0 if all(each["met"] for each in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
