"""Numbers with unit and source, parsed from entries of the knowledge files.

An entry is a TOML table with a number, or with a distribution of a number over a population:

    length = { value = 4.4, sigma = 0.2, unit = "m", source = "choice", rationale = "..." }
    patience = { distribution = "lognormal", median = 30.0, sigma = 0.4, low = 1.0, high = 120.0,
                 unit = "s", source = "choice", rationale = "..." }

Only traits of drivers (`drivers.toml`) have distributions, one for careful and one for reckless
drivers; for drivers in between, `scenarios` interpolates the parameters. All other numbers have a
`value`, and quantities of vehicle classes may state a spread around it (`sigma`, `low`, `high`).

`parse_quantity` and `parse_distribution` check an entry and convert its numbers to SI. A name with
a suffix such as `_percent` or `_mm` is the exception: its numbers stay in that unit
(`core.units.UNCONVERTED_SUFFIXES`). `toml_reader` reads the files and calls these functions.
"""

from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, TypeAlias, TypeGuard, cast

import numpy as np

from overtaking.core.errors import KnowledgeError
from overtaking.core.units import si_unit, unit_converter, unit_of_suffix

Values: TypeAlias = "float | tuple[Values, ...]"
"""A number, or a tuple of numbers or of tuples, as deep as the lists of the file."""

ENGINEERING_CHOICE = "choice"
"""Source of a number that the authors chose; its entry must state a rationale."""

SUPPORT_SIGMAS = 2.0
"""Where an entry states no limit (`low` or `high`), samples of the quantity stay within this many
standard deviations of its value. Chosen: rarer values make implausible vehicles."""

