"""Sections of a specification, one frozen model for each; proposals of importance sampling.

Units are in the names of the keys. The checks here need nothing but the file; the sampler checks
what depends on the road.
"""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import AfterValidator, Discriminator, Field, Tag, create_model, model_validator

from overtaking.core.units import NAME_SUFFIXES
from overtaking.model.vehicles import TRAIT_RANGES
from overtaking.model.weather import LateralPushes
from overtaking.scenarios.driver_sampling import RECORDED_TRAITS, trait_range
from overtaking.scenarios.specification_values import (
    MIN_GAP_M,
    AltitudeDeg,
    Duration,
    Factor,
    PercentRange,
    PopulationName,
    Presets,
    RoadName,
    Section,
    Share,
    check_ascending,
    check_on_clock,
    specification_error,
    suggestion,
)
from overtaking.scenarios.traffic_specification import (
    FlowLane,
    FlowTraffic,
    PlacedTraffic,
    TwoWayTraffic,
)
from overtaking.world.constants import STEP_MS

if TYPE_CHECKING:
    from collections.abc import Callable

PROPOSAL_UNIFORMS = (
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
    "ego_driving_style",
    "ego_heeds_solid_lines",
    "others_driving_style",
)
"""Uniform numbers that a proposal may transform. Small values of `rains` and `foggy` mean rain and
fog. Only two-way roads have `flow`, `start` (the ego's station), `held_up` (small: the ego is held
up) and `ego_heeds_solid_lines` (large: the ego ignores lines). `others_driving_style` is
transformed for each of the other drivers separately."""

PROPOSAL_NORMALS = tuple(
    f"ego_{trait}"
    for trait in (
        "time_gap",
        "reaction_time",
        "lane_change_duration",
        "min_speed_gain",
        "patience",
        "pull_out_ttc",
        "gap_demand_factor",
        "return_time_gap",
        "indicator_lead_time",
        "cruise_factor",
        "passing_time_factor",
    )
)
"""Standard normal numbers that a proposal may transform: traits of the ego, normal or lognormal."""

_MIN_PART = 0.001


def _rising(part: tuple[float, float]) -> tuple[float, float]:
    if part[1] - part[0] < _MIN_PART:
        expected = f"a lower end below the upper one, by {_MIN_PART:g} or more"
        raise specification_error(expected, "swap them or move them apart", got=list(part))
    return part


_Power = Annotated[float, Field(ge=0.01, le=20.0)]
_Part = Annotated[tuple[Share, Share], AfterValidator(_rising)]
_Shift = Annotated[float, Field(ge=-3.0, le=3.0)]
_Temper = Annotated[float, Field(gt=0.0, le=1.0)]


def _is_of_ego(name: str) -> bool:
    """Whether a quantity belongs to the ego."""
    return name.startswith("ego_")


def _name_check(names: tuple[str, ...]) -> Callable[[dict[str, Any]], dict[str, Any]]:
    def check_names(numbers: dict[str, Any]) -> dict[str, Any]:
        for name in numbers:
            if name not in names:
                raise specification_error("a known quantity", suggestion(name, names), got=name)
        return numbers

    return check_names


class Component(Section):
    """Entry of section `[[proposal]]`: draws a share of the simulations from other distributions.

    A power replaces u, uniform in (0, 1), by u^power: a power below one favours the upper end, a
    power above one the lower. A part replaces u by a uniform number between two limits. A shift
    replaces z, standard normal, by z + shift.

    Attributes:
        name: Purpose of these simulations.
        share: Share of the simulations that the component draws.
        powers: Power by name, one of `PROPOSAL_UNIFORMS`.
        parts: Lower and upper limit by name, one of `PROPOSAL_UNIFORMS`.
        shifts: Standard deviations by name, one of `PROPOSAL_NORMALS`.
        tempers: The share is divided equally among copies of the component, one for each temper t:
            its powers are raised to t and its shifts multiplied by it, so a small t changes little.
            Parts stay.
    """

    name: Annotated[str, Field(min_length=1, max_length=40)]
    share: Annotated[Share, Field(gt=0.0, lt=1.0)]
    powers: Annotated[dict[str, _Power], AfterValidator(_name_check(PROPOSAL_UNIFORMS))] = Field(
        default_factory=dict
    )
    parts: Annotated[dict[str, _Part], AfterValidator(_name_check(PROPOSAL_UNIFORMS))] = Field(
        default_factory=dict
    )
    shifts: Annotated[dict[str, _Shift], AfterValidator(_name_check(PROPOSAL_NORMALS))] = Field(
        default_factory=dict
    )
    tempers: Annotated[tuple[_Temper, ...], Field(min_length=1)] = (1.0,)

    def at_each_temper(self) -> tuple[Self, ...]:
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

    def changes(self, name: str) -> bool:
        """Whether the component transforms a number."""
        return name in self.powers or name in self.parts or name in self.shifts

    def without_ego_quantities(self) -> Self:
        """The component without its changes of the ego: its marginal for the scene and the others.

        A component draws each number independently, so leaving some out integrates over them.
        """
        changes = {
            field: {
                name: number
                for name, number in getattr(self, field).items()
                if not _is_of_ego(name)
            }
            for field in ("powers", "parts", "shifts")
        }
        return self.model_copy(update=changes)

    @model_validator(mode="after")
    def _once(self) -> Self:
        twice = set(self.powers) & set(self.parts)
        if twice:
            name = min(twice)
            raise specification_error(
                "a power or a part for a quantity", "leave one out", key=f"parts.{name}", got="both"
            )
        return self


