"""Measures how egos pass against oncoming traffic, beside what was measured on roads.

    python benchmarks/rural.py                    # 4,000 simulations of calibration/rural.toml
    python benchmarks/rural.py -n 20000 --seed 3 --json
    python benchmarks/rural.py --set weather.rain_probability=1

A pass is timed from when the ego's outer side crosses the line until all of it is back. Its margin
is the time until ego and oncomer would meet, at that moment. Figures with a target lie in an
interval that was measured on roads, or was chosen beforehand; the others are reported.

Sources of the intervals: Hegeman 2008 (durations, margins), Farah 2016 (aborts), Llorca and Garcia
2011 (speeds and distances), Farah 2013 (point of no return), a drone study of 2022 (safe gaps).
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from measure import ROOT, Measure, parser, report
from overtaking.cli.arguments import overrides
from overtaking.core.units import kmh_from_mps
from overtaking.model.trajectory import NO_VEHICLE, Stage, Trajectories
from overtaking.model.vehicles import VehicleKind
from overtaking.recordings.roads import load_road
from overtaking.scenarios import sample, spec
from overtaking.sim import engine
from overtaking.world.parameters import parameters

F64 = NDArray[np.float64]

SPEC = ROOT / "calibration" / "rural.toml"
"""The traffic that is measured."""

BATCH = 500
MET_WITHIN = 20.0
"""A pass has an oncomer if one is met within this time of its end [s]."""

SAFE = 3.0
"""A margin from which a pass counts as safe [s]."""

SURE = 0.85
"""Share of passes with such a margin that the safe gap is for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pass:
    """One completed pass.

    Attributes:
        duration: Time in the other lane, in part or whole [s].
        whole: From the decision until settled in the lane [s].
        length: Way in the other lane [m].
        surplus: Speed above that of the passed when abreast [m/s].
        passed_speed: Speed of the passed then [m/s].
        abreast: When that was, of the time in the other lane [1].
        offered: Time until the nearest oncomer would be met, at the decision [s].
        margin: The same at the end [s].
        is_truck: Whether a truck was passed.
    """

    duration: float
    whole: float
    length: float
    surplus: float
    passed_speed: float
    abreast: float
    offered: float
    margin: float
    is_truck: bool


@dataclass(slots=True, kw_only=True)
class Found:
    """What was counted in all simulations."""

    simulations: int
    attempts: int
    aborted: int
    head_on: int
    collided: int
    passes: list[Pass]
    offers: list[float]


def meeting(run: Trajectories, row: int, frame: int) -> float:
    """Time until the ego would meet the nearest oncomer, infinite without one [s]."""
    states = run.states
    comes = (run.scenario.start_lane[row] == 1) & run.scenario.vehicles.valid[row]
    ahead = (states.s[row, :, frame] - states.s[row, 0, frame]) / 1e3
    gap = np.where(comes & (ahead > 0), ahead, np.inf)
    nearest = int(gap.argmin())
    closing = (states.speed[row, 0, frame] + states.speed[row, nearest, frame]) / 1e3
    bodies = 0.5 * float(run.scenario.vehicles.length[row, [0, nearest]].sum())
    return max(float(gap[nearest]) - bodies, 0.0) / max(float(closing), 0.1)


