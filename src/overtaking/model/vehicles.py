"""Vehicles and the traits of their drivers."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from overtaking.core.arrays import F32, U8, Mask
from overtaking.knowledge.toml_reader import number
from overtaking.model.batch import Batch, Constraint, FieldSpec, batch_fields, with_field_docs

EGO_SLOT = 0
"""Slot of the ego. The other vehicles fill the slots from 1 on without gaps."""


class VehicleKind(IntEnum):
    """Vehicle types with the paper's encoding."""

    SMALL_CAR = 0
    MEDIUM_CAR = 1
    LARGE_CAR = 2
    VAN = 3
    TRUCK = 4
    MOTORCYCLE = 5
    BICYCLE = 6
    """A bicycle with its rider."""

    @property
    def code(self) -> str:
        """The paper's letters, `S` for a small car, which tables, profiles and TOML files have."""
        return ("S", "M", "L", "V", "T", "MC", "B")[self]


# Names of the lengths in `event_detection.toml`; the other kinds are cars.
_LENGTH_NAMES = {
    VehicleKind.VAN: "van",
    VehicleKind.TRUCK: "truck",
    VehicleKind.MOTORCYCLE: "motorcycle",
    VehicleKind.BICYCLE: "bicycle",
}


def may_be_kind(kind: ArrayLike, length: ArrayLike) -> Mask:
    """Whether a length is possible for a vehicle of a kind.

    Args:
        kind: `VehicleKind`, any shape.
        length: Length, in a shape that broadcasts with the shape of `kind` [m].

    Returns:
        A mask of the common shape, by the ranges of `kind_length` in `event_detection.toml`.
    """
    names = [_LENGTH_NAMES.get(vehicle_kind, "car") for vehicle_kind in VehicleKind]
    shortest, longest = (
        np.array([number(f"event_detection.kind_length.{end}.{name}") for name in names])
        for end in ("shortest", "longest")
    )
    kinds, lengths = np.asarray(kind, np.intp), np.asarray(length, np.float64)
    return (lengths >= shortest[kinds]) & (lengths <= longest[kinds])


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


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleSpecs(Batch):
    """Bodies of all vehicles; every array has shape (simulation, vehicle)."""

    AXES = ("simulation", "vehicle")

    valid: Annotated[
        Mask,
        FieldSpec(
            "Whether the slot holds a vehicle; an empty one has values in range without meaning"
        ),
    ]
    kind: Annotated[
        U8,
        FieldSpec(
            "Small, medium or large car, van, truck, motorcycle, bicycle",
            "1",
            0,
            max(VehicleKind),
            needs=["kinds"],
            names=[kind.code for kind in VehicleKind],
        ),
    ]
    colour: Annotated[
        U8,
        FieldSpec(
            "Colour of the body",
            "1",
            0,
            max(Colour),
            needs=["bodies"],
            names=[colour.name.lower() for colour in Colour],
        ),
    ]
    length: Annotated[F32, FieldSpec("Bumper to bumper", "m", 0.1, 60.0)]
    width: Annotated[F32, FieldSpec("Body without mirrors", "m", 0.1, 60.0)]
    height: Annotated[F32, FieldSpec("Height", "m", 0.1, 6.0)]
    mass: Annotated[F32, FieldSpec("With driver and load", "kg", 20.0, 2e5)]
    wheelbase: Annotated[F32, FieldSpec("Distance of the axles", "m", 0.1, 60.0)]
    cg_to_front: Annotated[F32, FieldSpec("Centre of gravity to front axle", "m", 0.01, 60.0)]
    cg_height: Annotated[F32, FieldSpec("Height of the centre of gravity", "m", 0.01, 6.0)]
    yaw_inertia: Annotated[F32, FieldSpec("About the vertical axis", "kg m^2", 0.1, 1e8)]
    front_stiffness: Annotated[
        F32, FieldSpec("Cornering stiffness of the front axle per axle load", "1/rad", 0.1, 100.0)
    ]
    rear_stiffness: Annotated[
        F32, FieldSpec("Cornering stiffness of the rear axle per axle load", "1/rad", 0.1, 100.0)
    ]
    launch_accel: Annotated[
        F32, FieldSpec("Largest acceleration at low speed", "m/s^2", 0.01, 30.0)
    ]
    power: Annotated[F32, FieldSpec("Power at the wheels", "W", 1.0, 1e7)]
    drag_area: Annotated[F32, FieldSpec("Drag coefficient times frontal area", "m^2", 0.0, 50.0)]
    side_area: Annotated[F32, FieldSpec("Side area exposed to wind", "m^2", 0.0, 200.0)]
    rolling_resistance: Annotated[F32, FieldSpec("Rolling force per weight", "1", 0.0, 0.5)]
    max_speed: Annotated[F32, FieldSpec("Governor or top speed", "m/s", 0.1, 150.0)]
    peak_decel: Annotated[
        F32, FieldSpec("Strongest braking that the brakes allow, positive", "m/s^2", 0.1, 30.0)
    ]
    wind_side_coefficient: Annotated[
        F32, FieldSpec("Side force coefficient on the side area", "1", 0.0, 5.0)
    ]
    wind_centre_ratio: Annotated[
        F32,
        FieldSpec("Centre of wind pressure ahead of mid-wheelbase, per wheelbase", "1", -2.0, 2.0),
    ]
    front_drive_share: Annotated[
        F32, FieldSpec("Share of the drive force at the front axle", "1", 0.0, 1.0)
    ]
    tyre_wear: Annotated[F32, FieldSpec("Tread wear, 0 new to 1 worn", "1", 0.0, 1.0)]
    track_width: Annotated[F32, FieldSpec("Distance of left and right wheels", "m", 0.01, 6.0)]
    spray_factor: Annotated[F32, FieldSpec("Spray behind it relative to a car", "1", 0.0, 100.0)]
    lamp_separation: Annotated[F32, FieldSpec("Distance of its rear lamps", "m", 0.01, 6.0)]
    contrast: Annotated[
        F32,
        FieldSpec("Luminance contrast of its colour against the background by day", "1", 0.0, 1.0),
    ]
    two_wheeler: Annotated[Mask, FieldSpec("Moves as a point mass")]
    unlawful_presence: Annotated[Mask, FieldSpec("May not be on a motorway at all")]

    def constraints(self) -> Iterable[Constraint]:
        """An ego in slot 0 and no empty slot before a filled one; centres between the axles."""
        is_ego = np.arange(self.valid.shape[1]) == EGO_SLOT
        follows_empty_slot = np.zeros_like(self.valid)
        follows_empty_slot[:, 1:] = self.valid[:, 1:] & ~self.valid[:, :-1]
        is_broken = follows_empty_slot | (is_ego & ~self.valid)
        expected = "True for the ego in slot 0, and no True after a False"
        yield Constraint("valid", expected, is_broken, self.valid)
        is_behind_axle = self.cg_to_front >= self.wheelbase
        yield Constraint("cg_to_front", "less than the wheelbase", is_behind_axle, self.cg_to_front)