SOURCE_KINDS = ("law", "standard", "handbook", "paper", "report", "software")
"""Valid kinds of sources."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A publication, standard or program from which values come.

    Attributes:
        id: Short name by which entries refer to it, such as "un-r157".
        citation: Author, year, title, and a DOI or an official number.
        kind: One of `SOURCE_KINDS`.
        checked: Whether the authors of this package read the values in the source or in a faithful
            reprint. If not, the values are common knowledge of the field.
    """

    id: str
    citation: str
    kind: str
    checked: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A number, or a table of numbers, with unit and source.

    Attributes:
        value: The number in `unit`, or nested tuples of such numbers.
        sigma: Standard deviation within the population, in `unit`; None if all members have the
            same value.
        low: Smallest value of a sample, in `unit`: the `low` of the entry; without it, `value`
            minus `SUPPORT_SIGMAS` times `sigma`; without both, and for a table, `value`.
        high: Largest value of a sample, in `unit`: the `high` of the entry; without it, `value`
            plus `SUPPORT_SIGMAS` times `sigma`; without both, and for a table, `value`.
        unit: The SI unit, or the unit in the suffix of the entry's name.
        quoted_unit: The unit in the file, which is the unit of its source.
        source: `Source.id`, or "choice".
        rationale: The reason for this value; None if a published source suffices.
    """

    value: Values
    sigma: float | None
    low: Values
    high: Values
    unit: str
    quoted_unit: str
    source: str
    rationale: str | None

    def numbers(self) -> dict[str, Any]:
        """Numbers and unit without source and rationale, as JSON types, to hash them."""
        limits = {"sigma": self.sigma, "low": self.low, "high": self.high}
        return {"value": self.value, **limits, "unit": self.unit}

    @property
    def number(self) -> float:
        """The value of a quantity that is a single number.

        Raises:
            KnowledgeError: The value is a table of numbers.
        """
        if isinstance(self.value, tuple):
            raise KnowledgeError(
                what="value",
                where="quantity",
                expected="one number",
                got=f"{len(self.value)} entries",
                next_step="use .value",
            )
        return self.value

    def __float__(self) -> float:
        """The same as `number`."""
        return self.number

    @property
    def f32(self) -> np.float32:
        """`number`, rounded to float32, in which the labels are computed."""
        return np.float32(self.number)

    def __str__(self) -> str:
        """The number with its unit, as its source states them: `80 km/h`."""
        return self.in_unit(self.quoted_unit)

    def bare(self) -> str:
        """The number alone, in the unit of its source: `80`."""
        return self._in_unit_without_symbol(self.quoted_unit)

    def in_unit(self, unit: str) -> str:
        """The number in a unit, with the unit: `8.33 m/s` is `30 km/h`.

        Args:
            unit: A unit of the same dimension.

        Raises:
            KnowledgeError: The unit has another dimension.
        """
        return f"{self._in_unit_without_symbol(unit)} {unit}"

    def _in_unit_without_symbol(self, unit: str) -> str:
        if unit == self.unit:
            number = self.number
        elif si_unit(unit) == self.unit:
            number = self.number / unit_converter(unit, where="quantity")(1.0)
        else:
            raise KnowledgeError(
                what="unit",
                where="quantity",
                expected=f"a unit of the dimension of {self.unit}",
                got=repr(unit),
                next_step="ask for one of them",
            )
        # Three significant digits: 8.33 m/s becomes 30 km/h instead of 29.988, and rounding errors
        # of a conversion to SI disappear.
        return f"{number:.3g}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Distribution:
    """The distribution of a parameter over a population.

    Kinds and their parameters:
        constant: value
        normal: mean, sigma
        lognormal: median, sigma (of the natural logarithm, so without unit)
        bernoulli: probability of 1; else 0

    Attributes:
        kind: A kind in this list.
        parameters: Parameter name to number, in `unit` if the parameter has one.
        low: Smallest possible draw, in `unit`; normal and lognormal are truncated here.
        high: Largest possible draw, in `unit`; normal and lognormal are truncated here.
        unit: The SI unit of a draw, or the unit in the suffix of the entry's name.
        quoted_unit: The unit in the file.
        source: `Source.id`, or "choice".
        rationale: The reason for this distribution; None if a published source suffices.
    """

    kind: str
    parameters: Mapping[str, float]
    low: float
    high: float
    unit: str
    quoted_unit: str
    source: str
    rationale: str | None

    def __post_init__(self) -> None:
        """Make the parameters read-only, because distributions are cached."""
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))

    def numbers(self) -> dict[str, Any]:
        """Numbers, kind and unit without source and rationale, as JSON types, to hash them."""
        limits = {"low": self.low, "high": self.high}
        return {"kind": self.kind, **self.parameters, **limits, "unit": self.unit}

    def parameter(self, name: str) -> float:
        """The value of a parameter.

        Args:
            name: Name of the parameter, such as "median".

        Raises:
            KnowledgeError: Distributions of this kind do not have it.
        """
        if name in self.parameters:
            return self.parameters[name]
        raise KnowledgeError(
            what="parameter",
            where=f"{self.kind} distribution",
            expected=f"one of {', '.join(self.parameters)}",
            got=name,
            next_step="ask for a parameter of this kind",
        )


_ENTRY_KEYS = frozenset(["value", "distribution", "unit", "source"])
"""Any of these keys makes a table an entry."""

_REQUIRED_KEYS = frozenset(["unit", "source"])
"""Keys that every entry must have."""

_OPTIONAL_KEYS = frozenset(["rationale"])
"""Keys that every entry may have."""

_SPREAD_KEYS = frozenset(["sigma", "low", "high"])
"""Keys that an entry with a value may have."""

# Kind of distribution to the keys that it needs beside `distribution`, `unit` and `source`.
_KEYS_BY_KIND = {
    "constant": frozenset(["value"]),
    "normal": frozenset(["mean", "sigma", "low", "high"]),
    "lognormal": frozenset(["median", "sigma", "low", "high"]),
    "bernoulli": frozenset(["probability"]),
}

# Kind of distribution to the parameters that are pure numbers, so that no unit applies to them.
_UNITLESS_BY_KIND = {
    "lognormal": frozenset(["sigma"]),
    "bernoulli": frozenset(["probability"]),
}


def is_entry(item: object) -> TypeGuard[dict[str, Any]]:
    """Whether an item of a TOML document is an entry, complete or not.

    Otherwise it is a table of entries, a text or a flag.
    """
    if not isinstance(item, dict):
        return False
    table = cast("dict[str, object]", item)
    # A table of entries may hold an entry with the name "value" or "source". The item at this key
    # is then a dict; in an entry it is a number or a text.
    return any(key in table and not isinstance(table[key], dict) for key in _ENTRY_KEYS)


def parse_quantity(
    entry: Mapping[str, Any], *, name: str, where: str, sources: Container[str]
) -> Quantity:
    """Parse an entry with a value.

    Args:
        entry: Keys value, unit, source; optionally sigma, low, high, rationale.
        name: Name of the entry; a suffix such as `_mm` keeps the value in that unit.
        where: File and entry, for messages.
        sources: The ids that `source` may have.

    Returns:
        The quantity, in SI or in the unit of the suffix.

    Raises:
        KnowledgeError: A key is missing or unknown, or its value is invalid.
    """
    needed = _REQUIRED_KEYS | {"value"}
    _check_entry(entry, needed=needed, optional=_SPREAD_KEYS, where=where, sources=sources)
    unit, convert = _unit_and_converter(entry, name, where)
    value = _convert_values(entry["value"], convert, where)
    sigma = _convert_number(entry["sigma"], convert, where) if "sigma" in entry else None
    low, high = _range_of_samples(entry, value, sigma, convert, where)
    return Quantity(
        value=value,
        sigma=sigma,
        low=low,
        high=high,
        unit=unit,
        **_origin(entry),
    )


def parse_distribution(
    entry: Mapping[str, Any], *, name: str, where: str, sources: Container[str]
) -> Distribution:
    """Parse an entry with a distribution.

    Args:
        entry: Keys distribution, unit, source and the parameters of the kind; optionally rationale.
        name: Name of the entry; a suffix such as `_mm` keeps the values in that unit.
        where: File and entry, for messages.
        sources: The ids that `source` may have.

    Returns:
        The distribution, in SI or in the unit of the suffix.

    Raises:
        KnowledgeError: A key is missing or unknown, the kind is unknown, or the parameters are
            inconsistent.
    """
    kind = entry.get("distribution")
    if kind not in _KEYS_BY_KIND:
        raise _error("distribution", where, f"one of {', '.join(_KEYS_BY_KIND)}", kind)
    needed = _REQUIRED_KEYS | {"distribution"} | _KEYS_BY_KIND[kind]
    _check_entry(entry, needed=needed, optional=frozenset(), where=where, sources=sources)
    unit, convert = _unit_and_converter(entry, name, where)
    unitless = _UNITLESS_BY_KIND.get(kind, frozenset())
    numbers = {
        key: _convert_number(entry[key], float if key in unitless else convert, where)
        for key in sorted(_KEYS_BY_KIND[kind])  # The order of a set differs between processes.
    }
    low, high = _range_of_draws(kind, numbers, where)
    return Distribution(
        kind=kind,
        parameters={key: value for key, value in numbers.items() if key not in ("low", "high")},
        low=low,
        high=high,
        unit=unit,
        **_origin(entry),
    )


def _origin(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Unit in the file, source and rationale, as fields of `Quantity` and `Distribution`."""
    return {
        "quoted_unit": entry["unit"],
        "source": entry["source"],
        "rationale": entry.get("rationale"),
    }


