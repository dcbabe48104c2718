"""What a specification says about traffic as it is met, and about an enriched draw."""

from collections.abc import Callable
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from overtaking.scenarios.complaints import advice, complaint
from overtaking.scenarios.fields import (
    Colours,
    Count,
    Density,
    Factor,
    LaneNumber,
    RoadRange,
    Section,
    Share,
    SpeedKmh,
    TypeName,
    Types,
    different,
    ordered,
)

BENT = (
    "rains",
    "rain",
    "foggy",
    "fog",
    "wind",
    "puddles",
    "clouds",
    "sun",
    "sun_direction",
    "density",
    "flow",
    "start",
    "held_up",
    "ego_temper",
    "ego_heeds_lines",
    "others_temper",
)
"""What a proposal may draw differently. `rains` and `foggy` decide whether there is any: they are
small where there is. Of two-way roads are `flow`, `start` (where the ego starts), `held_up` (small
where it is) and `ego_heeds_lines` (large where it heeds none). `others_temper` is bent for each of
the others on its own."""

SHIFTED = tuple(
    f"ego_{trait}"
    for trait in (
        "time_gap",
        "reaction_time",
        "lane_change_duration",
        "passing_gain",
        "patience",
        "pull_out_time",
        "gap_acceptance",
        "return_time_gap",
        "signal_time",
        "cruise_factor",
        "need_factor",
    )
)
"""Traits of the ego that a proposal may draw differently, all of them normal or lognormal."""


_LEAST_PART = 0.001


def _rising(part: tuple[float, float]) -> tuple[float, float]:
    if part[1] - part[0] < _LEAST_PART:
        expected = f"a lower end below the upper one, by {_LEAST_PART:g} or more"
        raise complaint(expected, "swap them or move them apart", got=list(part))
    return part


_Power = Annotated[float, Field(ge=0.01, le=20.0)]
_Part = Annotated[tuple[Share, Share], AfterValidator(_rising)]
_Shift = Annotated[float, Field(ge=-3.0, le=3.0)]
_Temper = Annotated[float, Field(gt=0.0, le=1.0)]
DensityRange = Annotated[tuple[Density, Density], AfterValidator(ordered)]


class FlowLane(Section):
    """A lane of section `[traffic]` with `mode = "flow"`.

    Attributes:
        density: Its density over the mean of all lanes.
        types: Weights of the vehicle types in it.
        speed_kmh: What its traffic drives at on average; the ends of the traffic are kept out of
            the ego's sight by it.
        wish: Factor on the speed that its drivers want, over that of all drivers of their type.
    """

    density: Factor
    types: Types
    speed_kmh: SpeedKmh
    wish: Annotated[float, Field(gt=0.5, lt=2.0)] = 1.0


class Flow(Section):
    """Section `[traffic]` with `mode = "flow"`: traffic of which the ego is one.

    Attributes:
        mode: Says which of the two kinds of traffic this is.
        vehicles: Fewest and most vehicles; there are as many as it takes to keep the ends of the
            traffic out of the ego's sight.
        density_per_km_lane: Vehicles on a kilometre of a lane, the mean of the lanes, uniform.
        lanes: What drives in each lane, the slowest first; as many as the road has.
        free_speed_kmh: What drivers of a type want on a free road, on average.
        spacing_sigma: Spread of the logarithm of the free part of the distances.
        colours: Weights of the colours.
        ego_lanes: Lanes that the ego may start in, as likely as their densities say.
        sight_m: How far the ego looks back and ahead; nearer than this it never sees an end.
    """

    mode: Literal["flow"]
    vehicles: Annotated[tuple[Count, Count], AfterValidator(ordered)]
    density_per_km_lane: DensityRange
    lanes: Annotated[tuple[FlowLane, ...], Field(min_length=2)]
    free_speed_kmh: dict[TypeName, SpeedKmh]
    spacing_sigma: Annotated[float, Field(gt=0.0, le=2.0)]
    colours: Colours
    ego_lanes: Annotated[tuple[LaneNumber, ...], Field(min_length=1), AfterValidator(different)]
    sight_m: RoadRange

    @model_validator(mode="after")
    def _complete(self) -> Self:
        missing = {name for lane in self.lanes for name in lane.types} - set(self.free_speed_kmh)
        if missing:
            name = min(missing)
            raise complaint(
                "a speed for every type in traffic.lanes",
                f"add {name}",
                key="free_speed_kmh",
                got=f"none for {name}",
            )
        if max(self.ego_lanes) > len(self.lanes) - 2:
            raise complaint(
                f"lanes with one on their faster side, 0 to {len(self.lanes) - 2}",
                "leave out the fastest lane",
                key="ego_lanes",
                got=list(self.ego_lanes),
            )
        return self


