"""The quantities that may be known when an overtake begins, in the words of a driver.

They are declared in `attributes.toml`. All of them are columns of the table `attempts`, or derived
from its columns. Beliefs are left out: they are recorded only where a driver decided to pull out,
so their absence alone would tell who did not. The place in the lane is left out too, since it shows
a move that has begun.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from overtaking.core.arrays import F64
from overtaking.core.units import kmh_from_mps
from overtaking.data.tables.columns import names_of
from overtaking.data.tables.schemas import SCHEMAS
from overtaking.knowledge.toml_reader import load_toml

Column = Callable[[str], F64]
"""A column of `attempts` by its name, NaN where there is no value."""

UNITS: dict[str, tuple[float, float]] = {
    "km/h": (kmh_from_mps(1.0), 1.0),
    "m": (1.0, 1.0),
    "dm": (10.0, 1.0),
    "s": (1.0, 0.1),
    "m/s²": (1.0, 0.1),
    "mm/h": (1.0, 0.1),
    "%": (100.0, 1.0),
    "n": (1.0, 1.0),
    "": (1.0, 0.01),
}
"""Units of the words: the size of one SI unit in the unit, and the step that values round to."""


@dataclass(frozen=True, slots=True)
class Scale:
    """Unit and range of a quantity.

    Attributes:
        unit: The unit of the words, a key of `UNITS`.
        absent: The value without a vehicle, or quantity, to measure: the harmless extreme [SI].
        low: Lower values count as this one [SI].
        high: Higher values count as this one [SI].
    """

    unit: str = ""
    absent: float = 0.0
    low: float = -1e9
    high: float = 1e9


@dataclass(frozen=True, slots=True)
class Attribute:
    """One quantity that is known at the instant of the decision.

    Attributes:
        name: Column of `attempts`, or key of `DERIVED`.
        factor: The factor that it belongs to.
        words: What a driver calls it; of a nominal one the vehicle or thing that has it.
        scale: Its unit and range.
        needs: Whose absence makes it absent; empty if it is always there.
        above: Of a difference: the words for positive values.
        below: Of a difference: the words for negative values.
        levels: The names of a nominal attribute; of yes and no the words for no and yes.
        is_plain: Whether a driver would speak of it, so that rules may use it.
        of_two_ways: Whether it is one of two-way roads alone.
    """

    name: str
    factor: str
    words: str
    scale: Scale = Scale()
    needs: str = ""
    above: str = ""
    below: str = ""
    levels: tuple[str, ...] = ()
    is_plain: bool = True
    of_two_ways: bool = False

    @property
    def is_nominal(self) -> bool:
        """Whether its values are codes of names."""
        return bool(self.levels)


_DECLARED = load_toml(Path(__file__).with_suffix(".toml"))
_SCALES = {name: Scale(**one) for name, one in _DECLARED["scales"].items()}


def _attribute(name: str, given: dict[str, Any]) -> Attribute:
    """An attribute; the levels of a nominal column are those of the table."""
    columns = SCHEMAS["attempts"]
    named = names_of(columns.field(name)) if name in columns.names else ()
    own: dict[str, Any] = {"name": name, "levels": tuple(given.get("levels", named))}
    own["scale"] = _SCALES[given["scale"]] if "scale" in given else Scale()
    return Attribute(**given | own)


ATTRIBUTES = tuple(_attribute(name, one) for name, one in _DECLARED["attributes"].items())
"""All attributes, in the order in which ties are broken."""

BY_NAME = {one.name: one for one in ATTRIBUTES}

FACTORS: dict[str, tuple[str, ...]] = {
    factor: tuple(one.name for one in ATTRIBUTES if one.factor == factor)
    for factor in dict.fromkeys(one.factor for one in ATTRIBUTES)
}
"""The names of the attributes of each factor."""


def over_limit(column: Column) -> F64:
    """Speed of the ego over the limit of road and vehicle [m/s]."""
    return -column("law_speed_mps")


def wish_over_limit(column: Column) -> F64:
    """Desired speed of its driver over that limit [m/s]."""
    limit = column("law_speed_mps") + column("ego_speed_mps")
    return column("ego_desired_speed_mps") - limit


def speed_wish(column: Column) -> F64:
    """Desired speed of its driver over the speed of the vehicle ahead [m/s]."""
    return column("ego_desired_speed_mps") - column("leader_speed_mps")


def time_to_safe_gap(column: Column) -> F64:
    """Time until the gap is shorter than the safe distance, at constant speeds [s].

    0 if it is shorter already, NaN if the gap does not shrink.
    """
    margin, closing = column("law_leader_m"), column("leader_closing_speed_mps")
    time = np.divide(margin, closing, out=np.full(len(margin), np.nan), where=closing > 0.0)
    return np.where(margin <= 0.0, 0.0, time)


DERIVED: dict[str, Callable[[Column], F64]] = {
    one.__name__: one for one in (over_limit, wish_over_limit, speed_wish, time_to_safe_gap)
}
"""The derived attributes by name."""
