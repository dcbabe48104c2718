"""The quantities that may be known when an overtake begins, in the words of a driver.

All of them are columns of the table `decisions`, or derived from its columns. Beliefs are left out:
they are recorded only where a driver decided to pull out, so their absence alone would tell who did
not. The place in the lane is left out too, since it shows a move that has begun.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.units import kmh_from_mps
from overtaking.model.vehicles import VehicleKind

F64 = NDArray[np.float64]
Column = Callable[[str], F64]
"""A column of `decisions` by its name, NaN where there is no value."""

KINDS = tuple(kind.name for kind in VehicleKind)

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
        absent: The value where there is nobody, or nothing, to measure: the harmless end [SI].
        low: Lower values count as this one [SI].
        high: Higher values count as this one [SI].
    """

    unit: str = ""
    absent: float = 0.0
    low: float = -1e9
    high: float = 1e9


FAR, LONG, SWIFT = 300.0, 30.0, 30.0  # Beyond this nobody matters [m, s, m/s].

_GAP = Scale("m", FAR, -FAR, FAR)
_TIME = Scale("s", LONG, 0.0, LONG)
_SPEED, _LENGTH, _LANES = Scale("km/h"), Scale("m"), Scale("n", high=9.0)
_ACCEL, _HARDNESS = Scale("m/s²", 0.0, -10.0, 10.0), Scale("m/s²", 0.0, 0.0, 20.0)
_CLOSING, _EXCESS = Scale("km/h", -SWIFT, -SWIFT, SWIFT), Scale("km/h", 0.0, -SWIFT, SWIFT)
_RANGE = Scale("m", 2000.0, 0.0, 2000.0)


