"""What follows from columns of `decisions`, and is nearer to what a driver thinks of."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
Column = Callable[[str], F64]
"""A column of `decisions` by its name, NaN where there is none."""


def over_limit(column: Column) -> F64:
    """How much faster than the limit of road and vehicle the ego is [m/s]."""
    return -column("law_speed_mps")


def wish_over_limit(column: Column) -> F64:
    """How much faster than that limit its driver would like to be [m/s]."""
    limit = column("law_speed_mps") + column("ego_speed_mps")
    return column("ego_desired_speed_mps") - limit


def speed_wish(column: Column) -> F64:
    """How much faster than the vehicle ahead its driver would like to be [m/s]."""
    return column("ego_desired_speed_mps") - column("ahead_speed_mps")


def time_to_safe_gap(column: Column) -> F64:
    """Time until the gap is shorter than the safe distance, at the speeds of now [s].

    0 if it is so already, NaN if it will not come to that.
    """
    margin, closing = column("law_follow_m"), column("ahead_closing_speed_mps")
    time = np.divide(margin, closing, out=np.full(len(margin), np.nan), where=closing > 0.0)
    return np.where(margin <= 0.0, 0.0, time)


DERIVED: dict[str, Callable[[Column], F64]] = {
    one.__name__: one for one in (over_limit, wish_over_limit, speed_wish, time_to_safe_gap)
}
"""Each by its name."""
