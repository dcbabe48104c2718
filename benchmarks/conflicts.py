"""How near each simulation came to an accident: contacts, near-crashes, least time to collision."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from overtaking.analysis.validation.traffic import Batch, by_frame, leaders
from overtaking.model.trajectories import NO_VEHICLE, Trajectories

NEAR_TTC_S = 1.5
NEAR_DECEL = 4000  # [mm/s^2]
"""A vehicle has a near-crash that is this near to its leader in time and brakes this hard: a severe
conflict by Hayward (1972), with the braking that naturalistic studies ask for beside it."""

EVERY_S = 0.2
LONGEST_TTC_S = 10.0
"""Upper bound of a time to collision; keeps the mean of the minima finite."""

Values = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Conflicts:
    """What happened in each simulation, shape (simulation,).

    Attributes:
        contact: Whether any vehicle touched another.
        ego_contact: Whether the ego did.
        near: Number of vehicles with a near-crash.
        least_ttc: Least time to collision of anybody with the leader, at most `LONGEST_TTC_S` [s].
        vehicle_seconds: Time of all vehicles, which stands for what the simulation costs [s].
    """

    contact: Values
    ego_contact: Values
    near: Values
    least_ttc: Values
    vehicle_seconds: Values


def conflicts(runs: Trajectories) -> Conflicts:
    """Count the conflicts of recorded simulations."""
    valid = runs.scenario.vehicles.valid
    touched = (runs.contacts.partner != NO_VEHICLE) & valid
    batch = Batch.of(runs)
    frames = slice(None, None, max(1, round(EVERY_S / batch.interval_s)))
    gap, closing = leaders(batch, frames)
    sound, accel = (by_frame(one, frames) for one in (batch.sound, runs.states.accel_lon))
    meets = sound & (closing > 0.0) & np.isfinite(gap)
    ttc = np.full(gap.shape, LONGEST_TTC_S)
    np.divide(gap, closing, out=ttc, where=meets)
    is_near = (ttc < NEAR_TTC_S) & (accel < -NEAR_DECEL)
    return Conflicts(
        contact=touched.any(axis=1).astype(np.float64),
        ego_contact=touched[:, 0].astype(np.float64),
        near=is_near.any(axis=1).sum(axis=1).astype(np.float64),
        least_ttc=np.clip(ttc.min(axis=(1, 2)), 0.0, LONGEST_TTC_S),
        vehicle_seconds=valid.sum(axis=1) * runs.num_frames * batch.interval_s,
    )


def gamma_interval(weight: Values, happened: Values) -> tuple[float, float, float]:
    """A weighted rate and its 95 % interval, for events that are few.

    Args:
        weight: Of each simulation, mean 1, shape (simulation,).
        happened: 1 where it happened, same shape.

    Source:
        M. P. Fay, E. J. Feuer, Confidence intervals for directly standardized rates: a method based
        on the gamma distribution, Statistics in Medicine 16 (1997) 791-801.
    """
    number = len(weight)
    parts = weight * happened / number
    rate, variance = float(parts.sum()), float((parts**2).sum())
    most = float(weight.max()) / number
    low = variance / (2 * rate) * chi2.ppf(0.025, 2 * rate**2 / variance) if rate > 0 else 0.0
    more, spread = rate + most, variance + most**2
    return rate, float(low), float(spread / (2 * more) * chi2.ppf(0.975, 2 * more**2 / spread))
