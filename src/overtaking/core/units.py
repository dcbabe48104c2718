"""Units: suffixes of names, units of recorded integers, conversion to SI.

Values in the code are in SI units and their names have no suffix. Other units occur at the edges:

- names of columns and keys in files end in a suffix for the unit, also for SI units
  (`NAME_SUFFIXES`);
- trajectories are recorded as integers, in small units such as mm (`INTEGER_UNITS`);
- the constants of the model, in the TOML files of `overtaking/knowledge/data`, state units as texts
  such as `km/h`. The reader of these files converts them to SI with `unit_converter`; constants
  whose name ends in one of `UNCONVERTED_SUFFIXES` keep their unit;
- commands and functions of the API take speeds in km/h and angles in degrees, which functions such
  as `mps_from_kmh` convert.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any, TypeVar

from overtaking.core.errors import KnowledgeError

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray


FloatOrArray = TypeVar("FloatOrArray", float, "NDArray[np.floating[Any]]")

NAME_SUFFIXES = {
    "1": "",
    "%": "_percent",
    "m": "_m",
    "m^2": "_m2",
    "mm": "_mm",
    "mm/h": "_mmph",
    "s": "_s",
    "s^2": "_s2",
    "ms": "_ms",
    "m/s": "_mps",
    "mm/s": "_mmps",
    "m/s^2": "_mps2",
    "mm/s^2": "_mmps2",
    "rad": "_rad",
    "0.1 mrad": "_100urad",
    "rad/s": "_radps",
    "0.1 mrad/s": "_100uradps",
    "1/rad": "_per_rad",
    "kg": "_kg",
    "kg m^2": "_kgm2",
    "N s": "_newton_s",
    "W": "_w",
}
"""Suffix of a name for each unit, in columns of tables and in keys of files. Numbers without a unit
have the unit "1"."""

INTEGER_UNITS = {
    "mm": ("m", 1000),
    "ms": ("s", 1000),
    "mm/s": ("m/s", 1000),
    "mm/s^2": ("m/s^2", 1000),
    "0.1 mrad": ("rad", 10_000),
    "0.1 mrad/s": ("rad/s", 10_000),
}
"""For each unit of recorded integers, its SI unit and the number of small units in it: 1000 mm are
1 m."""

_KMH_PER_MPS = 3.6
_RAD_PER_DEG = math.pi / 180.0
_DEG_PER_RAD = 180.0 / math.pi


def mps_from_kmh(speed_kmh: FloatOrArray) -> FloatOrArray:
    """Speed [m/s] from kilometres per hour; a float32 array stays float32."""
    return speed_kmh / _KMH_PER_MPS


def kmh_from_mps(speed: FloatOrArray) -> FloatOrArray:
    """Speed [km/h] from metres per second; a float32 array stays float32."""
    return speed * _KMH_PER_MPS


def rad_from_deg(angle_deg: FloatOrArray) -> FloatOrArray:
    """Angle [rad] from degrees; a float32 array stays float32."""
    return angle_deg * _RAD_PER_DEG


def deg_from_rad(angle: FloatOrArray) -> FloatOrArray:
    """Angle [degrees] from radians; a float32 array stays float32."""
    return angle * _DEG_PER_RAD


# Symbols that are not converted: SI units, 1 for a number without a unit, and counted vehicles.
_SI_SYMBOLS = frozenset(
    ["1", "m", "s", "kg", "rad", "N", "W", "J", "Pa", "Hz", "K", "cd", "lx", "vehicle"]
)

# Symbol: (SI symbol, numerator, denominator of the factor). Not one factor, because no float is
# equal to 1 / 1000: with it, a value in mm would be rounded twice. 0.2 * 1 / 1000 is rounded only
# in the division.
_OTHER_SYMBOLS = {
    "km": ("m", 1000.0, 1.0),
    "Mm": ("m", 1e6, 1.0),
    "Mkm": ("m", 1e9, 1.0),  # For accident rates, which are stated per million vehicle-km.
    "mm": ("m", 1.0, 1000.0),
    "inch": ("m", 254.0, 10000.0),
    "h": ("s", 3600.0, 1.0),
    "min": ("s", 60.0, 1.0),
    "ms": ("s", 1.0, 1000.0),
    "kPa": ("Pa", 1000.0, 1.0),
    "kW": ("W", 1000.0, 1.0),
    "klx": ("lx", 1000.0, 1.0),
    "deg": ("rad", math.pi, 180.0),  # In products such as `deg/s`, and for `si_unit`.
    "percent": ("1", 1.0, 100.0),
}

# Commands and the API convert these two units with the same functions, so that 120 km/h in a TOML
# file and in a command have the same bits. They take precedence over the factors above.
_SHARED_CONVERSIONS: dict[str, Callable[[float], float]] = {
    "km/h": mps_from_kmh,
    "deg": rad_from_deg,
}

UNCONVERTED_SUFFIXES = {
    "_mm": "mm",
    "_inch": "inch",
    "_kpa": "kPa",
    "_mmph": "mm/h",
    "_percent": "percent",
    "_deg": "deg",
    "_kmh": "km/h",
}
"""Unit by suffix, for names of constants that keep their unit when a TOML file is read, because
formulas from the literature use that unit, such as `film_mm` in mm. All other constants are
converted to SI."""

# A unit such as `kg m^2`, `m/s^2` or `1/(m s)`: a product; after a slash, one factor or a product
# in parentheses.
_FACTOR = r"(?:[A-Za-z]+|1)(?:\^[0-9]+)?"
_PRODUCT = rf"{_FACTOR}(?: {_FACTOR})*"
_UNIT = re.compile(rf"({_PRODUCT})(?:/(?:({_FACTOR})|\(({_PRODUCT})\)))?")


def _powers(unit: str) -> list[tuple[str, int]] | None:
    """The symbols of a unit with their powers: [("m", 1), ("s", -2)] for `m/s^2`.

    For a text that is not a product of known symbols, it returns None.
    """
    match = _UNIT.fullmatch(unit)
    if match is None:
        return None
    powers: list[tuple[str, int]] = []
    for product, sign in ((match[1], 1), (match[2] or match[3] or "", -1)):
        for factor in product.split():
            symbol, _, power = factor.partition("^")
            powers.append((symbol, sign * int(power or 1)))
    is_valid = all(symbol in _SI_SYMBOLS or symbol in _OTHER_SYMBOLS for symbol, _ in powers)
    return powers if is_valid else None


def si_unit(unit: str) -> str:
    """The SI unit of the same dimension: `m/s` for `km/h`, `1` for `percent`.

    Args:
        unit: A unit that `unit_converter` accepts, so that all its symbols are known.
    """
    return re.sub(r"[A-Za-z]+", lambda match: _OTHER_SYMBOLS.get(match[0], (match[0],))[0], unit)


def unit_converter(unit: str, *, where: str) -> Callable[[float], float]:
    """Make a function that converts a number in `unit` to the SI unit of `si_unit`.

    Args:
        unit: Symbols joined by spaces, `/` and `^`, such as `m/s^2` or `1/(m s)`.
        where: File and entry that contain the unit, for the message.

    Returns:
        The conversion. For SI units it returns its argument with the same bits.

    Raises:
        KnowledgeError: The text is not a product of known symbols.
    """
    powers = _powers(unit)
    if powers is None:
        symbols = ", ".join(sorted(_SI_SYMBOLS | _OTHER_SYMBOLS.keys()))
        raise KnowledgeError(
            what="unit",
            where=where,
            expected="a product of known symbols",
            got=repr(unit),
            next_step=f"write one with {symbols}",
        )
    if unit in _SHARED_CONVERSIONS:
        return _SHARED_CONVERSIONS[unit]
    numerator = denominator = 1.0
    for symbol, power in powers:
        _, multiplier, divisor = _OTHER_SYMBOLS.get(symbol, (symbol, 1.0, 1.0))
        if power < 0:
            multiplier, divisor = divisor, multiplier
        numerator *= multiplier ** abs(power)
        denominator *= divisor ** abs(power)
    return lambda number: number * numerator / denominator


def unit_of_suffix(name: str) -> str | None:
    """The unit in which a constant is kept, by the suffix of its name; None if it is kept in SI.

    Args:
        name: Name of the constant, such as `film_mm`.
    """
    for suffix, unit in UNCONVERTED_SUFFIXES.items():
        if name.endswith(suffix):
            return unit
    return None
