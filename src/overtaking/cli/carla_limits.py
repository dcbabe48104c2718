"""What the limits of CARLA's Traffic Manager look like."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from overtaking.cli.tables import open_table

if TYPE_CHECKING:
    from rich.console import RenderableType

    from overtaking.simulators.carla.limits import Limits

Values = dict[str, Any]


def values_of(limits: Limits) -> Values:
    """The limits for machines."""
    rows = [
        {"speed_kmh": speed, "changed": changed, "asked": limits.trials}
        for speed, changed in zip(limits.speeds_kmh, limits.changed, strict=True)
    ]
    return {"forced_lane_changes": rows, "again_after_s": limits.again_after}


def render(values: Values) -> RenderableType:
    """The limits for people."""
    from rich.console import Group
    from rich.text import Text

    table = open_table(
        "km/h>", "changed>", "of>", title="Forced lane changes", title_justify="left"
    )
    for row in values["forced_lane_changes"]:
        table.add_row(f"{row['speed_kmh']:.0f}", str(row["changed"]), str(row["asked"]))
    wait = values["again_after_s"]
    again = "never again" if wait is None else f"again {wait:.1f} s after the first"
    return Group(table, Text(f"A second one was accepted {again}."))
