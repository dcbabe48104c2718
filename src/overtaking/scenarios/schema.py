"""The sections of a specification file: one frozen model for each.

Units are in the names of the keys, as everywhere where numbers leave memory. The checks here need
nothing but the file; what needs the road is checked when a batch is sampled.
"""

from __future__ import annotations

import hashlib
import json
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Discriminator, Field, Tag, create_model, model_validator

from overtaking.core.units import SUFFIXES
from overtaking.model.drivers import DRIVER_RANGES
from overtaking.model.weather import Pushes
from overtaking.scenarios.complaints import advice, complaint
from overtaking.scenarios.fields import (
    MIN_GAP_M,
    STEP_MS,
    AltitudeDeg,
    Colours,
    Count,
    Duration,
    Factor,
    LaneNumber,
    PercentRange,
    PopulationName,
    Presets,
    RoadName,
    RoadRange,
    Section,
    Share,
    SpeedRange,
    Types,
    WorldRange,
    different,
    ego_type,
    multiple,
    ordered,
)
from overtaking.scenarios.populations import KEPT_TRAITS, drawn_range
from overtaking.scenarios.schema_flow import Component, Flow, FlowLane, Proposal
from overtaking.scenarios.schema_ways import TwoWay

Exponent = Annotated[float, Field(gt=0.0, le=20.0)] | None
Weibull = (
    tuple[Annotated[float, Field(gt=0.0, le=100.0)], Annotated[float, Field(ge=0.2, le=20.0)]]
    | None
)


def _kind_of_traffic(given: Any) -> str:
    """The mode of the traffic; without one, vehicles are placed independently, as in the study."""
    mode = given.get("mode") if isinstance(given, dict) else getattr(given, "mode", None)
    return mode if mode in ("flow", "two-way") else "placed"


class Profile(Section):
    """Section `[profile]`.

    Attributes:
        name: Name of the profile, for manifests and tables.
        road: A road that comes with the package; a map file given by the user replaces it.
        frame_interval_ms: Time between two recorded frames.
    """

    name: Annotated[str, Field(min_length=1, max_length=64)]
    road: RoadName
    frame_interval_ms: Annotated[int, Field(ge=STEP_MS, le=1000), AfterValidator(multiple)]


class Time(Section):
    """Section `[time]`.

    Attributes:
        horizon_s: Longest duration of a simulation.
        attempt_deadline_s: A simulation without an attempt ends here.
    """

    horizon_s: Duration
    attempt_deadline_s: Duration

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


