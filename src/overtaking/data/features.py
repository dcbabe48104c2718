"""The table of features as the paper shows it."""

import pandas as pd

from overtaking.core.errors import ConfigError
from overtaking.core.units import kmh_from_mps
from overtaking.data.tables.names import KINDS, POLICY_NAMES, READINGS

KMH_PER_MPS = kmh_from_mps(1.0)

_SPEEDS = {"SE": "SE_mps", "SP": "SP_mps", "DSEP": "DSEP_mps"}
_PLAIN = {
    "DN": "DN",
    "HL": "HL",
    "TE": "TE",
    "TP": "TP",
    "WT": "WT_s",
    "OT": "OT_s",
    "NV": "NV",
    "SE": "",
    "SP": "",
    "DSEP": "",
    "D": "D_m",
    "OLR": "OLR_percent",
    "PREC": "PREC_percent",
    "WIND": "WIND_percent",
    "FOG": "FOG_percent",
}
"""The paper's names in its order, with the columns that hold them; speeds are converted."""

_CODES = {
    "DN": ("Day", "Night"),
    "HL": ("No", "Yes"),
    "TE": KINDS,
    "TP": KINDS,
}
"""The paper's numbers for names: their places here."""


def features_frame(
    features: pd.DataFrame, labels: pd.DataFrame, *, policy: str, reading: str, encoded: bool
) -> pd.DataFrame:
    """Features and class of each simulation; see `Dataset.features`.

    Args:
        features: The table of that name.
        labels: The table of that name.
        policy: Whose class.
        reading: Whose way of measuring.
        encoded: Whether names become the paper's numbers.

    Raises:
        ConfigError: There is no such policy or reading.
    """
    _check("policy", policy, POLICY_NAMES)
    _check("reading", reading, READINGS)
    measured = features[features["policy"] == reading].set_index("simulation")
    said = labels[labels["policy"] == policy].set_index("simulation")
    frame = pd.DataFrame({name: _column(measured, name) for name in _PLAIN})
    if encoded:
        frame = _encoded(frame)
    frame["CLASS"] = said["class"].astype("str")
    frame["weight"] = said["class_weight"]
    return frame


def _column(measured: pd.DataFrame, name: str) -> pd.Series:
    if name in _SPEEDS:
        return measured[_SPEEDS[name]].astype("float64") * KMH_PER_MPS
    return measured[_PLAIN[name]]


def _encoded(frame: pd.DataFrame) -> pd.DataFrame:
    """Names as numbers, and 0 for what is missing, as the paper has it."""
    coded = {name: frame[name].map(_numbers(names)) for name, names in _CODES.items()}
    return frame.assign(**coded).astype("float64").fillna(0.0)


def _numbers(names: tuple[str, ...]) -> dict[str, int]:
    return {name: code for code, name in enumerate(names)}


def _check(what: str, got: str, known: tuple[str, ...]) -> None:
    if got not in known:
        raise ConfigError.of(
            what=what,
            where="features",
            expected=" or ".join(known),
            got=got,
            next_step="choose one of them",
        )
