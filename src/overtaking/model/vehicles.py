"""Vehicles and the traits of their drivers."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from overtaking.core.arrays import F32, U8, Mask
from overtaking.knowledge.toml_reader import number
from overtaking.model.batch import (
    Batch,
    Constraint,
    FieldSpec,
    batch_fields,
    documented,
    meant,
    within,
)


class Role(IntEnum):
    """Vehicle slots with a meaning; the others hold the rest of the traffic, packed from slot 1."""

    EGO = 0


class VehicleKind(IntEnum):
    """Vehicle types with the paper's encoding."""

    S = 0  # small car
    M = 1  # medium car
    L = 2  # large car
    V = 3  # van
    T = 4  # truck
    MC = 5  # motorcycle
    B = 6  # bicycle with rider


# Names of the lengths in `event_detection.toml`; the other kinds are cars.
_LENGTH_NAMES = {
    VehicleKind.V: "van",
    VehicleKind.T: "truck",
    VehicleKind.MC: "motorcycle",
    VehicleKind.B: "bicycle",
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
        np.array([number("event_detection.toml", f"kind_length.{end}.{name}") for name in names])
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


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleSpecs(Batch):
    """Bodies of all vehicles; every array has shape (simulation, vehicle)."""

    AXES = ("simulation", "vehicle")

    valid: Annotated[
        Mask,
        meant("Whether the slot holds a vehicle; an empty one has values in range without meaning"),
    ]
    kind: Annotated[U8, within(0, max(VehicleKind), "", "`VehicleKind`")]
    colour: Annotated[U8, within(0, max(Colour), "", "`Paint`")]
    length: Annotated[F32, within(0.1, 60.0, "m", "Bumper to bumper")]
    width: Annotated[F32, within(0.1, 60.0, "m", "Body without mirrors")]
    height: Annotated[F32, within(0.1, 6.0, "m", "Height")]
    mass: Annotated[F32, within(20.0, 2e5, "kg", "With driver and load")]
    wheelbase: Annotated[F32, within(0.1, 60.0, "m", "Distance of the axles")]
    cg_to_front: Annotated[F32, within(0.01, 60.0, "m", "Centre of gravity to front axle")]
    cg_height: Annotated[F32, within(0.01, 6.0, "m", "Height of the centre of gravity")]
    yaw_inertia: Annotated[F32, within(0.1, 1e8, "kg m^2", "About the vertical axis")]
    front_stiffness: Annotated[
        F32, within(0.1, 100.0, "1/rad", "Cornering stiffness of the front axle per axle load")
    ]
    rear_stiffness: Annotated[
        F32, within(0.1, 100.0, "1/rad", "Cornering stiffness of the rear axle per axle load")
    ]
    launch_accel: Annotated[F32, within(0.01, 30.0, "m/s^2", "Largest acceleration at low speed")]
    power: Annotated[F32, within(1.0, 1e7, "W", "Power at the wheels")]
    drag_area: Annotated[F32, within(0.0, 50.0, "m^2", "Drag coefficient times frontal area")]
    side_area: Annotated[F32, within(0.0, 200.0, "m^2", "Side area exposed to wind")]
    rolling_resistance: Annotated[F32, within(0.0, 0.5, "", "Rolling force per weight")]
    max_speed: Annotated[F32, within(0.1, 150.0, "m/s", "Governor or top speed")]
    peak_decel: Annotated[
        F32, within(0.1, 30.0, "m/s^2", "Strongest braking that the brakes allow, positive")
    ]
    wind_side_coefficient: Annotated[
        F32, within(0.0, 5.0, "", "Side force coefficient on the side area")
    ]
    wind_centre_ratio: Annotated[
        F32, within(-2.0, 2.0, "", "Centre of wind pressure ahead of mid-wheelbase, per wheelbase")
    ]
    front_drive_share: Annotated[
        F32, within(0.0, 1.0, "", "Share of the drive force at the front axle")
    ]
    tyre_wear: Annotated[F32, within(0.0, 1.0, "", "Tread wear, 0 new to 1 worn")]
    track_width: Annotated[F32, within(0.01, 6.0, "m", "Distance of left and right wheels")]
    spray_factor: Annotated[F32, within(0.0, 100.0, "", "Spray behind it relative to a car")]
    lamp_separation: Annotated[F32, within(0.01, 6.0, "m", "Distance of its rear lamps")]
    contrast: Annotated[
        F32, within(0.0, 1.0, "", "Luminance contrast of its colour against the background by day")
    ]
    two_wheeler: Annotated[Mask, meant("Moves as a point mass")]
    unlawful_presence: Annotated[Mask, meant("May not be on a motorway at all")]

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


_DISABLED = 1e9
"""Largest threshold: it disables the behaviour."""


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class DriverTraits(Batch):
    """Driver parameters; every array has shape (simulation, vehicle).

    Most parameters depend on a hidden temper of the driver, from careful to reckless. It is drawn
    and not kept. A new trait is a field here, a line for each population and extreme in
    `knowledge/data/drivers.toml`, and its use in the step.
    """

    AXES = ("simulation", "vehicle")

    desired_speed: Annotated[
        F32,
        within(0.0, 150.0, "m/s", "Speed wanted on a free road in good weather, without a limit"),
    ]
    time_gap: Annotated[F32, within(0.0, 60.0, "s", "Net time gap wanted behind a leader")]
    min_gap: Annotated[F32, within(0.0, 100.0, "m", "Gap wanted at standstill")]
    accel: Annotated[F32, within(0.01, 30.0, "m/s^2", "Everyday acceleration")]
    decel: Annotated[F32, within(0.01, 30.0, "m/s^2", "Comfortable deceleration, positive")]
    reaction_time: Annotated[F32, within(0.0, 10.0, "s", "From seeing to acting, good conditions")]
    caution: Annotated[
        F32, within(0.0, 1.0, "", "How far speed follows sight and grip, 0 not at all to 1 fully")
    ]
    politeness: Annotated[F32, within(0.0, 10.0, "", "Politeness of the lane-change model MOBIL")]
    lane_change_threshold: Annotated[
        F32, within(0.0, _DISABLED, "m/s^2", "Threshold of the lane-change model MOBIL")
    ]
    right_bias: Annotated[
        F32, within(0.0, 10.0, "m/s^2", "Bias of the lane-change model MOBIL towards the slow side")
    ]
    safe_decel: Annotated[
        F32, within(0.01, 30.0, "m/s^2", "Largest braking imposed on a new follower, positive")
    ]
    lane_change_duration: Annotated[
        F32, within(0.1, 100.0, "s", "Time from lane centre to lane centre")
    ]
    passing_gain: Annotated[
        F32,
        within(
            0.0, _DISABLED, "m/s", "Speed wanted above the leader's before overtaking is worth it"
        ),
    ]
    patience: Annotated[
        F32, within(0.01, _DISABLED, "s", "Time of waiting over which demands fall by a factor e")
    ]
    pull_out_time: Annotated[
        F32,
        within(
            0.0,
            _DISABLED,
            "s",
            "Time to collision with the leader at which a flying overtake pulls out",
        ),
    ]
    gap_acceptance: Annotated[
        F32, within(0.0, 100.0, "", "Factor on the gaps and times demanded of the target lane")
    ]
    return_time_gap: Annotated[
        F32, within(0.0, 60.0, "s", "Net time gap left to the overtaken vehicle before returning")
    ]
    signal_time: Annotated[
        F32, within(0.0, 60.0, "s", "How long the indicator is on before moving over")
    ]
    uses_indicator: Annotated[Mask, meant("Whether the indicator is used at all")]
    checks_blind_spot: Annotated[
        F32, within(0.0, 1.0, "", "Share of lane changes that a look over the shoulder precedes")
    ]
    limit_respect: Annotated[
        F32, within(0.0, 1.0, "", "Share of the speed above the limit that is given up")
    ]
    need_factor: Annotated[
        F32,
        within(
            0.0,
            100.0,
            "",
            "Time that passing against oncoming traffic is believed to take, over what it takes",
            since=5,
        ),
    ]
    heeds_lines: Annotated[
        Mask, meant("Whether solid lines between the directions are heeded when passing", since=5)
    ]


TRAIT_RANGES: dict[str, FieldSpec] = {
    name: field.spec for name, field in batch_fields(DriverTraits).items() if field.spec.is_bounded
}
"""Declaration of each number with a range, for code that makes drivers."""
