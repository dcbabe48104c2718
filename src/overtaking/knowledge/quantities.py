"""Numbers with unit and source, and how an entry of a TOML file becomes one."""

from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, TypeAlias, TypeGuard, cast

from overtaking.core.errors import KnowledgeError
from overtaking.core.units import si_unit, unit_converter, unit_of_suffix

Values: TypeAlias = "float | tuple[Values, ...]"
"""A number, or a tuple of numbers or of tuples, as deep as the lists of the file."""

ENGINEERING_CHOICE = "choice"
"""The source of an engineering choice; such an entry must give its rationale."""

SUPPORT_SIGMAS = 2.0
"""A quantity with a sigma is sampled within this many sigmas of its value."""
SOURCE_KINDS = ("law", "standard", "handbook", "paper", "report", "software")


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A publication, standard or program from which values come.

    Attributes:
        id: Short name by which entries refer to it.
        citation: Author, year, title, and a DOI or an official number.
        kind: One of `SOURCE_KINDS`.
        checked: Whether the values were read in the source or in a faithful reprint. If not, they
            are common knowledge of the field.
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
        sigma: Standard deviation within the population, in `unit`; None if the value is fixed.
        low: Smallest value that a sample may take; equals `value` if there is no sigma.
        high: Largest value that a sample may take; equals `value` if there is no sigma.
        unit: The SI unit of `value`, or the unit that the entry's name carries as a suffix.
        quoted_unit: The unit in which the file, following its source, writes the value.
        source: Id of the source, or `choice`.
        rationale: Why this value; always present for a choice.
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
        """The fields that decide values and their unit, as JSON types."""
        limits = {"sigma": self.sigma, "low": self.low, "high": self.high}
        return {"value": self.value, **limits, "unit": self.unit}

    @property
    def number(self) -> float:
        """The value of a scalar quantity; KnowledgeError for a table."""
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
        """The value of a scalar quantity, as `number`."""
        return self.number


@dataclass(frozen=True, slots=True, kw_only=True)
class Distribution:
    """The distribution of a parameter over a population.

    The parameters by kind: `constant`: value; `uniform`: none beside the limits; `normal`: mean,
    sigma; `lognormal`: median, sigma (of the natural logarithm, so without unit); `bernoulli`:
    probability; `choice`: values, weights (which sum to 1).

    Attributes:
        kind: One of the six above.
        parameters: Name to number, or to a tuple of numbers for `choice`, in `unit`.
        low: Smallest possible draw, in `unit`; normal and lognormal are truncated there.
        high: Largest possible draw, in `unit`.
        unit: The SI unit of a draw, or the unit that the entry's name carries as a suffix.
        quoted_unit: The unit in which the file writes the numbers.
        source: Id of the source, or `choice`.
        rationale: Why this distribution; always present for a choice.
    """

    kind: str
    parameters: Mapping[str, float | tuple[float, ...]]
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
        """The fields that decide draws and their unit, as JSON types."""
        limits = {"low": self.low, "high": self.high}
        return {"kind": self.kind, **self.parameters, **limits, "unit": self.unit}

    def parameter(self, name: str) -> float:
        """One scalar parameter; KnowledgeError if this kind lacks it."""
        value = self.parameters.get(name)
        if isinstance(value, float):
            return value
        raise KnowledgeError(
            what=f"parameter {name}",
            where=f"{self.kind} distribution",
            expected=f"one of {', '.join(self.parameters) or 'none'}",
            got=value,
            next_step="ask for a parameter of this kind",
        )


_ENTRY_KEYS = frozenset(["value", "distribution", "unit", "source"])
_PROVENANCE = frozenset(["unit", "source"])
_OPTIONAL = frozenset(["rationale"])

# Kind of distribution: the keys that it needs beside unit and source.
_PARAMETERS_BY_KIND = {
    "constant": frozenset(["value"]),
    "uniform": frozenset(["low", "high"]),
    "normal": frozenset(["mean", "sigma", "low", "high"]),
    "lognormal": frozenset(["median", "sigma", "low", "high"]),
    "bernoulli": frozenset(["probability"]),
    "choice": frozenset(["values", "weights"]),
}

