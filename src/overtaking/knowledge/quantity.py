"""The nouns of the knowledge base: a source, a quantity and a distribution."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeAlias

from overtaking.core.errors import KnowledgeError

Values: TypeAlias = "float | tuple[Values, ...]"
"""A number, or a tuple of them, nested as deep as the table that it stands for."""

CHOICE = "choice"
"""The source of an engineering choice; such an entry must give its rationale."""

TRUNCATION = 2.0
"""A quantity with a sigma is sampled within this many sigmas of its value."""


SOURCE_KINDS = ("law", "standard", "handbook", "paper", "report", "software")


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """Where values come from.

    Attributes:
        id: Short name by which entries refer to it.
        citation: What to look up: author, year, title, and a DOI or an official number.
        kind: One of `SOURCE_KINDS`.
        checked: Whether the values were read in the source, or in a faithful reprint of it,
            rather than taken over from the common knowledge of the field.
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

    @property
    def number(self) -> float:
        """The value of a scalar quantity; KnowledgeError for a table."""
        if isinstance(self.value, tuple):
            raise KnowledgeError.of(
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
    """How a parameter spreads over a population.

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
        """Close the parameters, so that a cached distribution cannot be changed."""
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))

    def parameter(self, name: str) -> float:
        """One scalar parameter; KnowledgeError if this kind has none of that name."""
        value = self.parameters.get(name)
        if isinstance(value, float):
            return value
        raise KnowledgeError.of(
            what=f"parameter {name}",
            where=f"{self.kind} distribution",
            expected=f"one of {', '.join(self.parameters) or 'none'}",
            got=value,
            next_step="ask for a parameter of this kind",
        )