@dataclass(frozen=True, slots=True)
class Attribute:
    """One quantity that is known at the instant of the decision.

    Attributes:
        name: Column of `decisions`, or key of `DERIVED`.
        factor: The factor that it belongs to.
        words: What a driver calls it; of a nominal one the vehicle or thing that has it.
        scale: Its unit and range.
        needs: Whose absence makes it absent; empty if it is always there.
        above: Of a difference: the words for positive values.
        below: Of a difference: the words for negative values.
        levels: The names of a nominal attribute; of yes and no the words for no and yes.
        is_plain: Whether a driver would speak of it, so that rules may use it.
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

    @property
    def is_nominal(self) -> bool:
        """Whether its values are codes of names."""
        return bool(self.levels)


def _hidden(name: str, factor: str, words: str, scale: Scale, needs: str = "") -> Attribute:
    """A quantity for models only."""
    return Attribute(name, factor, words, scale, needs, is_plain=False)


def _yes_no(name: str, factor: str, no: str, yes: str) -> Attribute:
    return Attribute(name, factor, yes, levels=(no, yes))


_AHEAD, _FRONT, _REAR = "vehicle ahead", "vehicle ahead on the left", "vehicle behind on the left"
_NO_FRONT, _NO_REAR = "nobody is ahead on the left", "nobody is behind on the left"
_SAFE = ("longer than the safe distance", "shorter than the safe distance")
_LAWFUL = ("longer than the law asks", "shorter than the law asks")
_OVER, _POWER = "speed over the limit", "type and power of the ego"
_DISTANCE, _CLOSER = "distance to the vehicle ahead", "closing in on the vehicle ahead"
_GOING, _KIND_AHEAD = "what the vehicle ahead is about to do", "type of the vehicle ahead"
_TAKES, _RAIN = "time that it takes", "rain, grip and wind"

ATTRIBUTES = (
    Attribute("ego_speed_mps", "speed of the ego", "speed", _SPEED),
    Attribute("over_limit", _OVER, "the ego is", _EXCESS, "", "above its limit", "below its limit"),
    Attribute("ego_accel_mps2", "acceleration of the ego", "acceleration", _ACCEL),
    Attribute("ego_available_accel_mps2", _POWER, "acceleration in reserve", _ACCEL),
    Attribute("ego_kind", _POWER, "the ego", levels=KINDS),
    Attribute("waiting_time_s", "waiting time", "time waited", Scale("s", 0.0, 0.0, 120.0)),
    Attribute("wish_over_limit", _OVER, "the speed that the driver wants is", _EXCESS, "",
              "above the limit", "below the limit"),
    Attribute("speed_wish", "wish to be faster", "the speed that the driver wants is", _EXCESS, "",
              "above that of the vehicle ahead", "below it"),
    Attribute("ahead_gap_m", _DISTANCE, f"gap to the {_AHEAD}", _GAP, "ahead"),
    Attribute("ahead_time_gap_s", _DISTANCE, f"time gap to the {_AHEAD}", _TIME, "ahead"),
    Attribute("law_follow_m", "safe distance ahead", f"the gap to the {_AHEAD} is", _GAP, "ahead",
              *_SAFE),
    Attribute("time_to_safe_gap", "safe distance ahead",
              f"time until the gap to the {_AHEAD} is shorter than the safe distance", _TIME,
              "ahead"),
    Attribute("ahead_closing_speed_mps", _CLOSER, "the ego is", _CLOSING, "ahead",
              f"faster than the {_AHEAD}", "slower"),
    Attribute("ahead_ttc_s", _CLOSER, f"time to collision with the {_AHEAD}", _TIME, "ahead"),
    Attribute("ahead_mttc_s", _CLOSER,
              f"time to collision with the {_AHEAD}, accelerations as now,", _TIME, "ahead"),
    _hidden("ahead_drac_mps2", _CLOSER, "braking that it asks for", _HARDNESS, "ahead"),
    _hidden("ahead_looming_radps", _CLOSER, "looming", _HARDNESS, "ahead"),
    Attribute("ahead_speed_mps", "speed of the vehicle ahead", f"speed of the {_AHEAD}", _SPEED,
              "ahead"),
    Attribute("ahead_accel_mps2", _GOING, f"acceleration of the {_AHEAD}", _ACCEL, "ahead"),
    Attribute("ahead_kind", _KIND_AHEAD, f"the {_AHEAD}", needs="ahead", levels=KINDS),
    _hidden("ahead_length_m", _KIND_AHEAD, f"length of the {_AHEAD}", _LENGTH, "ahead"),
    Attribute("ahead_lateral_offset_m", "lateral position of the vehicle ahead",
              f"the {_AHEAD} is", Scale("dm", 0.0, -3.0, 3.0), "ahead",
              "left of the middle of its lane", "right of the middle of its lane"),
    Attribute("ahead_indicator", _GOING, f"indicator of the {_AHEAD}", needs="ahead",
              levels=("off", "left", "right", "both")),
    Attribute("return_gap_m", "room to return", f"gap in front of the {_AHEAD}", _GAP,
              "next ahead"),
    Attribute("overtaking_time_s", _TAKES, "least time to overtake", _TIME, "ahead"),
    _hidden("overtaking_distance_m", _TAKES, "least way to overtake", _RANGE, "ahead"),
    _yes_no("left_exists", "lane", "there is no lane to the left", "there is a lane to the left"),
    _yes_no("left_crossable", "lane", "the line on the left may not be crossed",
            "the line on the left may be crossed"),
    Attribute("left_front_gap_m", _FRONT, f"gap to the {_FRONT}", _GAP, _NO_FRONT),
    Attribute("left_front_closing_speed_mps", _FRONT, "the ego is", _CLOSING, _NO_FRONT,
              f"faster than the {_FRONT}", "slower"),
    Attribute("left_front_ttc_s", _FRONT, f"time to collision with the {_FRONT}", _TIME, _NO_FRONT),
    _hidden("left_front_drac_mps2", _FRONT, "braking", _HARDNESS, _NO_FRONT),
    Attribute("law_entry_front_m", _FRONT, f"the gap to the {_FRONT} is", _GAP, _NO_FRONT,
              *_LAWFUL),
    Attribute("left_rear_gap_m", _REAR, f"gap to the {_REAR}", _GAP, _NO_REAR),
    Attribute("left_rear_closing_speed_mps", _REAR, f"the {_REAR} is", _CLOSING, _NO_REAR, "faster",
              "slower"),
    Attribute("left_rear_ttc_s", _REAR, f"time until the {_REAR} is here", _TIME, _NO_REAR),
    _hidden("left_rear_drac_mps2", _REAR, "braking", _HARDNESS, _NO_REAR),
    Attribute("law_entry_rear_m", _REAR, f"the gap to the {_REAR} is", _GAP, _NO_REAR, *_LAWFUL),
    Attribute("left_count", "number of vehicles", "number of vehicles near in the left lane",
              Scale("n", high=20.0)),
    _hidden("left_occupancy", "lane occupancy", "occupancy of the left lane",
            Scale("%", 0.0, 0.0, 1.0)),
    _hidden("left_space_mean_speed_mps", "space mean speed", "mean speed in the left lane", _SPEED),
    _hidden("left_time_mean_speed_mps", "time mean speed",
            "mean speed past a place in the left lane", _SPEED),
    Attribute("lane", "lane", "number of lanes to the right", _LANES),
    Attribute("lanes_to_left", "lane", "number of lanes to the left", _LANES),
    _hidden("speed_limit_mps", _OVER, "speed limit", _SPEED),
    _yes_no("night", "sight", "it is day", "it is night"),
    _yes_no("low_sun", "sight", "the sun does not stand low ahead", "the sun stands low ahead"),
    Attribute("rain_mmph", _RAIN, "rain", Scale("mm/h", 0.0, 0.0, 200.0)),
    Attribute("friction", _RAIN, "friction of the road", Scale("", 0.0, 0.0, 2.0)),
    _hidden("optical_range_m", "sight", "visibility in the fog", _RANGE),
    Attribute("sight_lit_m", "sight", "distance at which lit vehicles are seen", _RANGE),
    _hidden("sight_unlit_m", "sight", "distance at which unlit vehicles are seen", _RANGE),
    Attribute("law_stop_lit_m", "sight", "the distance seen ahead is", _GAP, "",
              "longer than the way to stop", "shorter than the way to stop"),
    Attribute("wind_mps", _RAIN, "wind", Scale("km/h", 0.0, 0.0, 60.0)),
)  # fmt: skip
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
    return column("ego_desired_speed_mps") - column("ahead_speed_mps")


def time_to_safe_gap(column: Column) -> F64:
    """Time until the gap is shorter than the safe distance, at constant speeds [s].

    0 if it is so already, NaN if the gap does not shrink.
    """
    margin, closing = column("law_follow_m"), column("ahead_closing_speed_mps")
    time = np.divide(margin, closing, out=np.full(len(margin), np.nan), where=closing > 0.0)
    return np.where(margin <= 0.0, 0.0, time)


DERIVED: dict[str, Callable[[Column], F64]] = {
    one.__name__: one for one in (over_limit, wish_over_limit, speed_wish, time_to_safe_gap)
}
"""The derived attributes by name."""
