"""Tables for people: the paper's features and frames, and the verdict on one simulation.

The paper's own table of frames, in its units and its coordinates, is an export; see
`recordings.pinto2023`.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from overtaking.core.equality import ContentEquality
from overtaking.core.errors import SchemaError, check_choice
from overtaking.core.representation import CompactRepr
from overtaking.core.units import kmh_from_mps
from overtaking.data.tables.columns import names_of, unit_of
from overtaking.data.tables.names import POLICY_NAMES, READINGS
from overtaking.data.tables.schemas import SCHEMAS
from overtaking.model.vehicles import EGO_SLOT

KMH_PER_MPS = kmh_from_mps(1.0)

_FEATURES = {
    field.name.partition("_")[0]: field
    for field in SCHEMAS["features"]
    if field.name not in ("simulation", "reading", "frame")
}
"""The columns that hold the paper's features, by its names and in its order."""

_PER_VEHICLE = {
    "positions_m": ("x_m", "y_m", "lane_id"),
    "speeds_mps": ("speed_mps",),
    "directions_rad": ("wheel_angle_rad", "heading_rad"),
    "accelerations_mps2": ("accel_mps2",),
}
"""Columns with a tuple per frame, and what each vehicle contributes to it."""

_OF_THE_ROAD = (
    "speed_limit_mps",
    "right_line",
    "left_line",
    "lane_width_m",
    "right_lane_width_m",
    "left_lane_width_m",
    "collided_with",
)
_OF_THE_WEATHER = ("rain_percent", "fog_percent", "wind_percent", "night", "low_sun")


def features_frame(
    features: pd.DataFrame, labels: pd.DataFrame, *, policy: str, reading: str, encoded: bool
) -> pd.DataFrame:
    """Features and class of each simulation, in the paper's units; see `Dataset.features`.

    Args:
        features: The table of that name.
        labels: The table of that name.
        policy: Whose class.
        reading: Whose way of measuring.
        encoded: Whether names become the paper's numbers, and missing values 0.

    Raises:
        ConfigError: There is no such policy or reading.
    """
    for what, got, known in (("policy", policy, POLICY_NAMES), ("reading", reading, READINGS)):
        check_choice(got, known, what=what, where="features")
    measured = features[features["reading"] == reading].set_index("simulation")
    said = labels[labels["policy"] == policy].set_index("simulation")
    frame = pd.DataFrame({name: measured[field.name] for name, field in _FEATURES.items()})
    for name, field in _FEATURES.items():
        if unit_of(field) == "m/s":
            frame[name] = frame[name].astype("float64") * KMH_PER_MPS
        elif encoded and (names := names_of(field)):
            frame[name] = frame[name].map({each: code for code, each in enumerate(names)})
    if encoded:
        frame = frame.astype("float64").fillna(0.0)
    frame["CLASS"] = said["class"].astype("str")
    frame["weight"] = said["balance_weight"]
    return frame


def wide_frames(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """One row per frame of a simulation.

    Args:
        tables: `frames`, `states`, `vehicles` and `weather` of one simulation, decoded.

    Returns:
        The 22 variables in the paper's order. Tuples have an element per vehicle, by slot: a
        number, or a tuple where several belong together. Positions are OpenDRIVE's.
    """
    frames, weather = tables["frames"], tables["weather"].iloc[0]
    columns: dict[str, object] = {name: frames[name] for name in ("simulation", "frame", "time_s")}
    columns["ego"] = EGO_SLOT
    dimensions = _cells(tables["vehicles"], ("length_m", "width_m", "height_m"))
    columns["dimensions_m"] = [tuple(dimensions)] * len(frames)
    columns |= _per_vehicle(tables["states"], len(dimensions), frames["frame"].tolist())
    columns |= {name: frames[name] for name in _OF_THE_ROAD}
    columns |= {name: weather[name] for name in _OF_THE_WEATHER}
    columns["lane_change_begins"] = frames["lane_change_begins"]
    return pd.DataFrame(columns)


def _per_vehicle(states: pd.DataFrame, num_vehicles: int, numbers: list[int]) -> dict[str, object]:
    """The columns with a tuple per frame; missing where a recording lacks a vehicle."""
    is_in_frames = states["frame"].isin(numbers) & (states["vehicle"] < num_vehicles)
    if not is_in_frames.all():
        raise SchemaError(
            what="rows",
            where="states",
            expected="those of frames and vehicles in the tables of these names",
            got="others",
            next_step="restore the data set from a copy, or generate it again",
        )
    norm = np.hypot(states["accel_lon_mps2"], states["accel_lat_mps2"])
    ordered = states.assign(accel_mps2=norm).sort_values(["frame", "vehicle"])
    if len(ordered) < num_vehicles * len(numbers):
        every = pd.MultiIndex.from_product([numbers, range(num_vehicles)])
        ordered = ordered.set_index(["frame", "vehicle"]).reindex(every)
    columns: dict[str, object] = {}
    for name, parts in _PER_VEHICLE.items():
        cells = _cells(ordered, parts)
        frames = range(0, len(cells), num_vehicles)
        columns[name] = [tuple(cells[first : first + num_vehicles]) for first in frames]
    return columns


def _cells(table: pd.DataFrame, columns: tuple[str, ...]) -> list[object]:
    """For each row its only value, or a tuple of several."""
    if len(columns) == 1:
        return table[columns[0]].tolist()
    return list(zip(*(table[column].tolist() for column in columns), strict=True))


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict(CompactRepr, ContentEquality):
    """The labels of one simulation.

    Attributes:
        simulation: Its number.
        outcome: How it ended, legality aside: `completed`, `not_completed`, `collision`,
            `no_attempt`.
        detail: How it came to that.
        classes: Class under each policy, by its name.
        phases: Time of each event that happened [s], in order.
        rules: One row per rule: verdict, margin, first and last frame of a breach, article,
            severity, and whether the driver could know.
    """

    simulation: int
    outcome: str
    detail: str
    classes: dict[str, str]
    phases: dict[str, float]
    rules: pd.DataFrame

    @property
    def broken(self) -> pd.DataFrame:
        """The rules that are broken."""
        return self.rules[self.rules["verdict"] == "illegal"]

    def summary(self) -> dict[str, object]:
        """Outcome, class under each policy and broken rules, by the name that is shown."""
        return {
            "simulation": self.simulation,
            "outcome": self.outcome,
            "detail": self.detail,
            **{f"class_{policy}": name for policy, name in self.classes.items()},
            "broken": ", ".join(map(str, self.broken.index)) or "no rule",
        }


def verdict_of(
    simulation: int, labels: pd.DataFrame, events: pd.DataFrame, findings: pd.DataFrame
) -> Verdict:
    """The labels of one simulation, from the tables of labels.

    Args:
        simulation: Its number.
        labels: Its rows in the table of that name.
        events: Its rows in the table of that name.
        findings: Its rows in the table of that name.
    """
    ordered = events.sort_values("time_s")
    return Verdict(
        simulation=simulation,
        outcome=str(labels["outcome"].iloc[0]),
        detail=str(labels["detail"].iloc[0]),
        classes=dict(zip(labels["policy"].astype(str), labels["class"].astype(str), strict=True)),
        phases=dict(zip(ordered["event"].astype(str), ordered["time_s"], strict=True)),
        rules=findings.drop(columns="simulation").set_index("rule"),
    )
