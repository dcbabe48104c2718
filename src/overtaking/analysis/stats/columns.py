"""The paper's features: name, unit and possible values of each."""

from dataclasses import dataclass

from overtaking.knowledge.glossary import terms
from overtaking.model.vehicles import VehicleKind
from overtaking.model.verdicts import OvertakeClass

CLASS = "CLASS"
"""Column of the class."""

WEIGHT = "weight"
"""Column of the importance weight: how many simulations of the natural population one stands for.
"""

NO_ATTEMPT = OvertakeClass.NO_ATTEMPT.title
COLLISION = OvertakeClass.UNSUCCESS_COL.title
CENSORED = OvertakeClass.CENSORED.title
"""Still open when the recording ended; left out of every rate."""

ALL_CLASSES = tuple(one.title for one in OvertakeClass)
PAPER_CLASSES = ALL_CLASSES[: OvertakeClass.UNSUCCESS_NCOL + 1]
"""The five classes of the paper, in its order; they are shown even where they are empty."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Feature:
    """One feature.

    Attributes:
        name: Column, as the paper abbreviates it.
        title: The name in words.
        unit: Unit, empty for counts and for names.
        levels: The values of a nominal feature in the paper's order, empty for a numeric one.
        is_static: Whether the paper lists it among the static features.
    """

    name: str
    title: str
    unit: str = ""
    levels: tuple[str, ...] = ()
    is_static: bool = False

    @property
    def is_nominal(self) -> bool:
        """Whether its values are names."""
        return bool(self.levels)

    @property
    def label(self) -> str:
        """Name and unit, as an axis shows them."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


VEHICLE_TYPES = tuple(kind.code for kind in VehicleKind)  # In the order of the paper's codes.
EGO_TYPES = VEHICLE_TYPES[:5]
"""Those that the ego has in the paper; two-wheelers are shown where a recording has one."""

_LEVELS = {"DN": ("Day", "Night"), "HL": ("No", "Yes"), "TE": VEHICLE_TYPES, "TP": VEHICLE_TYPES}
_STATIC = ("DN", "HL", "TE", "TP", "WT", "OT", "NV")

FEATURES = tuple(
    Feature(
        name=name,
        title=term.title,
        unit=term.display_unit,
        levels=_LEVELS.get(name, ()),
        is_static=name in _STATIC,
    )
    for name, term in terms("features").items()
)
"""All fifteen, static ones first, in the order of the paper's tables."""

BY_NAME = {one.name: one for one in FEATURES}
NOMINAL = tuple(one for one in FEATURES if one.is_nominal)
NUMERIC = tuple(one for one in FEATURES if not one.is_nominal)
WEATHER = ("PREC", "WIND", "FOG")