def passed_in(run: Trajectories, row: int, second: float) -> Pass | None:
    """The pass of a simulation, if one was completed."""
    frames = int(run.num_frames[row])
    stage, states = run.stage[row, :frames], run.states
    out, done = np.flatnonzero(stage == Stage.PULL_OUT), np.flatnonzero(stage == Stage.DONE)
    if not out.size or not done.size:
        return None
    # The last one, after aborts.
    start = int(out[np.flatnonzero(np.diff(out, prepend=-9) > 1)[-1]])
    side = run.road.side * states.d[row, 0, :frames] / 1e3
    reach = float(run.road.boundaries[-1]) * run.road.side - 0.5 * float(
        run.scenario.vehicles.width[row, 0]
    )
    beyond = np.flatnonzero(side[start:] > reach) + start
    decided = np.flatnonzero(run.percepts.valid[row] & (run.percepts.kind[row] == 0))
    target = int(run.percepts.vehicle[row, decided[-1], 0]) if decided.size else NO_VEHICLE
    if not beyond.size or target == NO_VEHICLE:
        return None
    first, last = int(beyond[0]), int(beyond[-1])
    ahead = states.s[row, 0, :frames] - states.s[row, target, :frames]
    level = np.flatnonzero(ahead[first : last + 1] >= 0)
    if not level.size:
        return None
    abreast = first + int(level[0])
    speed = states.speed[row, :, abreast] / 1e3
    return Pass(
        duration=(last - first) * second,
        whole=(int(done[0]) - start) * second,
        length=float(states.s[row, 0, last] - states.s[row, 0, first]) / 1e3,
        surplus=float(speed[0] - speed[target]),
        passed_speed=float(speed[target]),
        abreast=(abreast - first) / max(last - first, 1),
        offered=meeting(run, row, start),
        margin=meeting(run, row, last),
        is_truck=bool(run.scenario.vehicles.kind[row, target] == VehicleKind.T),
    )


def refused_in(run: Trajectories, row: int, second: float) -> Iterator[float]:
    """The largest gap between two oncomers that an ego let go while it was held up [s]."""
    frames, states = int(run.num_frames[row]), run.states
    stop = np.flatnonzero(run.stage[row, :frames] != Stage.FOLLOW)
    stop = int(stop[0]) if stop.size else frames
    follows = (states.s[row, 1, :stop] - states.s[row, 0, :stop]) / 1e3
    held = (follows < 3.0 * states.speed[row, 0, :stop] / 1e3) & (follows > 0)
    step = max(round(1.0 / second), 1)
    offered = [meeting(run, row, int(f)) for f in np.flatnonzero(held)[::step]]
    finite = [one for one in offered if np.isfinite(one) and one < 60.0]
    if finite:
        yield max(finite)


def counted(simulations: int, seed: int, changes: dict[str, object]) -> Found:
    """Draw, simulate and count."""
    found = Found(
        simulations=simulations, attempts=0, aborted=0, head_on=0, collided=0, passes=[], offers=[]
    )
    given, road = spec(SPEC, changes), load_road("rural")
    for first in range(0, simulations, BATCH):
        world = sample(given, road, seed, np.arange(first, min(first + BATCH, simulations)))
        run = engine.run(world, parameters(world))
        second = run.scenario.frame_interval_ms / 1e3
        begun = (run.stage == Stage.PULL_OUT).any(axis=1)
        found.attempts += int(begun.sum())
        found.aborted += int((begun & (run.stage == Stage.ABORT).any(axis=1)).sum())
        partner = run.contacts.partner[:, 0]
        hit = partner != NO_VEHICLE
        rows = np.flatnonzero(hit)
        found.collided += len(rows)
        found.head_on += int((world.start_lane[rows, partner[rows]] == 1).sum())
        for row in np.flatnonzero(begun | hit):
            one = passed_in(run, int(row), second)
            found.passes += [one] if one is not None else []
        for row in range(world.num_simulations):
            found.offers += refused_in(run, row, second)
    return found


def safe_gap(offered: F64, margin: F64) -> float:
    """The offered gap from which a share `SURE` of passes keeps a margin of `SAFE` [s].

    By a logistic regression of safe passes on the gap, as in the drone study.
    """
    design = np.column_stack([np.ones_like(offered), offered])
    safe, weights = (margin >= SAFE).astype(float), np.zeros(2)
    for _ in range(50):
        chance = 1.0 / (1.0 + np.exp(-np.clip(design @ weights, -30, 30)))
        slope = (chance * (1.0 - chance))[:, None] * design
        weights += np.linalg.solve(design.T @ slope + 1e-6 * np.eye(2), design.T @ (safe - chance))
    return float((np.log(SURE / (1.0 - SURE)) - weights[0]) / weights[1])


def critical_gap(accepted: F64, refused: F64) -> float:
    """Where as many accepted gaps are smaller as refused ones are larger (Raff 1950) [s]."""
    grid = np.arange(4.0, 60.0, 0.1)
    smaller = (accepted[:, None] < grid).mean(axis=0)
    larger = (refused[:, None] > grid).mean(axis=0)
    return float(grid[np.argmax(smaller >= larger)])


