"""What may be known when an overtake begins: each quantity in the words of a driver.

All of it is in the table `decisions`, or follows from its columns (`derived`). What was believed
is left out: it is on record only where somebody decided to pull out, so that its absence alone
would tell who did not. So is the place in the lane, which shows a move that has begun.
"""

from dataclasses import dataclass, field

from overtaking.model.vehicles import VehicleKind

KINDS = tuple(kind.name for kind in VehicleKind)

FAR = 300.0
"""As far as anybody matters; gaps are cut off here [m]."""

LONG = 30.0
"""As long as any time to collision or time gap matters [s]."""

SWIFT = 30.0
"""Differences of speed are cut off here [m/s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Attribute:
    """One quantity that is known at the instant of the decision.

    Attributes:
        name: Column of `decisions`, or what `derived` calls it.
        factor: The factor that it belongs to.
        words: What a driver calls it; of a nominal one the vehicle or thing that has it.
        unit: Unit in which it is told: a key of `wording.UNITS`.
        absent: Its value where there is nobody, or nothing, to measure: the harmless end [SI].
        low: Lower values count as this one [SI].
        high: Higher values count as this one [SI].
        above: Of a difference: what is so where it is positive.
        below: Of a difference: what is so where it is negative.
        levels: The names of a nominal attribute; of yes and no the words for no and yes.
        needs: Whose absence makes it absent, empty if it is always there.
        is_plain: Whether a driver would speak of it, so that it may stand in rules.
    """

    name: str
    factor: str
    words: str
    unit: str = ""
    absent: float = 0.0
    low: float = -1e9
    high: float = 1e9
    above: str = ""
    below: str = ""
    levels: tuple[str, ...] = field(default=())
    needs: str = ""
    is_plain: bool = True

    @property
    def is_nominal(self) -> bool:
        """Whether its values are numbers of names."""
        return bool(self.levels)


def _gap(name: str, factor: str, words: str, needs: str) -> Attribute:
    return Attribute(
        name=name, factor=factor, words=words, unit="m", absent=FAR, low=-FAR, high=FAR, needs=needs
    )


def _time(name: str, factor: str, words: str, needs: str, *, is_plain: bool = True) -> Attribute:
    return Attribute(
        name=name, factor=factor, words=words, unit="s", absent=LONG, low=0.0, high=LONG,
        needs=needs, is_plain=is_plain,
    )  # fmt: skip


def _difference(
    name: str, factor: str, words: str, above: str, below: str, *,
    unit: str = "km/h", absent: float = -SWIFT, reach: float = SWIFT, needs: str = "",
) -> Attribute:  # fmt: skip
    return Attribute(
        name=name, factor=factor, words=words, unit=unit, absent=absent, low=-reach, high=reach,
        above=above, below=below, needs=needs,
    )  # fmt: skip


def _hardness(name: str, factor: str, words: str, needs: str) -> Attribute:
    """A deceleration or a looming: nothing where nobody is, and not what a driver speaks of."""
    return Attribute(
        name=name, factor=factor, words=words, unit="m/s²", low=0.0, high=20.0, needs=needs,
        is_plain=False,
    )  # fmt: skip


def _yes_no(name: str, factor: str, no: str, yes: str) -> Attribute:
    return Attribute(name=name, factor=factor, words=yes, levels=(no, yes))


_AHEAD, _FRONT, _REAR = "vehicle ahead", "vehicle ahead on the left", "vehicle behind on the left"
_NOBODY_FRONT, _NOBODY_REAR = "nobody is ahead on the left", "nobody is behind on the left"

_OF_EGO = (
    Attribute(name="ego_speed_mps", factor="speed of the ego", words="speed", unit="km/h"),
    _difference(
        "over_limit", "speed over the limit", "the ego is", "above its limit", "below its limit",
        absent=0.0,
    ),
    Attribute(
        name="ego_accel_mps2", factor="acceleration of the ego", words="acceleration", unit="m/s²",
        low=-10.0, high=10.0,
    ),
    Attribute(
        name="ego_available_accel_mps2", factor="type and power of the ego",
        words="acceleration in reserve", unit="m/s²", low=-10.0, high=10.0,
    ),
    Attribute(
        name="ego_kind", factor="type and power of the ego", words="the ego", levels=KINDS,
    ),
    Attribute(
        name="waiting_time_s", factor="waiting time", words="time waited", unit="s", low=0.0,
        high=120.0,
    ),
    _difference(
        "wish_over_limit", "speed over the limit", "the speed that the driver wants is",
        "above the limit", "below the limit", absent=0.0,
    ),
    _difference(
        "speed_wish", "wish to be faster", "the speed that the driver wants is",
        "above that of the vehicle ahead", "below it", absent=0.0,
    ),
)  # fmt: skip

_OF_AHEAD = (
    _gap("ahead_gap_m", "distance to the vehicle ahead", f"gap to the {_AHEAD}", "ahead"),
    _time(
        "ahead_time_gap_s", "distance to the vehicle ahead", f"time gap to the {_AHEAD}", "ahead"
    ),
    _difference(
        "law_follow_m", "safe distance ahead", f"the gap to the {_AHEAD} is",
        "longer than the safe distance", "shorter than the safe distance", unit="m", absent=FAR,
        reach=FAR, needs="ahead",
    ),
    _time(
        "time_to_safe_gap", "safe distance ahead",
        f"time until the gap to the {_AHEAD} is shorter than the safe distance", "ahead",
    ),
    _difference(
        "ahead_closing_speed_mps", "closing in on the vehicle ahead", "the ego is",
        f"faster than the {_AHEAD}", "slower", needs="ahead",
    ),
    _time(
        "ahead_ttc_s", "closing in on the vehicle ahead", f"time to collision with the {_AHEAD}",
        "ahead",
    ),
    _time(
        "ahead_mttc_s", "closing in on the vehicle ahead",
        f"time to collision with the {_AHEAD}, accelerations as now,", "ahead",
    ),
    _hardness(
        "ahead_drac_mps2", "closing in on the vehicle ahead", "braking that it asks for", "ahead"
    ),
    _hardness("ahead_looming_radps", "closing in on the vehicle ahead", "looming", "ahead"),
    Attribute(
        name="ahead_speed_mps", factor="speed of the vehicle ahead", words=f"speed of the {_AHEAD}",
        unit="km/h", needs="ahead",
    ),
    Attribute(
        name="ahead_accel_mps2", factor="what the vehicle ahead is about to do",
        words=f"acceleration of the {_AHEAD}", unit="m/s²", low=-10.0, high=10.0, needs="ahead",
    ),
    Attribute(
        name="ahead_kind", factor="type of the vehicle ahead", words=f"the {_AHEAD}", levels=KINDS,
        needs="ahead",
    ),
    Attribute(
        name="ahead_length_m", factor="type of the vehicle ahead", words=f"length of the {_AHEAD}",
        unit="m", needs="ahead", is_plain=False,
    ),
    Attribute(
        name="ahead_lateral_offset_m", factor="lateral position of the vehicle ahead",
        words=f"the {_AHEAD} is", unit="dm", low=-3.0, high=3.0, needs="ahead",
        above="left of the middle of its lane", below="right of the middle of its lane",
    ),
    Attribute(
        name="ahead_indicator", factor="what the vehicle ahead is about to do",
        words=f"indicator of the {_AHEAD}", levels=("off", "left", "right", "both"), needs="ahead",
    ),
    _gap("return_gap_m", "room to return", f"gap in front of the {_AHEAD}", "next ahead"),
    _time("overtaking_time_s", "time that it takes", "least time to overtake", "ahead"),
    Attribute(
        name="overtaking_distance_m", factor="time that it takes", words="least way to overtake",
        unit="m", absent=2000.0, low=0.0, high=2000.0, needs="ahead", is_plain=False,
    ),
)  # fmt: skip

_OF_LEFT = (
    _yes_no("left_exists", "lane", "there is no lane to the left",
            "there is a lane to the left"),
    _yes_no("left_crossable", "lane", "the line on the left may not be crossed",
            "the line on the left may be crossed"),
    _gap("left_front_gap_m", "vehicle ahead on the left", f"gap to the {_FRONT}", _NOBODY_FRONT),
    _difference(
        "left_front_closing_speed_mps", "vehicle ahead on the left", "the ego is",
        f"faster than the {_FRONT}", "slower", needs=_NOBODY_FRONT,
    ),
    _time("left_front_ttc_s", "vehicle ahead on the left", f"time to collision with the {_FRONT}",
          _NOBODY_FRONT),
    _hardness("left_front_drac_mps2", "vehicle ahead on the left", "braking", _NOBODY_FRONT),
    _difference(
        "law_entry_front_m", "vehicle ahead on the left", f"the gap to the {_FRONT} is",
        "longer than the law asks", "shorter than the law asks", unit="m", absent=FAR, reach=FAR,
        needs=_NOBODY_FRONT,
    ),
    _gap("left_rear_gap_m", "vehicle behind on the left", f"gap to the {_REAR}", _NOBODY_REAR),
    _difference(
        "left_rear_closing_speed_mps", "vehicle behind on the left", f"the {_REAR} is", "faster",
        "slower", needs=_NOBODY_REAR,
    ),
    _time("left_rear_ttc_s", "vehicle behind on the left", f"time until the {_REAR} is here",
          _NOBODY_REAR),
    _hardness("left_rear_drac_mps2", "vehicle behind on the left", "braking", _NOBODY_REAR),
    _difference(
        "law_entry_rear_m", "vehicle behind on the left", f"the gap to the {_REAR} is",
        "longer than the law asks", "shorter than the law asks", unit="m", absent=FAR, reach=FAR,
        needs=_NOBODY_REAR,
    ),
    Attribute(name="left_count", factor="number of vehicles",
              words="number of vehicles near in the left lane", unit="n", high=20.0),
    Attribute(name="left_occupancy", factor="lane occupancy", words="occupancy of the left lane",
              unit="%", low=0.0, high=1.0, is_plain=False),
    Attribute(name="left_space_mean_speed_mps", factor="space mean speed",
              words="mean speed in the left lane", unit="km/h", is_plain=False),
    Attribute(name="left_time_mean_speed_mps", factor="time mean speed",
              words="mean speed past a place in the left lane", unit="km/h", is_plain=False),
)  # fmt: skip

_OF_WORLD = (
    Attribute(name="lane", factor="lane", words="number of lanes to the right", unit="n", high=9.0),
    Attribute(name="lanes_to_left", factor="lane", words="number of lanes to the left", unit="n",
              high=9.0),
    Attribute(name="speed_limit_mps", factor="speed over the limit", words="speed limit",
              unit="km/h", is_plain=False),
    _yes_no("night", "sight", "it is day", "it is night"),
    _yes_no("low_sun", "sight", "the sun does not stand low ahead", "the sun stands low ahead"),
    Attribute(name="rain_mmph", factor="rain, grip and wind", words="rain", unit="mm/h", low=0.0,
              high=200.0),
    Attribute(name="friction", factor="rain, grip and wind", words="friction of the road", low=0.0,
              high=2.0),
    Attribute(name="optical_range_m", factor="sight", words="visibility in the fog", unit="m",
              absent=2000.0, low=0.0, high=2000.0, is_plain=False),
    Attribute(name="sight_lit_m", factor="sight", words="distance at which lit vehicles are seen",
              unit="m", absent=2000.0, low=0.0, high=2000.0),
    Attribute(name="sight_unlit_m", factor="sight",
              words="distance at which unlit vehicles are seen", unit="m", absent=2000.0, low=0.0,
              high=2000.0, is_plain=False),
    _difference(
        "law_stop_lit_m", "sight", "the distance seen ahead is", "longer than the way to stop",
        "shorter than the way to stop", unit="m", absent=FAR, reach=FAR,
    ),
    Attribute(name="wind_mps", factor="rain, grip and wind", words="wind", unit="km/h",
              low=0.0, high=60.0),
)  # fmt: skip

ATTRIBUTES: tuple[Attribute, ...] = (*_OF_EGO, *_OF_AHEAD, *_OF_LEFT, *_OF_WORLD)
"""All of them, in the order in which ties are broken."""

BY_NAME = {one.name: one for one in ATTRIBUTES}

FACTORS: dict[str, tuple[str, ...]] = {
    factor: tuple(one.name for one in ATTRIBUTES if one.factor == factor)
    for factor in dict.fromkeys(one.factor for one in ATTRIBUTES)
}
"""The names of the attributes of each factor: what is ranked."""
