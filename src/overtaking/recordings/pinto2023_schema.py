"""The 22 columns of the paper's table: their order, their types as values, their units.

Columns and units are those of the table of stored variables in "Data and Knowledge for Overtaking
Scenarios in Autonomous Driving" (Pinto, Dutra, Fonseca, 2023); the decimals are those of the row
that it prints for frame 70 of simulation 1.
"""

# pyarrow ships no types.
# pyright: reportUnknownParameterType=false

import pyarrow as pa

from overtaking.model.road import RoadMark

FORMAT = "pinto2023"
DECIMALS = 2
"""Decimals of every number in the row that the paper prints, speeds excepted, which are whole."""

VEHICLE_COLUMNS: dict[str, tuple[tuple[str, pa.DataType], ...]] = {
    "Dim": (("length_m", pa.float64()), ("width_m", pa.float64()), ("height_m", pa.float64())),
    "L": (("x_m", pa.float64()), ("y_m", pa.float64()), ("lane_id", pa.int32())),
    "V": (("speed_kmh", pa.int32()),),
    "D": (("wheel_deg", pa.float64()), ("yaw_deg", pa.float64())),
    "A": (("accel_mps2", pa.float64()),),
}
"""What each vehicle's tuple holds after its id, in order."""

WORDS: dict[str, tuple[str, ...]] = {
    "RT": tuple(mark.value for mark in RoadMark),
    "LT": tuple(mark.value for mark in RoadMark),
    "DN": ("Day", "Night"),
    "HL": ("Yes", "No"),
}
"""The columns that hold one word, and the words that they may hold."""

PERCENTAGES = ("Prec", "Fog", "Wind")
NULLABLE = ("LWR", "LWL", "C")


def _vehicles(column: str) -> pa.DataType:
    """Type of a column with one tuple per vehicle."""
    return pa.list_(pa.struct([("id", pa.int32()), *VEHICLE_COLUMNS[column]]))


_TYPES: tuple[tuple[str, pa.DataType, str], ...] = (
    ("S", pa.int64(), "number of the simulation"),
    ("F", pa.int32(), "number of the frame, from 0"),
    ("TS", pa.float64(), "time since the start [s]"),
    ("IDego", pa.int32(), "id of the ego"),
    ("Dim", _vehicles("Dim"), "(id, length, width, height) [m]"),
    ("L", _vehicles("L"), "(id, x, y, lane) in CARLA's left-handed frame [m]"),
    ("V", _vehicles("V"), "(id, speed) [km/h]"),
    ("D", _vehicles("D"), "our reading: (id, front wheel angle, body yaw), clockwise [deg]"),
    ("A", _vehicles("A"), "(id, norm of the acceleration), contact spikes excluded [m/s^2]"),
    ("MV", pa.float64(), "speed limit of the ego's lane [km/h]"),
    ("RT", pa.string(), "line on the ego's right, as CARLA spells it"),
    ("LT", pa.string(), "line on the ego's left, as CARLA spells it"),
    ("LW", pa.float64(), "width of the ego's lane [m]"),
    ("LWR", pa.float64(), "width of the lane on its right, null if there is none [m]"),
    ("LWL", pa.float64(), "width of the lane on its left, null if there is none [m]"),
    ("C", pa.int32(), "id of the vehicle that the ego has collided with, null if none"),
    ("Prec", pa.float64(), "precipitation [%]"),
    ("Fog", pa.float64(), "fog density [%]"),
    ("Wind", pa.float64(), "wind intensity [%]"),
    ("DN", pa.string(), "Day or Night"),
    ("HL", pa.string(), "whether the low sun dazzles the driver, Yes or No"),
    ("OV", pa.int8(), "1 at the first frame of the pull-out and of the return, else 0"),
)

COLUMNS = tuple(name for name, _, _ in _TYPES)
"""The paper's names, in the paper's order."""

SCHEMA = pa.schema(
    [
        pa.field(name, kind, nullable=name in NULLABLE, metadata={"description": description})
        for name, kind, description in _TYPES
    ],
    metadata={"schema": f"overtaking.{FORMAT}", "version": "1"},
)
"""The table as values; `pinto2023_text.to_text` gives the cells as the paper prints them."""
