"""A specification of scenarios: one Pydantic model for each section of its TOML file.

`profiles.load_specification` makes a `Specification` from a file; the samplers of this package read
its sections. Section `[traffic]` is in `traffic_specification`, types of values are in
`specification_values`, and so is `Section`, the base of all models, which refuses unknown keys and
values of another type. The name of a key states its unit: `_m`, `_s`, `_kmh`, `_percent`; a key
without a unit is a plain number, a flag or a text. Two values in brackets are a range, from which
each simulation draws uniformly unless its key says otherwise.

The checks here need nothing but the file; `sampler` checks the specification against the road. The
*ego* is the vehicle under study, and a *trait* is a parameter of a driver, a field of
`model.vehicles.DriverTraits`. A *population*, from `knowledge/data/drivers.toml`, has distributions
of traits. *Placed* traffic is the kind of traffic without a mode: a few vehicles in a short zone.
`u` is a random number, uniform in (0, 1), and `z` is a standard normal one.

Section `[[proposal]]` draws rare simulations more often (importance sampling): its *components*
change the distributions of some random numbers. The distributions without a change, stated by the
other sections, are called the *profile*.
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
    "rains",  # Small: it rains.
    "rain",  # Amount of rain, if any.
    "foggy",  # Small: there is fog.
    "fog",  # Density of the fog, if any.
    "wind",
    "puddles",
    "clouds",  # Cloudiness.
    "sun",  # Height of the sun.
    "sun_direction",  # 0 and 1: the sun stands behind the ego, 0.5: ahead.
    "density",  # Density of the traffic on a motorway.
    "flow",  # Flow of the traffic on a two-way road.
    "start",  # Station of the ego on a two-way road.
    "held_up",  # Small: the ego starts close behind another vehicle, on a two-way road.
    "ego_driving_style",  # Small: careful.
    "ego_heeds_solid_lines",  # Large: the ego ignores solid lines, on a two-way road.
    "others_driving_style",  # Small: careful. Each of the other drivers has a number of its own.
)
"""Names of the uniform numbers u that a component may change, a choice. Where no comment says
otherwise, a large number gives a large quantity."""

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
"""Names of the standard normal numbers z that a component may change. Each decides a trait of the
ego; a large number gives a large trait. The list is a choice: other traits with a normal or
lognormal distribution, such as `accel`, could be added. A component has no effect on a trait that
is constant in the population."""

_MIN_PART = 0.001
"""Smallest width of a *part*, the limits within (0, 1) between which a component draws a u. Weights
contain 1 / width, which a width of zero would make infinite. The value is a choice."""


def _check_part(part: tuple[float, float]) -> tuple[float, float]:
    """Refuse a part that is too narrow, or whose limits are in the wrong order."""
    if part[1] - part[0] < _MIN_PART:
        expected = f"a lower end below the upper one, by {_MIN_PART:g} or more"
        raise specification_error(expected, "swap them or move them apart", got=list(part))
    return part


# Limits of the changes that a component may make, see `Component`; choices.
_Power = Annotated[float, Field(ge=0.01, le=20.0)]
_Part = Annotated[tuple[Share, Share], AfterValidator(_check_part)]
_Shift = Annotated[float, Field(ge=-3.0, le=3.0)]
_Temper = Annotated[float, Field(gt=0.0, le=1.0)]


def _is_of_ego(name: str) -> bool:
    """Whether a random number decides a property of the ego's driver."""
    return name.startswith("ego_")


def _keys_check(names: tuple[str, ...]) -> Callable[[dict[str, Any]], dict[str, Any]]:
    """A validator that refuses a table with a key that is not in `names`."""

    def check_keys(table: dict[str, Any]) -> dict[str, Any]:
        for name in table:
            if name not in names:
                raise specification_error("a known quantity", suggestion(name, names), got=name)
        return table

    return check_keys


