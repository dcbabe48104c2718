"""The careful and competent human driver of UN Regulation 157, annex 3, who keeps its lane.

It drives on as it did until a manoeuvre can be perceived, evaluates the risk for 0.4 s, waits in a
cut-in until the time to collision is below 2 s, reacts after 0.75 s, and brakes with 0.774 g, or as
hard as the road allows, which it reaches with 12.65 m/s^3.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from overtaking.analysis.evaluation.lane_changes import of

if TYPE_CHECKING:
    from overtaking.analysis.validation.tally import Array
    from overtaking.core.arrays import F64
    from overtaking.model.trajectories import Trajectories

GRAVITY = 9.81


def prevents(
    runs: Trajectories,
    simulation: int,
    partner: int,
    perceived: int,
    frame: int,
    *,
    friction: float,
    waits_for_risk: bool,
) -> bool:
    """Whether the reference driver in place of the ego has no contact with another vehicle.

    Args:
        runs: A batch.
        simulation: Place of the simulation.
        partner: Slot of the other vehicle.
        perceived: Frame in which its manoeuvre can be perceived.
        frame: Frame of the conflict; the other goes on from there as it moves and brakes then.
        friction: Peak friction under the ego [1].
        waits_for_risk: Whether it reacts below a time to collision only.
    """
    interval = 1e-3 * runs.scenario.frame_interval_ms
    states, vehicles = runs.states, runs.scenario.vehicles
    half = 0.5 * (vehicles.length[simulation, 0] + vehicles.length[simulation, partner])
    wide = 0.5 * (vehicles.width[simulation, 0] + vehicles.width[simulation, partner])
    other = _other_path(runs, simulation, partner, perceived, frame)
    speed = 1e-3 * float(states.speed[simulation, 0, perceived])
    begin = 1e-3 * float(states.s[simulation, 0, perceived])
    seconds = interval * np.arange(len(other))
    lateral = np.full(len(other), states.d[simulation, partner, frame], np.int64)
    known = states.d[simulation, partner, perceived : frame + 1]
    lateral[: len(known)] = known
    beside = np.abs(lateral - states.d[simulation, 0, perceived]) < 1e3 * wide
    gap = other - begin - speed * seconds - half
    start = of("competent.evaluation")
    if waits_for_risk:
        start = _at_risk(gap, speed, other, seconds, start)
    own = begin + braked_way(seconds, speed, start + of("competent.delay"), friction)
    return not bool((beside & (np.abs(other - own) < half)).any())


def braked_way(seconds: Array, speed: float, start: float, friction: float) -> F64:
    """The way since the begin of a driver who brakes from some time on, shape (time,) [m].

    Args:
        seconds: Times since the begin.
        speed: At the begin [m/s].
        start: When the brakes begin to act [s].
        friction: Peak friction [1].
    """
    jerk = of("competent.jerk")
    most = min(of("competent.braking"), friction * GRAVITY)
    ramp = most / jerk
    fine = np.arange(0.0, seconds[-1] + 1e-9, 0.01) if len(seconds) else np.zeros(1)
    braking = most * np.clip((fine - start) / ramp, 0.0, 1.0)
    pace = np.maximum(speed - np.cumsum(braking) * 0.01, 0.0)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (pace[1:] + pace[:-1])) * 0.01])
    return np.interp(seconds, fine, way)


def _at_risk(gap: Array, speed: float, other: Array, seconds: Array, earliest: float) -> float:
    """The first time from `earliest` on at which the other is a risk, infinite if never [s]."""
    pace = np.gradient(other, seconds)
    closing = speed - pace
    risky = (closing > 0.0) & (gap < of("competent.ttc") * closing) & (seconds >= earliest)
    return float(seconds[risky.argmax()]) if risky.any() else float("inf")


def _other_path(
    runs: Trajectories, simulation: int, partner: int, perceived: int, frame: int
) -> F64:
    """Where the other is along the road, as recorded until the conflict and then as it moves."""
    states, interval = runs.states, 1e-3 * runs.scenario.frame_interval_ms
    place = (simulation, partner)
    known = 1e-3 * states.s[(*place, slice(perceived, frame + 1))].astype(np.float64)
    later = interval * np.arange(1, round(of("competent.horizon") / interval) + 1)
    speed = 1e-3 * float(states.speed[(*place, frame)])
    braking = max(0.0, -1e-3 * float(states.accel_lon[(*place, frame)]))
    until = np.minimum(later, speed / braking) if braking > 0.0 else later
    return np.concatenate([known, known[-1] + speed * until - 0.5 * braking * until**2])