_DISABLED = 1e9
"""Largest threshold: it disables the behaviour."""


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class DriverTraits(Batch):
    """Driver parameters; every array has shape (simulation, vehicle).

    Most traits depend on the driving style of the driver, from careful to reckless, which is drawn
    and not stored. A new trait is a field here, a line for each population and extreme in
    `knowledge/data/drivers.toml`, and its use in the step.
    """

    AXES = ("simulation", "vehicle")

    desired_speed: Annotated[
        F32,
        FieldSpec(
            "Desired speed on a free road in good weather, without a limit", "m/s", 0.0, 150.0
        ),
    ]
    time_gap: Annotated[F32, FieldSpec("Net time gap wanted behind a leader", "s", 0.0, 60.0)]
    min_gap: Annotated[F32, FieldSpec("Gap wanted at standstill", "m", 0.0, 100.0)]
    accel: Annotated[F32, FieldSpec("Everyday acceleration", "m/s^2", 0.01, 30.0)]
    decel: Annotated[F32, FieldSpec("Comfortable deceleration, positive", "m/s^2", 0.01, 30.0)]
    reaction_time: Annotated[
        F32, FieldSpec("From seeing to acting, good conditions", "s", 0.0, 10.0)
    ]
    caution: Annotated[
        F32,
        FieldSpec(
            "Degree to which speed follows sight and grip, 0 not at all to 1 fully", "1", 0.0, 1.0
        ),
    ]
    politeness: Annotated[
        F32, FieldSpec("Politeness of the lane-change model MOBIL", "1", 0.0, 10.0)
    ]
    lane_change_threshold: Annotated[
        F32, FieldSpec("Threshold of the lane-change model MOBIL", "m/s^2", 0.0, _DISABLED)
    ]
    keep_right_bias: Annotated[
        F32,
        FieldSpec("Bias of the lane-change model MOBIL towards the slow side", "m/s^2", 0.0, 10.0),
    ]
    safe_decel: Annotated[
        F32, FieldSpec("Largest braking imposed on a new follower, positive", "m/s^2", 0.01, 30.0)
    ]
    lane_change_duration: Annotated[
        F32, FieldSpec("Time from lane centre to lane centre", "s", 0.1, 100.0)
    ]
    min_speed_gain: Annotated[
        F32,
        FieldSpec(
            "Speed wanted above the leader's before overtaking is worth it", "m/s", 0.0, _DISABLED
        ),
    ]
    patience: Annotated[
        F32,
        FieldSpec("Time of waiting over which demands fall by a factor e", "s", 0.01, _DISABLED),
    ]
    pull_out_ttc: Annotated[
        F32,
        FieldSpec(
            "Time to collision with the leader at which a flying overtake pulls out",
            "s",
            0.0,
            _DISABLED,
        ),
    ]
    gap_demand_factor: Annotated[
        F32, FieldSpec("Factor on the gaps and times demanded of the target lane", "1", 0.0, 100.0)
    ]
    return_time_gap: Annotated[
        F32,
        FieldSpec("Net time gap left to the overtaken vehicle before returning", "s", 0.0, 60.0),
    ]
    indicator_lead_time: Annotated[
        F32, FieldSpec("How long the indicator is on before moving over", "s", 0.0, 60.0)
    ]
    uses_indicator: Annotated[Mask, FieldSpec("Whether the indicator is used at all")]
    checks_blind_spot: Annotated[
        F32,
        FieldSpec("Share of lane changes that a look over the shoulder precedes", "1", 0.0, 1.0),
    ]
    speed_limit_compliance: Annotated[
        F32, FieldSpec("Share of the speed above the limit that is given up", "1", 0.0, 1.0)
    ]
    passing_time_factor: Annotated[
        F32,
        FieldSpec(
            "Time that passing against oncoming traffic is believed to take, over what it takes",
            "1",
            0.0,
            100.0,
        ),
    ]
    heeds_solid_lines: Annotated[
        Mask,
        FieldSpec("Whether solid lines between the directions are heeded when passing"),
    ]


TRAIT_RANGES: dict[str, FieldSpec] = {
    name: field.spec for name, field in batch_fields(DriverTraits).items() if field.spec.is_bounded
}
"""Declaration of each number with a range, for code that makes drivers."""