class Component(Section):
    """Entry of section `[[proposal]]`: draws a share of the simulations from other distributions.

    This is importance sampling: rare simulations are drawn more often, and each gets a weight that
    corrects statistics (`random_draws.ProposalSampler`). A *power* replaces u by u^power: below one
    it favours large numbers, above one small ones. A *part* replaces u by a uniform number between
    two limits. A *shift* replaces z by z + shift.

    Attributes:
        name: Purpose of these simulations, in words.
        share: Share of the simulations that the component draws.
        powers: Power by name of the number, one of `PROPOSAL_UNIFORMS`.
        parts: Lower and upper limit by name of the number, one of `PROPOSAL_UNIFORMS`.
        shifts: Shift by name of the number, one of `PROPOSAL_NORMALS` [standard deviations].
        tempers: Degrees t of the powers and shifts, above 0 and up to 1. Each t makes a copy of the
            component with powers^t and t * shifts; the copies divide the share equally. All copies
            have the same parts, a choice. If a component changes many numbers strongly, most of
            its simulations have nearly no weight; copies with a small t draw simulations of larger
            weights.
    """

    name: Annotated[str, Field(min_length=1, max_length=40)]
    share: Annotated[Share, Field(gt=0.0, lt=1.0)]
    powers: Annotated[dict[str, _Power], AfterValidator(_keys_check(PROPOSAL_UNIFORMS))] = Field(
        default_factory=dict
    )
    parts: Annotated[dict[str, _Part], AfterValidator(_keys_check(PROPOSAL_UNIFORMS))] = Field(
        default_factory=dict
    )
    shifts: Annotated[dict[str, _Shift], AfterValidator(_keys_check(PROPOSAL_NORMALS))] = Field(
        default_factory=dict
    )
    tempers: Annotated[tuple[_Temper, ...], Field(min_length=1)] = (1.0,)

    def at_each_temper(self) -> tuple[Self, ...]:
        """Copies of the component, one for each temper, which have the only temper 1."""
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
        """Whether the component transforms a number.

        Args:
            name: Name of the number, as in `PROPOSAL_UNIFORMS` and `PROPOSAL_NORMALS`.
        """
        return name in self.powers or name in self.parts or name in self.shifts

    def without_ego_quantities(self) -> Self:
        """The component without its changes of the ego's driver.

        `analysis.evaluation` compares drivers of the ego in the same scenes. The model's driver of
        the ego then does not drive, so its numbers must not affect the weight of a scene. A
        component draws each number independently, so the weight without them is exact as well.
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
    def _check_one_change_per_number(self) -> Self:
        names_in_both = set(self.powers) & set(self.parts)
        if names_in_both:
            name = min(names_in_both)
            raise specification_error(
                "a power or a part for a quantity", "leave one out", key=f"parts.{name}", got="both"
            )
        return self


def _check_total_share(components: tuple[Component, ...]) -> tuple[Component, ...]:
    """Refuse shares that leave no simulations to the profile: weights would have no bound."""
    total = sum(component.share for component in components)
    if total >= 1.0:
        raise specification_error(
            "shares that leave some simulations to the profile, a sum below 1",
            "lower a share",
            key="share",
            got=f"{total:g}",
        )
    return components


Proposal = Annotated[tuple[Component, ...], Field(min_length=1), AfterValidator(_check_total_share)]
"""Components; all other simulations are drawn from the profile itself, which bounds every weight by
1 / (1 - the sum of the shares)."""

# Types of keys of `IndependentWeather`; the limits are choices.
Exponent = Annotated[float, Field(gt=0.0, le=20.0)] | None
"""Exponent e of low + (high - low) u^e; None for another distribution."""

Weibull = (
    tuple[Annotated[float, Field(gt=0.0, le=100.0)], Annotated[float, Field(ge=0.2, le=20.0)]]
    | None
)
"""Scale [%] and shape of a Weibull distribution; None for another distribution."""


def _traffic_mode(section: Any) -> str:
    """Tag of the model for section `[traffic]`: its key `mode`, or "placed" without a known mode.

    An unknown mode leads to an error all the same: `PlacedTraffic` has no key `mode`. Pydantic
    calls this with the table of a file or with a model.
    """
    mode = section.get("mode") if isinstance(section, dict) else getattr(section, "mode", None)
    return mode if mode in ("flow", "two-way") else "placed"


class ProfileSection(Section):
    """Section `[profile]`.

    Attributes:
        name: Name of the profile, which manifests and tables of data sets state.
        road: Name of a road of the package; users may replace it by a map file.
        frame_interval_ms: Time between two recorded frames, a multiple of the time step of the
            simulation (`STEP_MS`, 10 ms).
    """

    name: Annotated[str, Field(min_length=1, max_length=64)]
    road: RoadName
    frame_interval_ms: Annotated[int, Field(ge=STEP_MS, le=1000), AfterValidator(check_on_clock)]


class TimeSection(Section):
    """Section `[time]`.

    Attributes:
        horizon_s: Longest duration of a simulation.
        attempt_deadline_s: From this time on a simulation also ends as soon as the ego neither
            overtakes nor is about to overtake, because it never began or has given up.
    """

    horizon_s: Duration
    attempt_deadline_s: Duration

    @model_validator(mode="after")
    def _check_deadline(self) -> Self:
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

    The study is Pinto, Dutra and Fonseca (2023). The road is dry and the air clear and still. Rain
    and wind push all vehicles sideways, to the side to which the wind blows; less rain or wind
    makes the pushes rarer. In each of three conditions drivers see as far as `sight_m`: by night,
    above 60 % of clouds (the study's limit), or towards a low sun. The limits of the keys are
    choices.

    Attributes:
        accel_mps2: Lateral acceleration of a push; 0 without pushes.
        duration_s: How long a push lasts.
        interval_s: Time between the starts of two pushes at 100 % of rain and of wind.
        sight_m: Sight distance of drivers by night, under clouds and towards a low sun.
    """

    accel_mps2: Annotated[float, Field(ge=0.0, le=50.0)]
    duration_s: Annotated[float, Field(ge=0.05, le=10.0)]
    interval_s: Annotated[float, Field(ge=0.05, le=1000.0)]
    sight_m: Annotated[float, Field(ge=1.0, le=1000.0)]

    @property
    def lateral_pushes(self) -> LateralPushes:
        """The same values as a scenario states them, in SI units."""
        return LateralPushes(
            accel=self.accel_mps2,
            duration=self.duration_s,
            interval=self.interval_s,
            sight_distance=self.sight_m,
        )


