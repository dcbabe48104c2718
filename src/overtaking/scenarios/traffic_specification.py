"""Section `[traffic]` of a specification: placed vehicles, flow, two-way traffic."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from overtaking.knowledge.toml_reader import number
from overtaking.knowledge.vehicle_classes import VEHICLE_CLASS_NAMES
from overtaking.model.scenario import MAX_VEHICLES
from overtaking.scenarios.specification_values import (
    Colours,
    Count,
    Density,
    Factor,
    LaneNumber,
    RoadRange,
    Section,
    Share,
    SpeedKmh,
    SpeedRange,
    TypeName,
    Types,
    WorldRange,
    check_ascending,
    check_distinct,
    check_four_wheels,
    specification_error,
)


class PlacedTraffic(Section):
    """Section `[traffic]`.

    Attributes:
        vehicles: Fewest and most vehicles, the ego among them, each number equally likely.
        types: Weights of the vehicle types of everyone but the ego.
        ego_types: Weights of the ego's vehicle types; never a two-wheeler.
        colours: Weights of the colours.
        speed_kmh: Range of the speeds that vehicles come with.
        leader_speed_kmh: The same for the vehicle ahead of the ego ...
        leader_speed_exponent: ... which is low + (high - low) u^exponent with u uniform.
        spawn_x_m: World x between which the centres of the vehicles start, or
        spawn_s_m: position along the road between which they start; exactly one of the two.
        ego_lanes: Lanes that the ego may start in, 0 the slowest; all but the fastest if not given.
    """

    vehicles: Annotated[tuple[Count, Count], AfterValidator(check_ascending)]
    types: Types
    ego_types: Annotated[Types, AfterValidator(check_four_wheels)]
    colours: Colours
    speed_kmh: SpeedRange
    leader_speed_kmh: SpeedRange
    leader_speed_exponent: Annotated[float, Field(gt=0.0, le=20.0)] = 1.0
    spawn_x_m: WorldRange | None = None
    spawn_s_m: RoadRange | None = None
    ego_lanes: (
        Annotated[tuple[LaneNumber, ...], Field(min_length=1), AfterValidator(check_distinct)]
        | None
    ) = None

    @model_validator(mode="after")
    def _one_zone(self) -> Self:
        zones = [zone for zone in (self.spawn_x_m, self.spawn_s_m) if zone is not None]
        if len(zones) != 1:
            raise specification_error(
                "exactly one of spawn_x_m and spawn_s_m",
                "give the zone in which vehicles start once",
                key="spawn_x_m",
                got="both" if zones else "neither",
            )
        return self


DensityRange = Annotated[tuple[Density, Density], AfterValidator(check_ascending)]


class FlowLane(Section):
    """A lane of section `[traffic]` with `mode = "flow"`.

    Attributes:
        density: Its density over the mean of all lanes.
        types: Weights of the vehicle types in it.
        speed_kmh: Mean speed of its traffic, by which the ends of the traffic stay out of the ego's
            sight.
        speed_factor: Factor on the desired speed that drivers of a vehicle class have on average.
    """

    density: Factor
    types: Types
    speed_kmh: SpeedKmh
    speed_factor: Annotated[float, Field(gt=0.5, lt=2.0)] = 1.0


class FlowTraffic(Section):
    """Section `[traffic]` with `mode = "flow"`: traffic of which the ego is one.

    Attributes:
        mode: Says which of the two kinds of traffic this is.
        vehicles: Fewest and most vehicles; there are as many as it takes to keep the ends of the
            traffic out of the ego's sight.
        density_per_km_lane: Vehicles on a kilometre of a lane, the mean of the lanes, uniform.
        lanes: Traffic of each lane, the slowest first; as many as the road has.
        free_speed_kmh: Mean desired speed on a free road by vehicle class.
        spacing_sigma: Spread of the logarithm of the free part of the distances.
        colours: Weights of the colours.
        ego_lanes: Lanes that the ego may start in, as likely as their densities say.
        sight_m: How far the ego looks back and ahead; nearer than this it never sees an end.
    """

    mode: Literal["flow"]
    vehicles: Annotated[tuple[Count, Count], AfterValidator(check_ascending)]
    density_per_km_lane: DensityRange
    lanes: Annotated[tuple[FlowLane, ...], Field(min_length=2)]
    free_speed_kmh: dict[TypeName, SpeedKmh]
    spacing_sigma: Annotated[float, Field(gt=0.0, le=2.0)]
    colours: Colours
    ego_lanes: Annotated[
        tuple[LaneNumber, ...], Field(min_length=1), AfterValidator(check_distinct)
    ]
    sight_m: RoadRange

    @model_validator(mode="after")
    def _complete(self) -> Self:
        missing = {name for lane in self.lanes for name in lane.types} - set(self.free_speed_kmh)
        if missing:
            name = min(missing)
            raise specification_error(
                "a speed for every type in traffic.lanes",
                f"add {name}",
                key="free_speed_kmh",
                got=f"none for {name}",
            )
        if max(self.ego_lanes) > len(self.lanes) - 2:
            raise specification_error(
                f"lanes with one on their faster side, 0 to {len(self.lanes) - 2}",
                "leave out the fastest lane",
                key="ego_lanes",
                got=list(self.ego_lanes),
            )
        return self


END_MARGIN = number("sampling.flow.end_margin")
"""Road behind the rearmost vehicle, and beyond both ends of two-way traffic [m]."""

_PerHour = Annotated[float, Field(ge=10.0, le=1500.0)]
_CountFromOne = Annotated[int, Field(ge=1, le=MAX_VEHICLES - 2)]
_CountFromZero = Annotated[int, Field(ge=0, le=MAX_VEHICLES - 2)]


class TwoWayTraffic(Section):
    """Section `[traffic]` with `mode = "two-way"`: a road with one lane in each direction.

    Vehicles arrive at random, in each direction at a rate of its own, and follow slower vehicles.
    Oncoming vehicles are drawn until the ego cannot meet another one while it overtakes, or until
    all slots are filled.

    Attributes:
        mode: Says which kind of traffic this is.
        ahead: Vehicles ahead of the ego in its direction.
        behind: Vehicles behind it.
        oncoming: Most vehicles of the other direction.
        flow_vph: Vehicles per hour and direction, the mean of both, uniform.
        split: Share of the busier direction, uniform; either may be it.
        min_headway_s: Least time between two arrivals; the rest is exponential.
        held_up: Share of the egos that follow the vehicle ahead in a platoon at the start; for the
            others the first headway is drawn like all headways.
        types: Weights of the vehicle types.
        ego_types: Weights of the ego's; never a two-wheeler.
        semitrailers: Part of the trucks that pull one.
        free_speed_kmh: Mean desired speed on a free road by vehicle class.
        slow_share: Part of the vehicles, the ego not among them, that are slow for some reason.
        slow_speed_kmh: Desired speed of the slow vehicles.
        start_s_m: Where the ego may start.
        sight_m: Largest distance at which the ego may see an oncoming vehicle; within it no arrival
            is missing.
        colours: Weights of the colours.
    """

    mode: Literal["two-way"]
    ahead: _CountFromOne
    behind: _CountFromZero
    oncoming: _CountFromZero
    flow_vph: Annotated[tuple[_PerHour, _PerHour], AfterValidator(check_ascending)]
    split: Annotated[tuple[Share, Share], AfterValidator(check_ascending)] = (0.5, 0.5)
    min_headway_s: Annotated[float, Field(ge=0.5, le=5.0)] = 1.5
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
    def num_slots(self) -> int:
        """Vehicles that are drawn, the ego among them."""
        return 1 + self.ahead + self.behind + self.oncoming

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.num_slots > MAX_VEHICLES:
            raise specification_error(
                f"at most {MAX_VEHICLES - 1} vehicles besides the ego",
                "lower ahead, behind or oncoming",
                key="oncoming",
                got=self.num_slots - 1,
            )
        missing = {*self.types, *self.ego_types} - set(self.free_speed_kmh)
        if missing:
            name = min(missing, key=VEHICLE_CLASS_NAMES.index)
            raise specification_error(
                "a speed for every type",
                f"add {name}",
                key="free_speed_kmh",
                got=f"none for {name}",
            )
        two_wheelers = [name for name in ("MC", "B") if self.ego_types.get(name, 0.0) > 0.0]
        if two_wheelers:
            raise specification_error(
                "vehicles with four wheels",
                f"leave {' and '.join(two_wheelers)} out",
                key="ego_types",
                got=two_wheelers,
            )
        if self.start_s_m[0] <= END_MARGIN:
            # Vehicles nearer to an end of the road are left out; the ego must not be one of them.
            raise specification_error(
                f"more than {END_MARGIN:g} m from the beginning of the road",
                f"begin above {END_MARGIN:g}",
                key="start_s_m",
                got=list(self.start_s_m),
            )
        longest = 3600.0 / self.min_headway_s
        if 2.0 * self.flow_vph[1] * self.split[1] > 0.9 * longest:
            raise specification_error(
                f"less than {0.9 * longest:g} vehicles per hour in the busier direction",
                "lower the flow or the split",
                key="flow_vph",
                got=f"{2.0 * self.flow_vph[1] * self.split[1]:g}",
            )
        return self
