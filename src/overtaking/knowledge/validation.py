"""The figures that profiles are compared with: limits, sources, and whether drivers were fitted."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cache

from overtaking.knowledge.conversion import converter
from overtaking.knowledge.quantity import CHOICE, Quantity
from overtaking.knowledge.reader import read_sections

_FILE = "validation.toml"


class Standing(StrEnum):
    """What a figure within its limits says of a profile's drivers."""

    FITTED = "fitted"
    HELD_OUT = "held out"
    CHOICE = "choice"

    @property
    def meaning(self) -> str:
        """The same in words."""
        return _MEANINGS[self]


_MEANINGS = {
    Standing.FITTED: "the drivers of the profile may be changed until it lies within its limits",
    Standing.HELD_OUT: "nothing is changed for it",
    Standing.CHOICE: "the limits are our own, so a figure within them is not validated",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """Description, limits and standing of one figure.

    Attributes:
        what: The figure in words.
        standing: What a figure within its limits says.
        low: Lower limit, None if it is open.
        high: Upper limit, None if it is open.
        shown_in: Unit in which a figure without limits is shown.
        least_distance: Distance that vehicles must have driven for a verdict; None for any.
    """

    what: str
    standing: Standing
    low: Quantity | None = None
    high: Quantity | None = None
    shown_in: str = "1"
    least_distance: Quantity | None = None

    @property
    def limits(self) -> list[Quantity]:
        """The limits that are not open."""
        return [one for one in (self.low, self.high) if one is not None]

    @property
    def unit(self) -> str:
        """The unit in which the figure and its limits are shown; empty for a share or a count."""
        unit = self.limits[0].quoted_unit if self.limits else self.shown_in
        return "" if unit == "1" else unit

    @property
    def scale(self) -> float:
        """The figure in that unit over the figure in SI."""
        return 1.0 / converter(self.unit or "1", where=_FILE)(1.0)

    @property
    def source(self) -> str:
        """Source of the limits, `choice` where one of them is our own; empty without any."""
        sources = [one.source for one in self.limits]
        return CHOICE if CHOICE in sources else "".join(sources[-1:])


@cache
def targets(of: str = "figures") -> Mapping[str, Target]:
    """Every figure by its name.

    Args:
        of: `figures`, of traffic in one direction, or `passes`, of overtakes on two-way roads.

    Raises:
        KnowledgeError: A standing is unknown, or a limit lacks its unit or source.
    """
    return read_sections(Target, _FILE, of)
