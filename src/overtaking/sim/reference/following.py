"""Car following: how hard to accelerate or brake behind a leader."""

import numpy as np

from overtaking.core.elementary import F32, clamp, exp, log, maximum, minimum
from overtaking.physics.constants import Constants
from overtaking.sim.reference.state import Fields


def wanted_gap(p: Fields, speed: F32, closing: F32, time_gap: F32) -> F32:
    """s* of the intelligent driver model [m]."""
    dynamic = speed * time_gap + speed * closing * p.interaction
    return p.min_gap + maximum(dynamic, np.float32(0.0))


def iidm(c: Constants, p: Fields, speed: F32, desired: F32, gap: F32, closing: F32) -> F32:
    """Acceleration of the improved intelligent driver model [m/s^2].

    Args:
        c: Constants.
        p: Driver parameters of shape (vehicle, simulation), or of one vehicle.
        speed: Own speed [m/s].
        desired: Desired speed, > 0 [m/s].
        gap: Gap to the leader [m].
        closing: Own speed minus the leader's [m/s].

    Source:
        Treiber and Kesting, Traffic Flow Dynamics (2013), section 11.3.7.
    """
    one = np.float32(1.0)
    z = wanted_gap(p, speed, closing, p.time_gap) / maximum(gap, c.smallest_gap)
    ratio = speed / desired
    square = ratio * ratio
    free_below = p.accel * (one - square * square)
    over = exp(-p.overspeed_exponent * log(maximum(ratio, one)))
    free_above = -p.decel * (one - over)
    interacting = p.accel * (one - z * z)
    steepness = minimum(
        np.float32(2.0) * p.accel / maximum(free_below, np.float32(1e-3)), np.float32(1000.0)
    )
    blended = free_below * (one - exp(steepness * log(clamp(z, np.float32(1e-6), one))))
    below = np.where(z >= one, interacting, blended)
    above = np.where(z >= one, free_above + interacting, free_above)
    return np.where(ratio <= one, below, above)


def forced_braking(
    c: Constants, p: Fields, speed: F32, gap: F32, closing: F32, time_gap: F32
) -> F32:
    """Acceleration, never positive, of someone following at the speed that they want [m/s^2].

    The IIDM at its desired speed: what a leader in this place does to the one behind it.
    """
    z = wanted_gap(p, speed, closing, time_gap) / maximum(gap, c.smallest_gap)
    return minimum(p.accel * (np.float32(1.0) - z * z), np.float32(0.0))