def measures(found: Found) -> list[Measure]:
    """The figures and what they are held against."""

    def values(name: str, of: Sequence[Pass] = found.passes) -> F64:
        return np.array([getattr(one, name) for one in of], float)

    met = [one for one in found.passes if one.margin < MET_WITHIN]
    margin = values("margin", met)
    duration = values("duration")
    slow = values("passed_speed") < 50.0 / 3.6
    near_70 = [one for one in found.passes if abs(kmh_from_mps(one.passed_speed) - 70.0) < 8.0]
    trucks = [one.length for one in near_70 if one.is_truck]
    cars = [one.length for one in near_70 if not one.is_truck]
    faced = [one for one in found.passes if one.offered < 60.0]
    rows = [
        Measure(name="simulations", value=found.simulations, unit=""),
        Measure(name="attempts", value=found.attempts, unit=""),
        Measure(name="completed passes", value=len(found.passes), unit=""),
        Measure(name="1 time in the other lane, mean", value=float(duration.mean()), unit="s",
                at_least=7.0, at_most=9.0),
        Measure(name="1 its deviation", value=float(duration.std()), unit="s", at_least=1.8,
                at_most=3.2),
        Measure(name="1 from the decision until settled, mean", value=float(values("whole").mean()),
                unit="s"),
        Measure(name="1 mean, passed below 50 km/h", value=float(duration[slow].mean()), unit="s",
                note=f"{slow.sum()} passes"),
        Measure(name="1 mean, passed above", value=float(duration[~slow].mean()), unit="s"),
        Measure(name="2 margin below 3 s", value=100 * float((margin < 3).mean()), unit="%",
                at_least=5.0, at_most=15.0, note=f"of {len(met)} with an oncomer within 20 s"),
        Measure(name="2 margin below 1 s", value=100 * float((margin < 1).mean()), unit="%",
                at_most=2.0),
        Measure(name="3 aborted, of attempts", value=100 * found.aborted / max(found.attempts, 1),
                unit="%", at_least=3.0, at_most=20.0),
        Measure(name="4 faster than the passed when abreast",
                value=kmh_from_mps(float(values("surplus").mean())), unit="km/h", at_least=20.0,
                at_most=35.0),
        Measure(name="7 abreast, share of the time", value=100 * float(values("abreast").mean()),
                unit="%", at_least=33.0, at_most=50.0),
        Measure(name="collisions of the ego, of attempts",
                value=100 * found.collided / max(found.attempts, 1), unit="%"),
        Measure(name="head-on, of attempts", value=100 * found.head_on / max(found.attempts, 1),
                unit="%"),
    ]  # fmt: skip
    if trucks and cars:
        rows += [
            Measure(name="5 way in the other lane, truck at 70 km/h", value=float(np.mean(trucks)),
                    unit="m", at_least=180.0, at_most=300.0, note=f"{len(trucks)} passes"),
            Measure(name="5 less for a car", value=float(np.mean(trucks) - np.mean(cars)), unit="m",
                    at_least=50.0, at_most=100.0, note=f"{len(cars)} passes"),
        ]  # fmt: skip
    if len(faced) > 10:
        offered, kept = values("offered", faced), values("margin", faced)
        rows += [
            Measure(name="6 gap with a margin of 3 s in 85 %", value=safe_gap(offered, kept),
                    unit="s", at_least=18.0, at_most=26.0, note=f"{len(faced)} passes"),
            Measure(name="8 critical gap", value=critical_gap(offered, np.array(found.offers)),
                    unit="s", at_least=13.0, at_most=22.0, note=f"{len(found.offers)} refused"),
        ]  # fmt: skip
    return rows


def main(arguments: Sequence[str]) -> int:
    """Measure, print, and say whether every target is met."""
    line = parser(__doc__)
    line.add_argument("-n", type=int, default=4000, help="simulations")
    line.add_argument("--seed", type=int, default=1)
    line.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="changes")
    given = line.parse_args(arguments)
    found = counted(given.n, given.seed, overrides(given.changes, None))
    return report(measures(found), as_json=given.json)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