def _check_entry(
    entry: Mapping[str, Any],
    *,
    needed: frozenset[str],
    optional: frozenset[str],
    where: str,
    sources: Container[str],
) -> None:
    """Raise KnowledgeError for wrong keys, an unknown source, or a choice without a rationale.

    Args:
        entry: The entry.
        needed: Keys that the entry must have.
        optional: Keys that it may have, besides a rationale.
        where: File and entry, for messages.
        sources: The ids that `source` may have.
    """
    allowed = needed | optional | _OPTIONAL_KEYS
    if missing := needed - entry.keys():
        expected = f"the keys {', '.join(sorted(needed))}"
        raise _error(f"missing {min(missing)}", where, expected, entry)
    if unknown := entry.keys() - allowed:
        expected = f"only the keys {', '.join(sorted(allowed))}"
        raise _error(f"unknown key {min(unknown)}", where, expected, min(unknown))
    source = entry["source"]
    if source == ENGINEERING_CHOICE and not str(entry.get("rationale", "")).strip():
        raise _error("missing rationale", where, "a reason beside source = 'choice'", "none")
    if source != ENGINEERING_CHOICE and source not in sources:
        raise _error("unknown source", where, "an id of sources.toml", repr(source))


def _unit_and_converter(
    entry: Mapping[str, Any], name: str, where: str
) -> tuple[str, Callable[[Any], float]]:
    """The unit of the parsed numbers, and the function that converts numbers of the entry to it."""
    quoted_unit: str = entry["unit"]
    # `str`, because the file may state a number as unit: the converter then raises a clear error.
    convert_to_si = unit_converter(str(quoted_unit), where=where)
    suffix_unit = unit_of_suffix(name)
    if suffix_unit is None:
        return si_unit(quoted_unit), convert_to_si
    if suffix_unit != quoted_unit:
        raise _error("unit", where, f"{suffix_unit}, as the name {name} says", quoted_unit)
    return quoted_unit, float


