"""Pedals and front wheels of vehicles that a program drives from outside, such as CARLA's clients.

The engine and the reference move such vehicles alike: `sim.pedal_driving` and
`sim.reference.pedal_driving`.
"""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import F32

WHEEL_RATE = np.float32(6.0)
"""How fast the front wheels turn [rad/s]; CARLA's follow the control almost at once."""


@dataclass(frozen=True, slots=True)
class PedalControls:
    """Positions of the pedals and the steering of all vehicles; arrays of shape (vehicle,).

    Attributes:
        throttle: Share of the engine force that is available at the present speed, 0 to 1.
        brake: Share of the full braking force, 0 to 1.
        wheel_angle: Requested angle of the front wheels, anticlockwise [rad].
    """

    throttle: F32
    brake: F32
    wheel_angle: F32
