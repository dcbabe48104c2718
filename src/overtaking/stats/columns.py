"""The paper's features: what each is called, what it is measured in, which values it may take."""

from dataclasses import dataclass

from overtaking.model.labels import OvertakeClass

CLASS = "CLASS"
"""Column of the class."""

WEIGHT = "weight"
"""Column of the importance weight: how many simulations of the natural population one stands for.
"""

NO_ATTEMPT = OvertakeClass.NO_ATTEMPT.title
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


# The order of the codes 0 to 6 in the paper's text.
VEHICLE_TYPES = ("S", "M", "L", "V", "T", "MC", "B")
EGO_TYPES = VEHICLE_TYPES[:5]
"""Those that the ego has in the paper; two-wheelers are shown where a recording has one."""

FEATURES = (
    Feature(name="DN", title="time of day", levels=("Day", "Night"), is_static=True),
    Feature(name="HL", title="low sun ahead", levels=("No", "Yes"), is_static=True),
    Feature(name="TE", title="type of the ego", levels=VEHICLE_TYPES, is_static=True),
    Feature(name="TP", title="type of the target", levels=VEHICLE_TYPES, is_static=True),
    Feature(name="WT", title="waiting time", unit="s", is_static=True),
    Feature(name="OT", title="overtaking time", unit="s", is_static=True),
    Feature(name="NV", title="number of vehicles", is_static=True),
    Feature(name="SE", title="speed of the ego", unit="km/h"),
    Feature(name="SP", title="speed of the target", unit="km/h"),
    Feature(name="DSEP", title="difference of the speeds", unit="km/h"),
    Feature(name="D", title="distance to the target", unit="m"),
    Feature(name="OLR", title="occupancy of the left lane", unit="%"),
    Feature(name="PREC", title="precipitation", unit="%"),
    Feature(name="WIND", title="wind", unit="%"),
    Feature(name="FOG", title="fog", unit="%"),
)
"""All fifteen, static ones first, in the order of the paper's tables."""

BY_NAME = {one.name: one for one in FEATURES}
NOMINAL = tuple(one for one in FEATURES if one.is_nominal)
NUMERIC = tuple(one for one in FEATURES if not one.is_nominal)
WEATHER = ("PREC", "WIND", "FOG")
