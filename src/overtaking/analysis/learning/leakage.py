"""Features that are known only afterwards: refused, and shown on request."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from overtaking.analysis.learning.attributes import BY_NAME, FACTORS
from overtaking.core.arrays import F64
from overtaking.core.errors import ConfigError
from overtaking.model.vehicles import EGO_SLOT

if TYPE_CHECKING:
    from overtaking.data.load import Dataset


OF_WHOLE_RUN = ("SE", "SP", "DSEP", "D", "OLR", "WT")
"""Features that the paper averages over the whole run where there is no attempt."""


@dataclass(frozen=True, slots=True)
class Leak:
    """A feature that a model of a decision must not see.

    Attributes:
        name: Its name.
        why: Why it leaks.
        others: Other names of it.
    """

    name: str
    why: str
    others: tuple[str, ...] = ()


LEAKS = (
    Leak("OT", "how long the overtake took is known when it is over", ("OT_s",)),
    Leak(
        "C",
        "the vehicle that the ego collided with is the outcome itself",
        ("collision", "collided_with", "partner"),
    ),
    Leak(
        "OV",
        "how often the ego changed lanes is known when it is over",
        ("overtaking", "ov_count", "num_lane_changes"),
    ),
    Leak(
        "max|a|",
        "the largest acceleration comes after the decision",
        ("max_a", "maxa", "max_accel", "max |a|", "a_max"),
    ),
    Leak(
        "means of the run",
        "a mean over the whole run holds what came after the decision",
        (
            *("mean", "average", "averages", "paper"),
            *(f"mean{sign}{name.lower()}" for name in OF_WHOLE_RUN for sign in "_ "),
        ),
    ),
)
"""The features of the source paper that reveal the outcome."""


def chosen_factors(names: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """The chosen factors.

    Args:
        names: Names of factors or attributes; none for all factors.

    Returns:
        The attributes of each factor; a single attribute is its own factor.

    Raises:
        ConfigError: One of them is known only afterwards, or unknown.
    """
    found: dict[str, tuple[str, ...]] = {}
    for name in names or tuple(FACTORS):
        if name in FACTORS:
            found[name] = FACTORS[name]
        elif name in BY_NAME:
            found[name] = (name,)
        else:
            raise _refusal(name)
    return found


def _refusal(name: str) -> ConfigError:
    """The reason why a feature is refused."""
    told = name.strip().lower()
    for leak in LEAKS:
        if told in (leak.name.lower(), *(one.lower() for one in leak.others)):
            return ConfigError(
                what=f"feature {name}",
                where="learn factors",
                expected="what is known when the overtake begins",
                got=leak.why,
                next_step="leave it out, or see with --show-leakage what it would fake",
            )
    return ConfigError(
        what=f"feature {name}",
        where="learn factors",
        expected=f"a factor or attribute, such as {', '.join(list(FACTORS)[:3])}",
        got="no such name",
        next_step="see docs/explanation/learning.md for all",
    )


def leaks_of(data: "Dataset") -> dict[str, tuple[str, F64]]:
    """Why each leak leaks, and its values, shape (simulation, column).

    Simulations that were not kept are simulated again for their largest acceleration.

    Args:
        data: The data set.
    """
    events, rows = data.events(), pd.RangeIndex(len(data))
    overtaking_time = data.features("paper", reading="matched")["OT"].reindex(rows)
    averages = data.features("paper", reading="paper").reindex(rows)[list(OF_WHOLE_RUN)]
    is_contact = events["event"] == "collision"
    is_change = events["event"].isin(["line_crossed", "return_end"])
    values = (
        overtaking_time.to_numpy(dtype=np.float64)[:, None],
        rows.isin(events.loc[is_contact, "simulation"]).astype(np.float64)[:, None],
        np.bincount(events.loc[is_change, "simulation"], minlength=len(rows))[:, None],
        _largest_acceleration(data, len(rows)),
        averages.to_numpy(dtype=np.float64),
    )
    return {
        leak.name: (leak.why, np.nan_to_num(found.astype(np.float64)))
        for leak, found in zip(LEAKS, values, strict=True)
    }


def _largest_acceleration(data: "Dataset", count: int) -> F64:
    """Largest acceleration of the ego, forwards or sideways [m/s^2], shape (simulation, 1)."""
    found = np.zeros((count, 1))
    for numbers, run in data.batches():
        states = run.states
        axes = (states.accel_lon[:, EGO_SLOT], states.accel_lat[:, EGO_SLOT])
        size = np.maximum(*(abs(one.astype(np.int32)) for one in axes))
        found[numbers, 0] = size.max(axis=-1) / 1000.0  # Recorded in mm/s^2.
    return found
