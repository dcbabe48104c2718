"""The reference of the tables, from their schemas."""

from __future__ import annotations

from typing import TYPE_CHECKING

from generators.markdown import page, section, table, unit

from overtaking.core.units import INTEGER_UNITS
from overtaking.data.tables.columns import flags_of, names_of, si_name, unit_of
from overtaking.data.tables.schemas import KEYS, SCHEMAS, VERSION

if TYPE_CHECKING:
    import pyarrow as pa

INTRODUCTION = f"""\
A data set is a folder with one subfolder of Parquet files for each table, and `dataset.json`, the
manifest. [`overtaking generate`](../how-to/make-a-data-set.md) writes them; with `--keep features`
it leaves out `frames` and `states`, which have a row per frame and are simulated again when asked
for. These are the columns of version {VERSION}.

Integer columns count steps of the unit in their name. Read through `overtaking.load_dataset` they
come back as SI numbers under the name in the second column, enumerations as pandas categories, and
each bit of a column of flags as a column of its own. Null means that there is nothing to state;
it never stands for zero.

Vehicle 0 is the ego. `x`, `y` and `heading` are those of the OpenDRIVE road, right-handed; `s`
runs along the road, `d` and all angles grow to the left; positions are centres of bounding boxes.
"""


def content() -> str:
    """The page `reference/tables.md`."""
    return page("Tables", INTRODUCTION, *map(_section, SCHEMAS))


def _section(name: str) -> str:
    keys = ", ".join(f"`{key}`" for key in KEYS[name])
    header = ("column", "in Python", "type", "unit", "meaning")
    return section(
        name, f"One row for each {keys}, in that order.", table(header, map(_row, SCHEMAS[name]))
    )


def _row(field: pa.Field) -> tuple[str, ...]:
    kind, meaning = str(field.type), field.metadata[b"description"].decode()
    python = f"`{si_name(field)}`"
    if names := names_of(field):
        kind, meaning = "name", f"{meaning}: {', '.join(names)}"
    if flags := flags_of(field):
        python = ", ".join(f"`{flag}`" for flag in flags)
        bits = ", ".join(f"{1 << place} {flag}" for place, flag in enumerate(flags))
        meaning = f"{meaning}: {bits}"
    if field.nullable:
        meaning += "; may be null"
    return f"`{field.name}`", python, kind, _unit(unit_of(field)), meaning


def _unit(name: str) -> str:
    if name in INTEGER_UNITS and name.startswith("0.1"):
        return f"{unit(INTEGER_UNITS[name][0])} / {INTEGER_UNITS[name][1]}"
    return unit(name)