# Parameters that are pure numbers whatever the unit of a draw.
_UNITLESS = {"lognormal": frozenset(["sigma"]), "choice": frozenset(["weights"])}
_WEIGHT_TOLERANCE = 1e-9


def is_entry(item: object) -> TypeGuard[dict[str, Any]]:
    """Whether an item is an entry, complete or not, rather than a table of entries."""
    if not isinstance(item, dict):
        return False
    table = cast("dict[str, object]", item)
    return any(key in table and not isinstance(table[key], dict) for key in _ENTRY_KEYS)


def parse_quantity(
    entry: Mapping[str, Any], *, name: str, where: str, sources: Container[str]
) -> Quantity:
    """A quantity from its inline table.

    Args:
        entry: Keys value, unit, source; optionally sigma, low, high, rationale.
        name: Key of the entry; a suffix such as `_mm` keeps the value in that unit.
        where: File and entry, for messages.
        sources: The known source ids.

    Returns:
        The quantity, in SI or in the unit of the suffix.

    Raises:
        KnowledgeError: A key is missing or unknown, or a value is not what its key asks for.
    """
    spread = frozenset(["sigma", "low", "high"])
    _check(entry, needed=_PROVENANCE | {"value"}, also=spread, where=where, sources=sources)
    unit, convert = _unit(entry, name, where)
    value = _values(entry["value"], convert, where)
    sigma = _number(entry["sigma"], convert, where) if "sigma" in entry else None
    low, high = _limits(entry, value, sigma, convert, where)
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
    """A distribution from its inline table.

    Args:
        entry: Keys distribution, unit, source and the parameters of the kind.
        name: Key of the entry; a suffix such as `_mm` keeps the values in that unit.
        where: File and entry, for messages.
        sources: The known source ids.

    Returns:
        The distribution, in SI or in the unit of the suffix.

    Raises:
        KnowledgeError: The kind is unknown, or its parameters do not make a distribution.
    """
    kind = entry.get("distribution")
    if kind not in _PARAMETERS_BY_KIND:
        raise _wrong("distribution", where, f"one of {', '.join(_PARAMETERS_BY_KIND)}", kind)
    needed = _PROVENANCE | {"distribution"} | _PARAMETERS_BY_KIND[kind]
    _check(entry, needed=needed, also=frozenset(), where=where, sources=sources)
    unit, convert = _unit(entry, name, where)
    plain = _UNITLESS.get(kind, frozenset())
    numbers = {
        key: _values(entry[key], float if key in plain else convert, where)
        for key in sorted(_PARAMETERS_BY_KIND[kind])
    }
    low, high = _range_of_draws(kind, numbers, where)
    return Distribution(
        kind=kind,
        parameters=cast("Any", {k: v for k, v in numbers.items() if k not in ("low", "high")}),
        low=low,
        high=high,
        unit=unit,
        **_origin(entry),
    )


