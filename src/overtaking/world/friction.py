"""Peak friction of tyre and road against speed and water film."""

import numpy as np

from overtaking.core.arrays import F32
from overtaking.core.elementary import clamp, maximum, minimum
from overtaking.world.constants import Constants

_ENDLESS = np.float32(1e6)
"""Distance beyond which sight does not limit the speed; its square still fits float32 [m]."""


def speed_columns(c: Constants, speed: F32, wear: F32, truck: F32) -> list[F32]:
    """Friction at the four film knots for a speed, a tread and a type of tyre.

    Args:
        c: Constants.
        speed: [m/s], any shape.
        wear: Tread wear, 0 new to 1 worn.
        truck: 1 for truck tyres: less friction when dry, half of the loss by speed when wet.

    Returns:
        One array for each knot of the film.

    Source:
        Bosch Automotive Handbook, friction of tyres; linear between its knots, clamped outside.
    """
    v0, v1, v2 = c.friction_speeds
    low = clamp((speed - v0) / (v1 - v0), np.float32(0.0), np.float32(1.0))
    high = clamp((speed - v1) / (v2 - v1), np.float32(0.0), np.float32(1.0))
    columns = []
    for knot in range(4):
        rows = [
            c.friction_new[i][knot] + wear * (c.friction_worn[i][knot] - c.friction_new[i][knot])
            for i in range(3)
        ]
        change = low * (rows[1] - rows[0]) + high * (rows[2] - rows[1])
        if knot == 0:
            scale = np.float32(1.0) + truck * (c.truck_dry_factor - np.float32(1.0))
            columns.append(scale * (rows[0] + change))
        elif knot == 1:
            columns.append(rows[0] + change)
        else:
            kept = np.float32(1.0) + truck * (c.truck_loss_factor - np.float32(1.0))
            columns.append(rows[0] + kept * change)
    return columns


def at_film(c: Constants, columns: list[F32], film: F32) -> F32:
    """Friction on a film [mm], from the columns of `speed_columns`; never below the floor."""
    h0, h1, h2, h3 = c.friction_films
    a = clamp((film - h0) / (h1 - h0), np.float32(0.0), np.float32(1.0))
    b = clamp((film - h1) / (h2 - h1), np.float32(0.0), np.float32(1.0))
    d = clamp((film - h2) / (h3 - h2), np.float32(0.0), np.float32(1.0))
    value = columns[0] + a * (columns[1] - columns[0])
    value = value + b * (columns[2] - columns[1])
    value = value + d * (columns[3] - columns[2])
    return maximum(value, c.friction_floor)


def peak_friction(c: Constants, speed: F32, film: F32, wear: F32, truck: F32) -> F32:
    """Peak friction coefficient; arguments as in `speed_columns` and `at_film`."""
    return at_film(c, speed_columns(c, speed, wear, truck), film)


def stopping_distance(speed: F32, reaction_time: F32, decel: F32) -> F32:
    """Distance to a stop: v t + v^2 / (2 b) [m]."""
    return speed * reaction_time + speed * speed / (np.float32(2.0) * decel)


def stoppable_speed(distance: F32, reaction_time: F32, decel: F32) -> F32:
    """Speed from which one stops within `distance`, the inverse of `stopping_distance` [m/s]."""
    bt = decel * reaction_time
    return np.sqrt(bt * bt + np.float32(2.0) * decel * minimum(distance, _ENDLESS)) - bt
