"""Vehicles and the traits of their drivers, as inputs of a simulation.

`scenarios` draws them from distributions, and readers of recordings fill them in from a file. The
simulation step and the rules of the law read them. Arrays have a row per simulation and a column
per slot: a slot is the number of a vehicle within its simulation, slot 0 is the ego, the vehicle
under study, and a slot may be empty.

`FieldSpec` declares for each field a description, the unit, the smallest and the largest value.
`names` are the texts that tables show for the integers of an enumeration, and `needs` names the
properties that a recording may leave unknown; the column is then null. `with_field_docs` lists the
fields in the docstring of the class.

The paper is `pinto-2023` in docs/reference/sources.md, a study that this package reproduces.
"""

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
"""Slot of the ego. The other vehicles fill the slots from 1 on; empty slots come last."""


class VehicleKind(IntEnum):
    """Vehicle types, with the integers by which the paper encodes them."""

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
        """The paper's letters, such as `S` for a small car, for tables, profiles and TOML files."""
        return ("S", "M", "L", "V", "T", "MC", "B")[self]


# Names of the kinds in the section `kind_length` of `event_detection.toml`; all others are "car".
_LENGTH_KEYS = {
    VehicleKind.VAN: "van",
    VehicleKind.TRUCK: "truck",
    VehicleKind.MOTORCYCLE: "motorcycle",
    VehicleKind.BICYCLE: "bicycle",
}


def may_be_kind(kind: ArrayLike, length: ArrayLike) -> Mask:
    """Whether a length is possible for a vehicle of a kind.

    Recordings often state a wrong kind. Their readers treat it as unknown if the length rules it
    out.

    Args:
        kind: `VehicleKind`, any shape.
        length: Length, in a shape that broadcasts with the shape of `kind` [m].

    Returns:
        A mask of the common shape. The ranges are the lengths of real vehicles, widened by errors
        of measurement (`kind_length` in `event_detection.toml`).
    """
    keys = [_LENGTH_KEYS.get(vehicle_kind, "car") for vehicle_kind in VehicleKind]
    shortest, longest = (
        np.array([number(f"event_detection.kind_length.{end}.{key}") for key in keys])
        for end in ("shortest", "longest")
    )
    kinds, lengths = np.asarray(kind, np.intp), np.asarray(length, np.float64)
    return (lengths >= shortest[kinds]) & (lengths <= longest[kinds])