def _is_own(name: str) -> bool:
    """Whether a quantity belongs to the ego."""
    return name.startswith("ego_")


def _known(of: tuple[str, ...]) -> Callable[[dict[str, Any]], dict[str, Any]]:
    def refuse_others(given: dict[str, Any]) -> dict[str, Any]:
        for name in given:
            if name not in of:
                raise complaint("a known quantity", advice(name, of), got=name)
        return given

    return refuse_others


class Component(Section):
    """Entry of section `[[proposal]]`: draws a part of the simulations from elsewhere.

    A bent quantity is made from u^power in place of u, uniform in (0, 1): a power below one favours
    its upper end, a power above one its lower. One that is drawn from a part of (0, 1) lies nowhere
    else. A shifted one is made from z + shift in place of z, normal: it lies so many standard
    deviations higher.

    Attributes:
        name: What the simulations of this part are for.
        share: Part of the simulations that is drawn so.
        powers: Quantity of `BENT` to power.
        parts: Quantity of `BENT` to the part of (0, 1) that it is drawn from.
        shifts: Trait of the ego, of `SHIFTED`, to standard deviations.
        tempers: The share is divided equally among copies of the component, one for each temper t:
            its powers are raised to t and its shifts multiplied by it, so a small t bends little.
            Parts stay.
    """

    name: Annotated[str, Field(min_length=1, max_length=40)]
    share: Annotated[Share, Field(gt=0.0, lt=1.0)]
    powers: Annotated[dict[str, _Power], AfterValidator(_known(BENT))] = Field(default_factory=dict)
    parts: Annotated[dict[str, _Part], AfterValidator(_known(BENT))] = Field(default_factory=dict)
    shifts: Annotated[dict[str, _Shift], AfterValidator(_known(SHIFTED))] = Field(
        default_factory=dict
    )
    tempers: Annotated[tuple[_Temper, ...], Field(min_length=1)] = (1.0,)

    def tempered(self) -> tuple[Self, ...]:
        """The component at each of its tempers, with equal parts of its share."""
        return tuple(
            self.model_copy(
                update={
                    "share": self.share / len(self.tempers),
                    "powers": {name: power**t for name, power in self.powers.items()},
                    "shifts": {name: t * shift for name, shift in self.shifts.items()},
                    "tempers": (1.0,),
                }
            )
            for t in self.tempers
        )

    def of_the_scene(self) -> Self:
        """The component without what it bends of the ego: its marginal of the scene and the others.

        A component draws each quantity by itself, so leaving some out integrates over them.
        """
        kept = {
            field: {name: one for name, one in getattr(self, field).items() if not _is_own(name)}
            for field in ("powers", "parts", "shifts")
        }
        return self.model_copy(update=kept)

    @model_validator(mode="after")
    def _once(self) -> Self:
        twice = set(self.powers) & set(self.parts)
        if twice:
            name = min(twice)
            raise complaint(
                "a power or a part for a quantity", "leave one out", key=f"parts.{name}", got="both"
            )
        return self


def _leave_some(components: tuple[Component, ...]) -> tuple[Component, ...]:
    total = sum(one.share for one in components)
    if not total < 1.0:
        raise complaint(
            "shares that leave some simulations as they are met, a sum below 1",
            "lower a share",
            key="share",
            got=f"{total:g}",
        )
    return components


Proposal = Annotated[tuple[Component, ...], Field(min_length=1), AfterValidator(_leave_some)]
"""What is drawn differently; the rest of the simulations is drawn as it is met, which bounds every
weight by 1 / (1 - the sum of the shares)."""
