"""Car following: how hard to accelerate or brake behind a leader."""

import numpy as np

from overtaking.core.arrays import F32
from overtaking.core.float32_math import clamp, exp, log, maximum, minimum
from overtaking.world.constants import ModelConstants
from overtaking.world.step_parameters import VehicleParameters

_STEADY = np.float32(0.0)


_MIN_STOPPING_TERM = np.float32(
    1e-3
)  # Keeps the quotient finite behind a standing leader [m^2/s^2].


# Near the desired speed the free acceleration vanishes and the exponent that blends it grows.
_MIN_FREE_ACCEL = np.float32(1e-3)  # [m/s^2]


_MAX_EXPONENT = np.float32(1000.0)


_MIN_GAP_RATIO = np.float32(1e-6)  # Of the wanted to the actual gap, for its logarithm.


def desired_gap(vehicle: VehicleParameters, speed: F32, closing: F32, time_gap: F32) -> F32:
    """s* of the intelligent driver model [m]."""
    dynamic = speed * time_gap + speed * closing * vehicle.idm_interaction
    return vehicle.min_gap + maximum(dynamic, np.float32(0.0))


def iidm_accel(
    constants: ModelConstants,
    vehicle: VehicleParameters,
    speed: F32,
    desired: F32,
    gap: F32,
    closing: F32,
    time_gap: F32 | None = None,
) -> F32:
    """Acceleration of the improved intelligent driver model [m/s^2].

    Args:
        constants: Constants.
        vehicle: Driver parameters of shape (vehicle, simulation), or of one vehicle.
        speed: Own speed [m/s].
        desired: Desired speed, > 0 [m/s].
        gap: Gap to the leader [m].
        closing: Own speed minus the leader's [m/s].
        time_gap: Time gap wanted; None for the driver's own [s].

    Source:
        Treiber and Kesting, Traffic Flow Dynamics (2013), section 11.3.7.
    """
    one = np.float32(1.0)
    wanted_time = vehicle.time_gap if time_gap is None else time_gap
    z = desired_gap(vehicle, speed, closing, wanted_time) / maximum(
        gap, constants.min_effective_gap
    )
    ratio = speed / desired
    square = ratio * ratio
    free_below = vehicle.accel * (one - square * square)
    over = exp(-vehicle.overspeed_exponent * log(maximum(ratio, one)))
    free_above = -vehicle.decel * (one - over)
    interacting = vehicle.accel * (one - z * z)
    steepness = minimum(
        np.float32(2.0) * vehicle.accel / maximum(free_below, _MIN_FREE_ACCEL), _MAX_EXPONENT
    )
    blended = free_below * (one - exp(steepness * log(clamp(z, _MIN_GAP_RATIO, one))))
    below = np.where(z >= one, interacting, blended)
    above = np.where(z >= one, free_above + interacting, free_above)
    return np.where(ratio <= one, below, above)


def cah_accel(
    constants: ModelConstants, speed: F32, gap: F32, closing: F32, leader_accel: F32 | np.float32
) -> F32:
    """Acceleration that just avoids a contact if the leader keeps braking as it does [m/s^2].

    Args:
        constants: Constants.
        speed: Own speed [m/s].
        gap: Gap to the leader [m].
        closing: Own speed minus the leader's [m/s].
        leader_accel: The leader's acceleration, never positive [m/s^2].

    Source:
        Constant-acceleration heuristic of Kesting, Treiber, Helbing 2010, equation 2.5.
    """
    zero = np.float32(0.0)
    room = np.float32(2.0) * maximum(gap, constants.min_effective_gap)
    leader_speed = maximum(speed - closing, zero)
    approach = maximum(closing, zero)
    moving = leader_accel - (approach * approach) / room
    way = leader_speed * leader_speed - room * leader_accel
    stopping = speed * speed * leader_accel / maximum(way, _MIN_STOPPING_TERM)
    stops_first = leader_speed * closing < -(room * leader_accel)
    return np.where(stops_first, stopping, moving)


def blend_iidm_with_cah(
    constants: ModelConstants, vehicle: VehicleParameters, wanted: F32, needed: F32
) -> F32:
    """A wanted acceleration without the alarm of car-following models at small gaps [m/s^2].

    Where the model asks for more braking than is needed, the excess is limited to about the
    comfortable deceleration, so that a cut-in by a faster vehicle causes no hard braking.

    Args:
        constants: Constants.
        vehicle: Driver parameters.
        wanted: What the following model asks for [m/s^2].
        needed: `needed_braking` [m/s^2].

    Source:
        Kesting, Treiber, Helbing 2010 (ACC model); Treiber and Kesting (2013), section 11.3.8.
    """
    one = np.float32(1.0)
    excess = minimum(wanted - needed, np.float32(0.0))
    e = exp(np.float32(2.0) * excess / vehicle.decel)
    softened = needed + vehicle.decel * ((e - one) / (e + one))
    # No vehicle brakes harder than gravity, however small the gap that alarms the model.
    alarmed = maximum(wanted, -constants.gravity)
    calm = (one - constants.coolness) * alarmed + constants.coolness * softened
    return np.where(wanted >= needed, wanted, calm)


def acc_accel(
    constants: ModelConstants,
    vehicle: VehicleParameters,
    speed: F32,
    desired: F32,
    gap: F32,
    closing: F32,
    time_gap: F32,
    leader_accel: F32 | np.float32 = _STEADY,
) -> F32:
    """Acceleration behind a leader: the IIDM, cooled, and heedful of a leader that brakes [m/s^2].

    The IIDM answers a gap and its change, so it begins to brake when a braking leader has become
    slower by what can be seen. A driver answers the stop lamps before that: with all that the
    leader's braking needs when near, with less the more room there is.

    Arguments as in `iidm` and `needed_braking`.
    """
    needed = cah_accel(constants, speed, gap, closing, leader_accel)
    cool = blend_iidm_with_cah(
        constants,
        vehicle,
        iidm_accel(constants, vehicle, speed, desired, gap, closing, time_gap),
        needed,
    )
    room = constants.stop_lamp_max_time_gap - gap / maximum(speed, constants.slip_speed)
    heed = clamp(
        room / (constants.stop_lamp_max_time_gap - constants.stop_lamp_full_time_gap),
        np.float32(0.0),
        np.float32(1.0),
    )
    return np.where(leader_accel < -constants.stop_lamp_decel, minimum(cool, heed * needed), cool)


def imposed_accel(
    constants: ModelConstants,
    vehicle: VehicleParameters,
    speed: F32,
    gap: F32,
    closing: F32,
    time_gap: F32,
) -> F32:
    """Acceleration, never positive, that a vehicle imposes on a follower at its speed [m/s^2].

    The plain model at its desired speed. The result is not damped: a small gap that a driver
    accepts for itself after a cut-in is too small to impose on another driver.

    Source:
        Kesting, Treiber, Helbing 2007, whose safety criterion is in the terms of the plain model.
    """
    z = desired_gap(vehicle, speed, closing, time_gap) / maximum(gap, constants.min_effective_gap)
    return minimum(vehicle.accel * (np.float32(1.0) - z * z), np.float32(0.0))