class Colour(IntEnum):
    """The paper's eight colours of vehicles. A colour sets the contrast of the body.

    From the contrast (`VehicleSpecs.contrast`) follows how far the vehicle is seen in fog.
    """

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
    """Bodies of all vehicles; every array has shape (simulation, vehicle).

    The ranges of the numbers are chosen: wider than real vehicles, to catch wrong units. Length,
    width and distances between axles share one limit. The values of empty slots have no effect, but
    have to be in range, because whole arrays are checked.

    Where vehicles are drawn, `two_wheeler` and `unlawful_presence` follow from the kind. Another
    simulator can state them without a kind.
    """

    AXES = ("simulation", "vehicle")

    valid: Annotated[
        Mask,
        FieldSpec(
            "Whether the slot holds a vehicle; in an empty slot all other values are meaningless"
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
    length: Annotated[F32, FieldSpec("From bumper to bumper", "m", 0.1, 60.0)]
    width: Annotated[F32, FieldSpec("Width of the body without mirrors", "m", 0.1, 60.0)]
    height: Annotated[
        F32, FieldSpec("Height above the road, with the rider of a two-wheeler", "m", 0.1, 6.0)
    ]
    mass: Annotated[F32, FieldSpec("Mass with driver and load", "kg", 20.0, 2e5)]
    wheelbase: Annotated[F32, FieldSpec("Distance between the axles", "m", 0.1, 60.0)]
    cg_to_front: Annotated[
        F32, FieldSpec("From the centre of gravity to the front axle", "m", 0.01, 60.0)
    ]
    cg_height: Annotated[F32, FieldSpec("Height of the centre of gravity", "m", 0.01, 6.0)]
    yaw_inertia: Annotated[
        F32, FieldSpec("Moment of inertia about the vertical axis", "kg m^2", 0.1, 1e8)
    ]
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
    rolling_resistance: Annotated[F32, FieldSpec("Rolling resistance over weight", "1", 0.0, 0.5)]
    max_speed: Annotated[
        F32, FieldSpec("Highest speed, by a governor or by design", "m/s", 0.1, 150.0)
    ]
    peak_decel: Annotated[
        F32, FieldSpec("Hardest braking on a dry road, positive", "m/s^2", 0.1, 30.0)
    ]
    wind_side_coefficient: Annotated[
        F32, FieldSpec("Side force over wind pressure and side area", "1", 0.0, 5.0)
    ]
    # Distance of the centre of wind pressure ahead of the middle between the axles, over the
    # wheelbase.
    wind_centre_ratio: Annotated[
        F32,
        FieldSpec("Centre of wind pressure ahead of mid-wheelbase, per wheelbase", "1", -2.0, 2.0),
    ]
    front_drive_share: Annotated[
        F32, FieldSpec("Share of the drive force at the front axle", "1", 0.0, 1.0)
    ]
    tyre_wear: Annotated[F32, FieldSpec("Tread wear, 0 new to 1 worn", "1", 0.0, 1.0)]
    track_width: Annotated[F32, FieldSpec("Distance between left and right wheels", "m", 0.01, 6.0)]
    spray_factor: Annotated[F32, FieldSpec("Spray thrown up, relative to a car", "1", 0.0, 100.0)]
    lamp_separation: Annotated[
        F32, FieldSpec("Distance between the rear lamps; diameter of a single lamp", "m", 0.01, 6.0)
    ]
    contrast: Annotated[
        F32,
        FieldSpec("Luminance contrast of its colour against the background by day", "1", 0.0, 1.0),
    ]
    two_wheeler: Annotated[Mask, FieldSpec("Whether it leans, and moves as a point mass")]
    unlawful_presence: Annotated[
        Mask, FieldSpec("Whether the law bans this kind of vehicle from motorways, as bicycles")
    ]

    def constraints(self) -> Iterable[Constraint]:
        """Conditions for `model.checks`.

        Slot 0 is filled, no empty slot comes before a filled one, and the centre of gravity lies
        ahead of the rear axle.
        """
        is_ego = np.arange(self.valid.shape[1]) == EGO_SLOT
        follows_empty_slot = np.zeros_like(self.valid)
        follows_empty_slot[:, 1:] = self.valid[:, 1:] & ~self.valid[:, :-1]
        is_invalid = follows_empty_slot | (is_ego & ~self.valid)
        expected = "True for the ego in slot 0, and no True after a False"
        yield Constraint("valid", expected, is_invalid, self.valid)
        is_behind_axle = self.cg_to_front >= self.wheelbase
        yield Constraint("cg_to_front", "less than the wheelbase", is_behind_axle, self.cg_to_front)


_UNLIMITED = 1e9
"""Largest value of traits that may be set beyond anything that happens on a road. With such a
`lane_change_threshold` a driver never changes lanes; with such a `patience` waiting changes
nothing."""


@with_field_docs
@dataclass(frozen=True, slots=True, kw_only=True)
class DriverTraits(Batch):
    """Parameters of the driver model; every array has shape (simulation, vehicle).

    Drivers follow a leader by the improved intelligent driver model, IIDM (Treiber, Kesting 2013),
    and change lanes by the model MOBIL (Kesting, Treiber, Helbing 2007);
    `docs/explanation/model.md` has the formulas. Most traits depend on a hidden driving style from
    careful to reckless, which is drawn and not stored.

    To add a trait, add a field here and use it in the simulation step. The file
    `knowledge/data/drivers.toml` describes populations, such as motorway drivers: add to each its
    two distributions of the trait, of careful and of reckless drivers. The ranges are chosen: wider
    than real drivers, to catch wrong units.
    """

    AXES = ("simulation", "vehicle")

    desired_speed: Annotated[
        F32,
        FieldSpec(
            "Desired speed on a free road in good weather, without a limit", "m/s", 0.0, 150.0
        ),
    ]
    time_gap: Annotated[
        F32, FieldSpec("Desired time gap behind a leader, bumper to bumper", "s", 0.0, 60.0)
    ]
    min_gap: Annotated[F32, FieldSpec("Desired gap at standstill", "m", 0.0, 100.0)]
    accel: Annotated[F32, FieldSpec("Everyday acceleration", "m/s^2", 0.01, 30.0)]
    decel: Annotated[F32, FieldSpec("Comfortable deceleration, positive", "m/s^2", 0.01, 30.0)]
    reaction_time: Annotated[
        F32, FieldSpec("Time from seeing to acting in good conditions", "s", 0.0, 10.0)
    ]
    caution: Annotated[
        F32,
        FieldSpec(
            "Degree to which the driver slows for short sight and low grip, 0 none to 1 full",
            "1",
            0.0,
            1.0,
        ),
    ]
    politeness: Annotated[
        F32,
        FieldSpec(
            "Weight of the acceleration that others lose by a lane change, in MOBIL", "1", 0.0, 10.0
        ),
    ]
    lane_change_threshold: Annotated[
        F32,
        FieldSpec(
            "Smallest advantage that a lane change has to bring, in MOBIL",
            "m/s^2",
            0.0,
            _UNLIMITED,
        ),
    ]
    keep_right_bias: Annotated[
        F32,
        FieldSpec(
            "Advantage attributed to the lane on the slow side, in MOBIL", "m/s^2", 0.0, 10.0
        ),
    ]
    safe_decel: Annotated[
        F32,
        FieldSpec(
            "Hardest braking that a lane change may impose on the new follower, positive",
            "m/s^2",
            0.01,
            30.0,
        ),
    ]
    lane_change_duration: Annotated[
        F32, FieldSpec("Time of a lane change from lane centre to lane centre", "s", 0.1, 100.0)
    ]
    min_speed_gain: Annotated[
        F32,
        FieldSpec(
            "Least excess of the desired over the leader's speed at which the driver overtakes",
            "m/s",
            0.0,
            _UNLIMITED,
        ),
    ]
    patience: Annotated[
        F32,
        FieldSpec(
            "Time of waiting in which the demands on gaps fall to 1/e", "s", 0.01, _UNLIMITED
        ),
    ]
    # For a driver that closes in on a leader and pulls out without following it first.
    pull_out_ttc: Annotated[
        F32,
        FieldSpec(
            "Time to collision at which the driver pulls out when it overtakes without following",
            "s",
            0.0,
            _UNLIMITED,
        ),
    ]
    gap_demand_factor: Annotated[
        F32,
        FieldSpec("Factor on the gaps and times demanded in the lane to enter", "1", 0.0, 100.0),
    ]
    return_time_gap: Annotated[
        F32,
        FieldSpec("Time gap to the overtaken vehicle at which the driver returns", "s", 0.0, 60.0),
    ]
    indicator_lead_time: Annotated[
        F32, FieldSpec("Time from switching the indicator on to moving sideways", "s", 0.0, 60.0)
    ]
    uses_indicator: Annotated[Mask, FieldSpec("Whether the indicator is used at all")]
    checks_blind_spot: Annotated[
        F32,
        FieldSpec(
            "Share of lane changes before which the driver looks over the shoulder", "1", 0.0, 1.0
        ),
    ]
    # At 1 the driver keeps the limit, at 0 it drives at its desired speed.
    speed_limit_compliance: Annotated[
        F32,
        FieldSpec(
            "Share of the desired speed above the limit that the driver gives up", "1", 0.0, 1.0
        ),
    ]
    passing_time_factor: Annotated[
        F32,
        FieldSpec(
            "Believed over true time of passing against oncoming traffic, below 1 too optimistic",
            "1",
            0.0,
            100.0,
        ),
    ]
    heeds_solid_lines: Annotated[
        Mask,
        FieldSpec("Whether the driver obeys solid lines between the directions when passing"),
    ]


TRAIT_RANGES: dict[str, FieldSpec] = {
    name: field.spec for name, field in batch_fields(DriverTraits).items() if field.spec.is_bounded
}
"""Declaration of each trait that is a number; flags are left out. Profiles and "what if" questions
check their values of traits against these ranges."""
