"""What a specification file may say: one frozen model for each of its sections.

Units are in the names of the keys, as everywhere where numbers leave memory. The checks here need
nothing but the file; what needs the road is checked when a batch is sampled.
"""

from __future__ import annotations

import hashlib
import json
from typing import Annotated, Any, Literal, Self, cast

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from overtaking.knowledge import COLOUR_ORDER, VEHICLE_CLASS_ORDER, presets
from overtaking.knowledge.roads import ROAD_NAMES
from overtaking.model.road import MAX_LANES
from overtaking.model.scenario import MAX_VEHICLES
from overtaking.scenarios.complaints import complaint, known_name
from overtaking.scenarios.populations import population_names

STEP_MS = 10
"""Frames lie on the steps of the simulation."""

MAX_HORIZON_S = 600.0
MAX_SPEED_KMH = 250.0
MIN_GAP_M = 3.0
MIN_VEHICLES = 2  # The ego and the one that it might overtake.


def _ordered(pair: tuple[Any, Any]) -> tuple[Any, Any]:
    if pair[0] > pair[1]:
        raise complaint("a range from low to high", f"write [{pair[1]:g}, {pair[0]:g}]")
    return pair


def _shares(value: Any) -> Any:
    """A name or a list of names stands for equal weights."""
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list | tuple):
        return names
    for name in cast("list[Any]", names):
        if not isinstance(name, str):
            raise complaint("names, or names with weights", "quote the names")
    return dict.fromkeys(cast("list[str]", names), 1.0)


def _drawable(weights: dict[str, float]) -> dict[str, float]:
    if not sum(weights.values()) > 0.0:
        raise complaint("a weight above zero", "give at least one of them a weight")
    return weights


def _ego_type(weights: dict[str, float]) -> dict[str, float]:
    two_wheelers = sorted({"MC", "B"} & {name for name, weight in weights.items() if weight > 0.0})
    if two_wheelers:
        raise complaint("vehicles with four wheels", f"leave {' and '.join(two_wheelers)} out")
    return weights


def _different(lanes: tuple[int, ...]) -> tuple[int, ...]:
    if len(set(lanes)) < len(lanes):
        raise complaint("each lane once", "leave out the repeated one")
    return lanes


def _multiple(interval_ms: int) -> int:
    if interval_ms % STEP_MS:
        nearest = max(STEP_MS, round(interval_ms / STEP_MS) * STEP_MS)
        raise complaint(f"a multiple of {STEP_MS}", f"use {nearest}")
    return interval_ms


