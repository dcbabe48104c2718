"""What a specification says about traffic on a two-way road."""

from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from overtaking.knowledge import VEHICLE_CLASS_ORDER
from overtaking.model.scenario import MAX_VEHICLES
from overtaking.scenarios.complaints import complaint
from overtaking.scenarios.fields import (
    Colours,
    RoadRange,
    Section,
    Share,
    SpeedKmh,
    SpeedRange,
    TypeName,
    Types,
    ordered,
)

_PerHour = Annotated[float, Field(ge=10.0, le=1500.0)]
_Some = Annotated[int, Field(ge=1, le=MAX_VEHICLES - 2)]
_None = Annotated[int, Field(ge=0, le=MAX_VEHICLES - 2)]


class TwoWay(Section):
    """Section `[traffic]` with `mode = "two-way"`: a road with one lane in each direction.

    Vehicles arrive at random, in each direction at a rate of its own, and follow who is slower. The
    ego is one of those who go along the road. Others come until the ego cannot meet any more of
    them while it overtakes, or as many as there is room for.

    Attributes:
        mode: Says which kind of traffic this is.
        ahead: Vehicles ahead of the ego in its direction.
        behind: Vehicles behind it.
        oncoming: Most vehicles of the other direction.
        flow_vph: Vehicles per hour and direction, the mean of both, uniform.
        split: Share of the busier direction, uniform; either may be it.
        least_headway_s: Least time between two arrivals; the rest is exponential.
        held_up: Part of the egos that follow the vehicle ahead at the start, as far off as they
            like to; the others meet it as everybody meets others.
        types: Weights of the vehicle types.
        ego_types: Weights of the ego's; never a two-wheeler.
        semitrailers: Part of the trucks that pull one.
        free_speed_kmh: What drivers of a type want on a free road, on average.
        slow_share: Part of the vehicles, the ego not among them, that are slow for some reason.
        slow_speed_kmh: What these want.
        start_s_m: Where the ego may start.
        sight_m: How far the ego may see who comes; nearer than this no arrival is missing.
        colours: Weights of the colours.
    """

    mode: Literal["two-way"]
    ahead: _Some
    behind: _None
    oncoming: _None
    flow_vph: Annotated[tuple[_PerHour, _PerHour], AfterValidator(ordered)]
    split: Annotated[tuple[Share, Share], AfterValidator(ordered)] = (0.5, 0.5)
    least_headway_s: Annotated[float, Field(ge=0.5, le=5.0)] = 1.5
    held_up: Share = 0.0
    types: Types
    ego_types: Types
    semitrailers: Share = 0.0
    free_speed_kmh: dict[TypeName, SpeedKmh]
    slow_share: Share = 0.0
    slow_speed_kmh: SpeedRange = (30.0, 50.0)
    start_s_m: RoadRange
    sight_m: Annotated[float, Field(ge=100.0, le=2000.0)] = 1000.0
    colours: Colours

    @property
    def vehicles(self) -> tuple[int, int]:
        """Fewest and most vehicles: as many as there are slots."""
        slots = 1 + self.ahead + self.behind + self.oncoming
        return slots, slots

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.vehicles[1] > MAX_VEHICLES:
            raise complaint(
                f"at most {MAX_VEHICLES - 1} vehicles besides the ego",
                "lower ahead, behind or oncoming",
                key="oncoming",
                got=self.vehicles[1] - 1,
            )
        missing = {*self.types, *self.ego_types} - set(self.free_speed_kmh)
        if missing:
            name = min(missing, key=VEHICLE_CLASS_ORDER.index)
            raise complaint(
                "a speed for every type",
                f"add {name}",
                key="free_speed_kmh",
                got=f"none for {name}",
            )
        two_wheelers = [name for name in ("MC", "B") if self.ego_types.get(name, 0.0) > 0.0]
        if two_wheelers:
            raise complaint(
                "vehicles with four wheels",
                f"leave {' and '.join(two_wheelers)} out",
                key="ego_types",
                got=two_wheelers,
            )
        longest = 3600.0 / self.least_headway_s
        if 2.0 * self.flow_vph[1] * self.split[1] > 0.9 * longest:
            raise complaint(
                f"less than {0.9 * longest:g} vehicles per hour in the busier direction",
                "lower the flow or the split",
                key="flow_vph",
                got=f"{2.0 * self.flow_vph[1] * self.split[1]:g}",
            )
        return self
