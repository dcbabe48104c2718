"""Section `[traffic]` of a specification, which has three models.

- `PlacedTraffic`, without a key `mode`: a few vehicles, placed independently on a short stretch, as
  in the study of Pinto, Dutra and Fonseca (2023);
- `FlowTraffic`, `mode = "flow"`: dense traffic of a road with one direction;
- `TwoWayTraffic`, `mode = "two-way"`: a road with one lane in each direction.

`specification.Specification` contains the section; `placed_traffic`, `motorway_traffic` and
`two_way_traffic` draw the vehicles. The *ego* is the vehicle whose overtaking is studied. The name
of a key states its unit; two values in brackets are a range, from which each simulation draws
uniformly unless the key says otherwise. Weights are relative frequencies by name. Vehicle types are
S, M and L (small, medium and large cars), V (van), T (truck), MC (motorcycle) and B (bicycle); the
code, unlike the file, calls them vehicle classes. Types of values, such as `Count`, have their
limits in `specification_values`; limits stated here are choices.

From the *deadline* on, a simulation ends as soon as the ego neither overtakes nor is about to
overtake, because it never began or has given up. The deadline is the stated one,
`time.attempt_deadline_s`, or an earlier one where the drawn traffic ends too near.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from overtaking.knowledge.toml_reader import number
from overtaking.knowledge.vehicle_classes import VEHICLE_CLASS_NAMES
from overtaking.model.scenario import MAX_VEHICLES
from overtaking.scenarios.specification_values import (
    TWO_WHEELERS,
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
    """Section `[traffic]` without a mode: a few vehicles, placed independently.

    Attributes:
        vehicles: Fewest and most vehicles, the ego among them, each number equally likely.
        types: Weights of the vehicle types of all vehicles but the ego.
        ego_types: Weights of the ego's vehicle types; never a two-wheeler.
        colours: Weights of the colours of all vehicles.
        speed_kmh: Range of the speeds at the start, except for the leader, the vehicle ahead of the
            ego in its lane. Slow vehicle types start at most at their top speed.
        leader_speed_kmh: Range of the leader's speed at the start.
        leader_speed_exponent: The leader's speed is low + (high - low) u^exponent with u uniform in
            (0, 1); an exponent above 1 makes slow leaders more frequent.
        spawn_x_m: Range of the world coordinate x in which the centres of the vehicles start.
        spawn_s_m: Range of the position along the road in which they start. Exactly one of the two
            ranges is stated.
        ego_lanes: Lanes in which the ego may start, 0 the slowest, each equally likely; None for
            all but the fastest lane, which has no lane beside it for an overtake.
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
    def _check_one_spawn_range(self) -> Self:
        ranges = [span for span in (self.spawn_x_m, self.spawn_s_m) if span is not None]
        if len(ranges) != 1:
            raise specification_error(
                "exactly one of spawn_x_m and spawn_s_m",
                "give the zone in which vehicles start once",
                key="spawn_x_m",
                got="both" if ranges else "neither",
            )
        return self


DensityRange = Annotated[tuple[Density, Density], AfterValidator(check_ascending)]


class FlowLane(Section):
    """A lane of section `[traffic]` with `mode = "flow"`.

    Attributes:
        density: Density of the lane relative to the other lanes; only ratios matter.
        types: Weights of the vehicle types in the lane, also for the ego. The ego is never a
            two-wheeler, so each lane of `FlowTraffic.ego_lanes` needs a type with four wheels.
        speed_kmh: Mean speed of the traffic in the lane. It does not set the speeds at the start,
            but serves to estimate when the ego meets an end of the traffic.
        speed_factor: Factor on the desired speeds of `FlowTraffic.free_speed_kmh` in this lane.
    """

    density: Factor
    types: Types
    speed_kmh: SpeedKmh
    speed_factor: Annotated[float, Field(gt=0.5, lt=2.0)] = 1.0