Percent = Annotated[float, Field(ge=0.0, le=100.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
SpeedKmh = Annotated[float, Field(gt=0.0, le=MAX_SPEED_KMH)]
Count = Annotated[int, Field(ge=MIN_VEHICLES, le=MAX_VEHICLES)]
LaneNumber = Annotated[int, Field(ge=0, lt=MAX_LANES)]
Range = Annotated[tuple[float, float], AfterValidator(_ordered)]
SpeedRange = Annotated[tuple[SpeedKmh, SpeedKmh], AfterValidator(_ordered)]
PercentRange = Annotated[tuple[Percent, Percent], AfterValidator(_ordered)]
AltitudeDeg = Annotated[float, Field(ge=-90.0, le=90.0)]
Weight = Annotated[float, Field(ge=0.0, le=1e6)]
TypeName = Annotated[str, AfterValidator(known_name("vehicle type", lambda: VEHICLE_CLASS_ORDER))]
ColourName = Annotated[str, AfterValidator(known_name("colour", lambda: COLOUR_ORDER))]
PresetName = Annotated[str, AfterValidator(known_name("weather preset", lambda: tuple(presets())))]
RoadName = Annotated[str, AfterValidator(known_name("road", lambda: ROAD_NAMES))]
PopulationName = Annotated[str, AfterValidator(known_name("population", population_names))]
Types = Annotated[dict[TypeName, Weight], BeforeValidator(_shares), AfterValidator(_drawable)]
Colours = Annotated[dict[ColourName, Weight], BeforeValidator(_shares), AfterValidator(_drawable)]
Presets = Annotated[dict[PresetName, Weight], BeforeValidator(_shares), AfterValidator(_drawable)]


class _Section(BaseModel):
    """What all sections share: nothing unknown, nothing converted, nothing infinite."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Profile(_Section):
    """Section `[profile]`.

    Attributes:
        name: Name of the profile, for manifests and tables.
        road: A road that comes with the package; a map file given by the user replaces it.
        frame_interval_ms: Time between two recorded frames.
    """

    name: Annotated[str, Field(min_length=1, max_length=64)]
    road: RoadName
    frame_interval_ms: Annotated[int, Field(ge=STEP_MS, le=1000), AfterValidator(_multiple)]


class Time(_Section):
    """Section `[time]`.

    Attributes:
        horizon_s: Longest duration of a simulation.
        attempt_deadline_s: A simulation without an attempt ends here.
    """

    horizon_s: Annotated[float, Field(gt=0.0, le=MAX_HORIZON_S)]
    attempt_deadline_s: Positive

    @model_validator(mode="after")
    def _deadline_inside(self) -> Self:
        if self.attempt_deadline_s > self.horizon_s:
            raise complaint(
                f"at most the horizon of {self.horizon_s:g}",
                "lower it or raise time.horizon_s",
                key="attempt_deadline_s",
                got=self.attempt_deadline_s,
            )
        return self


class Traffic(_Section):
    """Section `[traffic]`.

    Attributes:
        vehicles: Fewest and most vehicles, the ego among them, each number equally likely.
        types: Weights of the vehicle types of everyone but the ego.
        ego_types: Weights of the ego's vehicle types; never a two-wheeler.
        colours: Weights of the colours.
        speed_kmh: Range of the speeds that vehicles come with.
        lead_speed_kmh: The same for the vehicle ahead of the ego ...
        lead_speed_exponent: ... which is low + (high - low) u^exponent with u uniform.
        spawn_x_m: World x between which the centres of the vehicles start, or
        spawn_s_m: position along the road between which they start; exactly one of the two.
        ego_lanes: Lanes that the ego may start in, 0 the slowest; all but the fastest if not given.
    """

    vehicles: Annotated[tuple[Count, Count], AfterValidator(_ordered)]
    types: Types
    ego_types: Annotated[Types, AfterValidator(_ego_type)]
    colours: Colours
    speed_kmh: SpeedRange
    lead_speed_kmh: SpeedRange
    lead_speed_exponent: Annotated[float, Field(gt=0.0, le=20.0)] = 1.0
    spawn_x_m: Range | None = None
    spawn_s_m: Range | None = None
    ego_lanes: (
        Annotated[tuple[LaneNumber, ...], Field(min_length=1), AfterValidator(_different)] | None
    ) = None

    @model_validator(mode="after")
    def _one_zone(self) -> Self:
        zones = [zone for zone in (self.spawn_x_m, self.spawn_s_m) if zone is not None]
        if len(zones) != 1:
            raise complaint(
                "exactly one of spawn_x_m and spawn_s_m",
                "give the zone in which vehicles start once",
                key="spawn_x_m",
                got="both" if zones else "neither",
            )
        return self


class PresetWeather(_Section):
    """Section `[weather]` with `mode = "presets"`.

    Attributes:
        mode: Says which of the two kinds of weather this is.
        presets: Weights of CARLA's named weathers.
    """

    mode: Literal["presets"]
    presets: Presets


class IndependentWeather(_Section):
    """Section `[weather]` with `mode = "independent"`: every quantity is drawn on its own.

    Each range is uniform. Puddles and clouds are raised to what rain needs; see `weather`.

    Attributes:
        mode: Says which of the two kinds of weather this is.
        rain_probability: Part of the simulations with rain.
        rain_percent: Rain where it rains.
        puddles_percent: Water that lies on the road.
        wind_percent: Wind.
        fog_probability: Part of the simulations with fog.
        fog_percent: Fog where there is fog.
        cloudiness_percent: Clouds.
        sun_altitude_deg: Height of the sun; below zero it is night.
    """

    mode: Literal["independent"]
    rain_probability: Share = 0.5
    rain_percent: PercentRange = (0.0, 100.0)
    puddles_percent: PercentRange = (0.0, 0.0)
    wind_percent: PercentRange = (0.0, 100.0)
    fog_probability: Share = 0.5
    fog_percent: PercentRange = (0.0, 100.0)
    cloudiness_percent: PercentRange = (0.0, 100.0)
    sun_altitude_deg: Annotated[tuple[AltitudeDeg, AltitudeDeg], AfterValidator(_ordered)] = (
        -60.0,
        60.0,
    )


class FixedTraits(_Section):
    """Section `[drivers.fixed]`: parameters that are the same for every driver.

    The attributes are those of `model.drivers.Drivers` with their units; None leaves them to the
    population.
    """

    time_gap_s: NotNegative | None = None
    min_gap_m: Positive | None = None
    accel_mps2: Positive | None = None
    decel_mps2: Positive | None = None
    reaction_time_s: NotNegative | None = None
    caution: Share | None = None
    politeness: Share | None = None
    lane_change_threshold_mps2: NotNegative | None = None
    right_bias_mps2: NotNegative | None = None
    safe_decel_mps2: Positive | None = None
    lane_change_duration_s: Positive | None = None
    passing_gain_mps: NotNegative | None = None
    patience_s: Positive | None = None
    pull_out_time_s: NotNegative | None = None
    gap_acceptance: NotNegative | None = None
    return_time_gap_s: NotNegative | None = None
    signal_time_s: NotNegative | None = None
    limit_respect: Share | None = None

    def values(self) -> dict[str, float]:
        """What is fixed, by the names of `model.drivers.Drivers`."""
        given = self.model_dump(exclude_none=True)
        return {name.removesuffix("_" + _unit(name)): value for name, value in given.items()}


def _unit(name: str) -> str:
    """The unit that a key ends in, or nothing."""
    return next((unit for unit in ("mps2", "mps", "m", "s") if name.endswith(f"_{unit}")), "")


class People(_Section):
    """Section `[drivers]`.

    Attributes:
        population: A population of the knowledge base.
        temper: Range of the drivers' temper, 0 careful to 1 reckless.
        fixed: Parameters that are the same for everyone.
    """

    population: PopulationName
    temper: Annotated[tuple[Share, Share], AfterValidator(_ordered)] = (0.0, 1.0)
    fixed: FixedTraits = FixedTraits()


class Starts(_Section):
    """Section `[starts]`: what a start must leave to those in it.

    Attributes:
        allow_doomed: Whether a vehicle may start so fast that no braking saves it.
        min_gap_m: Smallest gap between two vehicles of a lane.
    """

    allow_doomed: bool = False
    min_gap_m: Annotated[float, Field(ge=MIN_GAP_M, le=100.0)] = 10.0


class Spec(_Section):
    """A whole specification: what to sample.

    Attributes:
        profile: Name, road and frames.
        time: Durations.
        traffic: Vehicles.
        weather: Weather and light.
        drivers: People.
        starts: Safety of the first frame.
    """

    profile: Profile
    time: Time
    traffic: Traffic
    weather: Annotated[PresetWeather | IndependentWeather, Field(discriminator="mode")]
    drivers: People
    starts: Starts = Starts()

    @property
    def name(self) -> str:
        """Name of the profile."""
        return self.profile.name

    @property
    def road(self) -> str:
        """Name of the road."""
        return self.profile.road

    def resolved(self) -> dict[str, Any]:
        """Everything that was given or left to a default, as JSON types; `spec` reads it back."""
        return self.model_dump(mode="json", exclude_none=True)

    def canonical_json(self) -> str:
        """`resolved` as text that is the same for equal specifications, on one line."""
        return json.dumps(self.resolved(), sort_keys=True, separators=(",", ":"), allow_nan=False)

    @property
    def spec_hash(self) -> str:
        """SHA-256 of `canonical_json`, in hexadecimal."""
        return hashlib.sha256(self.canonical_json().encode()).hexdigest()


_SECTIONS: dict[tuple[str, ...], type[_Section]] = {
    (): Spec,
    ("profile",): Profile,
    ("time",): Time,
    ("traffic",): Traffic,
    ("drivers",): People,
    ("drivers", "fixed"): FixedTraits,
    ("starts",): Starts,
}


def known_keys(section: tuple[str, ...], mode: str | None = None) -> tuple[str, ...]:
    """The keys that a section may have; `mode` is the weather's."""
    if section == ("weather",):
        model = PresetWeather if mode == "presets" else IndependentWeather
    else:
        model = _SECTIONS[section]
    return tuple(model.model_fields)
