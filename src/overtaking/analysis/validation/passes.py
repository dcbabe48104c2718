"""Counts passes against oncoming traffic on a two-way road: times, ways, gaps, margins, signs.

A pass is timed from when the ego's side crosses the line until all of it is back. Its margin is the
time until it would have met the nearest oncomer, at that moment.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.validation.tally import ratio
from overtaking.analysis.validation.traffic import Batch, limit
from overtaking.model.trajectories import (
    NO_VEHICLE,
    ManoeuvreKind,
    PerceivedVehicle,
    Stage,
    Trajectories,
)
from overtaking.model.vehicles import EGO_SLOT, VehicleKind
from overtaking.world.road_parameters import road_parameters
from overtaking.world.sight_distance import sight_at

if TYPE_CHECKING:
    from collections.abc import Sequence

    from overtaking.analysis.validation.tally import Array, Tally
    from overtaking.core.arrays import F64

EVERY_S = 1.0
"""Interval at which each decision of a driver behind a slower vehicle is counted [s]."""

GAP_BINS, GAP_WIDTH = 240, 0.25
"""Bins of the times until an oncomer is met [s]."""

AWAY_BINS, AWAY_WIDTH = 20, 50.0
"""Bins of the distances of oncomers [m]."""

LEADER = 1
"""The slot of the vehicle ahead of the ego at the start."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pass:
    """One completed pass.

    Attributes:
        row: Place of its simulation in the batch.
        duration: Time in the other lane, in part or whole [s].
        way: Way meanwhile [m].
        surplus: Speed minus the speed of the passed vehicle when abreast [m/s].
        passed_speed: Speed of the passed then [m/s].
        no_return: When its middle was beside the rear bumper of the passed, share of `duration`.
        offered: Time until the nearest oncomer would be met, at the decision [s].
        away: How far off that one was [m].
        their_speed: Its speed then [m/s].
        same: Whether it is the one that is met after the pass.
        margin: Time until the nearest oncomer would be met, at the end [s].
        left: Time gap of the passed to the ego, at the end [s].
        zone: Length of the stretch on which the line may be crossed, at the decision [m].
        too_fast: Whether the ego was faster than the limit of the road.
        is_truck: Whether a truck was passed.
        single: Whether it was the only one.
    """

    row: int
    duration: float
    way: float
    surplus: float
    passed_speed: float
    no_return: float
    offered: float
    away: float
    their_speed: float
    same: bool
    margin: float
    left: float
    zone: float
    too_fast: bool
    is_truck: bool
    single: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Attempt:
    """One attempt of another vehicle in the ego's direction, over before the recording ends.

    Attributes:
        row: Place of its simulation in the batch.
        slot: The vehicle.
        target: Who was next ahead of it in its direction as it set out.
        duration: Time in the other lane, in part or whole [s].
        passed: Whether it is back ahead of that one, not behind.
        margin: Time until the nearest oncomer would be met, at the end [s].
    """

    row: int
    slot: int
    target: int
    duration: float
    passed: bool
    margin: float


def count(tally: Tally, batch: Batch) -> None:
    """Add the attempts of a batch, its passes, and the gaps that were refused; those of others."""
    runs = batch.runs
    attempts = (runs.stage == Stage.PULL_OUT).any(axis=1)
    given_up = runs.stage == Stage.ABORT
    tally.add("simulations", batch.group, batch.weight)
    tally.add("aborted", batch.group, batch.weight * (attempts & given_up.any(axis=1)))
    _collisions(tally, batch, attempts)
    _split(tally, batch, attempts)
    found = passes(runs)
    if found:
        columns = zip(*map(astuple, found), strict=True)
        _completed(
            tally, batch, dict(zip((one.name for one in fields(Pass)), columns, strict=True))
        )
    _refused(tally, batch)
    _others(tally, batch)