def _check_natural_share(components: tuple[Component, ...]) -> tuple[Component, ...]:
    total = sum(component.share for component in components)
    if not total < 1.0:
        raise specification_error(
            "shares that leave some simulations as they are met, a sum below 1",
            "lower a share",
            key="share",
            got=f"{total:g}",
        )
    return components


Proposal = Annotated[
    tuple[Component, ...], Field(min_length=1), AfterValidator(_check_natural_share)
]
"""Components; all other simulations are drawn from the profile itself, which bounds every weight by
1 / (1 - the sum of the shares)."""

Exponent = Annotated[float, Field(gt=0.0, le=20.0)] | None

Weibull = (
    tuple[Annotated[float, Field(gt=0.0, le=100.0)], Annotated[float, Field(ge=0.2, le=20.0)]]
    | None
)


def _kind_of_traffic(section: Any) -> str:
    """The mode of the traffic; without one, vehicles are placed independently, as in the study."""
    mode = section.get("mode") if isinstance(section, dict) else getattr(section, "mode", None)
    return mode if mode in ("flow", "two-way") else "placed"


class ProfileSection(Section):
    """Section `[profile]`.

    Attributes:
        name: Name of the profile, for manifests and tables.
        road: A road that comes with the package; a map file given by the user replaces it.
        frame_interval_ms: Time between two recorded frames.
    """

    name: Annotated[str, Field(min_length=1, max_length=64)]
    road: RoadName
    frame_interval_ms: Annotated[int, Field(ge=STEP_MS, le=1000), AfterValidator(check_on_clock)]


class TimeSection(Section):
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
            raise specification_error(
                f"at most the horizon of {self.horizon_s:g}",
                "lower it or raise time.horizon_s",
                key="attempt_deadline_s",
                got=self.attempt_deadline_s,
            )
        return self