class PresetWeather(Section):
    """Section `[weather]` with `mode = "presets"`: one of the weathers of the simulator CARLA.

    Attributes:
        mode: Distinguishes the two models of section `[weather]`.
        presets: Weight of each preset by its name, such as `ClearNoon`.
        pushes: Lateral pushes in place of the physical effects of the weather; None for physics.
    """

    mode: Literal["presets"]
    presets: Presets
    pushes: PushesSection | None = None


class IndependentWeather(Section):
    """Section `[weather]` with `mode = "independent"`: every quantity is drawn on its own.

    The percentages have the meaning of the simulator CARLA: 100 is the heaviest rain, the strongest
    wind, the densest fog. A quantity is drawn from one of three distributions:

    - uniform between low and high, the ends of its range;
    - with an exponent e, low + (high - low) u^e, which makes small values more frequent for e > 1;
    - with `..._weibull`, low + a Weibull number with this scale and shape, limited to high, for
      quantities that are seldom extreme.

    Fog has no Weibull distribution and clouds have only the uniform one, because no profile of the
    package needs another. The defaults are choices. Rain never falls without clouds and water on
    the road: `weather_sampling` raises puddles and cloudiness to a minimum for the rain.

    Attributes:
        mode: Distinguishes the two models of section `[weather]`.
        rain_probability: Share of the simulations with rain.
        rain_percent: Rain, if any.
        puddles_percent: Water that lies on the road.
        wind_percent: Wind.
        fog_probability: Share of the simulations with fog.
        fog_percent: Fog, if any.
        cloudiness_percent: Clouds.
        sun_altitude_deg: Height of the sun above the horizon; below zero it is night.
        rain_exponent: Exponent e of rain.
        fog_exponent: Exponent e of fog.
        wind_exponent: Exponent e of wind.
        puddles_exponent: Exponent e of the water that lies on the road.
        rain_weibull: Scale [%] and shape of rain.
        wind_weibull: Scale [%] and shape of wind.
        puddles_weibull: Scale [%] and shape of the water that lies on the road.
        pushes: Lateral pushes in place of the physical effects of the weather; None for physics.
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
    def _check_one_distribution(self) -> Self:
        for name in ("rain", "wind", "puddles"):
            distributions = (getattr(self, f"{name}_exponent"), getattr(self, f"{name}_weibull"))
            if None not in distributions:
                raise specification_error(
                    f"{name}_exponent or {name}_weibull",
                    "leave one of them out",
                    key=f"{name}_weibull",
                    got="both",
                )
        return self


def _fixed_trait_fields() -> dict[str, Any]:
    """Fields of `FixedTraits`: (type, default) by key, for each trait that is a number.

    Flags, such as `uses_indicator`, cannot be fixed.
    """
    fields: dict[str, Any] = {}
    for name, field in RECORDED_TRAITS.items():
        if not field.is_flag:
            low, high = field.spec.limits
            limits = Field(ge=low, le=high)
            fields[name + NAME_SUFFIXES[field.spec.unit]] = (Annotated[float | None, limits], None)
    return fields


class FixedTraits(create_model("_FixedTraits", __base__=Section, **_fixed_trait_fields())):
    """Section `[drivers.fixed]`: traits that are the same for every driver.

    Its keys are names of traits with their unit, such as `reaction_time_s`. They are made from
    `DriverTraits`, which declares units and limits of all traits. A trait without a value (None) is
    drawn from the population.
    """

    def value_by_trait(self) -> dict[str, float]:
        """Fixed values by name of the trait, without the unit of the key, such as `time_gap`."""
        fixed = self.model_dump(exclude_none=True)
        names = {
            name + NAME_SUFFIXES[field.spec.unit]: name for name, field in RECORDED_TRAITS.items()
        }
        return {names[key]: value for key, value in fixed.items()}


_SCALABLE_TRAITS = tuple(name for name, field in RECORDED_TRAITS.items() if not field.is_flag)


def _check_scaled_traits(factors: dict[str, float]) -> dict[str, float]:
    """Refuse a factor on an unknown trait or on a flag."""
    for name in factors:
        if name not in _SCALABLE_TRAITS:
            next_step = suggestion(name, _SCALABLE_TRAITS)
            raise specification_error("a known trait", next_step, got=name)
    return factors


class DriversSection(Section):
    """Section `[drivers]`.

    Attributes:
        population: Name of a population.
        driving_style: Range of the driving style, 0 careful to 1 reckless, on which the
            distributions of the traits depend.
        fixed: Traits that are the same for every driver.
        scale: Factors on traits of every driver, drawn or fixed, by name of the trait; None
            without factors.
    """

    population: PopulationName
    driving_style: Annotated[tuple[Share, Share], AfterValidator(check_ascending)] = (0.0, 1.0)
    fixed: FixedTraits = FixedTraits()
    scale: Annotated[dict[str, Factor], AfterValidator(_check_scaled_traits)] | None = None

    @model_validator(mode="after")
    def _check_scaled_ranges(self) -> Self:
        fixed = self.fixed.value_by_trait()
        for name, factor in (self.scale or {}).items():
            fixed_value, spec = fixed.get(name), TRAIT_RANGES[name]
            min_allowed, max_allowed = spec.limits
            unit = "" if spec.unit == "1" else f" {spec.unit}"
            # For the whole population, also if `driving_style` is narrower: a choice.
            low, high = (
                trait_range(self.population, name)
                if fixed_value is None
                else (fixed_value, fixed_value)
            )
            if factor * low < min_allowed or factor * high > max_allowed:
                raise specification_error(
                    f"a factor that keeps {low:g} to {high:g} within {min_allowed:g} to"
                    f" {max_allowed:g}{unit}",
                    "choose one nearer to 1",
                    key=f"scale.{name}",
                    got=factor,
                )
        return self


class StartsSection(Section):
    """Section `[starts]`: conditions that every start fulfils, see `safe_start`.

    Attributes:
        allow_doomed: Whether a vehicle may start so fast and near behind another one that braking
            cannot avoid a collision.
        min_gap_m: Smallest gap between two vehicles of a lane, bumper to bumper; the default is a
            choice.
    """

    allow_doomed: bool = False
    min_gap_m: Annotated[float, Field(ge=MIN_GAP_M, le=100.0)] = 10.0


class Specification(Section):
    """A whole specification of scenarios; each attribute is a section of the file.

    Attributes:
        profile: Name, road and interval of the recorded frames.
        time: Durations.
        traffic: Vehicles, their numbers, lanes and speeds.
        weather: Weather and light.
        drivers: Drivers.
        starts: Safety of the starts.
        proposal: Components of importance sampling; None if all simulations are drawn from the
            other sections as they are.
    """

    profile: ProfileSection
    time: TimeSection
    traffic: Annotated[
        Annotated[PlacedTraffic, Tag("placed")]
        | Annotated[FlowTraffic, Tag("flow")]
        | Annotated[TwoWayTraffic, Tag("two-way")],
        Discriminator(_traffic_mode),
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
        """All values as JSON types, defaults included, None left out.

        `profiles.load_specification` reads them.
        """
        return self.model_dump(mode="json", exclude_none=True)

    def canonical_json(self) -> str:
        """`to_dict` as text on one line, the same for equal specifications."""
        return json.dumps(self.to_dict(), sort_keys=True, separators=(",", ":"), allow_nan=False)

    @property
    def specification_hash(self) -> str:
        """SHA-256 of `canonical_json`, in hexadecimal; data sets state it."""
        return hashlib.sha256(self.canonical_json().encode()).hexdigest()


_SECTIONS: dict[tuple[str, ...], type[Section]] = {
    (): Specification,
    ("profile",): ProfileSection,
    ("time",): TimeSection,
    ("weather", "pushes"): PushesSection,
    ("drivers",): DriversSection,
    ("drivers", "fixed"): FixedTraits,
    ("starts",): StartsSection,
    ("proposal",): Component,
    ("traffic", "lanes"): FlowLane,
}
"""Models of the sections whose keys do not depend on a mode, by path of the section."""


def known_keys(section: tuple[str, ...], mode: str | None = None) -> tuple[str, ...]:
    """The keys that a section may have, for messages about unknown keys.

    Args:
        section: Path of the section, such as `("drivers", "fixed")`; a number in it is the position
            of an entry of a list, as in `("proposal", "0")`.
        mode: The `mode` of section `[weather]` or `[traffic]`, or "placed"; None for any other
            section.
    """
    if section == ("weather",):
        model = PresetWeather if mode == "presets" else IndependentWeather
    elif section == ("traffic",):
        model = {"flow": FlowTraffic, "two-way": TwoWayTraffic}.get(mode or "", PlacedTraffic)
    else:
        model = _SECTIONS[tuple(part for part in section if not part.isdigit())]
    return tuple(model.model_fields)