def passes(runs: Trajectories) -> list[Pass]:
    """The passes that are completed, one at most of each simulation: the last."""
    begun, done = ((runs.stage == one).any(axis=1) for one in (Stage.PULL_OUT, Stage.DONE))
    found = [_passed(runs, int(row)) for row in np.flatnonzero(begun & done)]
    return [one for one in found if one is not None]


def meeting(
    runs: Trajectories, row: Array, frame: Array, who: int = EGO_SLOT
) -> tuple[F64, F64, Array]:
    """The nearest oncomer of egos, or of others in their direction.

    Args:
        runs: Recorded simulations.
        row: Places of simulations in the batch, shape (moment,).
        frame: Frames, the same shape.
        who: Slot of the vehicle.

    Returns:
        Time until both would meet [s], distance between the bumpers [m], both infinite without an
        oncomer, and its slot.
    """
    states, specs = runs.states, runs.scenario.vehicles
    comes = (runs.scenario.start_lane == runs.road.num_lanes) & specs.valid
    s = 1e-3 * states.s[row, :, frame].astype(np.float64)
    speed = 1e-3 * states.speed[row, :, frame].astype(np.float64)
    ahead = s - s[:, [who]]
    ahead = np.where(comes[row] & (ahead > 0.0), ahead, np.inf)
    slot = ahead.argmin(axis=1)
    at = np.arange(len(slot))
    bodies = 0.5 * (specs.length[row, who] + specs.length[row, slot])
    gap = np.maximum(ahead[at, slot] - bodies, 0.0)
    return gap / np.maximum(speed[:, who] + speed[at, slot], 0.1), gap, slot


def _passed(runs: Trajectories, row: int) -> Pass | None:
    """The last pass of a simulation, if one was completed."""
    frames = int(runs.num_frames[row])
    second = 1e-3 * runs.scenario.frame_interval_ms
    states, specs, road = runs.states, runs.scenario.vehicles, runs.road
    out = np.flatnonzero(runs.stage[row, :frames] == Stage.PULL_OUT)
    start = int(out[np.flatnonzero(np.diff(out, prepend=-9) > 1)[-1]])
    kind, valid = runs.percepts.kind[row], runs.percepts.valid[row]
    decided = np.flatnonzero(valid & (kind == ManoeuvreKind.PULL_OUT))
    leaders = runs.percepts.slot[row, :, PerceivedVehicle.LEADER]
    target = int(leaders[decided[-1]]) if decided.size else NO_VEHICLE
    offset = road.overtaking_sign * 1e-3 * states.d[row, EGO_SLOT, start:frames]
    line = road.overtaking_sign * float(road.lane_boundaries[-1])
    beyond = np.flatnonzero(offset > line - 0.5 * float(specs.width[row, EGO_SLOT])) + start
    if not beyond.size or target == NO_VEHICLE:
        return None
    first, last = int(beyond[0]), int(beyond[-1])
    while_out = slice(first, last + 1)
    s = states.s[row][:, : last + 1].astype(np.float64) * 1e-3
    ahead = s[EGO_SLOT, first:] - s[target, first:]
    level = np.flatnonzero(ahead >= 0.0)
    if not level.size:
        return None
    abreast = first + int(level[0])
    committed = int(np.argmax(ahead >= -0.5 * float(specs.length[row, target])))
    speed = 1e-3 * states.speed[row].astype(np.float64)
    at = (np.array([row, row]), np.array([start, last]))
    times, gaps, slots = meeting(runs, *at)
    bodies = 0.5 * float(specs.length[row, EGO_SLOT] + specs.length[row, target])
    along = (runs.scenario.start_lane[row] < road.num_lanes) & specs.valid[row]
    behind = float(s[EGO_SLOT, last] - s[target, last]) - bodies
    return Pass(
        row=row,
        duration=(last - first) * second,
        way=float(s[EGO_SLOT, last] - s[EGO_SLOT, first]),
        surplus=float(speed[EGO_SLOT, abreast] - speed[target, abreast]),
        passed_speed=float(speed[target, abreast]),
        no_return=committed / max(last - first, 1),
        offered=float(times[0]),
        away=float(gaps[0]),
        their_speed=float(speed[slots[0], start]),
        same=bool(slots[0] == slots[1]),
        margin=float(times[1]),
        left=behind / max(float(speed[target, last]), 1.0),
        zone=_zone(runs, float(s[EGO_SLOT, start])),
        too_fast=bool(
            (speed[EGO_SLOT, while_out] > road.speed_limit_at(s[EGO_SLOT, while_out])).any()
        ),
        is_truck=bool(specs.kind[row, target] == VehicleKind.TRUCK),
        single=int((along & (s[:, first] > s[0, first]) & (s[:, last] < s[0, last])).sum()) == 1,
    )


