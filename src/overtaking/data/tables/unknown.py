"""Tables of recordings that cannot tell everything: null where their source is silent."""

from collections.abc import Collection

import pyarrow as pa

from overtaking.data.tables.schemas import BODY_FIELDS, DRIVER_FIELDS, SCHEMAS

_TOLD = ("length_m", "width_m")
"""What is known of a body even where its name is in `UNKNOWNS`."""

_WEATHER = tuple(field.name for field in SCHEMAS["weather"] if field.name != "weather")
_BODIES = tuple(column for _, column in BODY_FIELDS if column not in _TOLD)
_DRIVERS = tuple(column for _, column in DRIVER_FIELDS)

SILENT: dict[str, dict[str, tuple[str, ...]]] = {
    "weather": {"weather": _WEATHER},
    "drivers": {"vehicles": _DRIVERS},
    "bodies": {"vehicles": ("colour", *_BODIES)},
    "kinds": {"vehicles": ("kind",)},
    "marks": {"frames": ("right_line", "left_line")},
    "speed_limit": {"frames": ("speed_limit_mps",)},
    "road_kind": {},  # The manifest says so.
    "indicators": {"states": ("indicator",)},
    "lamps": {"states": ("lights",)},
    "wheel_angle": {"states": ("wheel_angle_100urad",)},
    "yaw_rate": {"states": ("yaw_rate_100uradps",)},
    "impulse": {"vehicles": ("contact_impulse_newton_s", "contact_closing_speed_mmps")},
    "stage": {"frames": ("stage", "overtaking")},
    "percepts": {},  # They have no rows then.
}
"""For each of `model.trajectory.UNKNOWNS`, the columns of each table that say nothing."""


def silent_columns(table: str, unknown: Collection[str]) -> frozenset[str]:
    """The columns of a table that are null throughout.

    Args:
        table: Name of one of the `SCHEMAS`.
        unknown: Names of `model.trajectory.UNKNOWNS`.
    """
    return frozenset(column for name in sorted(unknown) for column in SILENT[name].get(table, ()))


def schema_of(table: str, unknown: Collection[str] = (), *, recorded: bool = False) -> pa.Schema:
    """The schema of a table where some things are not known.

    Args:
        table: Name of one of the `SCHEMAS`.
        unknown: Names of `model.trajectory.UNKNOWNS`.
        recorded: Whether it holds recordings, which have no seed.

    Returns:
        The schema as it is for simulations, with nulls allowed where they are needed.
    """
    silent = silent_columns(table, unknown)
    if recorded and table == "simulations":
        silent |= {"seed"}
    schema = SCHEMAS[table]
    if not silent:
        return schema
    fields = [field.with_nullable(field.nullable or field.name in silent) for field in schema]
    return pa.schema(fields, metadata=schema.metadata)
