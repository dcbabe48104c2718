"""The reference of the knowledge base: every number with its unit, source and reason."""

from __future__ import annotations

from typing import TYPE_CHECKING

from generators.markdown import page, section, table, unit

from overtaking.analysis.validation.targets import TargetRole, targets
from overtaking.knowledge.quantities import Distribution, Quantity
from overtaking.knowledge.toml_reader import all_quantities, sources
from overtaking.knowledge.vehicle_classes import VEHICLE_CLASS_NAMES
from overtaking.scenarios.driver_sampling import ALL_TRAITS, CLASS_FACTORS, population_names
from overtaking.scenarios.profiles import load_specification, profile_names

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from overtaking.analysis.validation.targets import FigureTarget

    Entry = Quantity | Distribution

FILES = {
    "model.toml": "Drivers, steering, perception, collisions",
    "weather.toml": "Weather, sight and wind",
    "friction.toml": "Tyres and road",
    "sampling.toml": "Starts, traffic around the ego, weather that goes together",
}


CONSTANTS = """\
Every number of the model that belongs neither to a vehicle class nor to a driver. A value whose
source is *choice* is ours, for the reason given; the others come from [sources](sources.md). They
live in `src/overtaking/knowledge/data/`.
"""
VEHICLES = """\
The seven vehicle classes of the study: small, medium and large car, van, rigid truck, motorcycle,
and bicycle with rider. `±` is one standard deviation; what varies is drawn for each vehicle,
within two standard deviations or the limits that `vehicle_classes.toml` states. Trucks that pull a
semitrailer have the numbers of `semitrailer` in [constants](constants.md).
"""
DRIVERS = """\
A profile draws its drivers from a *population*. Each driver has a hidden *driving style*, uniform
from 0 (careful) to 1 (reckless) unless the specification narrows it. A population gives each
parameter one distribution for careful and one for reckless drivers; a style in between interpolates
between the two (the median of a lognormal on a logarithmic scale). Draws are truncated at 2.5
standard deviations and at the limits in brackets.
"""
UNUSED = """\
No profile of the package draws from this population. A specification of your own can name it:
`--set drivers.population={name}`.
"""
SPEEDS = """\
A data set does not record `cruise_factor`, `speed_over_leader` and `wants_to_overtake`. They set
`desired_speed`: for the traffic, its initial speed times `cruise_factor`; for the ego, at least its
leader's speed plus `speed_over_leader`, unless it does not want to overtake.
"""
FIGURES = """\
What `overtaking validate` prints of a profile, with the limits within which natural traffic lies:
of roads with one direction, where the limits are those of motorways, and of two-way roads. The
*standing* of a figure says what a value within its limits means:

{standings}

Limits whose source is *choice* are ours, for the reason given: a figure within them is not
validated. A figure without limits has no verdict. All figures are declared in
`src/overtaking/knowledge/data/validation.toml`.
"""
PASSES = """\
A pass is timed from when the ego's side crosses the line until all of it is back. Its margin is
the time until it would have met the nearest oncomer, at that moment. The last figure is of profiles
with a proposal alone: such collisions are too rare to be met by running.
"""
SOURCES = """\
What the numbers of the knowledge base rest on. *Read* says whether the values were read in the
source or in a faithful reprint of it; the others are common knowledge of the field, and should be
looked up before they are quoted in a paper.
"""


def constants() -> str:
    """The page `reference/constants.md`."""
    return page("Constants", CONSTANTS, *(_file(name, title) for name, title in FILES.items()))


def vehicles() -> str:
    """The page `reference/vehicles.md`."""
    entries = all_quantities("vehicle_classes.toml")
    first = f"{VEHICLE_CLASS_NAMES[0]}."
    names = [name.removeprefix(first) for name in entries if name.startswith(first)]
    values = table(
        ("quantity", "unit", *VEHICLE_CLASS_NAMES), [_of_classes(entries, name) for name in names]
    )
    reasons = table(("quantity", "source", "why"), [_reason(entries, name) for name in names])
    return page("Vehicle classes", VEHICLES, values, section("Where they come from", reasons))


def drivers() -> str:
    """The page `reference/drivers.md`."""
    parameters = [(f"`{name}`", one.meaning, unit(one.unit)) for name, one in ALL_TRAITS.items()]
    profiles = {name: load_specification(name).drivers.population for name in profile_names()}
    used = sorted(population_names(), key=lambda name: name not in profiles.values())
    return page(
        "Drivers",
        DRIVERS,
        table(("profile", "population"), [_linked(*pair) for pair in profiles.items()]),
        section("Parameters", table(("parameter", "meaning", "unit"), parameters), SPEEDS),
        *(_population(name, [one for one in profiles if profiles[one] == name]) for name in used),
    )


def _linked(profile: str, population: str) -> tuple[str, str]:
    return f"`{profile}`", f"[`{population}`](#population-{population})"


def _population(name: str, profiles: list[str]) -> str:
    """One population: its distributions, and what the vehicle class changes in them."""
    header = ("parameter", "careful", "reckless", "sources", "why")
    users = ", ".join(f"`{one}`" for one in profiles)
    return section(
        f"Population {name}",
        f"Profiles: {users}." if profiles else UNUSED.format(name=name),
        table(header, [_distributions(name, trait) for trait in ALL_TRAITS]),
        table(*_factors(name)),
    )