def _zone(runs: Trajectories, s: float) -> float:
    """Length of the stretch around a station where the line may be crossed; 0 where it may not."""
    stations, solid, _ = road_parameters(runs.road).solid_line
    changes = np.append(True, np.diff(solid) != 0.0)
    stations, solid = stations[changes], solid[changes]
    borders = np.append(np.maximum(stations, 0.0), runs.road.length)
    place = int(np.searchsorted(borders[1:-1], s, side="right"))
    whole = float(borders[place + 1] - borders[place])
    return 0.0 if solid[place] else min(whole, limit("longest_zone"))


def _collisions(tally: Tally, batch: Batch, attempts: Array) -> None:
    """Add attempts in which the ego collides, and the hard ones by whom it meets."""
    runs = batch.runs
    contacts, ego = runs.contacts, EGO_SLOT
    partner = contacts.partner[:, ego]
    rows = np.flatnonzero((partner != NO_VEHICLE) & attempts)
    frame = contacts.time[rows, ego] // runs.scenario.frame_interval_ms
    frame = np.minimum(frame, runs.num_frames[rows] - 1)
    stage = runs.stage[rows, np.maximum(frame - 1, 0)]
    rows = rows[~np.isin(stage, (Stage.FOLLOW, Stage.DONE))]
    group, weight, other = batch.group[rows], batch.weight[rows], partner[rows]
    change = [
        contacts.impulse[rows, who] / runs.scenario.vehicles.mass[rows, who]
        for who in (np.full(len(rows), int(ego)), other)
    ]
    hard = np.maximum(*change) > limit("severe_impact")
    comes = runs.scenario.start_lane[rows, other] == runs.road.num_lanes
    tally.add("collided", group, weight)
    tally.add("hard", group, weight * hard)
    tally.add("hard_squares", group, weight**2 * hard)
    tally.add("head_on", group, weight * (hard & comes))


def _split(tally: Tally, batch: Batch, attempts: Array) -> None:
    """Add what the slope of attempts by how unequal both directions are is made of.

    An ego is one of those who drive on the road, so egos count by the flow of their direction.
    """
    if batch.flows is None:
        return
    own, other = batch.flows
    unequal = np.abs(own / (own + other) - 0.5)
    on_the_road = 2.0 * own / (own + other)
    regress(tally, "split", batch, np.arange(len(own)), [unequal], on_the_road * attempts)


