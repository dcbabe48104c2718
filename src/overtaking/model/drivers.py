"""People: how each vehicle is driven, without the body around them."""

from dataclasses import dataclass, field, fields

from overtaking.core.elementary import F32, Mask
from overtaking.model.batch import Batch
from overtaking.model.values import Range, within

_NEVER = 1e9
"""Largest threshold, of a driver who never does what it is about."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drivers(Batch):
    """Driver parameters; every array has shape (simulation, vehicle).

    What is drawn is one temper for each driver, from careful to reckless, on which most parameters
    depend; it is not kept. `knowledge/data/drivers.toml` has the populations.

    Attributes:
        desired_speed: Speed wanted on a free road in good weather [m/s].
        time_gap: Net time gap wanted behind a leader [s].
        min_gap: Gap wanted at standstill [m].
        accel: Everyday acceleration [m/s^2].
        decel: Comfortable deceleration, positive [m/s^2].
        reaction_time: From seeing to acting, good conditions [s].
        caution: How far speed follows sight and grip, 0 not at all to 1 fully [1].
        politeness: MOBIL's p [1].
        lane_change_threshold: MOBIL's threshold [m/s^2].
        right_bias: MOBIL's bias towards the slow side [m/s^2].
        safe_decel: Largest braking imposed on a new follower, positive [m/s^2].
        lane_change_duration: Time from lane centre to lane centre [s].
        passing_gain: Speed wanted above the leader's before overtaking is worth it [m/s].
        patience: Time of waiting over which demands fall by a factor e [s].
        pull_out_time: Time to collision with the leader at which a flying overtake pulls out [s].
        gap_acceptance: Factor on the gaps and times demanded of the target lane [1].
        return_time_gap: Net time gap left to the overtaken vehicle before returning [s].
        signal_time: How long the indicator is on before moving over [s].
        uses_indicator: Whether it is used at all.
        checks_blind_spot: Whether what drives alongside is looked for.
        limit_respect: Share of the speed above the limit that is given up, 0 to 1 [1].
    """

    AXES = ("simulation", "vehicle")

    desired_speed: F32 = field(metadata=within(0.0, 150.0, "m/s"))
    time_gap: F32 = field(metadata=within(0.0, 60.0, "s"))
    min_gap: F32 = field(metadata=within(0.0, 100.0, "m"))
    accel: F32 = field(metadata=within(0.01, 30.0, "m/s^2"))
    decel: F32 = field(metadata=within(0.01, 30.0, "m/s^2"))
    reaction_time: F32 = field(metadata=within(0.0, 10.0, "s"))
    caution: F32 = field(metadata=within(0.0, 1.0))
    politeness: F32 = field(metadata=within(0.0, 10.0))
    lane_change_threshold: F32 = field(metadata=within(0.0, _NEVER, "m/s^2"))
    right_bias: F32 = field(metadata=within(0.0, 10.0, "m/s^2"))
    safe_decel: F32 = field(metadata=within(0.01, 30.0, "m/s^2"))
    lane_change_duration: F32 = field(metadata=within(0.1, 100.0, "s"))
    passing_gain: F32 = field(metadata=within(0.0, _NEVER, "m/s"))
    patience: F32 = field(metadata=within(0.01, _NEVER, "s"))
    pull_out_time: F32 = field(metadata=within(0.0, _NEVER, "s"))
    gap_acceptance: F32 = field(metadata=within(0.0, 100.0))
    return_time_gap: F32 = field(metadata=within(0.0, 60.0, "s"))
    signal_time: F32 = field(metadata=within(0.0, 60.0, "s"))
    uses_indicator: Mask
    checks_blind_spot: Mask
    limit_respect: F32 = field(metadata=within(0.0, 1.0))


DRIVER_RANGES: dict[str, Range] = {
    one.name: one.metadata["range"] for one in fields(Drivers) if "range" in one.metadata
}
"""What each number may be, for those who make drivers."""