class Traffic(Section):
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

    vehicles: Annotated[tuple[Count, Count], AfterValidator(ordered)]
    types: Types
    ego_types: Annotated[Types, AfterValidator(ego_type)]
    colours: Colours
    speed_kmh: SpeedRange
    lead_speed_kmh: SpeedRange
    lead_speed_exponent: Annotated[float, Field(gt=0.0, le=20.0)] = 1.0
    spawn_x_m: WorldRange | None = None
    spawn_s_m: RoadRange | None = None
    ego_lanes: (
        Annotated[tuple[LaneNumber, ...], Field(min_length=1), AfterValidator(different)] | None
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


class PushSection(Section):
    """Section `[weather.pushes]`: weather acts as in the study, not by physics.

    The road is dry and the air clear and still. Rain and wind push all vehicles sideways, towards
    where the wind blows to; the less of them, the longer the interval. By night, above 60 % of
    clouds and towards a low sun, drivers see as far as `sight_m`.

    Attributes:
        accel_mps2: Lateral acceleration of a push; 0 for none.
        duration_s: How long a push lasts.
        interval_s: From the begin of a push to that of the next at 100 % of rain and of wind.
        sight_m: How far drivers see where vision is cut.
    """

    accel_mps2: Annotated[float, Field(ge=0.0, le=50.0)]
    duration_s: Annotated[float, Field(ge=0.05, le=10.0)]
    interval_s: Annotated[float, Field(ge=0.05, le=1000.0)]
    sight_m: Annotated[float, Field(ge=1.0, le=1000.0)]

    @property
    def value(self) -> Pushes:
        """The same in the terms of the model."""
        return Pushes(
            accel=self.accel_mps2,
            duration=self.duration_s,
            interval=self.interval_s,
            sight=self.sight_m,
        )


class PresetWeather(Section):
    """Section `[weather]` with `mode = "presets"`.

    Attributes:
        mode: Says which of the two kinds of weather this is.
        presets: Weights of CARLA's named weathers.
        pushes: How weather acts instead of by physics; None for physics.
    """

    mode: Literal["presets"]
    presets: Presets
    pushes: PushSection | None = None


class IndependentWeather(Section):
    """Section `[weather]` with `mode = "independent"`: every quantity is drawn on its own.

    Each range is uniform; or low + (high - low) u^exponent with u uniform where an exponent is
    given; or a Weibull distribution above its lower end, cut off at its upper one, where a scale in
    percent and a shape are given, as for what is seldom extreme. Puddles and clouds are raised to
    what rain needs; see `weather`.

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
        rain_exponent: Above one, light rain is more frequent than heavy rain.
        fog_exponent: The same for fog.
        wind_exponent: The same for wind.
        puddles_exponent: The same for the water that lies on the road.
        rain_weibull: Scale and shape of rain.
        wind_weibull: Scale and shape of wind.
        puddles_weibull: Scale and shape of the water that lies on the road.
        pushes: How weather acts instead of by physics; None for physics.
    """

    mode: Literal["independent"]
    rain_probability: Share = 0.5
    rain_percent: PercentRange = (0.0, 100.0)
    puddles_percent: PercentRange = (0.0, 0.0)
    wind_percent: PercentRange = (0.0, 100.0)
    fog_probability: Share = 0.5
    fog_percent: PercentRange = (0.0, 100.0)
    cloudiness_percent: PercentRange = (0.0, 100.0)
    sun_altitude_deg: Annotated[tuple[AltitudeDeg, AltitudeDeg], AfterValidator(ordered)] = (
        -60.0,
        60.0,
    )
    rain_exponent: Exponent = None
    fog_exponent: Exponent = None
    wind_exponent: Exponent = None
    puddles_exponent: Exponent = None
    rain_weibull: Weibull = None
    wind_weibull: Weibull = None
    puddles_weibull: Weibull = None
    pushes: PushSection | None = None

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        for name in ("rain", "wind", "puddles"):
            given = (getattr(self, f"{name}_exponent"), getattr(self, f"{name}_weibull"))
            if None not in given:
                raise complaint(
                    f"{name}_exponent or {name}_weibull",
                    "leave one of them out",
                    key=f"{name}_weibull",
                    got="both",
                )
        return self


def _fixable() -> dict[str, Any]:
    """A key for each number of `Drivers` that is drawn, with the range of the field."""
    keys: dict[str, Any] = {}
    for name, field in KEPT_TRAITS.items():
        if field.spec.is_bounded:
            low, high = field.spec.limits
            limits = Field(ge=low, le=high)
            keys[name + SUFFIXES[field.spec.unit]] = (Annotated[float | None, limits], None)
    return keys


class FixedTraits(create_model("_FixedTraits", __base__=Section, **_fixable())):
    """Section `[drivers.fixed]`: traits that are the same for every driver.

    The keys are the numbers of `model.drivers.Drivers` with their units and ranges; a trait without
    a value is left to the population.
    """

    def values(self) -> dict[str, float]:
        """What is fixed, by the names of `model.drivers.Drivers`."""
        given = self.model_dump(exclude_none=True)
        keys = {name + SUFFIXES[field.spec.unit]: name for name, field in KEPT_TRAITS.items()}
        return {keys[key]: value for key, value in given.items()}


_SCALABLE = tuple(name for name, field in KEPT_TRAITS.items() if not field.is_flag)


def _scalable(factors: dict[str, float]) -> dict[str, float]:
    for name in factors:
        if name not in _SCALABLE:
            raise complaint("a known parameter", advice(name, _SCALABLE), got=name)
    return factors


class People(Section):
    """Section `[drivers]`.

    Attributes:
        population: A population of the knowledge base.
        temper: Range of the drivers' temper, 0 careful to 1 reckless.
        fixed: Parameters that are the same for everyone.
        scale: Factors on the drawn traits of all drivers, by the names of `model.drivers.Drivers`.
    """

    population: PopulationName
    temper: Annotated[tuple[Share, Share], AfterValidator(ordered)] = (0.0, 1.0)
    fixed: FixedTraits = FixedTraits()
    scale: Annotated[dict[str, Factor], AfterValidator(_scalable)] | None = None

    @model_validator(mode="after")
    def _scaled_inside(self) -> Self:
        fixed = self.fixed.values()
        for name, factor in (self.scale or {}).items():
            value, spec = fixed.get(name), DRIVER_RANGES[name]
            lowest, highest = spec.limits
            unit = "" if spec.unit == "1" else f" {spec.unit}"
            low, high = drawn_range(self.population, name) if value is None else (value, value)
            if factor * low < lowest or factor * high > highest:
                raise complaint(
                    f"a factor that keeps {low:g} to {high:g} within {lowest:g} to"
                    f" {highest:g}{unit}",
                    "choose one nearer to 1",
                    key=f"scale.{name}",
                    got=factor,
                )
        return self


class Starts(Section):
    """Section `[starts]`: what a start must leave to those in it.

    Attributes:
        allow_doomed: Whether a vehicle may start so fast that no braking saves it.
        min_gap_m: Smallest gap between two vehicles of a lane.
    """

    allow_doomed: bool = False
    min_gap_m: Annotated[float, Field(ge=MIN_GAP_M, le=100.0)] = 10.0


class Spec(Section):
    """A whole specification: what to sample.

    Attributes:
        profile: Name, road and frames.
        time: Durations.
        traffic: Vehicles.
        weather: Weather and light.
        drivers: People.
        starts: Safety of the first frame.
        proposal: Quantities that are drawn more often than in nature; None for none.
    """

    profile: Profile
    time: Time
    traffic: Annotated[
        Annotated[Traffic, Tag("placed")]
        | Annotated[Flow, Tag("flow")]
        | Annotated[TwoWay, Tag("two-way")],
        Discriminator(_kind_of_traffic),
    ]
    weather: Annotated[PresetWeather | IndependentWeather, Field(discriminator="mode")]
    drivers: People
    starts: Starts = Starts()
    proposal: Proposal | None = None

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


_SECTIONS: dict[tuple[str, ...], type[Section]] = {
    (): Spec,
    ("profile",): Profile,
    ("time",): Time,
    ("traffic",): Traffic,
    ("weather", "pushes"): PushSection,
    ("drivers",): People,
    ("drivers", "fixed"): FixedTraits,
    ("starts",): Starts,
    ("proposal",): Component,
    ("traffic", "lanes"): FlowLane,
}


def known_keys(section: tuple[str, ...], mode: str | None = None) -> tuple[str, ...]:
    """The keys that a section may have; `mode` is the weather's or the traffic's."""
    if section == ("weather",):
        model = PresetWeather if mode == "presets" else IndependentWeather
    elif section == ("traffic",):
        model = {"flow": Flow, "two-way": TwoWay}.get(mode or "", Traffic)
    else:
        model = _SECTIONS[tuple(part for part in section if not part.isdigit())]
    return tuple(model.model_fields)