def _completed(tally: Tally, batch: Batch, given: dict[str, Sequence[float]]) -> None:
    """Add completed passes."""
    of = {name: np.array(values) for name, values in given.items()}
    row = of.pop("row").astype(np.int64)
    group, weight = batch.group[row], batch.weight[row]

    def add(name: str, values: Array, where: Array | None = None) -> None:
        there = np.ones(len(row), np.bool_) if where is None else where
        tally.add(name, group[there], (weight * values)[there])
        tally.add(f"{name}_number", group[there], weight[there])

    slow = of["passed_speed"] < limit("slow_passed")
    add("duration", of["duration"])
    add("duration_squared", of["duration"] ** 2)
    add("duration_slow", of["duration"], slow)
    add("duration_fast", of["duration"], ~slow)
    add("surplus", of["surplus"])
    add("no_return", of["no_return"])
    add("too_fast", of["too_fast"])
    near = np.abs(of["passed_speed"] - limit("way_speed")) < limit("way_speed_within")
    near = near & of["single"].astype(np.bool_)
    add("way_truck", of["way"], near & of["is_truck"])
    add("way_car", of["way"], near & ~of["is_truck"])
    met = of["margin"] < limit("oncomer_within")
    add("unsafe", of["margin"] < limit("safe_margin"), met)
    add("scarce", of["margin"] < limit("scarce_margin"), met)
    pressed = of["margin"] < limit("squeezing_margin")
    add("left_pressed", of["left"], met & pressed)
    add("left_calm", of["left"], met & ~pressed)
    faced = of["offered"] < limit("longest_offer")
    safe = of["margin"] >= limit("safe_margin")
    for name, where in (("offers_safe", faced & safe), ("offers_unsafe", faced & ~safe)):
        place = of["offered"][where] / GAP_WIDTH
        tally.add_binned(name, group[where], place, weight[where], GAP_BINS)
    seen = of["same"].astype(np.bool_) & (of["away"] < AWAY_BINS * AWAY_WIDTH)
    regress(
        tally, "fast", batch, row, [1e-2 * of["away"], of["their_speed"]], of["margin"], seen & met
    )
    zoned = of["zone"] > 0.0
    regress(tally, "zone", batch, row, [1e-2 * of["zone"]], of["duration"], zoned)


def attempts_of_others(runs: Trajectories) -> list[Attempt]:
    """Attempts of other vehicles in the ego's direction, from their recorded positions.

    An attempt begins when the side of a vehicle crosses the line, far enough beyond to be no
    wander in the lane, and ends when all of it is back.
    """
    road, states, specs = runs.road, runs.states, runs.scenario.vehicles
    second, line = (
        1e-3 * runs.scenario.frame_interval_ms,
        road.overtaking_sign * float(road.lane_boundaries[-1]),
    )
    along = specs.valid & (runs.scenario.start_lane < road.num_lanes)
    along[:, EGO_SLOT] = False
    found: list[Attempt] = []
    for row, slot in np.argwhere(along):
        frames = int(runs.num_frames[row])
        side = (
            road.overtaking_sign * 1e-3 * states.d[row, slot, :frames]
            + 0.5 * specs.width[row, slot]
            - line
        )
        edges = np.flatnonzero(np.diff(side > 0.0, prepend=False, append=False))
        for first, end in zip(edges[::2], edges[1::2], strict=True):
            if end == frames or side[first:end].max() < limit("begun_shift"):
                continue
            s = 1e-3 * states.s[row].astype(np.float64)
            ahead = np.where(along[row] | (np.arange(len(s)) == EGO_SLOT), s[:, first], -np.inf)
            ahead = np.where(ahead > s[slot, first], ahead, np.inf)
            target, last = int(ahead.argmin()), int(end) - 1
            if not np.isfinite(ahead[target]):
                continue
            margin = meeting(runs, np.array([row]), np.array([last]), int(slot))[0]
            found.append(
                Attempt(
                    row=int(row),
                    slot=int(slot),
                    target=target,
                    duration=(last - int(first)) * second,
                    passed=bool(s[slot, last] > s[target, last]),
                    margin=float(margin[0]),
                )
            )
    return found