def figures() -> str:
    """The page `reference/figures.md`."""
    standings = "\n".join(f"* *{one}*: {one.meaning}" for one in TargetRole)
    header = ("figure", "what", "from", "to", "unit", "standing", "sources", "why")
    return page(
        "Figures of a profile",
        FIGURES.format(standings=standings),
        table(header, [_figure(name, one) for name, one in targets().items()]),
        section(
            "Passes on two-way roads",
            PASSES,
            table(header, [_figure(name, one) for name, one in targets("passes").items()]),
        ),
    )


def _figure(name: str, one: FigureTarget) -> tuple[str, ...]:
    reasons = (limit.rationale or "" for limit in one.limits)
    return (
        f"`{name}`",
        one.description,
        "" if one.low is None else shown(one.low),
        "" if one.high is None else shown(one.high),
        unit(one.unit),
        one.standing,
        ", ".join(dict.fromkeys(source_link(limit.source) for limit in one.limits)),
        " · ".join(reason for reason in dict.fromkeys(reasons) if reason != "see low"),
    )


def bibliography() -> str:
    """The page `reference/sources.md`."""
    rows = [
        (f'<a id="{one.id}"></a>`{one.id}`', one.citation, one.kind, _yes(one.checked))
        for one in sources().values()
    ]
    return page("Sources", SOURCES, table(("id", "what", "kind", "read"), rows))


def source_link(id_: str) -> str:
    """A source as a link to its line."""
    return "*choice*" if id_ == "choice" else f"[{id_}](sources.md#{id_})"


def shown(entry: Entry) -> str:
    """A value, with its spread if it has one, in the unit in which it is written."""
    if isinstance(entry, Distribution):
        return _spread(entry)
    if isinstance(entry.value, tuple):
        return _nested(entry.value, _unscaled(entry))
    value = _rounded(_unscaled(entry)(entry.number))
    return value if entry.sigma is None else f"{value} ± {_rounded(_unscaled(entry)(entry.sigma))}"


def numbers_of(name: str) -> str:
    """Every number of a file, with its unit, source and reason."""
    rows = [
        (
            f"`{key}`",
            shown(entry),
            unit(entry.quoted_unit),
            source_link(entry.source),
            entry.rationale or "",
        )
        for key, entry in all_quantities(name).items()
    ]
    return table(("entry", "value", "unit", "source", "why"), rows)


def _file(name: str, title: str) -> str:
    return section(f"{title}: `{name}`", numbers_of(name))


def _of_classes(entries: Mapping[str, Entry], name: str) -> tuple[str, ...]:
    of_class = [entries[f"{kind}.{name}"] for kind in VEHICLE_CLASS_NAMES]
    return f"`{name}`", unit(of_class[0].quoted_unit), *map(shown, of_class)


def _reason(entries: Mapping[str, Entry], name: str) -> tuple[str, ...]:
    of_class = [entries[f"{kind}.{name}"] for kind in VEHICLE_CLASS_NAMES]
    origins = dict.fromkeys(source_link(entry.source) for entry in of_class)
    reasons = dict.fromkeys(entry.rationale for entry in of_class if entry.rationale)
    return f"`{name}`", ", ".join(origins), " · ".join(reasons)


def _distributions(population: str, name: str) -> tuple[str, ...]:
    entries = all_quantities("drivers.toml")
    careful, reckless = (entries[f"{population}.{end}.{name}"] for end in ("careful", "reckless"))
    origins = dict.fromkeys(source_link(entry.source) for entry in (careful, reckless))
    reasons = dict.fromkeys(
        entry.rationale
        for entry in (careful, reckless)
        if entry.rationale and "see care" not in entry.rationale.lower()
    )
    return (
        f"`{name}`",
        shown(careful),
        shown(reckless),
        ", ".join(origins),
        " · ".join(reasons),
    )


def _factors(population: str) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    entries = all_quantities("drivers.toml")
    prefix = f"{population}.classes."
    rows = [
        (
            key.removeprefix(prefix).partition(".")[0],
            f"`{key.rpartition('.')[2]}`",
            f"`{CLASS_FACTORS[key.rpartition('.')[2]]}`",
            shown(entry),
            source_link(entry.source),
            entry.rationale or "",
        )
        for key, entry in entries.items()
        if key.startswith(prefix)
    ]
    return ("class", "factor", "on", "value", "source", "why"), rows


def _spread(entry: Distribution) -> str:
    value = lambda name: _rounded(entry.parameter(name))  # noqa: E731
    limits = f"[{_rounded(entry.low)}, {_rounded(entry.high)}]"
    match entry.kind:
        case "constant":
            return value("value")
        case "bernoulli":
            return f"yes in {_rounded(100 * entry.parameter('probability'))} %"
        case "normal":
            return f"{value('mean')} ± {value('sigma')} {limits}"
        case _:
            return f"{value('median')} ×/÷ e^{value('sigma')} {limits}"


def _unscaled(entry: Quantity) -> Callable[[float], float]:
    """From the unit in which a value is kept back to that in which it is written."""
    from overtaking.core.units import unit_converter

    if entry.unit == entry.quoted_unit:
        return float
    factor = unit_converter(entry.quoted_unit, where="documentation")(1.0)
    return lambda number: number / factor


def _nested(value: object, convert: Callable[[float], float]) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(_nested(item, convert) for item in value)}]"
    return _rounded(convert(float(value)))  # type: ignore[arg-type]


def _rounded(value: float) -> str:
    return f"{value:.5g}"


def _yes(is_so: bool) -> str:
    return "yes" if is_so else "no"