class FlowTraffic(Section):
    """Section `[traffic]` with `mode = "flow"`: traffic of one direction around the ego.

    Attributes:
        mode: Distinguishes the models of section `[traffic]`.
        vehicles: Fewest and most vehicles, the ego among them. Within these limits, vehicles are
            added until the ego sees no end of the traffic while it may overtake.
        density_per_km_lane: Range of the density, the mean of all lanes [vehicles per km and lane].
        lanes: Traffic of each lane of the road, the slowest first.
        free_speed_kmh: Mean desired speed on a free road by vehicle type.
        spacing_sigma: Irregularity of the spacing between two vehicles: standard deviation of the
            logarithm of the part above a minimum for the lane (`motorway_traffic.MIN_SPACING`).
        colours: Weights of the colours.
        ego_lanes: Lanes in which the ego may start, in proportion to their densities; not the
            fastest.
        sight_m: Not a range, but two distances: how far the ego looks back and how far ahead, back
            at most as far as ahead. Before the deadline no end of the traffic comes within these
            distances of the ego; if the largest number of `vehicles` does not suffice, the deadline
            is earlier. An end within them at the start is an error (`InfeasibleError`).
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
    def _check_speeds_and_lanes(self) -> Self:
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
        for lane in self.ego_lanes:
            names = [name for name, weight in self.lanes[lane].types.items() if weight > 0.0]
            if set(names) <= set(TWO_WHEELERS):
                raise specification_error(
                    "a vehicle with four wheels for an ego that starts in this lane",
                    f"add a type such as M, or leave {lane} out of traffic.ego_lanes",
                    key=f"lanes.{lane}.types",
                    got=names,
                )
        return self


END_MARGIN = number("sampling.flow.end_margin")
"""Road behind the rearmost vehicle of a motorway, and smallest distance of vehicles from both ends
of a two-way road [m]. A choice: 50 m (`knowledge/data/sampling.toml`)."""

_FlowPerHour = Annotated[float, Field(ge=10.0, le=1500.0)]  # Vehicles per hour; limits are choices.
_BusierShare = Annotated[float, Field(ge=0.5, le=1.0)]

# Numbers of vehicles of one group: ahead, behind or oncoming. The groups behind and oncoming leave
# two places, for the ego and for a vehicle ahead of it. The group ahead needs to leave one place
# only; its equal limit is a choice. `TwoWayTraffic` limits the sum of the groups.
_CountFromOne = Annotated[int, Field(ge=1, le=MAX_VEHICLES - 2)]
_CountFromZero = Annotated[int, Field(ge=0, le=MAX_VEHICLES - 2)]

_MAX_FLOW_SHARE = 0.9
"""Largest flow of a direction, over the flow at which all vehicles have the shortest headway (a
choice). At a share of 1 the exponential part of the headways would have a mean of zero."""


class TwoWayTraffic(Section):
    """Section `[traffic]` with `mode = "two-way"`: a road with one lane in each direction.

    Vehicles arrive at random, in each direction at a flow of its own, and follow slower vehicles. A
    *headway* is the time between the arrivals of two vehicles at a point of the road.

    Attributes:
        mode: Distinguishes the models of section `[traffic]`.
        ahead: Number of vehicles ahead of the ego in its direction.
        behind: Number of vehicles behind it.
        oncoming: Number of vehicles of the other direction. The deadline is earlier if the ego
            could otherwise see the empty road behind the last oncoming vehicle during an overtake.
            Vehicles of either direction that would start beyond the ends of the road are left out.
        flow_vph: Range of the flow, the mean of both directions [vehicles per hour and direction].
        split: Range of the share of the busier direction in the flow of both, 0.5 or more. Either
            direction may be the busier one.
        min_headway_s: Smallest headway; the rest of a headway is exponentially distributed.
        held_up: Share of the egos that start within 4 s behind the vehicle ahead; for the others
            the headway to it is drawn like all headways.
        types: Weights of the vehicle types of all vehicles but the ego.
        ego_types: Weights of the ego's vehicle types; never a two-wheeler.
        semitrailers: Share of the trucks that pull a semitrailer.
        free_speed_kmh: Mean desired speed on a free road by vehicle type.
        slow_share: Share of slow vehicles, such as tractors, among all but the ego and
            two-wheelers.
        slow_speed_kmh: Range of the desired speed of the slow vehicles.
        start_s_m: Range of the position along the road at which the ego starts.
        sight_m: Largest distance at which the ego may see an oncoming vehicle. The deadline is so
            early that the empty road behind the last oncoming vehicle stays farther away than this
            during a common overtake.
        colours: Weights of the colours.
    """

    mode: Literal["two-way"]
    ahead: _CountFromOne
    behind: _CountFromZero
    oncoming: _CountFromZero
    flow_vph: Annotated[tuple[_FlowPerHour, _FlowPerHour], AfterValidator(check_ascending)]
    split: Annotated[tuple[_BusierShare, _BusierShare], AfterValidator(check_ascending)] = (
        0.5,
        0.5,
    )
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
        """Number of vehicles that are drawn, the ego among them."""
        return 1 + self.ahead + self.behind + self.oncoming

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
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
        # Not `check_four_wheels`, whose error shows all weights: this one shows the two-wheelers.
        two_wheelers = [name for name in TWO_WHEELERS if self.ego_types.get(name, 0.0) > 0.0]
        if two_wheelers:
            raise specification_error(
                "vehicles with four wheels",
                f"leave {' and '.join(two_wheelers)} out",
                key="ego_types",
                got=two_wheelers,
            )
        if self.start_s_m[0] <= END_MARGIN:
            # Vehicles within `END_MARGIN` of an end of the road are left out; the ego must not be.
            # The far end needs no check: `two_way_traffic.road_length` adds to the largest start.
            raise specification_error(
                f"more than {END_MARGIN:g} m from the beginning of the road",
                f"begin above {END_MARGIN:g}",
                key="start_s_m",
                got=list(self.start_s_m),
            )
        max_flow = _MAX_FLOW_SHARE * (3600.0 / self.min_headway_s)
        # `flow_vph` is the mean of both directions, half of the flow of the road.
        busier_flow = 2.0 * self.flow_vph[1] * self.split[1]
        if busier_flow > max_flow:
            raise specification_error(
                f"less than {max_flow:g} vehicles per hour in the busier direction",
                "lower the flow or the split",
                key="flow_vph",
                got=f"{busier_flow:g}",
            )
        return self
