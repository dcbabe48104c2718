"""Writes the names of parameters and constants for the engine from their declarations in Python.

python crates/fields.py            writes crates/overtaking-core/src/names.rs
python crates/fields.py --check    fails if it is out of date
"""

from __future__ import annotations

import sys
import textwrap
from pathlib import Path

from overtaking.world.constants import CONSTANT_FIELDS
from overtaking.world.parameters import SIMULATION_FIELDS, VEHICLE_FIELDS

TARGET = Path(__file__).parent / "overtaking-core" / "src" / "names.rs"

CONTENT = """\
// Made by crates/fields.py from world/parameters.py and world/constants.py; do not edit.

lane_fields! {{
    /// Parameters of one vehicle slot.
    Vehicle, VEHICLE_NAMES {{
{vehicle}
    }}
}}

lane_fields! {{
    /// Parameters of a simulation.
    Simulation, SIMULATION_NAMES {{
{simulation}
    }}
}}

number_fields! {{
    /// Constants of the model.
    Constants {{
{constants}
    }}
}}
"""


def content() -> str:
    """The generated file."""
    return CONTENT.format(
        vehicle=_listed(VEHICLE_FIELDS),
        simulation=_listed(SIMULATION_FIELDS),
        constants=_listed(CONSTANT_FIELDS),
    )


def _listed(names: tuple[str, ...]) -> str:
    return textwrap.fill(
        ", ".join(names) + ",", 100, initial_indent=" " * 8, subsequent_indent=" " * 8
    )


def main(arguments: list[str]) -> int:
    """Write or check the file."""
    if arguments != ["--check"]:
        TARGET.write_text(content(), encoding="utf-8", newline="\n")
    elif TARGET.read_text(encoding="utf-8") != content():
        print(f"{TARGET.name} is out of date: run python crates/fields.py", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