def _origin(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Unit and source of an entry, by field of `Quantity` and `Distribution`."""
    return {
        "quoted_unit": entry["unit"],
        "source": entry["source"],
        "rationale": entry.get("rationale"),
    }


def _check(
    entry: Mapping[str, Any],
    *,
    needed: frozenset[str],
    also: frozenset[str],
    where: str,
    sources: Container[str],
) -> None:
    """KnowledgeError unless the keys are right and the source is known or explained."""
    for key in sorted(needed - entry.keys()):
        raise _wrong(f"missing {key}", where, f"the keys {', '.join(sorted(needed))}", entry)
    for key in sorted(entry.keys() - needed - also - _OPTIONAL):
        allowed = ", ".join(sorted(needed | also | _OPTIONAL))
        raise _wrong(f"unknown key {key}", where, f"only the keys {allowed}", key)
    source = entry["source"]
    if source == ENGINEERING_CHOICE and not str(entry.get("rationale", "")).strip():
        raise _wrong("missing rationale", where, "a reason beside source = 'choice'", "none")
    if source != ENGINEERING_CHOICE and source not in sources:
        raise _wrong("unknown source", where, "an id of sources.toml", repr(source))


def _unit(entry: Mapping[str, Any], name: str, where: str) -> tuple[str, Callable[[Any], float]]:
    """The unit in which the value is kept, and the conversion into it."""
    quoted: str = entry["unit"]
    convert = unit_converter(str(quoted), where=where)
    suffix_unit = unit_of_suffix(name)
    if suffix_unit is None:
        return si_unit(quoted), convert
    if suffix_unit != quoted:
        raise _wrong("unit", where, f"{suffix_unit}, as the name {name} says", quoted)
    return quoted, float


def _values(item: Any, convert: Callable[[Any], float], where: str) -> Values:
    """A number or nested lists of numbers, converted; lists become tuples."""
    if isinstance(item, list):
        parts = cast("list[Any]", item)
        if parts:
            return tuple(_values(part, convert, where) for part in parts)
    return _number(item, convert, where)


def _number(item: Any, convert: Callable[[Any], float], where: str) -> float:
    """A finite number, converted."""
    if isinstance(item, bool) or not isinstance(item, int | float) or item - item != 0:
        raise _wrong("value", where, "a finite number", item)
    return convert(float(item))


def _limits(
    entry: Mapping[str, Any],
    value: Values,
    sigma: float | None,
    convert: Callable[[Any], float],
    where: str,
) -> tuple[Values, Values]:
    """Smallest and largest value of a sample of the quantity."""
    if isinstance(value, tuple):
        if entry.keys() & {"sigma", "low", "high"}:
            raise _wrong("spread", where, "sigma, low and high beside one number only", "a list")
        return value, value
    reach = SUPPORT_SIGMAS * (sigma or 0.0)
    low = _number(entry["low"], convert, where) if "low" in entry else value - reach
    high = _number(entry["high"], convert, where) if "high" in entry else value + reach
    if (sigma is not None and sigma <= 0.0) or not low <= value <= high:
        raise _wrong("spread", where, "sigma > 0 and low <= value <= high", entry)
    return low, high


def _range_of_draws(kind: str, numbers: Mapping[str, Any], where: str) -> tuple[float, float]:
    """Smallest and largest possible draw; KnowledgeError for inconsistent parameters."""
    if kind == "choice":
        return _choice_support(numbers, where)
    if any(isinstance(number, tuple) for number in numbers.values()):
        raise _wrong("parameters", where, "numbers, not lists", kind)
    if kind == "constant":
        return numbers["value"], numbers["value"]
    if kind == "bernoulli":
        if not 0.0 <= numbers["probability"] <= 1.0:
            raise _wrong("probability", where, "0 to 1", numbers["probability"])
        return 0.0, 1.0
    low, high = numbers["low"], numbers["high"]
    centre = numbers.get("mean", numbers.get("median", low))
    positive = kind != "lognormal" or low > 0.0
    if not (low < high and low <= centre <= high and numbers.get("sigma", 1.0) > 0.0 and positive):
        raise _wrong("parameters", where, "low < high around the centre, sigma > 0", numbers)
    return low, high


def _choice_support(numbers: Mapping[str, Any], where: str) -> tuple[float, float]:
    """Smallest and largest of the values to choose from."""
    values, weights = numbers["values"], numbers["weights"]
    pair = isinstance(values, tuple) and isinstance(weights, tuple)
    if not pair or len(values) != len(weights):
        raise _wrong("weights", where, "as many as values", numbers)
    if min(weights) < 0.0 or abs(sum(weights) - 1.0) > _WEIGHT_TOLERANCE:
        raise _wrong("weights", where, "none negative, summing to 1", weights)
    return min(values), max(values)


def _wrong(what: str, where: str, expected: str, got: object) -> KnowledgeError:
    return KnowledgeError(
        what=what, where=where, expected=expected, got=got, next_step="correct the entry"
    )
