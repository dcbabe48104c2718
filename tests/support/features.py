"""Frames of features that look like those of a labelled data set, made from nothing."""

from __future__ import annotations

import numpy as np
import pandas as pd

# Precipitation, wind and fog of eight weather presets [%], then night, then low sun: the facts that
# CARLA's table of presets holds.
PRESETS = (
    ("ClearNoon", 0, 10, 2, False, False),
    ("HardRainNoon", 100, 100, 7, False, False),
    ("ClearSunset", 0, 10, 2, False, True),
    ("ClearNight", 0, 10, 60, True, False),
    ("CloudyNight", 0, 10, 60, True, False),
    ("SoftRainNight", 30, 30, 60, True, False),
    ("MidRainyNight", 60, 60, 60, True, False),
    ("HardRainNight", 100, 100, 100, True, False),
)
SHARES = {
    "No_attempt": 0.109,
    "Success_I": 0.424,
    "Success_L": 0.105,
    "Unsuccess_col": 0.246,
    "Unsuccess_ncol": 0.116,
}


def synthetic_features(simulations: int = 276, seed: int = 1) -> pd.DataFrame:
    """A frame as `Dataset.features` returns it; legal overtakes only by day, as in the paper."""
    draw = np.random.default_rng(seed)
    names = np.array(list(SHARES))
    kind = draw.choice(len(names), simulations, p=list(SHARES.values()))
    kind[: len(names)] = np.arange(len(names))[:simulations]
    label = names[kind]
    weather = draw.integers(0, len(PRESETS), simulations)
    weather = np.where(label == "Success_L", weather % 2, weather)
    preset = pd.DataFrame([PRESETS[one] for one in weather])
    none = label == "No_attempt"
    target = 57.0 + 5.0 * draw.gamma(2.0, 1.0, simulations) * ~none
    difference = np.where(none, 4.0, 21.0) + draw.normal(0.0, np.where(none, 1.0, 7.0), simulations)
    waiting = np.where(none, 8.0, np.minimum(draw.exponential(0.9, simulations), 7.9))
    frame = pd.DataFrame(
        {
            "DN": np.where(preset[4], "Night", "Day"),
            "HL": np.where(preset[5], "Yes", "No"),
            "TE": draw.choice(list("SMLVT"), simulations),
            "TP": draw.choice(["S", "M", "L", "V", "T", "MC", "B"], simulations),
            "WT": np.round(waiting / 0.05) * 0.05,
            "OT": np.where(none, 0.0, draw.gamma(6.0, 0.8, simulations)),
            "NV": draw.integers(3, 7, simulations),
            "SE": target + difference,
            "SP": target,
            "DSEP": np.abs(difference),
            "D": np.clip(draw.gamma(4.0, 10.0, simulations), 5.0, None),
            "OLR": np.round(100.0 * draw.integers(0, 3, simulations) / 5.0),
            "PREC": preset[1].astype(float),
            "WIND": preset[2].astype(float),
            "FOG": preset[3].astype(float),
            "CLASS": label,
            "weight": draw.gamma(2.0, 0.5, simulations),
        },
        index=pd.RangeIndex(simulations, name="simulation"),
    )
    alone = draw.random(simulations) < 0.03
    frame.loc[alone, ["SP", "DSEP", "D"]] = np.nan
    frame["TP"] = frame["TP"].astype(object).where(~alone, None)
    return frame
