"""People: how each vehicle is driven, without the body around them."""

from dataclasses import dataclass
from typing import Annotated

from overtaking.core.arrays import F32, Mask
from overtaking.model.batch import Batch, FieldSpec, batch_fields
from overtaking.model.values import documented, meant, within

_NEVER = 1e9
"""Largest threshold: it disables the behaviour."""


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Drivers(Batch):
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
        F32, within(0.0, _NEVER, "m/s^2", "Threshold of the lane-change model MOBIL")
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
        within(0.0, _NEVER, "m/s", "Speed wanted above the leader's before overtaking is worth it"),
    ]
    patience: Annotated[
        F32, within(0.01, _NEVER, "s", "Time of waiting over which demands fall by a factor e")
    ]
    pull_out_time: Annotated[
        F32,
        within(
            0.0,
            _NEVER,
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


DRIVER_RANGES: dict[str, FieldSpec] = {
    name: field.spec for name, field in batch_fields(Drivers).items() if field.spec.is_bounded
}
"""Declaration of each number with a range, for code that makes drivers."""