def _others(tally: Tally, batch: Batch) -> None:
    """Add what others do who drive in the ego's direction: they see whoever comes, as egos do."""
    runs = batch.runs
    along = runs.scenario.vehicles.valid & (runs.scenario.start_lane < runs.road.num_lanes)
    driven = (along.sum(axis=1) - 1) * runs.num_frames * batch.interval_s
    tally.add("others_seconds", batch.group, batch.weight * driven)
    found = attempts_of_others(runs)
    row = np.array([one.row for one in found], np.int64)
    passed = np.array([one.passed for one in found], np.bool_)
    group, weight = batch.group[row], batch.weight[row]
    tally.add("others_attempts", group, weight)
    tally.add("others_aborted", group, weight * ~passed)
    margin = np.array([one.margin for one in found])
    met = passed & (margin < limit("oncomer_within"))
    for name, values, there in (
        ("others_time", np.array([one.duration for one in found]), passed),
        ("others_unsafe", margin < limit("safe_margin"), met),
        ("others_scarce", margin < limit("scarce_margin"), met),
    ):
        tally.add(name, group[there], weight[there] * values[there])
        tally.add(f"{name}_number", group[there], weight[there])


def _refused(tally: Tally, batch: Batch) -> None:
    """Add the gaps that egos were offered while they were held up, and might have crossed the line.

    The largest one that was refused, for the critical gap; all of them by distance, by whether a
    motorcycle comes, and by whether the ego goes, for the acceptance.
    """
    runs = batch.runs
    waits = np.logical_and.accumulate(runs.stage == Stage.FOLLOW, axis=1) & runs.frame_mask
    stop = waits.sum(axis=1)
    beyond = np.minimum(stop, runs.num_frames - 1)
    goes_at = runs.stage[np.arange(len(stop)), beyond] == Stage.PULL_OUT
    step = max(round(EVERY_S / batch.interval_s), 1)
    asked = waits.copy()
    asked[:, np.arange(asked.shape[1]) % step != 0] = False
    went = np.flatnonzero(goes_at & (stop > 0))
    asked[went, stop[went] - 1] = True
    row, frame = np.nonzero(asked)
    goes = goes_at[row] & (frame == stop[row] - 1)
    s, speed = (1e-3 * one[row, :, frame] for one in (runs.states.s, runs.states.speed))
    ahead = s[:, LEADER] - s[:, EGO_SLOT]
    held = (ahead > 0.0) & (ahead < limit("held_up_gap") * speed[:, EGO_SLOT])
    stations, solid, _ = road_parameters(runs.road).solid_line
    place = np.searchsorted(stations[1:], s[:, EGO_SLOT], side="right")
    open_here = solid[np.minimum(place, len(solid) - 1)] == 0.0
    time, away, slot = meeting(runs, row, frame)
    there = held & open_here & (time < limit("longest_offer"))
    largest = np.full(len(stop), -np.inf)
    refused = there & ~goes
    np.maximum.at(largest, row[refused], time[refused])
    some = np.flatnonzero(np.isfinite(largest))
    bins = largest[some] / GAP_WIDTH
    tally.add_binned("refused", batch.group[some], bins, batch.weight[some], GAP_BINS)
    seen = away < sight_at(runs.road, s[:, EGO_SLOT], 1)
    near = there & seen & (away < AWAY_BINS * AWAY_WIDTH)
    small = runs.scenario.vehicles.kind[row, slot] == VehicleKind.MOTORCYCLE
    place = (away[near] / AWAY_WIDTH).astype(np.int64) + AWAY_BINS * (
        small[near] + 2 * goes[near].astype(np.int64)
    )
    group, weight = batch.group[row[near]], batch.weight[row[near]]
    tally.add_binned("asked", group, place, weight, 4 * AWAY_BINS)


def regress(
    tally: Tally,
    name: str,
    batch: Batch,
    row: Array,
    by: Sequence[Array],
    values: Array,
    where: Array | None = None,
) -> None:
    """Add the sums of which `slope` makes a linear regression.

    Args:
        tally: Where to.
        name: Name of the sums.
        batch: The batch.
        row: Places of simulations in the batch, shape (value,).
        by: Quantities on which the values depend, each of that shape.
        values: The values, the same shape.
        where: Which of them count; all by default.
    """
    there = np.ones(len(row), np.bool_) if where is None else where
    group, weight = batch.group[row[there]], batch.weight[row[there]]
    columns = [np.ones(len(group)), *(one[there] for one in by)]
    bins = len(columns) * (len(columns) + 1)
    for i, one in enumerate(columns):
        for j, other in enumerate([*columns, values[there]]):
            place = np.full(len(group), i * (len(columns) + 1) + j)
            tally.add_binned(f"{name}_sums", group, place, weight * one * other, bins)