class PushesSection(Section):
    """Section `[weather.pushes]`: weather acts as in the study, not by physics.

    The road is dry and the air clear and still. Rain and wind push all vehicles sideways, towards
    where the wind blows to; the less of them, the longer the interval. By night, above 60 % of
    clouds and towards a low sun, drivers see as far as `sight_m`.

    Attributes:
        accel_mps2: Lateral acceleration of a push; 0 without pushes.
        duration_s: How long a push lasts.
        interval_s: Time between the starts of two pushes at 100 % of rain and of wind.
        sight_m: How far drivers see where vision is cut.
    """

    accel_mps2: Annotated[float, Field(ge=0.0, le=50.0)]
    duration_s: Annotated[float, Field(ge=0.05, le=10.0)]
    interval_s: Annotated[float, Field(ge=0.05, le=1000.0)]
    sight_m: Annotated[float, Field(ge=1.0, le=1000.0)]

    @property
    def to_model(self) -> LateralPushes:
        """The same in the terms of the model."""
        return LateralPushes(
            accel=self.accel_mps2,
            duration=self.duration_s,
            interval=self.interval_s,
            sight_distance=self.sight_m,
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
    pushes: PushesSection | None = None


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
    sun_altitude_deg: Annotated[
        tuple[AltitudeDeg, AltitudeDeg], AfterValidator(check_ascending)
    ] = (
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
    pushes: PushesSection | None = None

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        for name in ("rain", "wind", "puddles"):
            shapes = (getattr(self, f"{name}_exponent"), getattr(self, f"{name}_weibull"))
            if None not in shapes:
                raise specification_error(
                    f"{name}_exponent or {name}_weibull",
                    "leave one of them out",
                    key=f"{name}_weibull",
                    got="both",
                )
        return self


def _fixable() -> dict[str, Any]:
    """A key for each number of `DriverTraits` that is drawn, with the range of the field."""
    keys: dict[str, Any] = {}
    for name, field in RECORDED_TRAITS.items():
        if field.spec.is_bounded:
            low, high = field.spec.limits
            limits = Field(ge=low, le=high)
            keys[name + NAME_SUFFIXES[field.spec.unit]] = (Annotated[float | None, limits], None)
    return keys


class FixedTraits(create_model("_FixedTraits", __base__=Section, **_fixable())):
    """Section `[drivers.fixed]`: traits that are the same for every driver.

    The keys are the numbers of `model.vehicles.DriverTraits` with their units and ranges; a trait
    without a value is left to the population.
    """

    def values(self) -> dict[str, float]:
        """Fixed values by the names of `model.vehicles.DriverTraits`."""
        fixed = self.model_dump(exclude_none=True)
        keys = {
            name + NAME_SUFFIXES[field.spec.unit]: name for name, field in RECORDED_TRAITS.items()
        }
        return {keys[key]: value for key, value in fixed.items()}


_SCALABLE = tuple(name for name, field in RECORDED_TRAITS.items() if not field.is_flag)


def _scalable(factors: dict[str, float]) -> dict[str, float]:
    for name in factors:
        if name not in _SCALABLE:
            raise specification_error("a known parameter", suggestion(name, _SCALABLE), got=name)
    return factors


class DriversSection(Section):
    """Section `[drivers]`.

    Attributes:
        population: A population of the knowledge base.
        driving_style: Range of the driving style, 0 careful to 1 reckless.
        fixed: Parameters that are the same for everyone.
        scale: Factors on the drawn traits of all drivers, by the names of
            `model.vehicles.DriverTraits`.
    """

    population: PopulationName
    driving_style: Annotated[tuple[Share, Share], AfterValidator(check_ascending)] = (0.0, 1.0)
    fixed: FixedTraits = FixedTraits()
    scale: Annotated[dict[str, Factor], AfterValidator(_scalable)] | None = None

    @model_validator(mode="after")
    def _scaled_inside(self) -> Self:
        fixed = self.fixed.values()
        for name, factor in (self.scale or {}).items():
            value, spec = fixed.get(name), TRAIT_RANGES[name]
            lowest, highest = spec.limits
            unit = "" if spec.unit == "1" else f" {spec.unit}"
            low, high = trait_range(self.population, name) if value is None else (value, value)
            if factor * low < lowest or factor * high > highest:
                raise specification_error(
                    f"a factor that keeps {low:g} to {high:g} within {lowest:g} to"
                    f" {highest:g}{unit}",
                    "choose one nearer to 1",
                    key=f"scale.{name}",
                    got=factor,
                )
        return self


class StartsSection(Section):
    """Section `[starts]`: conditions that every start fulfils.

    Attributes:
        allow_doomed: Whether a vehicle may start so fast that no braking saves it.
        min_gap_m: Smallest gap between two vehicles of a lane.
    """

    allow_doomed: bool = False
    min_gap_m: Annotated[float, Field(ge=MIN_GAP_M, le=100.0)] = 10.0


class Specification(Section):
    """A whole specification of scenarios.

    Attributes:
        profile: Name, road and frames.
        time: Durations.
        traffic: Vehicles.
        weather: Weather and light.
        drivers: Drivers.
        starts: Safety of the first frame.
        proposal: Components of importance sampling; None without them.
    """

    profile: ProfileSection
    time: TimeSection
    traffic: Annotated[
        Annotated[PlacedTraffic, Tag("placed")]
        | Annotated[FlowTraffic, Tag("flow")]
        | Annotated[TwoWayTraffic, Tag("two-way")],
        Discriminator(_kind_of_traffic),
    ]
    weather: Annotated[PresetWeather | IndependentWeather, Field(discriminator="mode")]
    drivers: DriversSection
    starts: StartsSection = StartsSection()
    proposal: Proposal | None = None

    @property
    def name(self) -> str:
        """Name of the profile."""
        return self.profile.name

    @property
    def road(self) -> str:
        """Name of the road."""
        return self.profile.road

    def to_dict(self) -> dict[str, Any]:
        """All values as JSON types, defaults included; `load_specification` reads them."""
        return self.model_dump(mode="json", exclude_none=True)

    def canonical_json(self) -> str:
        """`to_dict` as text that is the same for equal specifications, on one line."""
        return json.dumps(self.to_dict(), sort_keys=True, separators=(",", ":"), allow_nan=False)

    @property
    def specification_hash(self) -> str:
        """SHA-256 of `canonical_json`, in hexadecimal."""
        return hashlib.sha256(self.canonical_json().encode()).hexdigest()


_SECTIONS: dict[tuple[str, ...], type[Section]] = {
    (): Specification,
    ("profile",): ProfileSection,
    ("time",): TimeSection,
    ("traffic",): PlacedTraffic,
    ("weather", "pushes"): PushesSection,
    ("drivers",): DriversSection,
    ("drivers", "fixed"): FixedTraits,
    ("starts",): StartsSection,
    ("proposal",): Component,
    ("traffic", "lanes"): FlowLane,
}


def known_keys(section: tuple[str, ...], mode: str | None = None) -> tuple[str, ...]:
    """The keys that a section may have; `mode` is the weather's or the traffic's."""
    if section == ("weather",):
        model = PresetWeather if mode == "presets" else IndependentWeather
    elif section == ("traffic",):
        model = {"flow": FlowTraffic, "two-way": TwoWayTraffic}.get(mode or "", PlacedTraffic)
    else:
        model = _SECTIONS[tuple(part for part in section if not part.isdigit())]
    return tuple(model.model_fields)
