"""The figures that profiles are compared with: limits, sources, and whether drivers were fitted."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cache

from overtaking.core.units import unit_converter
from overtaking.knowledge.quantities import ENGINEERING_CHOICE, Quantity
from overtaking.knowledge.toml_reader import read_records

_FILE = "validation.toml"


class TargetRole(StrEnum):
    """The meaning of a figure within its limits for the drivers of a profile."""

    FITTED = "fitted"
    HELD_OUT = "held out"
    CHOICE = "choice"

    @property
    def meaning(self) -> str:
        """The same in words."""
        return _MEANINGS[self]


_MEANINGS = {
    TargetRole.FITTED: "the drivers of the profile may be changed until it lies within its limits",
    TargetRole.HELD_OUT: "nothing is changed for it",
    TargetRole.CHOICE: "the limits are our own, so a figure within them is not validated",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class FigureTarget:
    """Description, limits and standing of one figure.

    Attributes:
        description: The figure in words.
        standing: The meaning of a figure within its limits.
        low: Lower limit, None if it is open.
        high: Upper limit, None if it is open.
        display_unit: Unit in which a figure without limits is shown.
        min_distance: Distance that vehicles must have driven for a verdict; None for any.
    """

    description: str
    standing: TargetRole
    low: Quantity | None = None
    high: Quantity | None = None
    display_unit: str = "1"
    min_distance: Quantity | None = None

    @property
    def limits(self) -> list[Quantity]:
        """The limits that are not open."""
        return [limit for limit in (self.low, self.high) if limit is not None]

    @property
    def unit(self) -> str:
        """The unit in which the figure and its limits are shown; empty for a share or a count."""
        unit = self.limits[0].quoted_unit if self.limits else self.display_unit
        return "" if unit == "1" else unit

    @property
    def scale(self) -> float:
        """The figure in that unit over the figure in SI."""
        return 1.0 / unit_converter(self.unit or "1", where=_FILE)(1.0)

    @property
    def source(self) -> str:
        """Source of the limits, `choice` where one of them is our own; empty without any."""
        sources = [limit.source for limit in self.limits]
        return ENGINEERING_CHOICE if ENGINEERING_CHOICE in sources else "".join(sources[-1:])


@cache
def targets(of: str = "figures") -> Mapping[str, FigureTarget]:
    """Every figure by its name.

    Args:
        of: `figures`, of traffic in one direction, or `passes`, of overtakes on two-way roads.

    Raises:
        KnowledgeError: A standing is unknown, or a limit lacks its unit or source.
    """
    return read_records(FigureTarget, _FILE, of)