def _convert_values(item: Any, convert: Callable[[Any], float], where: str) -> Values:
    """Convert a number, or nested lists of numbers to nested tuples; an empty list is invalid."""
    if isinstance(item, list) and item:
        elements = cast("list[Any]", item)
        return tuple(_convert_values(element, convert, where) for element in elements)
    return _convert_number(item, convert, where)


def _convert_number(item: Any, convert: Callable[[Any], float], where: str) -> float:
    """Convert a finite number.

    All conversions are factors without an offset, so they also hold for a standard deviation.
    """
    # For NaN and infinities the difference is NaN, which differs from 0.
    if isinstance(item, bool) or not isinstance(item, int | float) or item - item != 0:
        raise _error("value", where, "a finite number", item)
    return convert(float(item))


def _range_of_samples(
    entry: Mapping[str, Any],
    value: Values,
    sigma: float | None,
    convert: Callable[[Any], float],
    where: str,
) -> tuple[Values, Values]:
    """`Quantity.low` and `Quantity.high` of an entry."""
    if isinstance(value, tuple):
        if entry.keys() & _SPREAD_KEYS:
            raise _error("spread", where, "sigma, low and high beside one number only", "a list")
        return value, value
    reach = SUPPORT_SIGMAS * (sigma or 0.0)
    low = _convert_number(entry["low"], convert, where) if "low" in entry else value - reach
    high = _convert_number(entry["high"], convert, where) if "high" in entry else value + reach
    if (sigma is not None and sigma <= 0.0) or not low <= value <= high:
        raise _error("spread", where, "sigma > 0 and low <= value <= high", entry)
    return low, high


def _range_of_draws(kind: str, numbers: Mapping[str, float], where: str) -> tuple[float, float]:
    """Smallest and largest possible draw of a distribution.

    Args:
        kind: A key of `_KEYS_BY_KIND`.
        numbers: Its parameters, and `low` and `high` if the kind has them, by key of the entry.
        where: File and entry, for messages.

    Raises:
        KnowledgeError: The parameters are inconsistent.
    """
    if kind == "constant":
        return numbers["value"], numbers["value"]
    if kind == "bernoulli":
        if not 0.0 <= numbers["probability"] <= 1.0:
            raise _error("probability", where, "0 to 1", numbers["probability"])
        return 0.0, 1.0
    low, high = numbers["low"], numbers["high"]
    centre = numbers["median" if kind == "lognormal" else "mean"]
    # Lognormal numbers are positive.
    is_low_valid = kind != "lognormal" or low > 0.0
    is_ordered = low < high and low <= centre <= high
    if not (is_ordered and numbers["sigma"] > 0.0 and is_low_valid):
        raise _error("parameters", where, "low < high around the centre, sigma > 0", numbers)
    return low, high


def _error(what: str, where: str, expected: str, got: object) -> KnowledgeError:
    return KnowledgeError(
        what=what, where=where, expected=expected, got=got, next_step="correct the entry"
    )
