"""Conversions at the edges, and how units are written in names.

Inside the package every name without a suffix is SI. Kilometres per hour and degrees appear only
where a file, a person or another program uses them, in names that end in `_kmh` and `_deg`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Number = TypeVar("Number", float, "NDArray[np.floating[Any]]")

SUFFIXES = {
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
"""The ending of a name for each unit, wherever numbers leave memory: columns, keys of files."""

STEPS = {
    "mm": ("m", 1000),
    "ms": ("s", 1000),
    "mm/s": ("m/s", 1000),
    "mm/s^2": ("m/s^2", 1000),
    "0.1 mrad": ("rad", 10_000),
    "0.1 mrad/s": ("rad/s", 10_000),
}
"""The SI unit and the number of steps in it, for each unit of recorded integers."""

_KMH_PER_MPS = 3.6
_RAD_PER_DEG = math.pi / 180.0
_DEG_PER_RAD = 180.0 / math.pi


def mps_from_kmh(speed_kmh: Number) -> Number:
    """Speed [m/s] from kilometres per hour; a float32 array stays float32."""
    return speed_kmh / _KMH_PER_MPS


def kmh_from_mps(speed: Number) -> Number:
    """Speed [km/h] from metres per second; a float32 array stays float32."""
    return speed * _KMH_PER_MPS


def rad_from_deg(angle_deg: Number) -> Number:
    """Angle [rad] from degrees; a float32 array stays float32."""
    return angle_deg * _RAD_PER_DEG


def deg_from_rad(angle: Number) -> Number:
    """Angle [degrees] from radians; a float32 array stays float32."""
    return angle * _DEG_PER_RAD
