"""Bodies: what each vehicle is, without the person in it."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask
from overtaking.model.batch import Batch, Constraint
from overtaking.model.values import within


class Role(IntEnum):
    """Vehicle slots with a meaning; the others hold the rest of the traffic, packed from slot 1."""

    EGO = 0


class VehicleKind(IntEnum):
    """Vehicle types with the paper's encoding."""

    S = 0  # small car
    M = 1  # medium car
    L = 2  # large car
    V = 3  # van
    T = 4  # rigid truck
    MC = 5  # motorcycle
    B = 6  # bicycle with rider


class Colour(IntEnum):
    """The paper's eight colours; they change the contrast in fog."""

    YELLOW = 0
    BLUE = 1
    RED = 2
    GREEN = 3
    ORANGE = 4
    GREY = 5
    WHITE = 6
    BROWN = 7


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleSpecs(Batch):
    """Bodies of all vehicles; every array has shape (simulation, vehicle).

    Attributes:
        valid: Whether the slot holds a vehicle; the values of an empty one are in their ranges, and
            mean nothing.
        kind: `VehicleKind`.
        colour: `Colour`.
        length: Bumper to bumper [m].
        width: Body without mirrors [m].
        height: [m]; what is taller than a car hides what is ahead of it.
        mass: With driver and load [kg].
        wheelbase: Distance of the axles [m].
        cg_to_front: Centre of gravity to front axle [m].
        cg_height: Height of the centre of gravity [m].
        yaw_inertia: About the vertical axis [kg m^2].
        front_stiffness: Cornering stiffness of the front axle per axle load [1/rad].
        rear_stiffness: The same of the rear axle [1/rad].
        launch_accel: Largest acceleration at low speed [m/s^2].
        power: Power at the wheels [W].
        drag_area: Drag coefficient times frontal area [m^2].
        side_area: Side area exposed to wind [m^2].
        rolling_resistance: Rolling force per weight [1].
        max_speed: Governor or top speed [m/s].
        peak_decel: Strongest braking that the brakes allow [m/s^2].
        wind_side_coefficient: Side force coefficient on the side area [1].
        wind_centre_ratio: Centre of wind pressure ahead of mid-wheelbase, per wheelbase [1].
        front_drive_share: Share of the drive force at the front axle, 0 or 1.
        tyre_wear: Tread wear, 0 new (8 mm) to 1 worn (1.6 mm).
        track_width: Distance of left and right wheels [m].
        spray_factor: Spray behind it relative to a car [1].
        lamp_separation: Distance of its rear lamps, what looms at night [m].
        contrast: Luminance contrast of its colour against the background by day [1].
        two_wheeler: Moves as a point mass.
        unlawful_presence: May not be on a motorway at all.
    """

    AXES = ("simulation", "vehicle")

    valid: Mask
    kind: NDArray[np.uint8] = field(metadata=within(0, max(VehicleKind)))
    colour: NDArray[np.uint8] = field(metadata=within(0, max(Colour)))
    length: F32 = field(metadata=within(0.1, 60.0, "m"))
    width: F32 = field(metadata=within(0.1, 60.0, "m"))
    height: F32 = field(metadata=within(0.1, 6.0, "m"))
    mass: F32 = field(metadata=within(20.0, 2e5, "kg"))
    wheelbase: F32 = field(metadata=within(0.1, 60.0, "m"))
    cg_to_front: F32 = field(metadata=within(0.01, 60.0, "m"))
    cg_height: F32 = field(metadata=within(0.01, 6.0, "m"))
    yaw_inertia: F32 = field(metadata=within(0.1, 1e8, "kg m^2"))
    front_stiffness: F32 = field(metadata=within(0.1, 100.0, "1/rad"))
    rear_stiffness: F32 = field(metadata=within(0.1, 100.0, "1/rad"))
    launch_accel: F32 = field(metadata=within(0.01, 30.0, "m/s^2"))
    power: F32 = field(metadata=within(1.0, 1e7, "W"))
    drag_area: F32 = field(metadata=within(0.0, 50.0, "m^2"))
    side_area: F32 = field(metadata=within(0.0, 200.0, "m^2"))
    rolling_resistance: F32 = field(metadata=within(0.0, 0.5))
    max_speed: F32 = field(metadata=within(0.1, 150.0, "m/s"))
    peak_decel: F32 = field(metadata=within(0.1, 30.0, "m/s^2"))
    wind_side_coefficient: F32 = field(metadata=within(0.0, 5.0))
    wind_centre_ratio: F32 = field(metadata=within(-2.0, 2.0))
    front_drive_share: F32 = field(metadata=within(0.0, 1.0))
    tyre_wear: F32 = field(metadata=within(0.0, 1.0))
    track_width: F32 = field(metadata=within(0.01, 6.0, "m"))
    spray_factor: F32 = field(metadata=within(0.0, 100.0))
    lamp_separation: F32 = field(metadata=within(0.01, 6.0, "m"))
    contrast: F32 = field(metadata=within(0.0, 1.0))
    two_wheeler: Mask
    unlawful_presence: Mask

    def constraints(self) -> Iterable[Constraint]:
        """An ego in slot 0 and no empty slot before a filled one; centres between the axles."""
        filled = self.valid
        is_ego = np.arange(filled.shape[1]) == Role.EGO
        after_hole = np.zeros_like(filled)
        after_hole[:, 1:] = filled[:, 1:] & ~filled[:, :-1]
        expected = "True for the ego in slot 0, and no True after a False"
        yield Constraint("valid", expected, after_hole | (is_ego & ~filled), filled)
        beyond = self.cg_to_front >= self.wheelbase
        yield Constraint("cg_to_front", "less than the wheelbase", beyond, self.cg_to_front)