def slope(sums: F64, of: int) -> float:
    """A coefficient of the linear regression of `regress`; of 0 is the constant."""
    number = int(np.sqrt(len(sums)))
    if number * (number + 1) != len(sums):
        return float("nan")
    table = sums.reshape(number, number + 1)
    try:
        return float(np.linalg.solve(table[:, :-1], table[:, -1])[of])
    except np.linalg.LinAlgError:
        return float("nan")


def safe_gap(tally: Tally) -> float:
    """The offered gap from which most passes keep a safe margin [s].

    By a logistic regression of safe passes on the gap, as in the drone study.
    """
    safe, unsafe = tally.total("offers_safe"), tally.total("offers_unsafe")
    if len(safe) != GAP_BINS or len(unsafe) != GAP_BINS:
        return float("nan")
    gap = GAP_WIDTH * (np.arange(GAP_BINS) + 0.5)
    design = np.column_stack([np.ones(GAP_BINS), gap])
    total, weights = safe + unsafe, np.zeros(2)
    for _ in range(50):
        chance = 1.0 / (1.0 + np.exp(-np.clip(design @ weights, -30.0, 30.0)))
        curve = design.T @ ((total * chance * (1.0 - chance))[:, None] * design)
        weights += np.linalg.solve(curve + 1e-6 * np.eye(2), design.T @ (safe - total * chance))
    share = limit("safe_share")
    return float((np.log(share / (1.0 - share)) - weights[0]) / weights[1])


def critical_gap(tally: Tally) -> float:
    """Where as many accepted gaps are smaller as refused ones are larger [s].

    Source:
        M. S. Raff, J. W. Hart: A volume warrant for urban stop signs, 1950.
    """
    accepted = tally.total("offers_safe") + tally.total("offers_unsafe")
    refused = tally.total("refused")
    if len(accepted) != GAP_BINS or len(refused) != GAP_BINS or not accepted.sum():
        return float("nan")
    smaller = np.cumsum(accepted) / accepted.sum()
    larger = 1.0 - np.cumsum(refused) / max(refused.sum(), 1e-9)
    return GAP_WIDTH * float(1 + np.argmax(smaller >= larger))


def favour_of_small(tally: Tally) -> float:
    """Log odds ratio of the acceptance before motorcycles, over that before others as far off.

    Source:
        N. Mantel, W. Haenszel: Statistical aspects of the analysis of data from retrospective
        studies of disease, Journal of the National Cancer Institute 22 (1959) 719-748.
    """
    sums = tally.total("asked")
    if len(sums) != 4 * AWAY_BINS:
        return float("nan")
    (refused, refused_small), (taken, taken_small) = sums.reshape(2, 2, AWAY_BINS)
    total = np.maximum(sums.reshape(4, AWAY_BINS).sum(axis=0), 1e-9)
    for_small = float((taken_small * refused / total).sum())
    for_others = float((taken * refused_small / total).sum())
    return float(np.log(for_small / for_others)) if for_small and for_others else float("nan")


def cost_of_equal_split(tally: Tally) -> float:
    """How many attempts fewer an equal split brings than one of 70:30, over their mean [1]."""
    sums = tally.total("split_sums")
    mean = sums[2] / sums[0] if len(sums) == 6 and sums[0] else float("nan")
    return 0.2 * slope(sums, 1) / mean if mean else float("nan")


def mean_of(tally: Tally, name: str) -> float:
    """The mean of a quantity of completed passes, NaN without any."""
    return ratio(tally.total(name), tally.total(f"{name}_number"))
